/* SPDX-License-Identifier: MIT */
/// A measured sequence as one recording: each of its runs is estimated, the responses are put together.
#ifndef SERVOSCOPE_TOOLS_ESTIMATING_SEQUENCE_H
#define SERVOSCOPE_TOOLS_ESTIMATING_SEQUENCE_H

#include "lab/record/error.h"
#include "lab/record/frf_file.h"
#include "lab/record/run.h"
#include "lab/record/run_sequence.h"

#include <stddef.h>

/// Estimates one run. `segment` says which table it has to be of: see estimating_check_table().
typedef int (*estimating_one)(void *context, const char *path, const struct run_sequence_segment *segment,
                              struct frf *out_frf, struct error *out_error);

/// Refuses a run that was not made with the segment's table. A run that does not say its table is believed.
int estimating_check_table(const struct run *run, const struct run_sequence_segment *segment, struct error *out_error);

/// What became of the segments.
struct estimating_segments {
    char kind[16];
    size_t planned;
    size_t used;
    char missing[64]; ///< numbers of those left out, "4, 5"; empty if there are none
};

/// Estimates every run that the manifest at `path` names and assembles the responses (lab/estimate/assemble.h).
/// A segment that is missing, or of which fewer than two periods were measured before the measurement ended early, is
/// left out; the key `segments_missing` names those.
/// Errors: error_refused as the manifest, `estimate` and the assembly do, with the segment, and if no segment is left;
///         *out_frf is empty then
int estimating_sequence(const char *path, estimating_one estimate, void *context, struct frf *out_frf,
                        struct estimating_segments *out_segments, struct error *out_error);

#endif
