/* SPDX-License-Identifier: MIT */
/// Symmetric positive definite systems on the host.
#ifndef SERVOSCOPE_NUMERIC_CHOLESKY_H
#define SERVOSCOPE_NUMERIC_CHOLESKY_H

#include <stdbool.h>
#include <stddef.h>

/// Solves A x = b.
/// Shapes: inout_A: n x n, lower triangle of a column-major matrix, overwritten by its factor; inout_x: b, then x
/// Errors: false if A is not positive definite; inout_x is undefined then
bool cholesky_solve(size_t n, double *inout_A, double *inout_x);

#endif
