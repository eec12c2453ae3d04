/* SPDX-License-Identifier: MIT */
#include "lab/design/spectrum.h"

#include <math.h>
#include <stdlib.h>

static const double two_pi = 6.283185307179586;

static double limit_or_infinity(double limit)
{
    return limit > 0 ? limit : INFINITY;
}

bool design_spectrum_create(const struct design_request *request, struct design_spectrum *out_spectrum)
{
    struct design_spectrum spectrum = {.line_count = request->bin_count, .bins = request->bins};
    const struct design_limits *limits = &request->limits;
    spectrum.limit[design_position] = limit_or_infinity(limits->position_rad);
    spectrum.limit[design_velocity] = limit_or_infinity(limits->velocity_rad_per_s);
    spectrum.limit[design_acceleration] = fmin(limit_or_infinity(limits->acceleration_rad_per_s2),
                                               limit_or_infinity(limits->torque_Nm) / request->inertia_kgm2);
    spectrum.omega_rad_per_s = calloc(request->bin_count, sizeof(double));
    spectrum.amplitude_rad = calloc(request->bin_count, sizeof(double));
    if (!spectrum.omega_rad_per_s || !spectrum.amplitude_rad) {
        design_spectrum_free(&spectrum);
        return false;
    }
    double line_hz = (double)request->rate_num_hz / request->rate_den / (double)request->period_samples;
    for (size_t k = 0; k < request->bin_count; k++) {
        double omega = two_pi * line_hz * request->bins[k];
        spectrum.omega_rad_per_s[k] = omega;
        spectrum.amplitude_rad[k] =
            request->torque_shape
                ? request->torque_shape[k] / (request->inertia_kgm2 * omega * omega)
                : fmin(spectrum.limit[design_position], fmin(spectrum.limit[design_velocity] / omega,
                                                             spectrum.limit[design_acceleration] / (omega * omega)));
    }
    *out_spectrum = spectrum;
    return true;
}

void design_spectrum_free(struct design_spectrum *spectrum)
{
    free(spectrum->omega_rad_per_s);
    free(spectrum->amplitude_rad);
    spectrum->omega_rad_per_s = NULL;
    spectrum->amplitude_rad = NULL;
}

double design_spectrum_amplitude(const struct design_spectrum *self, enum design_signal signal, size_t line)
{
    double amplitude = self->amplitude_rad[line];
    for (int order = 0; order < (int)signal; order++) {
        amplitude *= self->omega_rad_per_s[line];
    }
    return amplitude;
}

double design_spectrum_rms(const struct design_spectrum *self, enum design_signal signal)
{
    double sum = 0;
    for (size_t k = 0; k < self->line_count; k++) {
        double amplitude = design_spectrum_amplitude(self, signal, k);
        sum += amplitude * amplitude;
    }
    return sqrt(sum / 2);
}

double design_spectrum_scale_bound(const struct design_spectrum *self, size_t points_per_period)
{
    const double highest = self->omega_rad_per_s[self->line_count - 1];
    const uint32_t highest_bin = self->bins[self->line_count - 1];
    double weakening = points_per_period > 0 ? cos(two_pi / 2 * highest_bin / (double)points_per_period) : 1;
    double least_peak = 0;
    for (int signal = 0; signal < design_signal_count; signal++) {
        if (!isfinite(self->limit[signal])) {
            continue;
        }
        double sum = 0;
        for (size_t k = 0; k < self->line_count; k++) {
            double amplitude = design_spectrum_amplitude(self, (enum design_signal)signal, k);
            double ratio = self->omega_rad_per_s[k] / highest;
            sum += amplitude * amplitude / 2 * (1 + ratio * ratio);
        }
        double rms = design_spectrum_rms(self, (enum design_signal)signal);
        least_peak = fmax(least_peak, fmax(sqrt(sum) * weakening, rms) / self->limit[signal]);
    }
    return 1 / least_peak;
}
