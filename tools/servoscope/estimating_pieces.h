/* SPDX-License-Identifier: MIT */
/// Recordings of any length for `frf`: short ones are read whole, of long ones the leading part; method mean then takes
/// the rest piece by piece, and other methods, which need everything at once, refuse what memory should not hold.
#ifndef SERVOSCOPE_TOOLS_ESTIMATING_PIECES_H
#define SERVOSCOPE_TOOLS_ESTIMATING_PIECES_H

#include "lab/estimate/inputs.h"
#include "lab/estimate/periodic.h"
#include "lab/record/error.h"
#include "lab/record/frf_file.h"
#include "lab/record/run.h"
#include "lab/record/run_stream.h"
#include "tools/servoscope/command.h"
#include "tools/servoscope/estimating_outcome.h"

#include <stdbool.h>
#include <stddef.h>

struct estimating_pieces {
    struct run run;                        ///< the whole recording, or its leading part
    struct run_stream *stream;             ///< the rest; NULL: `run` is the whole recording
    const struct command_context *context; ///< whether progress is shown; to be set after opening
};

/// Reads a recording whole if it has at most 2 Mi numbers (16 MiB), or if `needs_whole` (the method's name, NULL: none)
/// and it has at most 128 Mi (1 GiB); else its leading part of 2 Mi numbers, or of four periods if that is longer.
/// `period_samples`: of the options, 0: the file's.
/// Errors: as run_read; error_refused for a method that needs more than 1 GiB
int estimating_pieces_open(const char *path, const struct run_options *options, const char *needs_whole,
                           size_t period_samples, struct estimating_pieces *out_self, struct error *out_error);

/// Response of the whole recording by method mean. Columns, period and lines, and what else is found (distortion,
/// repetition, clock), come from the leading part; `inputs` as estimating_findings_measure. Once.
/// Where the leading part's true period is no whole number of samples, or drifts, the recording is taken as parts of
/// the leading part's length, each resampled by itself; G is their mean, weighed by periods: it does not depend on
/// where a part begins.
/// Errors: as periodic_cut, run_stream_fill and online_end
int estimating_pieces_estimate(struct estimating_pieces *self, const struct periodic_options *options,
                               const struct inputs *inputs, struct frf *out_frf, struct estimating_summary *out_summary,
                               struct error *out_error);

void estimating_pieces_free(struct estimating_pieces *self);

#endif
