/* SPDX-License-Identifier: MIT */
#include "lab/tune/reference.h"

#include <math.h>

static const double two_pi = 6.283185307179586;

double complex tune_reference_at(const struct tune_reference *self, double frequency_hz)
{
    // M/s = 1/s - s/(s^2 + 2 d w s + w^2), so M's step response is 1 - exp(-d w t)(cos v t - d w/v sin v t) with
    // v = w sqrt(1 - d^2), imaginary for d > 1; what follows is (1 - q) times the transform of its samples.
    const double Ts = 1.0 / self->rate_hz, w = two_pi * self->bandwidth_hz, d = self->damping;
    const double complex v = w * csqrt(1.0 - d * d);
    const double complex sine_over_v = cabs(v) * Ts > 1e-6 ? csin(v * Ts) / v : Ts;
    const double r = exp(-d * w * Ts), c = creal(ccos(v * Ts));
    const double complex q = cexp(-I * two_pi * frequency_hz * Ts);
    const double complex remainder =
        (1.0 - r * (c + d * w * creal(sine_over_v)) * q) / (1.0 - 2.0 * r * c * q + r * r * q * q);
    return (1.0 - (1.0 - q) * remainder) * cexp(-I * two_pi * frequency_hz * Ts * self->delay_samples);
}

double tune_reference_cutoff_hz(const struct tune_reference *self)
{
    const double half_power = sqrt(0.5), step = 1.01;
    double low = 1e-3 * self->bandwidth_hz, high = low;
    while (cabs(tune_reference_at(self, high)) >= half_power) {
        low = high;
        high *= step;
        if (!(high < 0.5 * self->rate_hz)) {
            return NAN;
        }
    }
    for (int halving = 0; halving < 60; halving++) {
        const double middle = 0.5 * (low + high);
        if (cabs(tune_reference_at(self, middle)) >= half_power) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return 0.5 * (low + high);
}
