/* SPDX-License-Identifier: MIT */
#include "lab/numeric/filter.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double pi = 3.14159265358979324;

/// Section number i of a low-pass with the analogue pole pair re +- j im (for a pass band edge at 1 rad/s) moved to
/// `edge` by the bilinear transform s = (z-1)/(z+1); gain 1 at DC.
static void set_section(struct filter *f, size_t i, double re, double im, double edge)
{
    re *= edge;
    im *= edge;
    double square = re * re + im * im;
    double norm = 1.0 - 2.0 * re + square;
    f->b[i][0] = square / norm;
    f->b[i][1] = 2.0 * square / norm;
    f->b[i][2] = square / norm;
    f->a[i][0] = 2.0 * (square - 1.0) / norm;
    f->a[i][1] = (1.0 + 2.0 * re + square) / norm;
}

struct filter filter_butterworth(size_t order, double cutoff)
{
    assert(order >= 2 && order % 2 == 0 && order / 2 <= filter_sections_max && cutoff > 0.0 && cutoff < 1.0);
    struct filter f = {.sections = order / 2};
    double edge = tan(pi * cutoff / 2.0);
    for (size_t i = 0; i < f.sections; i++) {
        double angle = pi * (2.0 * (double)i + 1.0) / (2.0 * (double)order);
        set_section(&f, i, -sin(angle), cos(angle), edge);
    }
    return f;
}

struct filter filter_chebyshev(size_t order, double ripple_db, double cutoff)
{
    assert(order >= 2 && order % 2 == 0 && order / 2 <= filter_sections_max && cutoff > 0.0 && cutoff < 1.0);
    struct filter f = {.sections = order / 2};
    double edge = tan(pi * cutoff / 2.0);
    double epsilon = sqrt(pow(10.0, ripple_db / 10.0) - 1.0);
    double width = asinh(1.0 / epsilon) / (double)order;
    for (size_t i = 0; i < f.sections; i++) {
        double angle = pi * (2.0 * (double)i + 1.0) / (2.0 * (double)order);
        set_section(&f, i, -sinh(width) * sin(angle), cosh(width) * cos(angle), edge);
    }
    double gain = pow(10.0, -ripple_db / 20.0);
    for (size_t j = 0; j < 3; j++)
        f.b[0][j] *= gain;
    return f;
}

/// Direct form II transposed, one section, starting in the steady state of the first sample.
static void run_section(const double b[3], const double a[2], size_t n, double *x)
{
    double gain = (b[0] + b[1] + b[2]) / (1.0 + a[0] + a[1]);
    double s2 = (b[2] - a[1] * gain) * x[0];
    double s1 = (b[1] - a[0] * gain) * x[0] + s2;
    for (size_t i = 0; i < n; i++) {
        double in = x[i];
        double out = b[0] * in + s1;
        s1 = b[1] * in - a[0] * out + s2;
        s2 = b[2] * in - a[1] * out;
        x[i] = out;
    }
}

static void reverse(size_t n, double *x)
{
    for (size_t i = 0; i < n / 2; i++) {
        double swap = x[i];
        x[i] = x[n - 1 - i];
        x[n - 1 - i] = swap;
    }
}

bool filter_zero_phase(const struct filter *self, size_t samples, double *x)
{
    size_t pad = 6 * self->sections;
    if (samples <= pad)
        return false;
    size_t n = samples + 2 * pad;
    double *work = malloc(n * sizeof *work);
    if (!work)
        return false;
    for (size_t i = 0; i < pad; i++) {
        work[i] = 2.0 * x[0] - x[pad - i];
        work[pad + samples + i] = 2.0 * x[samples - 1] - x[samples - 2 - i];
    }
    memcpy(work + pad, x, samples * sizeof *x);
    for (int direction = 0; direction < 2; direction++) {
        for (size_t i = 0; i < self->sections; i++)
            run_section(self->b[i], self->a[i], n, work);
        reverse(n, work);
    }
    memcpy(x, work + pad, samples * sizeof *x);
    free(work);
    return true;
}
