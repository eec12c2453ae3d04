/* SPDX-License-Identifier: MIT */
#include "sim/belt_drive.h"

#include "sim/effect.h"
#include "sim/random.h"

#include <math.h>
#include <string.h>

/// The model may change between samples: a bus sets its own rate.
static void prepare(struct sim_belt_drive *self)
{
    // Padding that differs would only prepare it once more.
    if (memcmp(&self->stepper.model, self->model, sizeof *self->model) != 0)
        sim_stepper_init(&self->stepper, self->model, 1.0 / (self->model->sample_rate_hz * sim_substeps));
}

void sim_belt_drive_init(struct sim_belt_drive *self, const struct sim_model *model, double position)
{
    const uint64_t record_stream = 0x7265636f7264; // any number that sets it apart from the noise's
    memset(self, 0, sizeof *self);
    self->model = model;
    prepare(self);
    sim_plant_init(&self->plant, position);
    sim_actuator_init(&self->actuator);
    sim_random_seed(self->random, model->seed);
    sim_random_seed(self->record_random, model->seed ^ record_stream);
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
    if (self->encoder == sim_encoder_dead) {
        self->velocity_integral = 0.0; // nothing to control with
        return 0.0;
    }
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
    case sim_control_velocity:
        torque = velocity_control(self, command->velocity, velocity, c->torque_feedforward * command->torque);
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

/// Falsifies what the encoder says; see enum sim_encoder.
static void disturb_encoder(struct sim_belt_drive *self, struct sim_sample *io_sample)
{
    switch (self->encoder) {
    case sim_encoder_good:
        self->encoder_onset = io_sample->position;
        break;
    case sim_encoder_stuck:
        io_sample->position = self->encoder_onset;
        io_sample->velocity = 0.0;
        break;
    case sim_encoder_reversed:
        io_sample->position = 2.0 * self->encoder_onset - io_sample->position;
        io_sample->velocity = -io_sample->velocity;
        break;
    case sim_encoder_dead:
        io_sample->position = io_sample->velocity = NAN;
        break;
    }
}

static void sense(struct sim_belt_drive *self, const struct noise *noise, struct sim_sample *out_sample)
{
    const struct sim_model *model = self->model;
    struct sim_motion motion = {.position = self->plant.position,
                                .velocity = self->plant.velocity,
                                .time_s = self->plant.time_s,
                                .linear = model->linear};
    struct sim_sensed sensed;
    sim_stepper_sense(&self->stepper, &motion, &sensed);
    out_sample->position = quantised(model, sensed.position + noise->position);
    out_sample->velocity = filtered_velocity(self, sensed.velocity + noise->velocity);
    out_sample->load_position = quantised(model, self->plant.load_position + noise->load_position);
    disturb_encoder(self, out_sample);
}

/// Rows that the recording lost repeat the one before, but for the reference.
static void lose_rows(struct sim_belt_drive *self, struct sim_sample *io_sample)
{
    bool lost = false;
    for (size_t i = 0; i < self->stepper.lose.count; i++) {
        size_t e = self->stepper.lose.effects[i];
        double uniform = sim_random_uniform(self->record_random);
        lost = sim_effects[e]->lose(self->model->effect_parameters[e], uniform) || lost;
    }
    if (lost && self->has_last) {
        double torque_ref = io_sample->torque_ref;
        *io_sample = self->last;
        io_sample->torque_ref = torque_ref;
    }
    self->last = *io_sample;
    self->has_last = true;
}

void sim_belt_drive_step(struct sim_belt_drive *self, const struct sim_command *command, struct sim_sample *out_sample)
{
    const struct sim_model *model = self->model;
    struct noise noise = draw_noise(self);
    prepare(self);
    sense(self, &noise, out_sample);
    out_sample->torque_ref = control(self, command, out_sample->position, out_sample->velocity);
    sim_actuator_hold(&self->actuator, out_sample->torque_ref);
    out_sample->torque = sim_actuator_now(&self->actuator, &self->stepper) + noise.torque;
    for (size_t i = 0; i < sim_substeps; i++) {
        sim_plant_drive(&self->plant, &self->stepper, &self->actuator, i, noise.process);
        if (model->has_end_stops)
            hold_at_end_stops(self);
    }
    lose_rows(self, out_sample);
}
