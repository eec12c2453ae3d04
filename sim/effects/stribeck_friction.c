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

static bool stribeck_scan(const struct sim_model *model, const struct sim_coverage *coverage, size_t index, double *out)
{
    static const double shares[] = {0.03, 0.07, 0.15, 0.3, 0.6};
    (void)model;
    if (index >= sizeof shares / sizeof shares[0])
        return false;
    out[0] = 0.02 * coverage->torque_rms;
    out[1] = shares[index] * coverage->velocity_rms;
    return true;
}

/// Slow enough to be friction at low speed, fast enough for the recording to have moved that slowly for a while.
static bool stribeck_testable(const double *p, const struct sim_coverage *coverage, char *out_why, size_t size)
{
    double low = 0.02 * coverage->velocity_rms, high = 1.2 * coverage->velocity_rms;
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
