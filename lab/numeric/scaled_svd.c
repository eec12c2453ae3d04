/* SPDX-License-Identifier: MIT */
#include "lab/numeric/scaled_svd.h"

#include <lapacke.h>
#include <math.h>
#include <stdlib.h>

bool scaled_svd_init(struct scaled_svd *out_self, size_t columns)
{
    double *work = malloc((2 * columns * columns + 2 * columns) * sizeof *work);
    *out_self = (struct scaled_svd){0};
    if (!work) {
        return false;
    }
    *out_self = (struct scaled_svd){.columns = columns, .length = work};
    out_self->singular = out_self->length + columns;
    out_self->W = out_self->singular + columns;
    out_self->Vt = out_self->W + columns * columns;
    return true;
}

void scaled_svd_free(struct scaled_svd *self)
{
    free(self->length);
    *self = (struct scaled_svd){0};
}

/// Overflow and underflow of squares do not matter to hypot().
static double column_length(const double *column, size_t rows)
{
    double length = 0.0;
    for (size_t i = 0; i < rows; i++) {
        length = hypot(length, column[i]);
    }
    return length > 0.0 ? length : 1.0;
}

bool scaled_svd_factorise(struct scaled_svd *self, const double *R, size_t stride)
{
    size_t n = self->columns;
    for (size_t j = 0; j < n; j++) {
        self->length[j] = column_length(R + j * stride, n);
        for (size_t i = 0; i < n; i++) {
            self->W[j * n + i] = R[j * stride + i] / self->length[j];
        }
    }
    lapack_int order = (lapack_int)n;
    // jobz 'O': the left vectors take the matrix's place.
    return LAPACKE_dgesdd(LAPACK_COL_MAJOR, 'O', order, order, self->W, order, self->singular, NULL, order, self->Vt,
                          order) == 0;
}

void scaled_svd_solve(const struct scaled_svd *self, const double *b, size_t rank, double damping, double *out_x)
{
    size_t n = self->columns;
    for (size_t j = 0; j < n; j++) {
        out_x[j] = 0.0;
    }
    for (size_t k = 0; k < rank && self->singular[k] > 0.0; k++) {
        double projection = 0.0;
        for (size_t i = 0; i < n; i++) {
            projection += self->W[k * n + i] * b[i];
        }
        double s = self->singular[k];
        double along = projection * s / (s * s + damping * damping);
        for (size_t j = 0; j < n; j++) {
            out_x[j] += along * self->Vt[j * n + k] / self->length[j];
        }
    }
}

void scaled_svd_null_vector(const struct scaled_svd *self, double *out_x)
{
    size_t n = self->columns;
    for (size_t j = 0; j < n; j++) {
        out_x[j] = self->Vt[j * n + n - 1] / self->length[j];
    }
}

void scaled_svd_inverse_gram(const struct scaled_svd *self, size_t rank, double *out_inverse)
{
    size_t n = self->columns;
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j <= i; j++) {
            double sum = 0.0;
            for (size_t k = 0; k < rank && self->singular[k] > 0.0; k++) {
                sum += self->Vt[i * n + k] / self->singular[k] * (self->Vt[j * n + k] / self->singular[k]);
            }
            sum /= self->length[i] * self->length[j];
            out_inverse[i * n + j] = sum;
            out_inverse[j * n + i] = sum;
        }
    }
}

size_t scaled_svd_rank(const struct scaled_svd *self, size_t expected, double share)
{
    size_t rank = 0;
    while (rank < expected && self->singular[rank] > share * self->singular[0]) {
        rank++;
    }
    return rank;
}
