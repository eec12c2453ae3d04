/* SPDX-License-Identifier: MIT */
/* Needs math.h; firmware whose tables are in flash leaves this file out. */
#include "frf/block_basis.h"

#include "frf/block_table.h"

#include <math.h>

enum { half_max = FRF_BLOCK_SAMPLES_MAX / 2u };

/* The tridiagonal matrix that has the sequences as eigenvectors, folded: entries below `size` of the diagonal, and
 * beside[t] between t - 1 and t. */
struct tridiagonal {
    double diagonal[half_max], beside[half_max];
    uint32_t size;
};

static void fill(struct tridiagonal *self, uint32_t half, double width, int sign)
{
    struct tridiagonal zero = {{0.0}, {0.0}, 0};
    *self = zero;
    static const double two_pi = 6.28318530717958647692;
    self->size = half;
    for (uint32_t t = 0; t < half; ++t) {
        double centred = (double)half - 0.5 - (double)t;
        self->diagonal[t] = centred * centred * cos(two_pi * width);
        self->beside[t] = 0.5 * (double)t * (double)(2u * half - t);
    }
    self->diagonal[half - 1u] += sign * 0.5 * (double)half * (double)half;
}

/* A pivot that is 0 only says that x is an eigenvalue of a part. */
static double pivot(double value)
{
    static const double tiny = 1e-200;
    return value < tiny && value > -tiny ? -tiny : value;
}

/* Sylvester: as many eigenvalues lie above x as there are positive pivots of the matrix less x. */
static uint32_t count_above(const struct tridiagonal *matrix, double x)
{
    uint32_t count = 0;
    double last = 1.0;
    for (uint32_t t = 0; t < matrix->size; ++t) {
        last = pivot(matrix->diagonal[t] - x - matrix->beside[t] * matrix->beside[t] / last);
        count += last > 0.0;
    }
    return count;
}

static double eigenvalue(const struct tridiagonal *matrix, uint32_t order)
{
    double size = (double)matrix->size, high = 4.0 * size * size, low = -high; /* Gershgorin, generously */
    for (unsigned i = 0; i < 80; ++i) {
        double middle = 0.5 * (low + high);
        if (count_above(matrix, middle) > order) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return 0.5 * (low + high);
}

/* From both ends towards the row where the two factorisations disagree least, which is where the vector is large: the
 * recursion then only runs in directions that damp its errors. */
static void eigenvector(const struct tridiagonal *matrix, double value, double *out_vector)
{
    double down[half_max], up[half_max], least = HUGE_VAL;
    uint32_t last = matrix->size - 1u, twist = 0;
    down[0] = pivot(matrix->diagonal[0] - value);
    for (uint32_t t = 1; t <= last; ++t) {
        down[t] = pivot(matrix->diagonal[t] - value - matrix->beside[t] * matrix->beside[t] / down[t - 1u]);
    }
    up[last] = pivot(matrix->diagonal[last] - value);
    for (uint32_t t = last; t > 0; --t) {
        up[t - 1u] = pivot(matrix->diagonal[t - 1u] - value - matrix->beside[t] * matrix->beside[t] / up[t]);
    }
    for (uint32_t t = 0; t <= last; ++t) {
        double gap = fabs(down[t] + up[t] - (matrix->diagonal[t] - value));
        if (gap < least) {
            least = gap;
            twist = t;
        }
    }
    out_vector[twist] = 1.0;
    for (uint32_t t = twist; t > 0; --t) {
        out_vector[t - 1u] = -matrix->beside[t] * out_vector[t] / down[t - 1u];
    }
    for (uint32_t t = twist; t < last; ++t) {
        out_vector[t + 1u] = -matrix->beside[t + 1u] * out_vector[t] / up[t + 1u];
    }
}

void frf_basis_function(uint32_t half, double width, int sign, uint32_t order, double *out_function)
{
    struct tridiagonal matrix;
    double vector[half_max] = {0.0}, squares = 0.0;
    fill(&matrix, half, width, sign);
    eigenvector(&matrix, eigenvalue(&matrix, order), vector);
    for (uint32_t t = 0; t < half; ++t) {
        squares += vector[t] * vector[t];
    }
    for (uint32_t i = 0; i < half; ++i) { /* the matrix counts from the edge inwards */
        out_function[i] = vector[half - 1u - i] * sqrt((double)half / squares);
    }
}
