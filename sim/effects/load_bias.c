/* SPDX-License-Identifier: MIT */
// A constant torque on the motor: gravity, a cable, a spring over a short travel. Positive opposes positive motion.
#include "sim/effect.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>

static void bias_oppose(const double *p, const struct sim_motion *motion, struct sim_opposing *io_opposing)
{
    (void)motion;
    io_opposing->smooth += p[0];
}

static bool bias_scan(const struct sim_model *model, const struct sim_coverage *coverage, size_t index, double *out)
{
    (void)model;
    out[0] = 0.01 * coverage->torque_rms;
    return index == 0;
}

static void bias_say(const struct sim_finding *f, char *out_text, size_t size)
{
    snprintf(out_text, size, "A constant load of %.4g +- %.2g %s acts against %s motion.", fabs(f->parameters[0]),
             f->deviations[0], f->linear ? "N" : "Nm", f->parameters[0] > 0.0 ? "positive" : "negative");
}

const struct sim_effect sim_effect_load_bias = {
    .id = "load_bias",
    .place = sim_place_motor,
    .parameter_count = 1,
    .parameters = {{.name = "bias_Nm",
                    .linear_name = "bias_N",
                    .kind = sim_parameter_linear,
                    .minimum = -1e6,
                    .maximum = 1e6,
                    .linear_minimum = -1e9,
                    .linear_maximum = 1e9,
                    .model_offset = SIZE_MAX}},
    .steady = true,
    .oppose = bias_oppose,
    .scan = bias_scan,
    .measure = "the torque that holds the axis still when approached from both sides, and at half the level",
    .say = bias_say,
};
