/* SPDX-License-Identifier: MIT */
/// Several inputs that are excited at once, each on lines of its own: which columns they are, and which lines are
/// whose. On its own lines one input is the only one with power, so that output over input is its response there, as if
/// it had been excited alone (second paper, 8).
#ifndef SERVOSCOPE_ESTIMATE_INPUTS_H
#define SERVOSCOPE_ESTIMATE_INPUTS_H

#include "lab/record/error.h"
#include "lab/record/run.h"
#include "lab/record/sequence_file.h"

#include <stddef.h>
#include <stdint.h>

enum { inputs_max = 16 };

struct inputs {
    size_t count;
    const char *names[inputs_max]; ///< columns in the order of their numbers; owned by the run
    uint32_t *bins[inputs_max];    ///< ascending; owned
    size_t bin_count[inputs_max];
    /// Largest |U of another input| / |U of the line's own| on any line. In an open loop next to nothing; in a closed
    /// one the others answer, and what they answer passes for the response.
    double foreign_share;
};

/// Names the columns of several inputs: torque_1_Nm, torque_2_Nm, ...; else force, current, voltage, torque_ref,
/// force_ref, the first kind that has two. Ascending numbers, whatever the columns' order. Returns their number, 0 if
/// there are no two.
size_t inputs_list(const struct run *run, const char *out_names[inputs_max]);

/// The same for outputs: velocity_rad_per_s, velocity_m_per_s, position_rad, position_m, the first of which there is a
/// column, with numbers or (one output) without.
size_t inputs_list_outputs(const struct run *run, const char *out_names[inputs_max]);

/// What is known beforehand; zero-initialised: nothing.
struct inputs_known {
    const struct sequence_file *design; ///< which lines are whose; NULL: by their power
    size_t period_samples; ///< 0: the design's, else the run's, else found by repetition of the first input
};

/// Finds the lines of each input.
///
/// design:    the segment that the run's key `segment` ("2 of 8") names, or its only one
/// by power:  of the run's excited_bins, or of all bins that repeat with power (line_search_run), each is the line
/// of
///            the input that has most there, in shares of its own strongest bin
/// Errors:    error_refused: no two inputs, another period or number of inputs than the design's, no segment named, an
///            input without lines, a line on which two inputs are of like strength (within a factor of 2), numbers that
///            are not finite; *out_self is empty then
/// Test:      tests/unit/test_inputs.c
int inputs_find(const struct run *run, const struct inputs_known *known, struct inputs *out_self,
                struct error *out_error);

/// Lines of all inputs but `own`, ascending, for distortion_options; to be freed, NULL if memory is short.
uint32_t *inputs_others(const struct inputs *self, size_t own, size_t *out_count);

void inputs_free(struct inputs *self);

#endif
