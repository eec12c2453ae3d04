/* SPDX-License-Identifier: MIT */
/* An ODrive, spoken to in its CAN Simple protocol, on a CAN bus outside of the program. */
#include "drivers/can/odrive_master.h"
#include "tools/servoscope/door_bus.h"

#include <stdlib.h>

/// Master and bus in one piece. The master is first: a pointer to it is a pointer to this.
struct remote_odrive {
    struct odrive_master master;
    struct door_bus remote;
};

/// It has no SYNC to trip on; only the program waits longer where other work may come in between.
static enum drive_status open_remote(void *object, const struct drive_configuration *configuration)
{
    struct remote_odrive *self = object;
    struct odrive_master_options *options = &self->master.options;
    real_time_enter(&self->remote.rights);
    if (!self->remote.rights.fifo) {
        options->lost_in_a_row =
            door_bus_lost_in_a_row(door_bus_patience_s, configuration->sample_rate_hz, options->lost_in_a_row);
    }
    return self->remote.open(object, configuration);
}

static void close_remote(void *object)
{
    struct remote_odrive *self = object;
    self->remote.close(object);
    real_time_leave(&self->remote.rights);
}

static int open_door(const struct door_scheme *scheme, const char *rest, const struct sim_model *model,
                     struct door *out_door, struct error *out_error)
{
    struct door_query query;
    (void)model;
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
    // Its identifiers are not CANopen's: all frames are listened to.
    status = door_bus_open(&self->remote, scheme, &query, 0, out_error);
    if (status) {
        free(self);
        return status;
    }
    const struct can_port port = can_bus_port(&self->remote.bus);
    odrive_master_init(&self->master, &port, &options);
    const struct drive master = odrive_master_drive(&self->master);
    *out_door = (struct door){.owner = self, .patience_s = door_bus_patience_s};
    door_bus_wrap(&self->remote, &master, open_remote, close_remote, &out_door->drive);
    return 0;
}

static void read_statistics(const struct door *door, struct door_statistics *out_statistics)
{
    const struct remote_odrive *self = door->owner;
    const struct odrive_master *master = &self->master;
    door_bus_count(&self->remote, odrive_master_cycle_bits(master->configuration.mode, master->polled),
                   master->configuration.sample_rate_hz, master->options.bitrate, out_statistics);
    out_statistics->setpoints_clipped = master->saturated;
}

static void free_door(struct door *door)
{
    struct remote_odrive *self = door->owner;
    can_bus_close(&self->remote.bus);
    free(self);
}

const struct door_scheme door_odrive = {
    .prefix = "odrive:",
    .bus = "",
    .form = "odrive:IFACE?node=N",
    .asked = "node bitrate kt",
    .node_default = 0,
    .node_lowest = 0,
    .node_highest = odrive_node_max,
    .open = open_door,
    .read_statistics = read_statistics,
    .free = free_door,
};

const struct door_scheme door_odrive_slcan = {
    .prefix = "odrive-slcan:",
    .bus = "slcan:",
    .form = "odrive-slcan:HOST:PORT?node=N",
    .asked = "node bitrate kt",
    .node_default = 0,
    .node_lowest = 0,
    .node_highest = odrive_node_max,
    .open = open_door,
    .read_statistics = read_statistics,
    .free = free_door,
};
