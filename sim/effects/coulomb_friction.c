/* SPDX-License-Identifier: MIT */
// Dry friction: constant against the motion, and holding at rest whatever is smaller.
#include "sim/effect.h"
#include "sim/model.h"

#include <stdio.h>

static bool coulomb_scan(const struct sim_model *model, const struct sim_coverage *coverage, size_t index, double *out)
{
    if (index > 0)
        return false;
    out[0] = model->coulomb_friction_Nm > 0.0 ? model->coulomb_friction_Nm : 0.02 * coverage->torque_rms;
    return true;
}

static void coulomb_say(const struct sim_finding *f, char *out_text, size_t size)
{
    const char *unit = f->linear ? "N" : "Nm";
    if (f->nominal[0] > 0.0)
        snprintf(out_text, size, "Dry (Coulomb) friction is %.4g +- %.2g %s; the model has %.4g %s.", f->parameters[0],
                 f->deviations[0], unit, f->nominal[0], unit);
    else
        snprintf(out_text, size, "There is dry (Coulomb) friction of %.4g +- %.2g %s; the model has none.",
                 f->parameters[0], f->deviations[0], unit);
}

const struct sim_effect sim_effect_coulomb_friction = {
    .id = "coulomb_friction",
    .place = sim_place_structure,
    .parameter_count = 1,
    .parameters = {{.name = "coulomb_friction_Nm",
                    .linear_name = "coulomb_friction_N",
                    .kind = sim_parameter_linear,
                    .minimum = 0.0,
                    .maximum = 1e6,
                    .linear_minimum = 0.0,
                    .linear_maximum = 1e9,
                    .model_offset = offsetof(struct sim_model, coulomb_friction_Nm)}},
    .scan = coulomb_scan,
    .measure = "at constant speeds, several of them both ways",
    .say = coulomb_say,
};
