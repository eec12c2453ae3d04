/* SPDX-License-Identifier: MIT */
/// Whether the lines of a response lie on a smooth curve as well as their standard deviations say. The scatter from
/// period to period does not show what repeats in every period: nonlinear distortion on the lines, disturbances on the
/// same bins. It moves each line by itself, and a drive's response does not do that.
#ifndef SERVOSCOPE_ESTIMATE_SMOOTHNESS_H
#define SERVOSCOPE_ESTIMATE_SMOOTHNESS_H

#include "lab/record/frf_file.h"

#include <stdbool.h>
#include <stddef.h>

enum {
    smoothness_half_width = 4, ///< neighbours on each side
    smoothness_fewest_lines = 2 * smoothness_half_width + 1,
};

struct smoothness {
    size_t lines;         ///< that were compared with their neighbours; 0: too few, nothing else means anything
    size_t beyond;        ///< of those, further away than 2 std of the difference
    double ratio;         ///< median distance over what std alone explains: about 1 for a linear drive
    double simpler_ratio; ///< the same with curves of one pole less
    double level;         ///< of what moves a line by itself, noise included, over abs(G): median of the lines
};

/// Compares each valid line with a local rational curve through its eight neighbours in log f, the line left out.
///
/// Equation:  G(x) (1 + a1 x + a2 x^2) = b0 + b1 x + b2 x^2,  x = log(f/f_k): weighted least squares over the
///            neighbours, weights 1 / (std |1 + a1 x + a2 x^2|), twice;  b0 = sum c_j G_j is what line k should be
///            distance = |G_k - b0| / (2 sqrt(std_k^2 + sum |c_j (1 + a1 x_j + a2 x_j^2)|^2 std_j^2))
///            of circular normal errors its median is sqrt(log 2) / 2, which `ratio` is in units of (theory.md, F60)
/// Shapes:    out_over_two_std: frf->count, NaN where a line is not valid, has no std, or there are under nine lines
/// Errors:    false if memory is short
/// Test:      tests/unit/test_smoothness.c
bool smoothness_measure(const struct frf *frf, double *out_over_two_std, struct smoothness *out);

/// Whether lines scatter by more than std explains: half of at least twenty lines beyond 2 std, and not because the
/// response bends between lines that are too coarse for it.
bool smoothness_is_rough(const struct smoothness *self);

/// Whether the lines are too coarse to tell: they lie off the curve, and one pole less would put them much further off
/// (1.5 times).
bool smoothness_is_coarse(const struct smoothness *self);

#endif
