/* SPDX-License-Identifier: MIT */
// All friction is stronger one way than the other: times (1 + a) for positive speed, (1 - a) for negative.
#include "sim/effect.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>

static void asymmetric_oppose(const double *p, const struct sim_motion *motion, struct sim_opposing *io_opposing)
{
    (void)motion;
    io_opposing->positive_factor *= 1.0 + p[0];
    io_opposing->negative_factor *= 1.0 - p[0];
}

static bool asymmetric_scan(const struct sim_model *model, const struct sim_coverage *coverage, size_t index,
                            double *out)
{
    (void)model;
    (void)coverage;
    out[0] = 0.01;
    return index == 0;
}

static void asymmetric_say(const struct sim_finding *f, char *out_text, size_t size)
{
    snprintf(out_text, size,
             "Friction is %.3g +- %.2g %% stronger for %s motion than the mean of both directions, and as much weaker "
             "the other way.",
             100.0 * fabs(f->parameters[0]), 100.0 * f->deviations[0],
             f->parameters[0] > 0.0 ? "positive" : "negative");
}

const struct sim_effect sim_effect_asymmetric_friction = {
    .id = "asymmetric_friction",
    .place = sim_place_friction_scale,
    .parameter_count = 1,
    .parameters = {{.name = "asymmetry_ratio",
                    .linear_name = "asymmetry_ratio",
                    .kind = sim_parameter_linear,
                    .minimum = -0.95,
                    .maximum = 0.95,
                    .linear_minimum = -0.95,
                    .linear_maximum = 0.95,
                    .model_offset = SIZE_MAX}},
    .steady = true,
    .oppose = asymmetric_oppose,
    .scan = asymmetric_scan,
    .measure = "at constant speeds both ways, and at half the level",
    .say = asymmetric_say,
};
