/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/gain_tie.h"

#include <stdio.h>
#include <string.h>

/// `next` says how to tell the two apart.
static void add(struct diagnosis *d, size_t model_offset, const char *next)
{
    for (int e = 0; sim_effects[e] && d->tie_count < diagnosis_ties_max; e++) {
        if (sim_effects[e]->parameters[0].model_offset != model_offset || sim_effects[e]->parameter_count != 1)
            continue;
        struct diagnosis_tie *tie = &d->ties[d->tie_count++];
        tie->effects[0] = e;
        tie->effects[1] = diagnosis_gain;
        snprintf(tie->next, sizeof tie->next, "%s", next);
    }
}

void gain_tie_list(struct diagnosis *io_diagnosis)
{
    struct diagnosis *d = io_diagnosis;
    if (!d->input_unit)
        return;
    add(d, offsetof(struct sim_model, load_inertia_kgm2),
        "weigh the load, or measure the torque that a known current makes, and give it with --map");
    if (strcmp(d->input_unit, "V") == 0)
        add(d, offsetof(struct sim_model, viscous_friction_Nms_per_rad),
            "record the current as well: what the motor's own voltage takes at speed looks like viscous "
            "friction");
    if (d->model_given)
        oddities_add(&d->oddities,
                     "The input is in %s; 1 %s makes %.4g +- %.2g %s, if the model's inertia is right. All torques and "
                     "frictions are wrong by as much as that is.",
                     d->input_unit, d->input_unit, d->input_gain, d->input_gain_deviation, d->linear ? "N" : "Nm");
}
