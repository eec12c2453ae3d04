/* SPDX-License-Identifier: MIT */
// The belt gets stiffer the more it is stretched: torque k e (1 + c e^2) for a twist e.
#include "sim/effect.h"
#include "sim/model.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>

static void hardening_bend(const double *p, const struct sim_motion *motion, struct sim_belt *io_belt)
{
    (void)motion;
    io_belt->stiffness *= 1.0 + p[0] * io_belt->twist * io_belt->twist;
}

static bool hardening_applies(const struct sim_model *model)
{
    return model->structure == sim_structure_two_mass;
}

/// Twist to be expected: what the load's share of the torque makes of the belt. At the resonance it is many times that.
static double usual_twist(const struct sim_model *model, const struct sim_coverage *coverage)
{
    double share = model->load_inertia_kgm2 / (model->motor_inertia_kgm2 + model->load_inertia_kgm2);
    return share * coverage->torque_rms / model->belt_stiffness_Nm_per_rad;
}

static bool hardening_scan(const struct sim_model *model, const struct sim_coverage *coverage, size_t index,
                           double *out)
{
    static const double shares[] = {1e-4, 1e-3, 1e-2, 0.1, 0.5};
    if (index >= sizeof shares / sizeof shares[0])
        return false;
    double twist = usual_twist(model, coverage);
    double limit = coverage->linear ? 1e14 : 1e10;
    out[0] = twist > 0.0 ? fmin(shares[index] / (twist * twist), limit) : limit;
    return true;
}

static void hardening_say(const struct sim_finding *f, char *out_text, size_t size)
{
    const double percent = 0.01;
    snprintf(out_text, size,
             "The belt hardens: its stiffness grows with the square of the twist, by %.3g +- %.2g per %s squared (1 %% "
             "at a twist of %.3g %s).",
             f->parameters[0], f->deviations[0], f->linear ? "m" : "rad", sqrt(percent / f->parameters[0]),
             f->linear ? "m" : "rad");
}

const struct sim_effect sim_effect_hardening_stiffness = {
    .id = "hardening_stiffness",
    .place = sim_place_belt,
    .parameter_count = 1,
    .parameters = {{.name = "cubic_ratio_per_rad2",
                    .linear_name = "cubic_ratio_per_m2",
                    .kind = sim_parameter_positive,
                    .minimum = 1e-6,
                    .maximum = 1e10,
                    .linear_minimum = 1e-6,
                    .linear_maximum = 1e14,
                    .model_offset = SIZE_MAX}},
    .proportional = true,
    .size = 0,
    .bend = hardening_bend,
    .applies = hardening_applies,
    .scan = hardening_scan,
    .measure = "the same excitation at half and at twice the level",
    .say = hardening_say,
};
