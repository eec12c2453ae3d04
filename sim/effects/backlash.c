/* SPDX-License-Identifier: MIT */
// Motor and load are loose against each other within a gap: no torque, of spring or damper, while the twist is within
// plus or minus half of it; outside the twist counts from there.
#include "sim/effect.h"
#include "sim/model.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>

static void gap_bend(const double *p, const struct sim_motion *motion, struct sim_belt *io_belt)
{
    double half = 0.5 * p[0];
    (void)motion;
    if (fabs(io_belt->twist) <= half) {
        io_belt->twist = 0.0;
        io_belt->twist_rate = 0.0;
    } else {
        io_belt->twist -= copysign(half, io_belt->twist);
    }
}

static bool gap_applies(const struct sim_model *model)
{
    return model->structure == sim_structure_two_mass;
}

/// Gaps around the twist that the load's share of the torque makes.
static bool gap_scan(const struct sim_model *model, const struct sim_coverage *coverage, size_t index, double *out)
{
    static const double shares[] = {0.03, 0.1, 0.3, 1.0, 3.0};
    if (index >= sizeof shares / sizeof shares[0])
        return false;
    double share = model->load_inertia_kgm2 / (model->motor_inertia_kgm2 + model->load_inertia_kgm2);
    double twist = model->belt_stiffness_Nm_per_rad > 0.0
                       ? share * coverage->torque_rms / model->belt_stiffness_Nm_per_rad
                       : 1e-3 * coverage->position_span;
    double smallest = coverage->linear ? 1e-9 : 1e-7;
    out[0] = fmin(fmax(shares[index] * twist, smallest), 1.0);
    return true;
}

/// The load has to cross the gap: with less travel than the gap it may lie on one side all the time.
static bool gap_testable(const double *p, const struct sim_coverage *coverage, char *out_why, size_t size)
{
    if (p[0] < 0.5 * coverage->position_span)
        return true;
    snprintf(out_why, size, "its gap of %.3g %s is not less than half of the travel, %.3g", p[0],
             coverage->linear ? "m" : "rad", coverage->position_span);
    return false;
}

static void gap_say(const struct sim_finding *f, char *out_text, size_t size)
{
    snprintf(out_text, size, "Motor and load are loose against each other by %.3g +- %.2g %s (backlash).",
             f->parameters[0], f->deviations[0], f->linear ? "m" : "rad");
}

const struct sim_effect sim_effect_backlash = {
    .id = "backlash",
    .place = sim_place_belt,
    .parameter_count = 1,
    .parameters = {{.name = "gap_rad",
                    .linear_name = "gap_m",
                    .kind = sim_parameter_positive,
                    .minimum = 1e-7,
                    .maximum = 1.0,
                    .linear_minimum = 1e-9,
                    .linear_maximum = 1.0,
                    .model_offset = SIZE_MAX}},
    .bend = gap_bend,
    .applies = gap_applies,
    .scan = gap_scan,
    .testable = gap_testable,
    .measure = "at a small level around standstill, and again with a constant load on one side",
    .say = gap_say,
};
