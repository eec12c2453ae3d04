/* SPDX-License-Identifier: MIT */
/* The simulated drive on a bus inside the program. */
#include "drivers/can/cia402_master.h"
#include "lab/record/model_file.h"
#include "ports/inproc.h"
#include "sim/node/simulated_drive.h"
#include "tools/servoscope/door_parts.h"

#include <stdlib.h>

/// Bus, drive and master in one piece. The master is first: a pointer to it is a pointer to this.
struct virtual_drive {
    struct cia402_master master;
    struct drive_operations operations; ///< the master's, but for open
    enum drive_status (*open)(void *self, const struct drive_configuration *configuration);
    struct inproc_bus bus;
    struct simulated_drive node;
    uint64_t opened_us;
    uint64_t opened_busy_ns;
};

/// Chooses the bus's bit rate for the sample rate asked for, then opens as the master does.
static enum drive_status open_virtual(void *object, const struct drive_configuration *configuration)
{
    struct virtual_drive *self = object;
    const uint32_t slowest = 1000000, fastest = 8000000;
    double needed =
        cia402_master_cycle_bits(configuration->mode, true) * configuration->sample_rate_hz / CIA402_BUS_LOAD_LIMIT;
    self->bus.bitrate = slowest;
    while (self->bus.bitrate < needed && self->bus.bitrate < fastest)
        self->bus.bitrate *= 2;
    self->master.options.bitrate = self->bus.bitrate;
    enum drive_status status = self->open(object, configuration);
    self->opened_us = self->bus.now_ns / 1000;
    self->opened_busy_ns = self->bus.counters.busy_ns;
    return status;
}

static int open_simulator(const struct sim_model *model, struct door *out_door, struct error *out_error)
{
    struct virtual_drive *self = calloc(1, sizeof *self);
    if (!self)
        return error_set(out_error, error_refused, "out of memory");
    struct can_port master_port, node_port;
    const struct cia402_master_options options = cia402_master_defaults();
    inproc_bus_init(&self->bus, options.bitrate, inproc_stuffing_worst);
    inproc_bus_add_port(&self->bus, &master_port);
    int node = inproc_bus_add_participant(&self->bus, &node_port);
    simulated_drive_init(&self->node, model, options.node_id, &node_port);
    const struct can_participant participant = simulated_drive_participant(&self->node);
    inproc_bus_bind(&self->bus, node, &participant);
    cia402_master_init(&self->master, &master_port, &options);
    self->operations = *cia402_master_drive(&self->master).operations;
    self->open = self->operations.open;
    self->operations.open = open_virtual;
    *out_door = (struct door){.drive = {.operations = &self->operations, .self = self}, .owner = self};
    return error_none;
}

static int open_model(const struct door_scheme *scheme, const char *path, const struct sim_model *model,
                      struct door *out_door, struct error *out_error)
{
    (void)scheme;
    if (!model && *path == '\0')
        return error_set(out_error, error_usage, "--drive: 'sim:' needs a model file: sim:MODEL.json");
    struct sim_model read;
    if (!model) {
        int status = model_file_read(path, &read, out_error);
        if (status != error_none)
            return status;
        model = &read;
    }
    char text[200];
    const char *wrong = sim_model_check(model, text, sizeof text);
    if (wrong)
        return error_set(out_error, error_refused, "%s: %s", *path ? path : "model", wrong);
    return open_simulator(model, out_door, out_error);
}

static void read_statistics(const struct door *self, struct door_statistics *out_statistics)
{
    const struct virtual_drive *v = self->owner;
    *out_statistics = (struct door_statistics){
        .bitrate = v->bus.bitrate,
        .bus_load = inproc_bus_load(&v->bus, v->opened_us, v->opened_busy_ns),
        .frames = v->bus.counters.frames,
        .targets_lost = v->node.node.errors.targets_lost + v->node.node.errors.targets_rejected,
        .setpoints_clipped = v->master.saturated,
        .samples_clipped = v->node.objects.saturated,
    };
}

static void free_drive(struct door *self)
{
    free(self->owner);
}

const struct door_scheme door_simulated = {
    .prefix = "sim:",
    .form = "sim:MODEL.json",
    .open = open_model,
    .read_statistics = read_statistics,
    .free = free_drive,
};
