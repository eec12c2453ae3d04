/* SPDX-License-Identifier: MIT */
/// Singular values of a factor whose columns are scaled to length 1 first, so that units of the unknowns do not matter,
/// and what follows from them: solutions, null vectors, covariances.
#ifndef SERVOSCOPE_NUMERIC_SCALED_SVD_H
#define SERVOSCOPE_NUMERIC_SCALED_SVD_H

#include <stdbool.h>
#include <stddef.h>

/// R D^-1 = W S V'
struct scaled_svd {
    size_t columns;
    double *length;   ///< columns: diagonal of D; 1 for a column of zeros
    double *singular; ///< columns, descending
    double *W, *Vt;   ///< columns x columns, column after column
};

/// Errors: false if memory is short; *out_self needs no freeing then.
bool scaled_svd_init(struct scaled_svd *out_self, size_t columns);
void scaled_svd_free(struct scaled_svd *self);

/// Factorises the first `columns` rows and columns of R, whose columns are `stride` apart.
/// Errors: false if R is not finite or the iteration fails.
/// Test:   tests/unit/test_scaled_svd.c
bool scaled_svd_factorise(struct scaled_svd *self, const double *R, size_t stride);

/// Solves R x = b in the `rank` largest directions, damped: x = D^-1 V diag(s / (s^2 + damping^2)) W' b.
void scaled_svd_solve(const struct scaled_svd *self, const double *b, size_t rank, double damping, double *out_x);

/// The x that R makes least of, for |D x| = 1.
void scaled_svd_null_vector(const struct scaled_svd *self, double *out_x);

/// (R'R)^+ over the `rank` largest directions: columns x columns.
void scaled_svd_inverse_gram(const struct scaled_svd *self, size_t rank, double *out_inverse);

/// How many of the first `expected` singular values are above `share` of the largest.
size_t scaled_svd_rank(const struct scaled_svd *self, size_t expected, double share);

#endif
