/* SPDX-License-Identifier: MIT */
/// Small dense linear least squares on the host, with covariance.
#ifndef SERVOSCOPE_NUMERIC_LEAST_SQUARES_H
#define SERVOSCOPE_NUMERIC_LEAST_SQUARES_H

#include <stdbool.h>
#include <stddef.h>

/// Minimises |A x - b|^2 + sum_i weight_i^2 (x_i - centre_i)^2 by Cholesky on column-scaled normal equations.
/// Shapes: A: rows x columns, column after column; b: rows; weight, centre, out_x: columns (weight and centre may be
///         NULL: no prior); out_covariance: columns x columns or NULL, (A'A + W'W)^-1, for residuals of unit variance.
/// Range:  for condition numbers of the scaled A up to about 1e7; a column of zeros without prior gives x = 0 there and
///         a covariance of 0 in its row and column.
/// Errors: false if memory is short or columns depend on each other beyond that; outputs untouched then.
/// Test:   tests/unit/test_least_squares.c
bool least_squares_solve(size_t rows, size_t columns, const double *A, const double *b, const double *weight,
                         const double *centre, double *out_x, double *out_covariance);

#endif
