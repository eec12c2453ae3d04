/* SPDX-License-Identifier: MIT */
// Dry friction that is higher at low speed: Fs exp(-(v/vs)^2) on top of Coulomb's.
#include "sim/effect.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>

static void stribeck_oppose(const double *p, const struct sim_motion *motion, struct sim_opposing *io_opposing)
{
    double ratio = motion->velocity / p[1];
    io_opposing->dry += p[0] * exp(-ratio * ratio);
}

/// Speeds between which a recording can show a rise towards standstill: it has to have moved that slowly for a few
/// samples, however small a part they are of all, and faster than that somewhere.
static void stribeck_range(const struct sim_coverage *coverage, double *out_low, double *out_high)
{
    const double standing = 0.002; // of the RMS: an axis at rest does not move slowly
    *out_low = fmax(coverage->velocity_slow, standing * coverage->velocity_rms);
    *out_high = coverage->velocity_peak;
}

static bool stribeck_scan(const struct sim_model *model, const struct sim_coverage *coverage, size_t index, double *out)
{
    const double growth = 2.5, first = 2.0;
    double low, high;
    (void)model;
    stribeck_range(coverage, &low, &high);
    out[0] = 0.02 * coverage->torque_rms;
    out[1] = first * low * pow(growth, (double)index);
    return index == 0 || (index < 10 && out[1] < high);
}

static bool stribeck_testable(const double *p, const struct sim_coverage *coverage, char *out_why, size_t size)
{
    double low, high;
    stribeck_range(coverage, &low, &high);
    bool shown = p[1] > low && p[1] < high;
    if (!shown)
        snprintf(out_why, size, "its speed %.3g is outside of %.3g..%.3g, where this motion could show it", p[1], low,
                 high);
    return shown;
}

static void stribeck_say(const struct sim_finding *f, char *out_text, size_t size)
{
    snprintf(
        out_text, size,
        "Dry friction rises by %.4g +- %.2g %s towards standstill, within about %.3g +- %.2g %s (Stribeck effect).",
        f->parameters[0], f->deviations[0], f->linear ? "N" : "Nm", f->parameters[1], f->deviations[1],
        f->linear ? "m/s" : "rad/s");
}

const struct sim_effect sim_effect_stribeck_friction = {
    .id = "stribeck_friction",
    .place = sim_place_friction,
    .parameter_count = 2,
    .parameters = {{.name = "stribeck_excess_Nm",
                    .linear_name = "stribeck_excess_N",
                    .kind = sim_parameter_linear,
                    .minimum = 0.0,
                    .maximum = 1e6,
                    .linear_minimum = 0.0,
                    .linear_maximum = 1e9,
                    .model_offset = SIZE_MAX},
                   {.name = "stribeck_velocity_rad_per_s",
                    .linear_name = "stribeck_velocity_m_per_s",
                    .kind = sim_parameter_positive,
                    .minimum = 1e-6,
                    .maximum = 1e4,
                    .linear_minimum = 1e-9,
                    .linear_maximum = 1e3,
                    .model_offset = SIZE_MAX}},
    .oppose = stribeck_oppose,
    .scan = stribeck_scan,
    .testable = stribeck_testable,
    .measure = "at slow constant speeds down to creeping",
    .say = stribeck_say,
};
