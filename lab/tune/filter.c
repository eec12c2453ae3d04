/* SPDX-License-Identifier: MIT */
#include "lab/tune/filter.h"

#include <math.h>
#include <string.h>

static const double pi = 3.141592653589793;

/// Numerator of s^2/w^2 + 2 d s/w + 1 with s/w = (1 - q)/(1 + q) / tan(w Ts/2), over (1 + q)^2.
static void section(double frequency_hz, double damping, double rate_hz, double out_c[3])
{
    const double g = 1.0 / tan(pi * frequency_hz / rate_hz);
    out_c[0] = g * g + 2.0 * damping * g + 1.0;
    out_c[1] = 2.0 - 2.0 * g * g;
    out_c[2] = g * g - 2.0 * damping * g + 1.0;
}

static bool in_range(double frequency_hz, double damping, double rate_hz)
{
    return frequency_hz > 0.0 && frequency_hz < 0.5 * rate_hz && damping > 0.0 && isfinite(damping);
}

bool tune_filter_make(struct tune_filter *self, double rate_hz)
{
    double above[3], below[3];
    if (!in_range(self->zero_hz, self->zero_damping, rate_hz) ||
        !in_range(self->pole_hz, self->pole_damping, rate_hz)) {
        return false;
    }
    // Both sections are 4 at q = 1 (0 Hz), so their quotient has gain 1 there.
    section(self->zero_hz, self->zero_damping, rate_hz, above);
    section(self->pole_hz, self->pole_damping, rate_hz, below);
    for (int i = 0; i < 3; i++) {
        self->b[i] = above[i] / below[0];
        self->a[i] = below[i] / below[0];
    }
    self->on = true;
    return true;
}

double complex tune_filter_at(const struct tune_filter *self, double complex delay)
{
    if (!self->on) {
        return 1.0;
    }
    return (self->b[0] + delay * (self->b[1] + delay * self->b[2])) /
           (self->a[0] + delay * (self->a[1] + delay * self->a[2]));
}
