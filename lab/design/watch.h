/* SPDX-License-Identifier: MIT */
/// Who may end a search and who is told how far it is: one watch for all threads of one design.
#ifndef SERVOSCOPE_DESIGN_WATCH_H
#define SERVOSCOPE_DESIGN_WATCH_H

#include "lab/design/design.h"

#include <pthread.h>
#include <stdatomic.h>

struct design_watch {
    const struct design_request *request;
    double torque_rms_Nm; ///< at a score of 1
    double begun_s;       ///< on the monotonic clock
    double told_s;        ///< when progress was called last; only the owner's
    pthread_t owner;      ///< the thread that called design_run()
    atomic_size_t done;   ///< evaluations so far, all threads
    atomic_size_t planned;
    _Atomic double best_score;
    atomic_bool interrupted;
    _Atomic double deadline_s; ///< since begun_s; INFINITY at first
    double cpu_s;              ///< of threads that were started for this design and have ended; the owner's to write
    size_t starts;             ///< finished ones; the owner's to write
};

/// `torque_rms_Nm`: effective torque of the design whose largest signal is just its limit.
void design_watch_begin(const struct design_request *request, double torque_rms_Nm, struct design_watch *out_watch);

/// Sets how many evaluations there will be at most, from now on counted from 0.
void design_watch_plan(struct design_watch *self, size_t evaluations);

/// Counts one evaluation; tells the owner's thread's caller the progress, at most 20 times a second.
/// Returns false once the stop request was seen, or after the limit of design_watch_limit_time().
/// May be called from any thread.
bool design_watch_goes_on(struct design_watch *self);

/// Sets when the search has to end, in seconds since design_watch_begin(); without it there is no such time.
void design_watch_limit_time(struct design_watch *self, double elapsed_s);

/// Notes the score of a better design; may be called from any thread.
void design_watch_offer(struct design_watch *self, double score);

/// Seconds since design_watch_begin().
double design_watch_elapsed_s(const struct design_watch *self);

#endif
