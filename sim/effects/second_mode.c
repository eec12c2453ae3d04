/* SPDX-License-Identifier: MIT */
// A third mass swings on a spring of its own on the load: a tool, a cable carrier, the machine's frame. Seen from the
// motor: spring J3 (2 pi f)^2, damper 2 zeta J3 2 pi f.
#include "sim/effect.h"
#include "sim/model.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>

static const double turn = 6.283185307179586;

static void mode_attach(const double *p, struct sim_attached_mass *out_mass)
{
    double rate = turn * p[0];
    *out_mass = (struct sim_attached_mass){
        .inertia = p[1], .stiffness = p[1] * rate * rate, .damping = 2.0 * p[2] * rate * p[1]};
}

/// Frequencies from a sixteenth of the highest line to half above it, each felt as far as the next, with a mass so
/// small that what it does is proportional to it.
static bool mode_scan(const struct sim_model *model, const struct sim_coverage *coverage, size_t index, double *out)
{
    const double first = 0.06, last = 1.5, growth = 1.08, share = 0.002, damping_ratio = 0.04;
    out[0] = coverage->frequency_max_hz * first * pow(growth, (double)index);
    out[1] = share * (model->motor_inertia_kgm2 + model->load_inertia_kgm2);
    out[2] = damping_ratio;
    return index < sim_effect_scan_max && out[0] < last * coverage->frequency_max_hz;
}

static bool mode_testable(const double *p, const struct sim_coverage *coverage, char *out_why, size_t size)
{
    const double beyond = 1.5, fewest = 3.0;
    double low = fewest / coverage->duration_s, high = beyond * coverage->frequency_max_hz;
    if (p[0] >= low && p[0] <= high)
        return true;
    snprintf(out_why, size, "its frequency %.3g Hz is outside of %.2g..%.3g Hz, which was excited", p[0], low, high);
    return false;
}

static void mode_say(const struct sim_finding *f, char *out_text, size_t size)
{
    snprintf(
        out_text, size,
        "A further mass of %.3g +- %.2g %s swings on the load at %.4g +- %.2g Hz (second mode, damping ratio %.2g).",
        f->parameters[1], f->deviations[1], f->linear ? "kg" : "kg m2", f->parameters[0], f->deviations[0],
        f->parameters[2]);
}

const struct sim_effect sim_effect_second_mode = {
    .id = "second_mode",
    .place = sim_place_load,
    .parameter_count = 3,
    .parameters = {{.name = "mode_frequency_hz",
                    .linear_name = "mode_frequency_hz",
                    .kind = sim_parameter_positive,
                    .minimum = 1e-3,
                    .maximum = 1e5,
                    .linear_minimum = 1e-3,
                    .linear_maximum = 1e5,
                    .model_offset = SIZE_MAX},
                   {.name = "mode_inertia_kgm2",
                    .linear_name = "mode_mass_kg",
                    .kind = sim_parameter_positive,
                    .minimum = 1e-12,
                    .maximum = 1e6,
                    .linear_minimum = 1e-6,
                    .linear_maximum = 1e7,
                    .model_offset = SIZE_MAX},
                   {.name = "mode_damping_ratio",
                    .linear_name = "mode_damping_ratio",
                    .kind = sim_parameter_positive,
                    .minimum = 1e-5,
                    .maximum = 2.0,
                    .linear_minimum = 1e-5,
                    .linear_maximum = 2.0,
                    .optional = true,
                    .usual = 0.02,
                    .model_offset = SIZE_MAX}},
    .proportional = true,
    .size = 1,
    .attach = mode_attach,
    .scan = mode_scan,
    .testable = mode_testable,
    .measure = "with lines close together around the suspected frequency",
    .say = mode_say,
};
