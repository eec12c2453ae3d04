/* SPDX-License-Identifier: MIT */
#include "lab/estimate/lpm_window.h"

#include "lab/numeric/cmplx.h"

#include <math.h>
#include <stdlib.h>

/// What is left of a column after the others are taken out, as a share of its length: less is rounding.
static const double least_independent_share = 1e-10;

bool lpm_window_alloc(size_t lines, int order, struct lpm_window *out_self)
{
    *out_self = (struct lpm_window){.lines = lines, .columns = (size_t)order + 1};
    out_self->offsets = malloc(lines * sizeof *out_self->offsets);
    out_self->basis = malloc(out_self->columns * lines * sizeof *out_self->basis);
    out_self->weights = calloc(lines, sizeof *out_self->weights);
    if (out_self->offsets && out_self->basis && out_self->weights) {
        return true;
    }
    lpm_window_free(out_self);
    return false;
}

void lpm_window_free(struct lpm_window *self)
{
    free(self->offsets);
    free(self->basis);
    free(self->weights);
    *self = (struct lpm_window){0};
}

static double length_of(const double *x, size_t count)
{
    double power = 0.0;
    for (size_t i = 0; i < count; i++) {
        power += x[i] * x[i];
    }
    return sqrt(power);
}

/// Takes the earlier columns out of one, and out of its value at the centre: a polynomial is both.
static void take_out(const struct lpm_window *self, size_t column, const double *at_centre, double *io_value)
{
    double *q = self->basis + column * self->lines;
    for (size_t j = 0; j < column; j++) {
        const double *other = self->basis + j * self->lines;
        double product = 0.0;
        for (size_t i = 0; i < self->lines; i++) {
            product += other[i] * q[i];
        }
        for (size_t i = 0; i < self->lines; i++) {
            q[i] -= product * other[i];
        }
        *io_value -= product * at_centre[j];
    }
}

static bool add_column(struct lpm_window *self, size_t column, double scale, double *io_at_centre)
{
    double *q = self->basis + column * self->lines;
    double value = column == 0 ? 1.0 : 0.0;
    for (size_t i = 0; i < self->lines; i++) {
        q[i] = pow((double)self->offsets[i] / scale, (double)column);
    }
    double whole = length_of(q, self->lines);
    take_out(self, column, io_at_centre, &value);
    take_out(self, column, io_at_centre, &value);
    double rest = length_of(q, self->lines);
    if (!(rest > least_independent_share * whole)) {
        return false;
    }
    for (size_t i = 0; i < self->lines; i++) {
        q[i] /= rest;
    }
    io_at_centre[column] = value / rest;
    return true;
}

bool lpm_window_prepare(struct lpm_window *self)
{
    double at_centre[64] = {0};
    double scale = 1.0;
    if (self->columns > sizeof at_centre / sizeof *at_centre) {
        return false;
    }
    for (size_t i = 0; i < self->lines; i++) {
        scale = fmax(scale, fabs((double)self->offsets[i]));
        self->weights[i] = 0.0;
    }
    self->leverage = 0.0;
    for (size_t c = 0; c < self->columns; c++) {
        if (!add_column(self, c, scale, at_centre)) {
            return false;
        }
        self->leverage += at_centre[c] * at_centre[c];
        for (size_t i = 0; i < self->lines; i++) {
            self->weights[i] += at_centre[c] * self->basis[c * self->lines + i];
        }
    }
    return true;
}

double complex lpm_window_fit(const struct lpm_window *self, const double complex *centre, double complex *out_residual)
{
    double complex value = 0.0;
    for (size_t i = 0; i < self->lines; i++) {
        out_residual[i] = centre[self->offsets[i]];
        value += self->weights[i] * out_residual[i];
    }
    for (size_t c = 0; c < self->columns; c++) {
        const double *q = self->basis + c * self->lines;
        double real = 0.0;
        double imaginary = 0.0;
        for (size_t i = 0; i < self->lines; i++) {
            real += q[i] * creal(out_residual[i]);
            imaginary += q[i] * cimag(out_residual[i]);
        }
        for (size_t i = 0; i < self->lines; i++) {
            double real_left = creal(out_residual[i]) - q[i] * real;
            double imaginary_left = cimag(out_residual[i]) - q[i] * imaginary;
            out_residual[i] = CMPLX(real_left, imaginary_left);
        }
    }
    return value;
}
