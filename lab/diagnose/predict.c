/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/predict.h"

#include "sim/plant.h"

#include <math.h>
#include <string.h>

/// Position and speed of the masses that were not measured: load, attached mass.
enum { hidden_max = 4 };

struct predictor {
    const struct stretch *stretch;
    struct sim_stepper stepper;
    struct sim_plant plant;
    struct sim_actuator actuator;
    size_t hidden; ///< states, 0, 2 or 4
    bool cyclic;
    double gain; ///< of a measured position, beside the one that was reached
    bool placed; ///< whether there is one
    bool leaps;  ///< a period ends elsewhere than it begins
};

static bool is_lost(const struct stretch *s, size_t n)
{
    return s->lost && s->lost[n];
}

/// Moves over substep i when only the measured torque is known: straight between its samples unless they are held.
static void move_measured(struct predictor *p, size_t n, size_t i)
{
    const double *torque = p->stretch->torque;
    size_t last = p->stretch->samples - 1;
    size_t next = p->stretch->held ? n : n < last ? n + 1 : p->cyclic ? 0 : last;
    double share = 1.0 / (double)p->stretch->substeps, rise = torque[next] - torque[n];
    // A line that rises by r over the step: I1 = -r / 12, I2 = -r / 24.
    struct sim_torque line = {torque[n] + ((double)i + 0.5) * share * rise, -rise * share / 24.0, -rise * share / 24.0};
    sim_plant_move_under(&p->plant, &p->stepper, &line);
}

/// Sets the motor to where the sensors saw it, unless they saw nothing. What a speed column has taken a position to is
/// less noisy for a while than the next position: a stiff belt, and a gap in it, feel the difference.
static void place_motor(struct predictor *p, size_t n)
{
    const struct stretch *s = p->stretch;
    p->plant.time_s = s->start_s + (p->cyclic ? 0.0 : (double)n / p->stepper.model.sample_rate_hz);
    if (is_lost(s, n))
        return;
    struct sim_motion motion = {.time_s = p->plant.time_s, .linear = p->stepper.model.linear};
    struct sim_sensed sensed = {.position = s->position[n], .velocity = s->velocity[n]};
    sim_stepper_unsense(&p->stepper, &sensed, &motion);
    bool anew = !p->placed || (n == 0 && p->leaps);
    p->plant.position += (anew ? 1.0 : p->gain) * (motion.position - p->plant.position);
    p->plant.velocity = motion.velocity;
    p->placed = true;
}

/// Speed that the sensors will say the motor has now.
static double seen_velocity(const struct predictor *p)
{
    if (p->stepper.sense.count == 0)
        return p->plant.velocity;
    struct sim_motion motion = {.position = p->plant.position,
                                .velocity = p->plant.velocity,
                                .time_s = p->plant.time_s,
                                .linear = p->stepper.model.linear};
    struct sim_sensed sensed;
    sim_stepper_sense(&p->stepper, &motion, &sensed);
    return sensed.velocity;
}

/// Moves from sampling instant n to the next; returns the actuator's torque at instant n.
static double predict_sample(struct predictor *p, size_t n)
{
    const struct stretch *s = p->stretch;
    double now = s->torque[n];
    if (s->torque_ref) {
        sim_actuator_hold(&p->actuator, s->torque_ref[n]);
        now = sim_actuator_now(&p->actuator, &p->stepper);
    }
    place_motor(p, n);
    for (size_t i = 0; i < s->substeps; i++) {
        if (s->torque_ref)
            sim_plant_drive(&p->plant, &p->stepper, &p->actuator, i, 0.0);
        else
            move_measured(p, n, i);
    }
    return now;
}

// ---- The hidden masses' periodic state

static void get_hidden(const struct predictor *p, double out[hidden_max])
{
    const struct sim_plant *q = &p->plant;
    bool load = p->stepper.model.structure == sim_structure_two_mass;
    out[0] = load ? q->load_position : q->attached_position;
    out[1] = load ? q->load_velocity : q->attached_velocity;
    out[2] = q->attached_position;
    out[3] = q->attached_velocity;
}

static void set_hidden(struct predictor *p, const double x[hidden_max])
{
    struct sim_plant *q = &p->plant;
    bool load = p->stepper.model.structure == sim_structure_two_mass;
    size_t attached = load ? 2 : 0;
    if (load) {
        q->load_position = x[0];
        q->load_velocity = x[1];
    }
    if (p->hidden > attached) {
        q->attached_position = x[attached];
        q->attached_velocity = x[attached + 1];
    }
}

struct square {
    double a[hidden_max][hidden_max];
};

/// Free motion of the hidden masses over one sample, x' = A x for deviations: the simulator's own, of a motor that
/// starts at the measured state and gives way until the next sample. A belt that is not linear counts as one that is.
static void free_motion(const struct predictor *p, struct square *out_phi)
{
    struct predictor free = *p;
    struct sim_model linear = p->stepper.model;
    linear.coulomb_friction_Nm = 0.0;
    for (size_t e = 0; sim_effects[e]; e++)
        linear.effect_on[e] = linear.effect_on[e] && sim_effects[e]->attach;
    sim_stepper_init_quick(&free.stepper, &linear, p->stepper.dt_s);
    for (size_t j = 0; j < p->hidden; j++) {
        double x[hidden_max] = {0.0};
        x[j] = 1.0;
        sim_plant_init(&free.plant, 0.0);
        set_hidden(&free, x);
        for (size_t i = 0; i < p->stretch->substeps; i++)
            sim_plant_move(&free.plant, &free.stepper, 0.0);
        get_hidden(&free, x);
        for (size_t i = 0; i < p->hidden; i++)
            out_phi->a[i][j] = x[i];
    }
}

static struct square product(size_t n, const struct square *a, const struct square *b)
{
    struct square c = {{{0.0}}};
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < n; k++)
            for (size_t j = 0; j < n; j++)
                c.a[i][j] += a->a[i][k] * b->a[k][j];
    return c;
}

static struct square power(size_t n, struct square phi, size_t exponent)
{
    struct square result = {{{0.0}}};
    for (size_t i = 0; i < n; i++)
        result.a[i][i] = 1.0;
    for (; exponent > 0; exponent /= 2) {
        if (exponent % 2 == 1)
            result = product(n, &phi, &result);
        phi = product(n, &phi, &phi);
    }
    return result;
}

static void swap_rows(size_t n, struct square *m, double *b, size_t i, size_t j)
{
    for (size_t k = 0; k < n; k++) {
        double held = m->a[i][k];
        m->a[i][k] = m->a[j][k];
        m->a[j][k] = held;
    }
    double held = b[i];
    b[i] = b[j];
    b[j] = held;
}

/// Solves m x = b in place by elimination with row exchange; false where a pivot is next to nothing.
static bool solve(size_t n, struct square m, double *io_b)
{
    const double smallest = 1e-9;
    for (size_t i = 0; i < n; i++) {
        size_t best = i;
        for (size_t j = i + 1; j < n; j++)
            if (fabs(m.a[j][i]) > fabs(m.a[best][i]))
                best = j;
        swap_rows(n, &m, io_b, i, best);
        if (!(fabs(m.a[i][i]) > smallest))
            return false;
        for (size_t j = i + 1; j < n; j++) {
            double share = m.a[j][i] / m.a[i][i];
            for (size_t k = i; k < n; k++)
                m.a[j][k] -= share * m.a[i][k];
            io_b[j] -= share * io_b[i];
        }
    }
    for (size_t i = n; i-- > 0;) {
        for (size_t k = i + 1; k < n; k++)
            io_b[i] -= m.a[i][k] * io_b[k];
        io_b[i] /= m.a[i][i];
    }
    return true;
}

/// After a pass from x0 to x1: the state that repeats after one period, x1 = Phi x0 + c for any start, so x* =
/// (I - Phi)^-1 (x1 - Phi x0). An undamped mass never settles: it goes on with what the pass left.
static void settle_hidden(struct predictor *p, const struct square *phi, const double x0[hidden_max])
{
    double x1[hidden_max], x[hidden_max] = {0.0};
    struct square m = {{{0.0}}};
    get_hidden(p, x1);
    for (size_t i = 0; i < p->hidden; i++) {
        x[i] = x1[i];
        for (size_t j = 0; j < p->hidden; j++) {
            x[i] -= phi->a[i][j] * x0[j];
            m.a[i][j] = (i == j) - phi->a[i][j];
        }
    }
    if (solve(p->hidden, m, x))
        set_hidden(p, x);
}

/// Passes over the period until the hidden masses repeat: one where the belt is linear. What a linear guess leaves
/// otherwise fades over the next.
static void settle(struct predictor *p, struct square phi)
{
    size_t passes = p->stepper.bend.count > 0 ? 2 : 1;
    phi = power(p->hidden, phi, p->stretch->samples);
    for (size_t pass = 0; pass < passes; pass++) {
        double x0[hidden_max] = {0.0};
        get_hidden(p, x0);
        for (size_t n = 0; n < p->stretch->samples; n++)
            predict_sample(p, n);
        settle_hidden(p, &phi, x0);
    }
}

/// Samples at the end of the period after which friction that builds up has forgotten where it began.
static size_t friction_memory(const struct predictor *p)
{
    const struct stretch *s = p->stretch;
    const double lengths = 40.0; // exp(-40): nothing of the start is left
    double way = 0.0, step_s = 1.0 / p->stepper.model.sample_rate_hz;
    size_t n = 0;
    while (n < s->samples && p->stepper.build_up > 0.0 && way < lengths * p->stepper.build_up)
        way += fabs(s->velocity[s->samples - 1 - n++]) * step_s;
    return n;
}

/// Whether the hidden masses run away while the motor is set to where it was measured, sample by sample: a belt that
/// swings faster than that, with next to no damping, is shaken by it. phi: free motion over a sample.
static bool runs_away(const struct predictor *p, struct square phi)
{
    const size_t many = 4096;
    const double most = 1.005; // per sample; positions and speeds are a few powers of ten apart
    double largest = 0.0;
    phi = power(p->hidden, phi, many);
    for (size_t i = 0; i < p->hidden; i++)
        for (size_t j = 0; j < p->hidden; j++)
            largest = fmax(largest, isfinite(phi.a[i][j]) ? fabs(phi.a[i][j]) : INFINITY);
    return largest > pow(most, (double)many);
}

/// Nothing that such a model says is of any use: it is off by far more than any other.
static void say_nothing(const struct stretch *stretch, double *out_mechanics, double *out_actuator)
{
    const double far = 1e3;
    for (size_t n = 0; n < stretch->samples; n++) {
        out_mechanics[n] = is_lost(stretch, n) ? 0.0 : far * stretch->torque[n];
        if (out_actuator)
            out_actuator[n] = out_mechanics[n];
    }
}

/// One period ahead of the one that counts, for the hidden masses; for actuator and friction the last samples are
/// enough.
static void warm_up(struct predictor *p, const struct square *phi)
{
    size_t samples = p->stretch->samples;
    if (p->hidden > 0) {
        settle(p, *phi);
        return;
    }
    const double lags = 40.0; // exp(-40): nothing of the start is left
    double needed = fmax(sim_actuator_history + lags * p->stepper.lag_samples, (double)friction_memory(p));
    size_t history = needed < (double)samples ? (size_t)needed : samples;
    p->placed = false;
    for (size_t n = samples - history; n < samples; n++)
        predict_sample(p, n);
}

// ---- A stretch

static void start(struct predictor *p)
{
    const struct stretch *s = p->stretch;
    double x[hidden_max], step_s = 1.0 / p->stepper.model.sample_rate_hz, farthest = 0.0;
    for (size_t n = 0; n < s->samples; n++)
        farthest = fmax(farthest, fabs(s->velocity[n]) * step_s);
    p->gain = s->position_gain > 0.0 ? s->position_gain : 1.0;
    p->leaps = fabs(s->position[0] - s->position[s->samples - 1]) > 2.0 * farthest;
    sim_plant_init(&p->plant, 0.0);
    place_motor(p, 0);
    for (size_t i = 0; i < hidden_max; i++)
        x[i] = i % 2 == 0 ? p->plant.position : p->plant.velocity;
    set_hidden(p, x);
    sim_actuator_init(&p->actuator);
}

/// Nothing accelerates: the torque is what opposes the motion. A step of the simulator would say that too, but so would
/// one of a body that no torque can move.
static void balance(const struct sim_model *model, const struct stretch *stretch, double *out_mechanics)
{
    for (size_t n = 0; n < stretch->samples; n++) {
        struct sim_motion motion = {.position = stretch->position[n],
                                    .velocity = stretch->velocity[n],
                                    .time_s = stretch->start_s + (double)n / model->sample_rate_hz,
                                    .linear = model->linear};
        struct sim_opposing opposing;
        sim_plant_opposing(model, &motion, &opposing);
        double sign = (double)(motion.velocity > 0.0) - (double)(motion.velocity < 0.0);
        double factor = motion.velocity < 0.0 ? opposing.negative_factor : opposing.positive_factor;
        double friction = factor * (opposing.viscous + sign * opposing.dry);
        out_mechanics[n] = is_lost(stretch, n) ? 0.0 : opposing.smooth + friction - stretch->torque[n];
    }
}

void predict(const struct sim_model *model, const struct stretch *stretch, bool cyclic, double scale_inertia,
             double *out_mechanics, double *out_actuator)
{
    if (stretch->still) {
        balance(model, stretch, out_mechanics);
        if (out_actuator)
            memset(out_actuator, 0, stretch->samples * sizeof *out_actuator);
        return;
    }
    struct predictor p = {.stretch = stretch, .cyclic = cyclic};
    sim_stepper_init_quick(&p.stepper, model, 1.0 / (model->sample_rate_hz * (double)stretch->substeps));
    p.hidden = 2 * (p.stepper.chain.masses - 1);
    start(&p);
    struct square phi = {{{0.0}}};
    free_motion(&p, &phi);
    if (runs_away(&p, phi)) {
        say_nothing(stretch, out_mechanics, out_actuator);
        return;
    }
    if (cyclic)
        warm_up(&p, &phi);
    double scale = scale_inertia * model->sample_rate_hz;
    for (size_t n = 0; n < stretch->samples; n++) {
        double now = predict_sample(&p, n);
        bool last = n + 1 == stretch->samples;
        size_t next = last ? 0 : n + 1;
        bool unseen = (last && !cyclic) || is_lost(stretch, n) || is_lost(stretch, next);
        out_mechanics[n] = unseen ? 0.0 : scale * (stretch->velocity[next] - seen_velocity(&p));
        if (out_actuator)
            out_actuator[n] = is_lost(stretch, n) ? 0.0 : stretch->torque[n] - now;
    }
}

/// What the actuator makes of a stretch's reference: at each instant, and on the average until the next, added to
/// `io_now` and `io_until` times `sign`.
static void add_made(const struct sim_model *model, const struct stretch *stretch, bool cyclic, double sign,
                     double *io_now, double *io_until)
{
    struct predictor p = {.stretch = stretch, .cyclic = cyclic};
    sim_stepper_init_quick(&p.stepper, model, 1.0 / (model->sample_rate_hz * (double)stretch->substeps));
    sim_actuator_init(&p.actuator);
    size_t first = cyclic ? 0 : stretch->samples; // one period ahead of the one that counts
    for (size_t m = first; m < 2 * stretch->samples; m++) {
        size_t n = m % stretch->samples;
        double sum = 0.0;
        sim_actuator_hold(&p.actuator, stretch->torque_ref[n]);
        double now = sim_actuator_now(&p.actuator, &p.stepper);
        for (size_t i = 0; i < stretch->substeps; i++)
            sum += sim_actuator_substep(&p.actuator, &p.stepper, i);
        if (m < stretch->samples)
            continue;
        io_now[n] += sign * now;
        io_until[n] += sign * sum / (double)stretch->substeps;
    }
}

bool predict_limits(const struct sim_model *model)
{
    for (size_t e = 0; sim_effects[e]; e++)
        if (model->effect_on[e] && sim_effects[e]->limit)
            return true;
    return false;
}

void predict_limited(const struct sim_model *model, const struct stretch *stretch, bool cyclic, double scale_inertia,
                     double *out_mechanics, double *out_actuator)
{
    struct sim_model unlimited = *model;
    for (size_t e = 0; sim_effects[e]; e++)
        unlimited.effect_on[e] = unlimited.effect_on[e] && !sim_effects[e]->limit;
    memset(out_mechanics, 0, stretch->samples * sizeof *out_mechanics);
    memset(out_actuator, 0, stretch->samples * sizeof *out_actuator);
    add_made(&unlimited, stretch, cyclic, 1.0, out_actuator, out_mechanics);
    add_made(model, stretch, cyclic, -1.0, out_actuator, out_mechanics);
    double moved = model->motor_inertia_kgm2;
    if (model->structure == sim_structure_rigid)
        moved += model->load_inertia_kgm2;
    for (size_t n = 0; n < stretch->samples; n++)
        out_mechanics[n] *= scale_inertia / moved;
}

void predict_kinematics(const struct sim_model *model, const struct stretch *stretch, double *out_kinematics)
{
    struct sim_stepper stepper;
    sim_stepper_init_once(&stepper, model, 1.0 / model->sample_rate_hz);
    double ahead_s = 1e-3 / model->sample_rate_hz;
    for (size_t n = 0; n < stretch->samples; n++) {
        struct sim_motion motion = {.time_s = stretch->start_s + (double)n / model->sample_rate_hz,
                                    .linear = model->linear};
        struct sim_sensed here = {.position = stretch->position[n], .velocity = stretch->velocity[n]}, ahead;
        sim_stepper_unsense(&stepper, &here, &motion);
        struct sim_motion later = motion;
        later.position += ahead_s * motion.velocity;
        later.time_s += ahead_s;
        sim_stepper_sense(&stepper, &motion, &here);
        sim_stepper_sense(&stepper, &later, &ahead);
        double error_rate = ((ahead.position - later.position) - (here.position - motion.position)) / ahead_s;
        out_kinematics[n] =
            is_lost(stretch, n) ? 0.0 : stretch->kinematics[n] - (here.velocity - motion.velocity - error_rate);
    }
}
