/* SPDX-License-Identifier: MIT */
#include "lab/estimate/complex_fit.h"

#include <math.h>

static const double least_independent_share = 1e-9;

static double length_of(const double complex *x, size_t count)
{
    double power = 0.0;
    for (size_t i = 0; i < count; i++) {
        power += creal(x[i]) * creal(x[i]) + cimag(x[i]) * cimag(x[i]);
    }
    return sqrt(power);
}

/// Takes the part along `q` out of `x` and returns it.
static double complex take_out(size_t rows, const double complex *q, double complex *io_x)
{
    double real = 0.0;
    double imaginary = 0.0;
    for (size_t i = 0; i < rows; i++) {
        real += creal(q[i]) * creal(io_x[i]) + cimag(q[i]) * cimag(io_x[i]);
        imaginary += creal(q[i]) * cimag(io_x[i]) - cimag(q[i]) * creal(io_x[i]);
    }
    for (size_t i = 0; i < rows; i++) {
        double real_left = creal(io_x[i]) - (real * creal(q[i]) - imaginary * cimag(q[i]));
        double imaginary_left = cimag(io_x[i]) - (real * cimag(q[i]) + imaginary * creal(q[i]));
        io_x[i] = real_left + imaginary_left * I;
    }
    return real + imaginary * I;
}

bool complex_fit_orthonormalise(size_t rows, size_t columns, double complex *io_K, double *out_lengths)
{
    for (size_t c = 0; c < columns; c++) {
        double complex *column = io_K + c * rows;
        double whole = length_of(column, rows);
        /* Twice is enough: what the first pass leaves by rounding, the second takes out. */
        for (int pass = 0; pass < 2; pass++) {
            for (size_t j = 0; j < c; j++) {
                (void)take_out(rows, io_K + j * rows, column);
            }
        }
        out_lengths[c] = length_of(column, rows);
        if (!(out_lengths[c] > least_independent_share * whole)) {
            return false;
        }
        for (size_t i = 0; i < rows; i++) {
            column[i] /= out_lengths[c];
        }
    }
    return true;
}

double complex complex_fit_last(size_t rows, size_t columns, const double complex *Q, double last_length,
                                double complex *io_values)
{
    double complex last = 0.0;
    for (size_t c = 0; c < columns; c++) {
        last = take_out(rows, Q + c * rows, io_values);
    }
    return last / last_length;
}
