/* SPDX-License-Identifier: MIT */
// Motor and load are two masses on an elastic belt: antiresonance at sqrt(k/J2), resonance at sqrt(k (1/J1 + 1/J2)).
#include "sim/effect.h"
#include "sim/model.h"

#include <math.h>
#include <stdio.h>

static const double turn = 6.283185307179586;

static double series_inertia(const struct sim_model *model)
{
    return model->motor_inertia_kgm2 * model->load_inertia_kgm2 /
           (model->motor_inertia_kgm2 + model->load_inertia_kgm2);
}

/// A rigid model may know only the sum of both inertias: halves are the start of the search then.
static void elasticity_engage(struct sim_model *model)
{
    double total = model->motor_inertia_kgm2 + model->load_inertia_kgm2;
    if (!(model->motor_inertia_kgm2 > 0.0) || !(model->load_inertia_kgm2 > 0.0)) {
        model->motor_inertia_kgm2 = total / 2;
        model->load_inertia_kgm2 = total / 2;
    }
    model->structure = sim_structure_two_mass;
}

/// Resonances from an eighth of the highest line up to four times it; beyond, the belt is rigid to this recording.
static bool elasticity_scan(const struct sim_model *model, const struct sim_coverage *coverage, size_t index,
                            double *out)
{
    const double first = 0.125, last = 4.0, growth = 1.12, damping_ratio = 0.03;
    double share = first * pow(growth, (double)index);
    if (index >= sim_effect_scan_max || share > last)
        return false;
    struct sim_model engaged = *model;
    elasticity_engage(&engaged);
    double inertia = series_inertia(&engaged);
    double rate = turn * coverage->frequency_max_hz * share;
    if (index == 0 && model->structure == sim_structure_two_mass)
        rate = sqrt(model->belt_stiffness_Nm_per_rad / inertia); // the given one first
    out[0] = rate * rate * inertia;
    out[1] = 2.0 * damping_ratio * rate * inertia;
    return true;
}

static void elasticity_say(const struct sim_finding *f, char *out_text, size_t size)
{
    const char *unit = f->linear ? "N/m" : "Nm/rad";
    if (f->nominal[0] > 0.0)
        snprintf(out_text, size, "The belt's stiffness is %.4g +- %.2g %s; the model has %.4g %s.", f->parameters[0],
                 f->deviations[0], unit, f->nominal[0], unit);
    else
        snprintf(out_text, size, "Motor and load are two masses on a belt of %.4g +- %.2g %s; the model is rigid.",
                 f->parameters[0], f->deviations[0], unit);
}

const struct sim_effect sim_effect_belt_elasticity = {
    .id = "belt_elasticity",
    .place = sim_place_structure,
    .parameter_count = 2,
    .parameters = {{.name = "belt_stiffness_Nm_per_rad",
                    .linear_name = "belt_stiffness_N_per_m",
                    .kind = sim_parameter_positive,
                    .minimum = 1e-6,
                    .maximum = 1e9,
                    .linear_minimum = 1e-3,
                    .linear_maximum = 1e12,
                    .model_offset = offsetof(struct sim_model, belt_stiffness_Nm_per_rad)},
                   {.name = "belt_damping_Nms_per_rad",
                    .linear_name = "belt_damping_Ns_per_m",
                    .kind = sim_parameter_positive,
                    .minimum = 1e-12,
                    .maximum = 1e6,
                    .linear_minimum = 1e-9,
                    .linear_maximum = 1e9,
                    .model_offset = offsetof(struct sim_model, belt_damping_Nms_per_rad)}},
    .engage = elasticity_engage,
    .scan = elasticity_scan,
    .measure = "with lines up to twice the suspected resonance",
    .say = elasticity_say,
};
