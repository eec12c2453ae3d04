/* SPDX-License-Identifier: MIT */
/// Slow changes over the periods of a run: a friction that drifts, a gain or a bias that creeps. They are the same from
/// one period to the next but for a little, and noise is not.
#ifndef SERVOSCOPE_DIAGNOSE_SLOW_H
#define SERVOSCOPE_DIAGNOSE_SLOW_H

#include <stdbool.h>
#include <stddef.h>

struct evidence;

enum { slow_octaves_most = 24, slow_orders_most = 2, slow_fewest_periods = 4 };

/// Bins from .. to - 1 of the block.
struct slow_octave {
    size_t from, to;
};

/// Octaves of the band; the constant part counts with the first lines. Returns how many.
size_t slow_octaves(size_t band, struct slow_octave out[slow_octaves_most]);

/// Orthonormal slow courses over the periods: straight and, with six periods or more, curved. Returns how many.
/// Shapes: out: slow_orders_most x periods
size_t slow_courses(size_t periods, double *out);

/// How much of one complex value of each period lies in a course.
/// Shapes: values: the first period's, `stride` doubles from one period to the next
void slow_along(const double *values, size_t stride, size_t periods, const double *course, double out_along[2]);

/// Evidence that m of n squares, of sum `part`, have a larger variance than the others; out_excess: how much larger.
/// Equation: (n ln(S / n) - m ln(A / m) - (n - m) ln((S - A) / (n - m))) / 2,  A `part`, S `sum`; 0 if it is not larger
double slow_larger_variance(double part, double m, double sum, double n, double *out_excess);

/// Finds octaves in which the mechanics change slowly over the periods, by the present whitening, and writes per bin
/// how many courses that is. What changes slowly is part of its own whitening then, but of that of the other courses as
/// well: it stands out all the same. Returns whether there are any.
/// Range:  four periods or more; nothing is found in fewer
/// Shapes: deviations: spectra of the periods' residuals less their mean, `stride` doubles each; out_orders: band + 1
bool slow_find(const struct evidence *evidence, const double *deviations, size_t stride, size_t *out_orders);

#endif
