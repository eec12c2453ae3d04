/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/predict.h"

#include "sim/plant.h"

#include <math.h>
#include <string.h>

struct predictor {
    const struct sim_model *model;
    const struct stretch *stretch;
    struct sim_plant plant;
    struct sim_actuator actuator;
    bool cyclic;
};

/// Torque over substep i when only the measured torque is known: straight between its samples.
static double measured_torque(const struct predictor *p, size_t n, size_t i)
{
    const double *torque = p->stretch->torque;
    size_t last = p->stretch->samples - 1;
    size_t next = n < last ? n + 1 : p->cyclic ? 0 : last;
    double part = ((double)i + 0.5) / (double)p->stretch->substeps;
    return torque[n] + part * (torque[next] - torque[n]);
}

/// Moves from sampling instant n to the next; returns the actuator's torque at instant n.
static double predict_sample(struct predictor *p, size_t n)
{
    const struct stretch *s = p->stretch;
    double now = s->torque[n];
    if (s->torque_ref) {
        sim_actuator_hold(&p->actuator, s->torque_ref[n]);
        now = sim_actuator_now(&p->actuator, p->model);
    }
    p->plant.position = s->position[n];
    p->plant.velocity = s->velocity[n];
    for (size_t i = 0; i < s->substeps; i++) {
        double torque = s->torque_ref ? sim_actuator_substep(&p->actuator, p->model, i) : measured_torque(p, n, i);
        sim_plant_step(&p->plant, p->model, torque, 1.0 / (p->model->sample_rate_hz * (double)s->substeps));
    }
    return now;
}

/// Free motion of the load over one sample, x' = A x for deviations x = (angle, speed): the simulator's own, of a motor
/// that starts at the measured state and gives way to the belt until the next sample.
static void free_motion(const struct predictor *p, double out_phi[2][2])
{
    struct sim_model linear = *p->model;
    linear.coulomb_friction_Nm = 0.0;
    memset(linear.effect_on, 0, sizeof linear.effect_on);
    for (size_t j = 0; j < 2; j++) {
        struct sim_plant plant = {.load_position = j == 0, .load_velocity = j == 1};
        for (size_t i = 0; i < p->stretch->substeps; i++)
            sim_plant_step(&plant, &linear, 0.0, 1.0 / (linear.sample_rate_hz * (double)p->stretch->substeps));
        out_phi[0][j] = plant.load_position;
        out_phi[1][j] = plant.load_velocity;
    }
}

static void multiply(double a[2][2], double b[2][2], double out[2][2])
{
    double c[2][2];
    for (size_t i = 0; i < 2; i++)
        for (size_t j = 0; j < 2; j++)
            c[i][j] = a[i][0] * b[0][j] + a[i][1] * b[1][j];
    memcpy(out, c, sizeof c);
}

/// io_phi to the power of n.
static void raise(double io_phi[2][2], size_t n)
{
    double result[2][2] = {{1.0, 0.0}, {0.0, 1.0}};
    for (; n > 0; n /= 2) {
        if (n % 2 == 1)
            multiply(result, io_phi, result);
        multiply(io_phi, io_phi, io_phi);
    }
    memcpy(io_phi, result, sizeof result);
}

/// The load's state that repeats after one period: x1 = Phi x0 + c for any start x0, so x* = (I - Phi)^-1 (x1 - Phi
/// x0).
static void settle_load(struct predictor *p, double position0, double velocity0)
{
    double phi[2][2];
    free_motion(p, phi);
    raise(phi, p->stretch->samples);
    double b0 = p->plant.load_position - phi[0][0] * position0 - phi[0][1] * velocity0;
    double b1 = p->plant.load_velocity - phi[1][0] * position0 - phi[1][1] * velocity0;
    double m00 = 1.0 - phi[0][0], m01 = -phi[0][1], m10 = -phi[1][0], m11 = 1.0 - phi[1][1];
    double determinant = m00 * m11 - m01 * m10;
    if (!(fabs(determinant) > 1e-9)) // an undamped load never settles: go on with what the pass left
        return;
    p->plant.load_position = (m11 * b0 - m01 * b1) / determinant;
    p->plant.load_velocity = (m00 * b1 - m10 * b0) / determinant;
}

/// One period ahead of the one that counts, for the load; for the actuator the last samples are enough.
static void warm_up(struct predictor *p)
{
    size_t samples = p->stretch->samples;
    bool two = p->model->structure == sim_structure_two_mass;
    const double lags = 40.0; // exp(-40): nothing of the start is left
    double needed = sim_actuator_history + lags * p->model->torque_lag_s * p->model->sample_rate_hz;
    size_t history = needed < (double)samples ? (size_t)needed : samples;
    double position0 = p->plant.load_position, velocity0 = p->plant.load_velocity;
    for (size_t n = two ? 0 : samples - history; n < samples; n++)
        predict_sample(p, n);
    if (two)
        settle_load(p, position0, velocity0);
}

void predict(const struct sim_model *model, const struct stretch *stretch, bool cyclic, double scale_inertia,
             double *out_mechanics, double *out_actuator)
{
    struct predictor p = {.model = model, .stretch = stretch, .cyclic = cyclic};
    sim_plant_init(&p.plant, stretch->position[0]);
    p.plant.load_velocity = stretch->velocity[0];
    sim_actuator_init(&p.actuator);
    if (cyclic)
        warm_up(&p);
    double scale = scale_inertia * model->sample_rate_hz;
    for (size_t n = 0; n < stretch->samples; n++) {
        double now = predict_sample(&p, n);
        bool last = n + 1 == stretch->samples;
        double reached = stretch->velocity[last ? 0 : n + 1];
        out_mechanics[n] = last && !cyclic ? 0.0 : scale * (reached - p.plant.velocity);
        if (out_actuator)
            out_actuator[n] = stretch->torque[n] - now;
    }
}
