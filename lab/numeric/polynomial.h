/* SPDX-License-Identifier: MIT */
/// Polynomials with real coefficients, lowest power first.
#ifndef SERVOSCOPE_NUMERIC_POLYNOMIAL_H
#define SERVOSCOPE_NUMERIC_POLYNOMIAL_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

/// p(x) = sum_{i=0}^{order} coefficients[i] x^i
double complex polynomial_value(const double *coefficients, size_t order, double complex x);

/// dp/dx
double complex polynomial_slope(const double *coefficients, size_t order, double complex x);

/// Finds all roots: eigenvalues of the balanced companion matrix (LAPACK dgeev), polished by Newton's method. Complex
/// roots come as exact pairs, the one above the real axis first.
/// Range:  highest coefficient not 0 (leading zeros lower *out_count); roots: room for `order`
/// Errors: false if memory is short, a coefficient is not finite or the iteration fails
/// Test:   tests/unit/test_polynomial.c
bool polynomial_roots(const double *coefficients, size_t order, double complex *out_roots, size_t *out_count);

#endif
