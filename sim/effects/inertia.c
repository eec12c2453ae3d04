/* SPDX-License-Identifier: MIT */
// The load differs from the model: J dv/dt takes more or less torque, growing with the square of frequency for a
// motion.
#include "sim/effect.h"
#include "sim/model.h"

#include <stdio.h>

static bool inertia_scan(const struct sim_model *model, const struct sim_coverage *coverage, size_t index, double *out)
{
    static const double factors[] = {1.0, 0.6, 1.6, 3.0};
    (void)coverage;
    if (index >= sizeof factors / sizeof factors[0])
        return false;
    // A load may be missing in the given model altogether: start from a share of the motor's inertia then.
    double load = model->load_inertia_kgm2;
    out[0] = load > 0.0 ? load * factors[index] : model->motor_inertia_kgm2 * 0.1 * factors[index];
    return true;
}

static void inertia_say(const struct sim_finding *f, char *out_text, size_t size)
{
    const char *unit = f->linear ? "kg" : "kg m2";
    snprintf(out_text, size, "%s is %s than the model says: %.4g +- %.2g %s instead of %.4g %s.",
             f->linear ? "The moved mass" : "The load's inertia",
             f->parameters[0] > f->nominal[0] ? "larger" : "smaller", f->parameters[0], f->deviations[0], unit,
             f->nominal[0], unit);
}

const struct sim_effect sim_effect_inertia = {
    .id = "inertia",
    .place = sim_place_structure,
    .parameter_count = 1,
    .parameters = {{.name = "load_inertia_kgm2",
                    .linear_name = "mass_kg",
                    .kind = sim_parameter_linear,
                    .minimum = 0.0,
                    .maximum = 1e6,
                    .linear_minimum = 0.0,
                    .linear_maximum = 1e7,
                    .model_offset = offsetof(struct sim_model, load_inertia_kgm2)}},
    .scan = inertia_scan,
    .measure = "at a higher level of high-frequency torque, where friction matters less",
    .say = inertia_say,
};
