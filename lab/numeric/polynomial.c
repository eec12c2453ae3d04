/* SPDX-License-Identifier: MIT */
#include "lab/numeric/polynomial.h"

#include <float.h>
#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

double complex polynomial_value(const double *coefficients, size_t order, double complex x)
{
    double complex value = coefficients[order];
    for (size_t i = order; i-- > 0;) {
        value = value * x + coefficients[i];
    }
    return value;
}

double complex polynomial_slope(const double *coefficients, size_t order, double complex x)
{
    double complex slope = 0.0;
    for (size_t i = order; i > 0; i--) {
        slope = slope * x + (double)i * coefficients[i];
    }
    return slope;
}

/// A step is taken only while it makes the value smaller: near multiple roots Newton's steps run wild.
static double complex polish(const double *coefficients, size_t order, double complex root)
{
    enum { steps_max = 4 };
    double size = cabs(polynomial_value(coefficients, order, root));
    for (int step = 0; step < steps_max && size > 0.0; step++) {
        double complex next =
            root - polynomial_value(coefficients, order, root) / polynomial_slope(coefficients, order, root);
        double next_size = cabs(polynomial_value(coefficients, order, next));
        if (!(next_size < size)) {
            break;
        }
        root = next;
        size = next_size;
    }
    return root;
}

/// Column after column: ones below the diagonal, the monic polynomial's coefficients in the last column.
static void fill_companion(const double *coefficients, size_t order, double *out_matrix)
{
    memset(out_matrix, 0, order * order * sizeof *out_matrix);
    for (size_t i = 0; i + 1 < order; i++) {
        out_matrix[i * order + i + 1] = 1.0;
    }
    for (size_t i = 0; i < order; i++) {
        out_matrix[(order - 1) * order + i] = -coefficients[i] / coefficients[order];
    }
}

bool polynomial_roots(const double *coefficients, size_t order, double complex *out_roots, size_t *out_count)
{
    *out_count = 0;
    while (order > 0 && coefficients[order] == 0.0) {
        order--;
    }
    if (order == 0) {
        return isfinite(coefficients[0]);
    }
    double *matrix = malloc((order * order + 2 * order) * sizeof *matrix);
    if (!matrix) {
        return false;
    }
    double *real = matrix + order * order;
    double *imag = real + order;
    fill_companion(coefficients, order, matrix);
    lapack_int n = (lapack_int)order;
    bool found = LAPACKE_dgeev(LAPACK_COL_MAJOR, 'N', 'N', n, matrix, n, real, imag, NULL, n, NULL, n) == 0;
    for (size_t i = 0; i < order && found; i++) {
        if (imag[i] < 0.0 && i > 0) {
            out_roots[i] = conj(out_roots[i - 1]);
        } else {
            out_roots[i] = polish(coefficients, order, real[i] + imag[i] * I);
        }
    }
    *out_count = found ? order : 0;
    free(matrix);
    return found;
}
