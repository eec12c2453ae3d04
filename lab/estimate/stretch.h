/* SPDX-License-Identifier: MIT */
/// Consecutive periods taken as one record, for methods that need more than one period at once: its spectrum has P - 1
/// lines between two bins of a period, which a periodic signal does not reach.
#ifndef SERVOSCOPE_ESTIMATE_STRETCH_H
#define SERVOSCOPE_ESTIMATE_STRETCH_H

#include "lab/estimate/periodic.h"

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

struct stretch {
    size_t first; ///< its first period
    size_t periods;
    size_t rows;
};

/// Finds the longest stretch of consecutive periods that count.
struct stretch stretch_longest(const struct periodic *recording);

/// Transforms input and output of the whole stretch, the output without the trend that the cut found.
/// Shapes: out_input, out_output: rows/2 + 1 lines, resolution 1/P of a bin
/// Errors: false if memory is short
bool stretch_transform(const struct periodic *recording, const struct stretch *self, double complex *out_input,
                       double complex *out_output);

/// The same for those lines only that lie up to `reach` lines from a multiple of P (all of them if P < 2 reach + 2);
/// the others are not touched. With many periods that is a small part of the work.
/// Equation:  X(kP + r) = sum_n exp(-j 2 pi k n / N) z_r[n],
///            z_r[n] = exp(-j 2 pi r n / (N P)) sum_p x[pN + n] exp(-j 2 pi r p / P), transforms of one period's length
bool stretch_transform_near(const struct periodic *recording, const struct stretch *self, size_t reach,
                            double complex *out_input, double complex *out_output);

#endif
