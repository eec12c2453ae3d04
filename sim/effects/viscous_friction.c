/* SPDX-License-Identifier: MIT */
// Friction in proportion to speed: bearings, grease, belt.
#include "sim/effect.h"
#include "sim/model.h"

#include <stdio.h>

static bool viscous_scan(const struct sim_model *model, const struct sim_coverage *coverage, size_t index, double *out)
{
    if (index > 0)
        return false;
    double trial = 0.02 * coverage->torque_rms / coverage->velocity_rms;
    out[0] = model->viscous_friction_Nms_per_rad > 0.0 ? model->viscous_friction_Nms_per_rad : trial;
    return true;
}

static void viscous_say(const struct sim_finding *f, char *out_text, size_t size)
{
    const char *unit = f->linear ? "N s/m" : "Nm s/rad";
    if (f->nominal[0] > 0.0)
        snprintf(out_text, size, "Friction in proportion to speed is %.4g +- %.2g %s; the model has %.4g %s.",
                 f->parameters[0], f->deviations[0], unit, f->nominal[0], unit);
    else
        snprintf(out_text, size, "There is friction in proportion to speed, %.4g +- %.2g %s; the model has none.",
                 f->parameters[0], f->deviations[0], unit);
}

const struct sim_effect sim_effect_viscous_friction = {
    .id = "viscous_friction",
    .place = sim_place_structure,
    .parameter_count = 1,
    .parameters = {{.name = "viscous_friction_Nms_per_rad",
                    .linear_name = "viscous_friction_Ns_per_m",
                    .kind = sim_parameter_linear,
                    .minimum = 0.0,
                    .maximum = 1e6,
                    .linear_minimum = 0.0,
                    .linear_maximum = 1e9,
                    .model_offset = offsetof(struct sim_model, viscous_friction_Nms_per_rad)}},
    .scan = viscous_scan,
    .measure = "at constant speeds, several of them both ways",
    .say = viscous_say,
};
