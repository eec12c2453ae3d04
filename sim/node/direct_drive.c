/* SPDX-License-Identifier: MIT */
#include "sim/node/direct_drive.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const double stop_time_s = 2.0;
/// Rates that differ by less than this share are the same fraction, written differently.
static const double same_rate = 1e-9;

static enum drive_status fail(struct direct_drive *self, enum drive_status status, const char *text, double value)
{
    snprintf(self->detail, sizeof self->detail, "%s %.9g", text, value);
    return status;
}

static enum drive_status open_drive(void *object, const struct drive_configuration *configuration)
{
    struct direct_drive *self = object;
    double rate_hz = self->model->sample_rate_hz;
    if (!(fabs(configuration->sample_rate_hz - rate_hz) <= same_rate * rate_hz)) {
        snprintf(self->detail, sizeof self->detail, "the model's sample_rate_hz is %.9g, the table's rate %.9g Hz",
                 rate_hz, configuration->sample_rate_hz);
        return drive_err_argument;
    }
    self->configuration = *configuration;
    if (configuration->torque_limit_Nm > 0.0) {
        self->drive.torque_limit = configuration->torque_limit_Nm;
    }
    return drive_ok;
}

static enum drive_status arm(void *object)
{
    struct direct_drive *self = object;
    self->origin = self->drive.plant.position;
    self->armed = true;
    return drive_ok;
}

static enum drive_status check(struct direct_drive *self, const struct drive_setpoint *setpoint,
                               const struct drive_sample *sample)
{
    double following_error = fabs(setpoint->position_rad - sample->position_rad);
    if (!isfinite(sample->position_rad) || !isfinite(sample->velocity_rad_per_s) || !isfinite(sample->torque_Nm)) {
        return fail(self, drive_err_fault, "the simulation has left all bounds: position", sample->position_rad);
    }
    if (self->drive.hit_end_stop) {
        return fail(self, drive_err_fault, "the axis hit an end stop at position", self->drive.plant.position);
    }
    if (self->configuration.mode == drive_mode_cascade && self->configuration.following_error_rad > 0.0 &&
        !(following_error <= self->configuration.following_error_rad)) {
        return fail(self, drive_err_fault, "following error", following_error);
    }
    return drive_ok;
}

static enum drive_status exchange(void *object, const struct drive_setpoint *setpoint, struct drive_sample *out_sample)
{
    struct direct_drive *self = object;
    if (!self->armed) {
        snprintf(self->detail, sizeof self->detail, "a set-point came before arm");
        return drive_err_refused;
    }
    bool cascade = self->configuration.mode == drive_mode_cascade;
    struct sim_command command = {
        .control = cascade ? sim_control_cascade : sim_control_torque,
        .position = self->origin + setpoint->position_rad,
        .velocity = setpoint->velocity_rad_per_s,
        .torque = setpoint->torque_Nm,
    };
    struct sim_sample sample;
    sim_belt_drive_step(&self->drive, &command, &sample);
    *out_sample = (struct drive_sample){
        .torque_ref_Nm = sample.torque_ref,
        .torque_Nm = sample.torque,
        .position_rad = sample.position - self->origin,
        .velocity_rad_per_s = sample.velocity,
        .valid = true,
    };
    return check(self, setpoint, out_sample);
}

static enum drive_status stop(void *object)
{
    struct direct_drive *self = object;
    struct sim_command command = {.control = sim_control_stop};
    struct sim_sample sample;
    for (double n = 0.0; self->armed && n < stop_time_s * self->model->sample_rate_hz; n += 1.0) {
        sim_belt_drive_step(&self->drive, &command, &sample);
    }
    command.control = sim_control_off;
    sim_belt_drive_step(&self->drive, &command, &sample);
    self->armed = false;
    return drive_ok;
}

static void close_drive(void *object)
{
    (void)object;
}

static const struct drive_counters *counters(const void *object)
{
    const struct direct_drive *self = object;
    return &self->counters;
}

static const char *detail(const void *object)
{
    const struct direct_drive *self = object;
    return self->detail;
}

struct drive direct_drive_init(struct direct_drive *self, const struct sim_model *model)
{
    static const struct drive_operations operations = {open_drive, arm, exchange, stop, close_drive, counters, detail};
    memset(self, 0, sizeof *self);
    self->model = model;
    sim_belt_drive_init(&self->drive, model, 0.0);
    snprintf(self->detail, sizeof self->detail, "simulation");
    return (struct drive){&operations, self};
}
