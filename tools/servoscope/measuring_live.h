/* SPDX-License-Identifier: MIT */
/// A few lines on the terminal while a measurement runs: progress, peaks against limits, lost and late samples, the
/// response so far in coarse bands. A thread of its own without real-time priority reads what the loop stores and
/// writes them, so that a slow terminal holds up no SYNC.
#ifndef SERVOSCOPE_TOOLS_MEASURING_LIVE_H
#define SERVOSCOPE_TOOLS_MEASURING_LIVE_H

#include "lab/measure/live.h"
#include "lab/measure/measure.h"
#include "lab/numeric/fft.h"
#include "tools/servoscope/command.h"

#include <pthread.h>
#include <stdbool.h>
#include <stddef.h>

enum { measuring_live_lines_max = 10, measuring_live_width_max = 120 };

/// Where one measurement stands in a sequence of them; zeros for a single one.
struct measuring_live_place {
    size_t segment, segments;               ///< from 1
    size_t samples_before, samples_planned; ///< of the whole; samples_planned 0: this one is the whole
};

struct measuring_live {
    bool running;
    struct measure_live feed;
    const struct msgen_table *table;
    const struct guard_real_limits *limits;
    struct measuring_live_place place;
    double started_s; ///< of the whole
    double table_peak[3];
    pthread_t thread;
    pthread_mutex_t mutex;
    pthread_cond_t ended_changed;
    bool ended;
    // The thread's own from here on.
    struct fft_plan *plan;
    double *memory, *amplitude[2];
    size_t shown_period;
    size_t line_count; ///< on the screen now
    size_t line_length[measuring_live_lines_max];
};

/// Starts the view if standard error is a terminal and neither --quiet nor --json was given, and has *io_plan tell it
/// of each sample; does nothing else, also where memory or threads are short. It shows itself from a second after
/// `started_s` (wall_clock_now_s) on, twice a second. TERM=dumb, or a window of fewer lines, gets one line.
/// Lifetime: *io_plan and its table must outlive the view; *out_self must not move
void measuring_live_start(struct measuring_live *out_self, const struct command_context *context, double started_s,
                          const struct measuring_live_place *place, struct measure_plan *io_plan);

/// Ends the thread and takes the lines off the screen; harmless if it was not started.
void measuring_live_stop(struct measuring_live *self);

#endif
