/* SPDX-License-Identifier: MIT */
// First-order lag between the torque asked for and the torque made: the current loop.
#include "sim/effect.h"
#include "sim/model.h"

#include <math.h>
#include <stdio.h>

extern const struct sim_effect sim_effect_torque_lag;

static bool lag_scan(const struct sim_model *model, const struct sim_coverage *coverage, size_t index, double *out)
{
    static const double steps[] = {0.3, 0.6, 1.0, 1.8, 3.0};
    (void)coverage;
    if (index >= sizeof steps / sizeof steps[0])
        return false;
    double lag_s = model->torque_lag_s > 0.0 ? model->torque_lag_s : 1.0 / model->sample_rate_hz;
    out[0] = fmin(steps[index] * lag_s, sim_effect_torque_lag.parameters[0].maximum);
    return true;
}

static void lag_say(const struct sim_finding *f, char *out_text, size_t size)
{
    snprintf(out_text, size, "Torque follows its command with a lag of %.4g +- %.2g ms; the model has %.4g ms.",
             1e3 * f->parameters[0], 1e3 * f->deviations[0], 1e3 * f->nominal[0]);
}

const struct sim_effect sim_effect_torque_lag = {
    .id = "torque_lag",
    .place = sim_place_actuator,
    .parameter_count = 1,
    .parameters = {{.name = "torque_lag_s",
                    .linear_name = "torque_lag_s",
                    .kind = sim_parameter_positive,
                    .minimum = 1e-7,
                    .maximum = 1.0,
                    .linear_minimum = 1e-7,
                    .linear_maximum = 1.0,
                    .model_offset = offsetof(struct sim_model, torque_lag_s)}},
    .scan = lag_scan,
    .measure = "with lines up to a quarter of the sample rate",
    .say = lag_say,
};
