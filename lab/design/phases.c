/* SPDX-License-Identifier: MIT */
#include "lab/design/phases.h"

#include "sim/random.h"

#include <math.h>

static const double pi = 3.14159265358979323846;

static void set_phase(double *c, size_t line, double phase_rad)
{
    c[2 * line] = cos(phase_rad);
    c[2 * line + 1] = sin(phase_rad);
}

void design_phases_newman(size_t line_count, double *out_c)
{
    for (size_t k = 0; k < line_count; k++) {
        // k^2 is exact. Where two limits compete, modified clipping is chaotic: at one of the first paper's 24 points
        // the last digits of these phases move its result by 2 %, and one rounding less keeps it where others find it.
        set_phase(out_c, k, pi * (double)(k * k) / (double)line_count);
    }
}

void design_phases_schroeder(const struct design_spectrum *spectrum, double *out_c)
{
    double total = design_spectrum_rms(spectrum, design_acceleration);
    total *= 2 * total;
    double share_below = 0;
    double phase_rad = 0;
    for (size_t k = 0; k < spectrum->line_count; k++) {
        set_phase(out_c, k, phase_rad);
        double amplitude = design_spectrum_amplitude(spectrum, design_acceleration, k);
        share_below += amplitude * amplitude / total;
        // Lines need not be neighbours: the delay acts over the distance to the next one, counted in lines as
        // published.
        phase_rad = fmod(phase_rad - 2 * pi * share_below, 2 * pi);
    }
}

void design_phases_random(size_t line_count, uint64_t seed, double *out_c)
{
    uint64_t state[4];
    sim_random_seed(state, seed);
    for (size_t k = 0; k < line_count; k++) {
        set_phase(out_c, k, 2 * pi * sim_random_uniform(state));
    }
}
