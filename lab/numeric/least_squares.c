/* SPDX-License-Identifier: MIT */
#include "lab/numeric/least_squares.h"

#include "lab/numeric/blas.h"
#include "lab/numeric/vector.h"

#include <lapacke.h>
#include <math.h>
#include <stdlib.h>

/// Column norms, prior included; zero columns get norm 1 so that they drop out instead of dividing by zero.
static void column_norms(size_t rows, size_t columns, const double *A, const double *weight, double *out_norm)
{
    for (size_t i = 0; i < columns; i++) {
        double w = weight ? weight[i] : 0.0;
        double norm = sqrt(vector_dot(rows, A + i * rows, A + i * rows) + w * w);
        out_norm[i] = norm > 0.0 ? norm : 1.0;
    }
}

static void normal_equations(size_t rows, size_t columns, const double *A, const double *b, const double *weight,
                             const double *centre, const double *norm, double *out_H, double *out_g)
{
    for (size_t i = 0; i < columns; i++) {
        double w = weight ? weight[i] / norm[i] : 0.0;
        double target = centre ? centre[i] * norm[i] : 0.0;
        out_g[i] = vector_dot(rows, A + i * rows, b) / norm[i] + w * w * target;
        for (size_t j = 0; j <= i; j++) {
            double h = vector_dot(rows, A + i * rows, A + j * rows) / (norm[i] * norm[j]);
            out_H[i * columns + j] = out_H[j * columns + i] = h;
        }
        out_H[i * columns + i] += w * w;
        if (out_H[i * columns + i] == 0.0) // an empty column: pinned at zero
            out_H[i * columns + i] = 1.0;
    }
}

/// Whether columns are independent: the square of a pivot of the factor is what a column of length 1 has of its own,
/// apart from those before it. Dependent columns leave rounding there, of either sign, so that the factorisation may go
/// through.
static bool independent(size_t columns, const double *factor)
{
    const double own_least = 1e-14;
    for (size_t i = 0; i < columns; i++)
        if (!(factor[i * columns + i] * factor[i * columns + i] > own_least))
            return false;
    return true;
}

static void store_covariance(size_t columns, const double *inverse, const double *norm, const double *gram_diagonal,
                             double *out_covariance)
{
    for (size_t i = 0; i < columns; i++)
        for (size_t j = 0; j < columns; j++) {
            bool empty = gram_diagonal[i] == 0.0 || gram_diagonal[j] == 0.0;
            double value = i >= j ? inverse[j * columns + i] : inverse[i * columns + j];
            out_covariance[i * columns + j] = empty ? 0.0 : value / (norm[i] * norm[j]);
        }
}

bool least_squares_solve(size_t rows, size_t columns, const double *A, const double *b, const double *weight,
                         const double *centre, double *out_x, double *out_covariance)
{
    blas_use_one_thread();
    double *work = malloc((columns * columns + 3 * columns) * sizeof *work);
    if (!work)
        return false;
    double *H = work, *g = H + columns * columns, *norm = g + columns, *gram = norm + columns;
    for (size_t i = 0; i < columns; i++)
        gram[i] = vector_dot(rows, A + i * rows, A + i * rows) + (weight ? weight[i] * weight[i] : 0.0);
    column_norms(rows, columns, A, weight, norm);
    normal_equations(rows, columns, A, b, weight, centre, norm, H, g);
    lapack_int n = (lapack_int)columns;
    // 'L' of a column-major matrix: element (i, j), i >= j, lies at [j * columns + i].
    bool good = LAPACKE_dposv(LAPACK_COL_MAJOR, 'L', n, 1, H, n, g, n) == 0 && independent(columns, H);
    if (good && out_covariance)
        good = LAPACKE_dpotri(LAPACK_COL_MAJOR, 'L', n, H, n) == 0;
    if (good) {
        for (size_t i = 0; i < columns; i++)
            out_x[i] = g[i] / norm[i];
        if (out_covariance)
            store_covariance(columns, H, norm, gram, out_covariance);
    }
    free(work);
    return good;
}
