/* SPDX-License-Identifier: MIT */
#include "sim/effect.h"
#include "sim/plant.h"

#include <assert.h>
#include <string.h>

void sim_actuator_init(struct sim_actuator *self)
{
    memset(self, 0, sizeof *self);
}

void sim_actuator_hold(struct sim_actuator *self, double torque_ref)
{
    self->newest = (self->newest + 1) % sim_actuator_history;
    self->held[self->newest] = torque_ref;
}

static double held_ago(const struct sim_actuator *self, size_t samples)
{
    assert(samples < sim_actuator_history);
    return self->held[(self->newest + sim_actuator_history - samples) % sim_actuator_history];
}

static double limited(const struct sim_stepper *stepper, double torque)
{
    for (size_t i = 0; i < stepper->limit.count; i++) {
        size_t e = stepper->limit.effects[i];
        torque = sim_effects[e]->limit(stepper->model.effect_parameters[e], torque);
    }
    return torque;
}

double sim_actuator_now(const struct sim_actuator *self, const struct sim_stepper *stepper)
{
    return limited(stepper, stepper->lag_samples > 0.0 ? self->torque : held_ago(self, stepper->now_ago));
}

/// Adds a part to the integrals of the torque, of (end - t) of it and of (end - t)^2 / 2 of it. The limit acts on the
/// mean: exact but where the lag crosses it within one.
static void add_part(struct sim_actuator *self, const struct sim_stepper *stepper, const struct sim_actuator_part *part,
                     double io_integrals[3])
{
    double input = held_ago(self, part->ago), to_go = self->torque - input, span = part->samples;
    double mean = input + to_go * part->fading[0] / span, made = limited(stepper, mean);
    bool fades = made == mean;
    self->torque -= to_go * part->approach;
    double level = fades ? input : made, fading = fades ? to_go : 0.0;
    double half_square = 0.5 * span * span;
    io_integrals[2] += span * io_integrals[1] + half_square * io_integrals[0] + level * half_square * span / 3.0 +
                       fading * part->fading[2];
    io_integrals[1] += span * io_integrals[0] + level * half_square + fading * part->fading[1];
    io_integrals[0] += level * span + fading * part->fading[0];
}

double sim_actuator_substep(struct sim_actuator *self, const struct sim_stepper *stepper, size_t index)
{
    const double n = sim_substeps;
    double integrals[3] = {0.0};
    for (size_t i = 0; i < stepper->part_count[index]; i++)
        add_part(self, stepper, &stepper->parts[index][i], integrals);
    double mean = n * integrals[0], before = n * n * n * integrals[2] - mean / 6.0;
    self->last = (struct sim_torque){mean, before, n * n * integrals[1] - 0.5 * mean - before};
    return mean;
}
