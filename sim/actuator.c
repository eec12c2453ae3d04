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

double sim_actuator_substep(struct sim_actuator *self, const struct sim_stepper *stepper, size_t index)
{
    double sum = 0.0;
    for (size_t i = 0; i < stepper->part_count[index]; i++) {
        const struct sim_actuator_part *part = &stepper->parts[index][i];
        double input = held_ago(self, part->ago);
        double change = (self->torque - input) * part->approach;
        self->torque -= change;
        double integral = input * part->samples + (stepper->lag_samples > 0.0 ? change * stepper->lag_samples : 0.0);
        // The limit acts on the mean of a part: exact but where the lag crosses it within one.
        sum += stepper->limit.count > 0 ? limited(stepper, integral / part->samples) * part->samples : integral;
    }
    return sim_substeps * sum;
}
