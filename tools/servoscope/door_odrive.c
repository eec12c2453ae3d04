/* SPDX-License-Identifier: MIT */
/* An ODrive, spoken to in its CAN Simple protocol, on a CAN bus outside of the program. */
#include "drivers/can/odrive_master.h"
#include "ports/real_time.h"
#include "tools/servoscope/can_bus.h"
#include "tools/servoscope/door_parts.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/// It has no SYNC to trip on; a machine with other work gets this long between two samples.
static const double patience_s = 0.05;

/// Master and bus in one piece. The master is first: a pointer to it is a pointer to this.
struct remote_odrive {
    struct odrive_master master;
    struct drive_operations operations; ///< the master's, but for open and close
    enum drive_status (*open)(void *self, const struct drive_configuration *configuration);
    void (*close)(void *self);
    struct can_bus bus;
    struct real_time rights;
};

static enum drive_status open_remote(void *object, const struct drive_configuration *configuration)
{
    struct remote_odrive *self = object;
    real_time_enter(&self->rights);
    if (!self->rights.fifo) {
        double samples = ceil(patience_s * configuration->sample_rate_hz);
        self->master.options.lost_in_a_row = (uint16_t)fmin(fmax(samples, self->master.options.lost_in_a_row), 10000.0);
    }
    return self->open(object, configuration);
}

static void close_remote(void *object)
{
    struct remote_odrive *self = object;
    self->close(object);
    real_time_leave(&self->rights);
}

static int open_bus(const struct door_scheme *scheme, const char *rest, struct door *out_door, struct error *out_error)
{
    struct door_query query;
    char name[sizeof query.address + 8];
    int status = door_read_query(scheme, rest, &query, out_error);
    if (status) {
        return status;
    }
    struct remote_odrive *self = calloc(1, sizeof *self);
    if (!self) {
        return error_set(out_error, error_refused, "out of memory");
    }
    struct odrive_master_options options = odrive_master_defaults();
    options.node_id = (uint8_t)query.node;
    options.bitrate = (uint32_t)query.bitrate;
    options.torque_constant_Nm_per_A = query.torque_constant_Nm_per_A;
    snprintf(name, sizeof name, "%s%s", scheme == &door_odrive_slcan ? "slcan:" : "", query.address);
    // Its identifiers are not CANopen's: all frames are listened to.
    status = can_bus_open(&self->bus, name, "--drive", can_bus_master, 0, options.bitrate, out_error);
    if (status) {
        free(self);
        return status;
    }
    const struct can_port port = can_bus_port(&self->bus);
    odrive_master_init(&self->master, &port, &options);
    self->operations = *odrive_master_drive(&self->master).operations;
    self->open = self->operations.open;
    self->close = self->operations.close;
    self->operations.open = open_remote;
    self->operations.close = close_remote;
    *out_door = (struct door){
        .drive = {.operations = &self->operations, .self = self}, .owner = self, .patience_s = patience_s};
    return 0;
}

static int open_interface(const char *rest, const struct sim_model *model, struct door *out_door,
                          struct error *out_error)
{
    (void)model;
    return open_bus(&door_odrive, rest, out_door, out_error);
}

static int open_adapter(const char *rest, const struct sim_model *model, struct door *out_door, struct error *out_error)
{
    (void)model;
    return open_bus(&door_odrive_slcan, rest, out_door, out_error);
}

static void read_statistics(const struct door *door, struct door_statistics *out_statistics)
{
    const struct remote_odrive *self = door->owner;
    const struct odrive_master *master = &self->master;
    const struct can_bus_statistics bus = can_bus_read_statistics(&self->bus);
    unsigned bits = odrive_master_cycle_bits(master->configuration.mode, master->polled);
    *out_statistics = (struct door_statistics){
        .bitrate = master->options.bitrate,
        .bus_load = bits * master->configuration.sample_rate_hz / master->options.bitrate,
        .frames = bus.sent + bus.received,
        .setpoints_clipped = master->saturated,
        .in_real_time = true,
        .cycle_bits = bits,
        .rate_hz = master->configuration.sample_rate_hz,
        .frames_unsent = bus.unsent,
        .frames_lost = bus.overflowed,
        .error_frames = bus.error_frames,
    };
    snprintf(out_statistics->rights, sizeof out_statistics->rights, "%s", self->rights.text);
}

static void free_bus(struct door *door)
{
    struct remote_odrive *self = door->owner;
    can_bus_close(&self->bus);
    free(self);
}

const struct door_scheme door_odrive = {
    .prefix = "odrive:",
    .form = "odrive:IFACE?node=N",
    .asked = "node bitrate kt",
    .node_default = 0,
    .node_lowest = 0,
    .node_highest = odrive_node_max,
    .open = open_interface,
    .read_statistics = read_statistics,
    .free = free_bus,
};

const struct door_scheme door_odrive_slcan = {
    .prefix = "odrive-slcan:",
    .form = "odrive-slcan:HOST:PORT?node=N",
    .asked = "node bitrate kt",
    .node_default = 0,
    .node_lowest = 0,
    .node_highest = odrive_node_max,
    .open = open_adapter,
    .read_statistics = read_statistics,
    .free = free_bus,
};
