/* SPDX-License-Identifier: MIT */
/// Triangular factor of a matrix with many rows, which come one after the other: memory does not grow with them, and
/// no digits are lost as in normal equations.
#ifndef SERVOSCOPE_NUMERIC_TALL_QR_H
#define SERVOSCOPE_NUMERIC_TALL_QR_H

#include <stdbool.h>
#include <stddef.h>

/// Rows on their way into A = Q R.
struct tall_qr {
    size_t columns;
    size_t capacity; ///< rows of `block`
    size_t filled;
    double *block; ///< capacity x columns, column after column: the factor so far, then rows not yet folded in
    double *tau;   ///< 2 columns: of the reflections, and scratch
    bool finite;   ///< nothing was NaN or infinite so far
};

/// Errors: false if memory is short; *out_self needs no freeing then.
bool tall_qr_init(struct tall_qr *out_self, size_t columns);
void tall_qr_free(struct tall_qr *self);

/// Forgets all rows.
void tall_qr_reset(struct tall_qr *self);

/// Adds one row of `columns` values.
/// Cost: 2 columns^2 multiply-adds, by Householder reflections in blocks (LAPACK dgeqrf)
void tall_qr_add(struct tall_qr *self, const double *row);

/// Gives R: columns x columns, column after column, zero below the diagonal. Fewer rows than columns leave zero rows.
/// Errors: false if a row was not finite.
/// Test:   tests/unit/test_tall_qr.c
bool tall_qr_finish(struct tall_qr *self, double *out_R);

#endif
