/* SPDX-License-Identifier: MIT */
/// Sums over vectors, added in a given order, so that they come out the same on every machine.
#ifndef SERVOSCOPE_NUMERIC_VECTOR_H
#define SERVOSCOPE_NUMERIC_VECTOR_H

#include <stddef.h>

/// sum_i a_i b_i, sum_i a_i, and sum_i a_i^2: several partial sums beside each other, because one would wait for its
/// own last addition.
double vector_dot(size_t count, const double *a, const double *b);
double vector_sum(size_t count, const double *a);
double vector_power(size_t count, const double *a);

/// Root of the sum of squares.
double vector_length(size_t count, const double *x);

#endif
