/* SPDX-License-Identifier: MIT */
/// Which lines are excited: from what an engineer types to bins of the period.
///
///     linear:FMIN:FMAX:STEP      FMIN, FMIN + STEP, ... up to FMAX
///     odd:FMIN:FMAX:STEP         the odd multiples of STEP in FMIN .. FMAX: even-order distortion falls between them
///     random-odd:FMIN:FMAX:STEP  the same, but of each four neighbours one, drawn by the seed, is left out: these show
///                                odd-order distortion
///     quasilog:FMIN:FMAX:RATIO   greedy: the next bin is max(b + 1, round(RATIO b))
///     list:FILE                  one frequency in Hz per line, any order, `#` begins a comment
///     octaves:FMIN:FMAX:STEP     the lines of linear:, which a sequence plays one octave after the other (sequence.h)
///     dwell:FMIN:FMAX:STEP       the same, one line after the other
///
/// Frequencies have to lie on the period's grid of rate / period within 1e-6 of themselves (and a hundredth of a bin).
#ifndef SERVOSCOPE_DESIGN_LINES_H
#define SERVOSCOPE_DESIGN_LINES_H

#include "lab/record/error.h"

#include <stddef.h>
#include <stdint.h>

struct design_lines {
    size_t count;
    uint32_t *bins;     ///< ascending, 1 .. (period - 1) / 2; owned
    uint32_t step_bins; ///< STEP; 1 for kinds that have none
};

/// The grid that lines have to lie on.
struct design_line_grid {
    double rate_hz;
    size_t period_samples;
};

/// Reads a specification.
/// Errors: error_usage with value and expectation (unknown kind, malformed number, off the grid, at or above half the
///         rate, nothing left); error_refused with file and line for what stands in a list file. *out_lines is empty
///         then.
/// Test:   tests/unit/test_design_lines.c
int design_lines_parse(const char *specification, const struct design_line_grid *grid, uint64_t seed,
                       struct design_lines *out_lines, struct error *out_error);

/// How far from a bin a frequency may lie that is meant to be on it, in bins.
double design_lines_tolerance(double bins);

void design_lines_free(struct design_lines *lines);

#endif
