/* SPDX-License-Identifier: MIT */
#include "sim/plant.h"

#include "sim/effect.h"

#include <assert.h>
#include <math.h>
#include <string.h>

// ---- Actuator

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

double sim_actuator_now(const struct sim_actuator *self, const struct sim_model *model)
{
    if (model->torque_lag_s > 0.0)
        return self->torque;
    const double rounding = 1e-9; // a dead time of whole samples must not be counted as one more
    return held_ago(self, (size_t)ceil(fmax(model->dead_time_s * model->sample_rate_hz - rounding, 0.0)));
}

/// Moves the lag's state over `samples` of a constant input; returns the integral of the torque, in Nm samples.
static double lagged(struct sim_actuator *self, const struct sim_model *model, double input, double samples)
{
    if (!(model->torque_lag_s > 0.0)) {
        self->torque = input;
        return input * samples;
    }
    double lag_samples = model->torque_lag_s * model->sample_rate_hz;
    double change = (self->torque - input) * -expm1(-samples / lag_samples);
    self->torque -= change;
    return input * samples + change * lag_samples;
}

double sim_actuator_substep(struct sim_actuator *self, const struct sim_model *model, size_t index)
{
    // Samples from the start of the current one, seen through the dead time. A held value begins at every whole number,
    // so a substep meets at most one change, and both parts of it are exact.
    double delay = model->dead_time_s * model->sample_rate_hz;
    double from = (double)index / sim_substeps - delay, to = (double)(index + 1) / sim_substeps - delay;
    double change = ceil(from);
    if (change > from && change < to) {
        double before = lagged(self, model, held_ago(self, (size_t)-floor(from)), change - from);
        return sim_substeps * (before + lagged(self, model, held_ago(self, (size_t)-change), to - change));
    }
    return sim_substeps * lagged(self, model, held_ago(self, (size_t)-floor(from)), to - from);
}

// ---- Plant

void sim_plant_init(struct sim_plant *self, double position)
{
    *self = (struct sim_plant){.position = position, .load_position = position};
}

/// The model as one step sees it: which effects oppose the motion is looked up once, not at every instant.
struct field {
    const struct sim_model *model;
    bool two_mass;
    double torque;
    size_t count;
    size_t effects[sim_effects_max];
};

static void field_init(struct field *self, const struct sim_model *model, double torque)
{
    self->model = model;
    self->two_mass = model->structure == sim_structure_two_mass;
    self->torque = torque;
    self->count = 0;
    for (size_t e = 0; sim_effects[e]; e++)
        if (model->effect_on[e] && sim_effects[e]->oppose)
            self->effects[self->count++] = e;
}

static void field_opposing(const struct field *self, const struct sim_motion *motion, struct sim_opposing *out_opposing)
{
    *out_opposing = (struct sim_opposing){
        .viscous = self->model->viscous_friction_Nms_per_rad * motion->velocity,
        .dry = self->model->coulomb_friction_Nm,
        .positive_factor = 1.0,
        .negative_factor = 1.0,
    };
    for (size_t i = 0; i < self->count; i++) {
        size_t e = self->effects[i];
        sim_effects[e]->oppose(self->model->effect_parameters[e], motion, out_opposing);
    }
}

void sim_plant_opposing(const struct sim_model *model, const struct sim_motion *motion,
                        struct sim_opposing *out_opposing)
{
    struct field field;
    field_init(&field, model, 0.0);
    field_opposing(&field, motion, out_opposing);
}

struct rates {
    double velocity, acceleration, load_velocity, load_acceleration;
};

static double belt_torque(const struct sim_plant *p, const struct sim_model *model)
{
    return model->belt_stiffness_Nm_per_rad * (p->position - p->load_position) +
           model->belt_damping_Nms_per_rad * (p->velocity - p->load_velocity);
}

/// Torque left for acceleration and dry friction at the present state, and that friction for motion in `direction`.
static double driving_torque(const struct sim_plant *p, const struct field *field, int direction, double *out_dry)
{
    struct sim_motion motion = {
        .position = p->position, .velocity = p->velocity, .time_s = p->time_s, .linear = field->model->linear};
    struct sim_opposing o;
    field_opposing(field, &motion, &o);
    double factor = direction >= 0 ? o.positive_factor : o.negative_factor;
    *out_dry = factor * o.dry;
    double belt = field->two_mass ? belt_torque(p, field->model) : 0.0;
    return field->torque - o.smooth - factor * o.viscous - belt;
}

/// Time derivatives while the motor moves in `direction` (+1, -1) or sticks (0).
static struct rates plant_rates(const struct sim_plant *p, const struct field *field, int direction)
{
    const struct sim_model *model = field->model;
    struct rates r = {.velocity = p->velocity, .load_velocity = p->load_velocity};
    if (direction != 0) {
        double dry;
        double driving = driving_torque(p, field, direction, &dry);
        double inertia = model->motor_inertia_kgm2 + (field->two_mass ? 0.0 : model->load_inertia_kgm2);
        r.acceleration = (driving - direction * dry) / inertia;
    }
    if (field->two_mass)
        r.load_acceleration = belt_torque(p, model) / model->load_inertia_kgm2;
    else
        r.load_acceleration = r.acceleration;
    return r;
}

static struct sim_plant advanced(const struct sim_plant *p, const struct rates *r, double dt_s)
{
    struct sim_plant q = *p;
    q.position += dt_s * r->velocity;
    q.velocity += dt_s * r->acceleration;
    q.load_position += dt_s * r->load_velocity;
    q.load_velocity += dt_s * r->load_acceleration;
    q.time_s += dt_s;
    return q;
}

/// One classical Runge-Kutta step with the direction of friction held.
static struct sim_plant runge_kutta(const struct sim_plant *p, const struct field *field, int direction, double dt_s)
{
    struct rates a = plant_rates(p, field, direction);
    struct sim_plant at = advanced(p, &a, dt_s / 2);
    struct rates b = plant_rates(&at, field, direction);
    at = advanced(p, &b, dt_s / 2);
    struct rates c = plant_rates(&at, field, direction);
    at = advanced(p, &c, dt_s);
    struct rates d = plant_rates(&at, field, direction);
    struct rates mean = {
        .velocity = (a.velocity + 2 * b.velocity + 2 * c.velocity + d.velocity) / 6,
        .acceleration = (a.acceleration + 2 * b.acceleration + 2 * c.acceleration + d.acceleration) / 6,
        .load_velocity = (a.load_velocity + 2 * b.load_velocity + 2 * c.load_velocity + d.load_velocity) / 6,
        .load_acceleration =
            (a.load_acceleration + 2 * b.load_acceleration + 2 * c.load_acceleration + d.load_acceleration) / 6,
    };
    return advanced(p, &mean, dt_s);
}

/// Direction in which a motor at rest sets off, 0 if friction holds it.
static int breakaway(const struct sim_plant *p, const struct field *field)
{
    for (int direction = -1; direction <= 1; direction += 2) {
        double dry;
        double driving = driving_torque(p, field, direction, &dry);
        if (direction * driving > dry)
            return direction;
    }
    return 0;
}

/// Time after which the motor comes to rest in a step that ends with it running backward at end_speed. False position:
/// the straight line alone would drop a speed of the second order of the step, which a belt's changing pull makes felt.
static double time_to_rest(const struct sim_plant *p, const struct field *field, int direction, double dt_s,
                           double end_speed)
{
    enum { refinements = 2 };
    double low_s = 0.0, low = fabs(p->velocity), high_s = dt_s, high = end_speed, at_s = 0.0;
    for (int i = 0; i <= refinements; i++) {
        at_s = low_s + (high_s - low_s) * low / (low + high);
        if (i == refinements)
            break;
        double speed = direction * runge_kutta(p, field, direction, at_s).velocity;
        if (speed > 0.0) {
            low_s = at_s;
            low = speed;
        } else if (speed < 0.0) {
            high_s = at_s;
            high = -speed;
        } else {
            break;
        }
    }
    return at_s;
}

/// A step in which the motor may come to rest: split there, so that its speed is exactly zero while it sticks.
static void step_with_reversal(struct sim_plant *self, const struct field *field, double dt_s)
{
    // Each pass either ends the step or brings the motor to rest; after two rests in one step it is held to the end.
    double left_s = dt_s;
    for (int pass = 0; pass < 3 && left_s > 0.0; pass++) {
        int direction = self->velocity > 0.0 ? 1 : self->velocity < 0.0 ? -1 : breakaway(self, field);
        if (pass == 2 && self->velocity == 0.0)
            direction = 0;
        struct sim_plant next = runge_kutta(self, field, direction, left_s);
        if (direction == 0 || direction * next.velocity >= 0.0) {
            *self = next;
            return;
        }
        double part_s = left_s;
        if (self->velocity == 0.0) // set off and came back within the step: it did not get away
            direction = 0;
        else
            part_s = time_to_rest(self, field, direction, left_s, fabs(next.velocity));
        *self = runge_kutta(self, field, direction, part_s);
        self->velocity = 0.0;
        left_s -= part_s;
    }
}

/// Steps that keep the Runge-Kutta error below 1e-5 of the fastest mode's swing.
static size_t inner_steps(const struct sim_model *model, double dt_s)
{
    if (model->structure != sim_structure_two_mass)
        return 1;
    double mobility = 1.0 / model->motor_inertia_kgm2 + 1.0 / model->load_inertia_kgm2;
    double rate = sqrt(model->belt_stiffness_Nm_per_rad * mobility) + model->belt_damping_Nms_per_rad * mobility;
    const double longest = 0.25, most = 400.0;
    return (size_t)fmin(fmax(ceil(rate * dt_s / longest), 1.0), most);
}

void sim_plant_step(struct sim_plant *self, const struct sim_model *model, double torque, double dt_s)
{
    struct field field;
    field_init(&field, model, torque);
    size_t steps = inner_steps(model, dt_s);
    for (size_t i = 0; i < steps; i++)
        step_with_reversal(self, &field, dt_s / (double)steps);
    if (model->structure == sim_structure_rigid) {
        self->load_position = self->position;
        self->load_velocity = self->velocity;
    }
}
