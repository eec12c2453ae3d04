/* SPDX-License-Identifier: MIT */
#include "sim/belt_drive.h"

#include "sim/random.h"

#include <math.h>
#include <string.h>

void sim_belt_drive_init(struct sim_belt_drive *self, const struct sim_model *model, double position)
{
    memset(self, 0, sizeof *self);
    self->model = model;
    sim_plant_init(&self->plant, position);
    sim_actuator_init(&self->actuator);
    sim_random_seed(self->random, model->seed);
    self->torque_limit = INFINITY;
    self->stop_deceleration = 50.0;
}

struct noise {
    double position, velocity, torque, load_position, process;
};

/// The same draws every sample, used or not, so that two models with one seed see the same noise.
static struct noise draw_noise(struct sim_belt_drive *self)
{
    const struct sim_sensors *s = &self->model->sensors;
    struct noise noise;
    noise.position = s->position_noise_rad * sim_random_normal(self->random);
    noise.velocity = s->velocity_noise_rad_per_s * sim_random_normal(self->random);
    noise.torque = s->torque_noise_Nm * sim_random_normal(self->random);
    noise.load_position = s->position_noise_rad * sim_random_normal(self->random);
    noise.process = self->model->process_noise_Nm * sim_random_normal(self->random);
    return noise;
}

static double quantised(const struct sim_model *model, double position)
{
    if (!(model->sensors.counts_per_rev > 0.0))
        return position;
    const double turn = 6.283185307179586;
    double counts_per_unit = model->linear ? model->sensors.counts_per_rev : model->sensors.counts_per_rev / turn;
    return floor(position * counts_per_unit + 0.5) / counts_per_unit;
}

static double filtered_velocity(struct sim_belt_drive *self, double velocity)
{
    double filter_s = self->model->sensors.velocity_filter_s;
    if (filter_s > 0.0)
        self->velocity_filtered +=
            (velocity - self->velocity_filtered) * -expm1(-1.0 / (self->model->sample_rate_hz * filter_s));
    else
        self->velocity_filtered = velocity;
    return self->velocity_filtered;
}

/// PI speed controller with anti-windup: the integral stands still while the torque limit clips.
static double velocity_control(struct sim_belt_drive *self, double velocity_cmd, double velocity, double torque_ff)
{
    const struct sim_controller *c = &self->model->controller;
    double error = velocity_cmd - velocity;
    double torque = c->velocity_gain_Nms_per_rad * error + self->velocity_integral + torque_ff;
    if (c->velocity_integral_time_s > 0.0 && fabs(torque) < self->torque_limit)
        self->velocity_integral +=
            c->velocity_gain_Nms_per_rad * error / (c->velocity_integral_time_s * self->model->sample_rate_hz);
    return torque;
}

static double clipped(double value, double limit)
{
    return fmin(fmax(value, -limit), limit);
}

static double control(struct sim_belt_drive *self, const struct sim_command *command, double position, double velocity)
{
    const struct sim_controller *c = &self->model->controller;
    double torque = 0.0;
    double slope = self->stop_deceleration / self->model->sample_rate_hz;
    switch (command->control) {
    case sim_control_off:
        self->velocity_integral = 0.0;
        break;
    case sim_control_torque:
        self->velocity_integral = 0.0;
        torque = command->torque;
        break;
    case sim_control_cascade:
        torque = velocity_control(
            self, c->position_gain_per_s * (command->position - position) + c->velocity_feedforward * command->velocity,
            velocity, c->torque_feedforward * command->torque);
        break;
    case sim_control_stop:
        self->stop_velocity -= clipped(self->stop_velocity, slope);
        torque = velocity_control(self, self->stop_velocity, velocity, 0.0);
        break;
    }
    if (command->control != sim_control_stop)
        self->stop_velocity = velocity;
    return clipped(torque, self->torque_limit);
}

static void hold_at_end_stops(struct sim_belt_drive *self)
{
    const double *stops = self->model->end_stops_rad;
    double position = fmin(fmax(self->plant.position, stops[0]), stops[1]);
    if (position == self->plant.position)
        return;
    self->plant.position = position;
    self->plant.velocity = 0.0;
    if (self->model->structure == sim_structure_rigid) {
        self->plant.load_position = position;
        self->plant.load_velocity = 0.0;
    }
    self->hit_end_stop = true;
}

void sim_belt_drive_step(struct sim_belt_drive *self, const struct sim_command *command, struct sim_sample *out_sample)
{
    const struct sim_model *model = self->model;
    struct noise noise = draw_noise(self);
    out_sample->position = quantised(model, self->plant.position + noise.position);
    out_sample->velocity = filtered_velocity(self, self->plant.velocity + noise.velocity);
    out_sample->load_position = quantised(model, self->plant.load_position + noise.load_position);
    out_sample->torque_ref = control(self, command, out_sample->position, out_sample->velocity);
    sim_actuator_hold(&self->actuator, out_sample->torque_ref);
    out_sample->torque = sim_actuator_now(&self->actuator, model) + noise.torque;
    for (size_t i = 0; i < sim_substeps; i++) {
        double torque = sim_actuator_substep(&self->actuator, model, i) + noise.process;
        sim_plant_step(&self->plant, model, torque, 1.0 / (model->sample_rate_hz * sim_substeps));
        if (model->has_end_stops)
            hold_at_end_stops(self);
    }
}
