/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/predict.h"

#include "sim/plant.h"

#include <math.h>

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

/// Free motion of the load over t_s with the motor held: x(t) = Phi x(0) for deviations x = (angle, speed) from rest.
static void free_motion(const struct sim_model *model, double t_s, double out_phi[2][2])
{
    double square = model->belt_stiffness_Nm_per_rad / model->load_inertia_kgm2;
    double alpha = 0.5 * model->belt_damping_Nms_per_rad / model->load_inertia_kgm2;
    double inside = square - alpha * alpha, rate = sqrt(fabs(inside)), c, s; // c and s / rate carry the decay
    if (inside > 0.0) {
        c = exp(-alpha * t_s) * cos(rate * t_s);
        s = exp(-alpha * t_s) * sin(rate * t_s);
    } else {
        c = 0.5 * (exp((rate - alpha) * t_s) + exp(-(rate + alpha) * t_s));
        s = 0.5 * (exp((rate - alpha) * t_s) - exp(-(rate + alpha) * t_s));
    }
    double over = rate > 0.0 ? s / rate : t_s * c;
    out_phi[0][0] = c + alpha * over;
    out_phi[0][1] = over;
    out_phi[1][0] = -square * over;
    out_phi[1][1] = c - alpha * over;
}

/// The load's state that repeats after one period: x1 = Phi x0 + c for any start x0, so x* = (I - Phi)^-1 (x1 - Phi x0).
static void settle_load(struct predictor *p, double position0, double velocity0)
{
    double phi[2][2];
    free_motion(p->model, (double)p->stretch->samples / p->model->sample_rate_hz, phi);
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
    size_t history = samples < sim_actuator_history ? samples : sim_actuator_history;
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
