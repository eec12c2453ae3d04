/* SPDX-License-Identifier: MIT */
#include "sim/stepper.h"

#include "sim/effect.h"
#include "sim/transition.h"

#include <math.h>
#include <string.h>

static void hook_up(struct sim_hooked *self, size_t effect)
{
    self->effects[self->count++] = effect;
}

static void prepare_effect(struct sim_stepper *self, size_t e)
{
    const struct sim_effect *effect = sim_effects[e];
    const double *parameters = self->model.effect_parameters[e];
    if (effect->oppose && effect->steady)
        effect->oppose(parameters, &(struct sim_motion){.linear = self->model.linear}, &self->steady);
    else if (effect->oppose)
        hook_up(&self->oppose, e);
    if (effect->build_up)
        self->build_up = effect->build_up(parameters, &self->build_up_exponent, &self->build_up_damping_s);
    if (effect->bend && self->model.structure == sim_structure_two_mass)
        hook_up(&self->bend, e);
    if (effect->limit)
        hook_up(&self->limit, e);
    if (effect->sense)
        hook_up(&self->sense, e);
    if (effect->lose)
        hook_up(&self->lose, e);
    struct sim_chain *chain = &self->chain;
    bool room = chain->masses == (self->model.structure == sim_structure_two_mass ? 2 : 1);
    if (effect->attach && room) {
        struct sim_attached_mass mass;
        effect->attach(parameters, &mass);
        chain->inertia[chain->masses] = mass.inertia;
        chain->stiffness[chain->masses - 1] = mass.stiffness;
        chain->damping[chain->masses - 1] = mass.damping;
        chain->masses++;
    }
}

static void prepare_chain(struct sim_stepper *self)
{
    const struct sim_model *m = &self->model;
    bool two = m->structure == sim_structure_two_mass;
    self->chain = (struct sim_chain){
        .masses = two ? 2 : 1,
        .inertia = {two ? m->motor_inertia_kgm2 : m->motor_inertia_kgm2 + m->load_inertia_kgm2, m->load_inertia_kgm2},
        .stiffness = {m->belt_stiffness_Nm_per_rad},
        .damping = {m->belt_damping_Nms_per_rad},
    };
}

/// Sum over the links: no mode is faster than all of them on the masses at their ends.
static double chain_rate(const struct sim_chain *chain)
{
    double square = 0.0, damping = 0.0;
    for (size_t i = 0; i + 1 < chain->masses; i++) {
        double mobility = 1.0 / chain->inertia[i] + 1.0 / chain->inertia[i + 1];
        square += chain->stiffness[i] * mobility;
        damping += chain->damping[i] * mobility;
    }
    return sqrt(square) + damping;
}

size_t sim_stepper_inner_steps(double rate, double dt_s)
{
    const double longest = 0.25, most = 400.0;
    return (size_t)fmin(fmax(ceil(rate * dt_s / longest), 1.0), most);
}

/// Where substeps meet the changes of a delayed reference. A held value begins at every whole number of samples, so a
/// substep meets at most one change, and both parts of it are exact.
static void prepare_actuator(struct sim_stepper *self)
{
    const struct sim_model *m = &self->model;
    const double rounding = 1e-9; // a dead time of whole samples must not be counted as one more
    double delay = m->dead_time_s * m->sample_rate_hz;
    self->lag_samples = fmax(m->torque_lag_s * m->sample_rate_hz, 0.0);
    self->now_ago = (size_t)ceil(fmax(delay - rounding, 0.0));
    for (size_t i = 0; i < sim_substeps; i++) {
        double from = (double)i / sim_substeps - delay, to = (double)(i + 1) / sim_substeps - delay;
        double change = ceil(from);
        bool split = change > from && change < to;
        struct sim_actuator_part *part = self->parts[i];
        part[0] = (struct sim_actuator_part){.ago = (size_t)-floor(from), .samples = (split ? change : to) - from};
        part[1] = (struct sim_actuator_part){.ago = (size_t)fmax(-change, 0.0), .samples = to - change};
        self->part_count[i] = split ? 2 : 1;
        for (size_t j = 0; j < self->part_count[i]; j++) {
            double lag = self->lag_samples, span = part[j].samples;
            part[j].approach = lag > 0.0 ? -expm1(-span / lag) : 1.0;
            part[j].fading[0] = lag * part[j].approach;
            part[j].fading[1] = lag * (span - part[j].fading[0]);
            part[j].fading[2] = lag * (0.5 * span * span - part[j].fading[1]);
        }
    }
}

void sim_stepper_init_once(struct sim_stepper *self, const struct sim_model *model, double dt_s)
{
    memset(self, 0, sizeof *self);
    memcpy(&self->model, model, sizeof *model); // padding too: callers compare
    self->dt_s = dt_s;
    self->steady =
        (struct sim_opposing){.dry = model->coulomb_friction_Nm, .positive_factor = 1.0, .negative_factor = 1.0};
    prepare_chain(self);
    for (size_t e = 0; sim_effects[e]; e++)
        if (model->effect_on[e])
            prepare_effect(self, e);
    self->chain_rate = chain_rate(&self->chain);
    self->inner_steps = sim_stepper_inner_steps(self->chain_rate, dt_s);
}

static void init(struct sim_stepper *self, const struct sim_model *model, double dt_s, bool quick)
{
    sim_stepper_init_once(self, model, dt_s);
    prepare_actuator(self);
    self->quick = quick;
    self->exact = self->oppose.count == 0 && self->bend.count == 0 && !(self->build_up > 0.0);
    self->split = self->exact || (quick && self->bend.count == 0);
    if (!self->split)
        return;
    self->one_way =
        self->exact && !(self->steady.dry > 0.0) && self->steady.positive_factor == self->steady.negative_factor;
    const double factors[] = {self->steady.negative_factor, 0.0, self->steady.positive_factor};
    for (size_t i = 0; i < 3; i++) {
        if (i == 2 && factors[2] == factors[0])
            self->transitions[2] = self->transitions[0];
        else if (i != 1 || self->chain.masses > 1)
            sim_transition_init(&self->transitions[i], &self->chain, factors[i] * model->viscous_friction_Nms_per_rad,
                                i == 1, self->chain_rate, dt_s);
    }
}

void sim_stepper_init(struct sim_stepper *self, const struct sim_model *model, double dt_s)
{
    init(self, model, dt_s, false);
}

void sim_stepper_init_quick(struct sim_stepper *self, const struct sim_model *model, double dt_s)
{
    init(self, model, dt_s, true);
}

void sim_stepper_sense(const struct sim_stepper *self, const struct sim_motion *motion, struct sim_sensed *out_sensed)
{
    struct sim_motion at = *motion;
    *out_sensed = (struct sim_sensed){.position = motion->position, .velocity = motion->velocity};
    at.radius = self->model.linear && self->model.pulley_radius_m > 0.0 ? self->model.pulley_radius_m : 1.0;
    for (size_t i = 0; i < self->sense.count; i++) {
        size_t e = self->sense.effects[i];
        sim_effects[e]->sense(self->model.effect_parameters[e], &at, out_sensed);
    }
}

void sim_stepper_unsense(const struct sim_stepper *self, const struct sim_sensed *sensed, struct sim_motion *io_motion)
{
    // Errors of sensors are small: each pass leaves about the error's slope of what the last one left.
    enum { passes = 8 };
    io_motion->position = sensed->position;
    io_motion->velocity = sensed->velocity;
    for (int pass = 0; pass < passes && self->sense.count > 0; pass++) {
        struct sim_sensed said;
        sim_stepper_sense(self, io_motion, &said);
        double position = sensed->position - said.position, velocity = sensed->velocity - said.velocity;
        if (position == 0.0 && velocity == 0.0)
            break;
        io_motion->position += position;
        io_motion->velocity += velocity;
    }
}
