/* SPDX-License-Identifier: MIT */
/// Sums over vectors, added in order, so that they come out the same on every machine.
#ifndef SERVOSCOPE_NUMERIC_VECTOR_H
#define SERVOSCOPE_NUMERIC_VECTOR_H

#include <stddef.h>

/// sum_i a_i b_i
double vector_dot(size_t count, const double *a, const double *b);

/// Root of the sum of squares.
double vector_length(size_t count, const double *x);

#endif
