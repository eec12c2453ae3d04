/* SPDX-License-Identifier: MIT */
// Delay between the torque asked for and the torque made, whole and fractional samples: bus and controller cycles.
#include "sim/effect.h"
#include "sim/model.h"

#include <math.h>
#include <stdio.h>

extern const struct sim_effect sim_effect_dead_time;

static bool delay_scan(const struct sim_model *model, const struct sim_coverage *coverage, size_t index, double *out)
{
    // The first: where a lag makes up for most of a delay, what remains of it is a small part of a sample.
    static const double samples[] = {0.06, 0.3, 0.7, 1.2, 1.8, 2.6, 3.6};
    const size_t count = sizeof samples / sizeof samples[0];
    // Among them, in order, what the model has already: it may be off by little, and across the instants at which a
    // delayed torque changes within a sample no step leads back to it.
    double given = model->dead_time_s * model->sample_rate_hz;
    size_t below = 0, more = given > 0.0;
    while (below < count && samples[below] < given)
        below++;
    (void)coverage;
    if (index >= count + more)
        return false;
    double delay = more && index == below ? given : samples[index - (more && index > below)];
    out[0] = fmin(delay / model->sample_rate_hz, sim_effect_dead_time.parameters[0].maximum);
    return true;
}

/// A column that was read just before the command of its row began to act has a delay of nearly nothing.
static void delay_say(const struct sim_finding *f, char *out_text, size_t size)
{
    const double nothing_s = 1e-6;
    if (f->parameters[0] < nothing_s) {
        snprintf(out_text, size,
                 "Torque comes less than %.0e s after its command (dead time), but in a row it is that of the command "
                 "before; the model has %.4g ms.",
                 nothing_s, 1e3 * f->nominal[0]);
        return;
    }
    snprintf(out_text, size, "Torque comes %.4g +- %.2g ms after its command (dead time); the model has %.4g ms.",
             1e3 * f->parameters[0], 1e3 * f->deviations[0], 1e3 * f->nominal[0]);
}

const struct sim_effect sim_effect_dead_time = {
    .id = "dead_time",
    .place = sim_place_actuator,
    .parameter_count = 1,
    .parameters = {{.name = "dead_time_s",
                    .linear_name = "dead_time_s",
                    .kind = sim_parameter_linear,
                    .minimum = 0.0,
                    .maximum = 0.05,
                    .linear_minimum = 0.0,
                    .linear_maximum = 0.05,
                    .model_offset = offsetof(struct sim_model, dead_time_s)}},
    .scan = delay_scan,
    .measure = "with lines up to a quarter of the sample rate",
    .say = delay_say,
};
