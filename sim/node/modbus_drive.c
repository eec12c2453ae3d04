/* SPDX-License-Identifier: MIT */
#include "sim/node/modbus_drive.h"

#include <math.h>
#include <string.h>

/// A table is played at its own rate, if the model can run at it.
static enum core_status prepare(void *object, const struct msgen_table *table, const struct modbus_run_setup *setup)
{
    struct modbus_drive *self = object;
    struct sim_model candidate = self->model;
    char text[160];
    candidate.sample_rate_hz = (double)table->rate_num_hz / (double)table->rate_den;
    if (sim_model_check(&candidate, text, sizeof text) != NULL)
        return core_err_table_rate;
    enum core_status status = self->device.prepare(self->device.self, table, setup);
    if (status == core_ok) {
        self->model.sample_rate_hz = candidate.sample_rate_hz;
        self->drive.torque_limit = setup->torque_limit > 0.0f ? (double)setup->torque_limit : INFINITY;
    }
    return status;
}

static enum core_status arm(void *object)
{
    struct modbus_drive *self = object;
    return self->device.arm(self->device.self);
}

static void start(void *object)
{
    struct modbus_drive *self = object;
    self->device.start(self->device.self);
}

static void stop(void *object)
{
    struct modbus_drive *self = object;
    self->device.stop(self->device.self);
}

static void abort_run(void *object)
{
    struct modbus_drive *self = object;
    self->device.abort(self->device.self);
}

/// A fault that is reset may be an end stop that was hit: the axis stands there, and may be driven away from it.
static void clear(void *object)
{
    struct modbus_drive *self = object;
    self->drive.hit_end_stop = false;
    self->device.clear(self->device.self);
}

static void alive(void *object)
{
    struct modbus_drive *self = object;
    self->device.alive(self->device.self);
}

static void report(const void *object, struct modbus_report *out_report)
{
    const struct modbus_drive *self = object;
    self->device.report(self->device.self, out_report);
}

static uint32_t spectrum(const void *object, uint32_t period, struct modbus_record *out_records, uint32_t *out_count)
{
    const struct modbus_drive *self = object;
    return self->device.spectrum(self->device.self, period, out_records, out_count);
}

static void sample_once(struct modbus_drive *self, const struct sim_command *command)
{
    struct sim_sample sample;
    sim_belt_drive_step(&self->drive, command, &sample);
    const struct table_player_sample measured = {sample.torque_ref, sample.torque, sample.position, sample.velocity,
                                                 true};
    table_player_take(&self->player, &measured);
}

enum core_status modbus_drive_init(struct modbus_drive *self, const struct sim_model *model)
{
    memset(self, 0, sizeof *self);
    self->model = *model;
    sim_belt_drive_init(&self->drive, &self->model, 0.0);
    const struct table_player_storage storage = {
        .samples_max = modbus_drive_samples_max,
        .bins_max = modbus_drive_bins_max,
        .periods_kept = modbus_drive_periods_kept,
        .twiddles = self->twiddles,
        .bins = self->bins,
        .transform = self->transform,
        .pairs = self->pairs,
        .kept = self->kept,
        .kept_reasons = self->kept_reasons,
    };
    enum core_status status = table_player_init(&self->player, &storage);
    self->device = table_player_device(&self->player);
    const struct modbus_map_config config = {
        .device = {self, prepare, arm, start, stop, abort_run, clear, alive, report, spectrum},
        .table = self->table,
        .table_bytes = sizeof self->table,
        .snapshot = self->snapshot,
        .bins_max = modbus_drive_bins_max,
        .samples_max = modbus_drive_samples_max,
        .periods_kept = modbus_drive_periods_kept,
        .linear = model->linear,
    };
    return status == core_ok ? modbus_map_init(&self->map, &config) : status;
}

static struct sim_command command_of(const struct table_player_setpoint *setpoint)
{
    static const enum sim_control controls[] = {
        [table_player_off] = sim_control_off,
        [table_player_cascade] = sim_control_cascade,
        [table_player_torque] = sim_control_torque,
        [table_player_quick_stop] = sim_control_stop,
    };
    const struct sim_command command = {
        .control = controls[setpoint->control],
        .position = setpoint->position,
        .velocity = setpoint->velocity,
        .torque = setpoint->torque,
    };
    return command;
}

void modbus_drive_step(struct modbus_drive *self)
{
    struct table_player_setpoint setpoint;
    bool had_hit = self->drive.hit_end_stop;
    table_player_next(&self->player, &setpoint);
    const struct sim_command command = command_of(&setpoint);
    sample_once(self, &command);
    if (self->drive.hit_end_stop && !had_hit)
        table_player_fail(&self->player, modbus_fault_drive, self->drive.plant.position);
    table_player_collect(&self->player);
}

double modbus_drive_rate_hz(const struct modbus_drive *self)
{
    return self->model.sample_rate_hz;
}
