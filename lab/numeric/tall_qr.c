/* SPDX-License-Identifier: MIT */
#include "lab/numeric/tall_qr.h"

#include "lab/numeric/blas.h"

#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/// A block of this many rows and its factor stay in the first-level cache for up to 25 columns.
enum { rows_per_block = 128 };

bool tall_qr_init(struct tall_qr *out_self, size_t columns)
{
    blas_use_one_thread();
    *out_self = (struct tall_qr){.columns = columns, .capacity = columns + rows_per_block, .finite = true};
    out_self->block = malloc(out_self->capacity * columns * sizeof *out_self->block);
    out_self->tau = malloc(2 * columns * sizeof *out_self->tau);
    if (!out_self->block || !out_self->tau) {
        tall_qr_free(out_self);
        return false;
    }
    return true;
}

void tall_qr_free(struct tall_qr *self)
{
    free(self->block);
    free(self->tau);
    *self = (struct tall_qr){0};
}

void tall_qr_reset(struct tall_qr *self)
{
    self->filled = 0;
    self->finite = true;
}

/// Replaces the rows by their factor. A row that is not finite makes a factor that is not.
static void fold(struct tall_qr *self)
{
    size_t n = self->columns;
    double *work = self->tau + n;
    lapack_int failed = LAPACKE_dgeqrf_work(LAPACK_COL_MAJOR, (lapack_int)self->filled, (lapack_int)n, self->block,
                                            (lapack_int)self->capacity, self->tau, work, (lapack_int)n);
    self->finite = self->finite && failed == 0;
    for (size_t j = 0; j < n; j++) {
        for (size_t i = j + 1; i < n && i < self->filled; i++) {
            self->block[j * self->capacity + i] = 0.0;
        }
    }
    self->filled = self->filled < n ? self->filled : n;
}

void tall_qr_add(struct tall_qr *self, const double *row)
{
    if (self->filled == self->capacity) {
        fold(self);
    }
    for (size_t j = 0; j < self->columns; j++) {
        self->block[j * self->capacity + self->filled] = row[j];
    }
    self->filled++;
}

bool tall_qr_finish(struct tall_qr *self, double *out_R)
{
    size_t n = self->columns;
    memset(out_R, 0, n * n * sizeof *out_R);
    if (self->filled > 0) {
        fold(self);
    }
    for (size_t j = 0; j < n; j++) {
        for (size_t i = 0; i <= j && i < self->filled; i++) {
            out_R[j * n + i] = self->block[j * self->capacity + i];
            self->finite = self->finite && isfinite(out_R[j * n + i]);
        }
    }
    return self->finite;
}
