/* SPDX-License-Identifier: MIT */
/// Small complex least squares of which one unknown is wanted.
#ifndef SERVOSCOPE_ESTIMATE_COMPLEX_FIT_H
#define SERVOSCOPE_ESTIMATE_COMPLEX_FIT_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

/// Makes the columns of K orthonormal in place, the last one last: then it alone holds what only the last unknown can
/// explain.
/// Shapes: K: columns x rows, column after column; out_lengths: what is left of each column beside the earlier ones,
///         as a length; 1 / out_lengths[last]^2 = [(K^H K)^-1] of the last unknown
/// Errors: false if a column depends on earlier ones within 1e-9 of its length: rank loss
/// Test:   tests/unit/test_frf_lpm_arbitrary.c
bool complex_fit_orthonormalise(size_t rows, size_t columns, double complex *io_K, double *out_lengths);

/// Takes all columns out of a right-hand side, which becomes the residual, and returns the last unknown.
double complex complex_fit_last(size_t rows, size_t columns, const double complex *Q, double last_length,
                                double complex *io_values);

#endif
