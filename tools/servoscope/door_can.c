/* SPDX-License-Identifier: MIT */
/* A CiA 402 drive on a CAN bus outside of the program, in real time. */
#include "drivers/can/cia402_master.h"
#include "tools/servoscope/door_bus.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/// Master and bus in one piece. The master is first: a pointer to it is a pointer to this.
struct remote_drive {
    struct cia402_master master;
    struct door_bus remote;
    double sync_timeout_s; ///< asked for; 0: by the rights
};

/// Where other work may come in between, the drive waits longer for a SYNC, and the program as long for samples.
static enum drive_status open_remote(void *object, const struct drive_configuration *configuration)
{
    struct remote_drive *self = object;
    struct cia402_master_options *options = &self->master.options;
    real_time_enter(&self->remote.rights);
    const double patient_s = self->sync_timeout_s > 0.0 ? self->sync_timeout_s
                             : self->remote.rights.fifo ? 0.0
                                                        : door_bus_patience_s;
    options->sync_timeout_us = (uint32_t)(1e6 * patient_s);
    options->reply_patience_us = options->sync_timeout_us / 4;
    if (patient_s > 0.0) {
        options->lost_in_a_row =
            door_bus_lost_in_a_row(patient_s, configuration->sample_rate_hz, options->lost_in_a_row);
    }
    enum drive_status status = self->remote.open(object, configuration);
    // What came while it was set up is not the measurement's.
    bus_watch_start(can_bus_watch(&self->remote.bus), self->master.period_us, (uint16_t)(0x280 + options->node_id));
    return status;
}

static void close_remote(void *object)
{
    struct remote_drive *self = object;
    self->remote.close(object);
    real_time_leave(&self->remote.rights);
}

static int refuse_profile(const char *name, struct error *out_error)
{
    char names[200] = "";
    for (size_t i = 0; cia402_profiles[i]; i++) {
        size_t used = strlen(names);
        snprintf(&names[used], sizeof names - used, "%s%s", i == 0 ? "" : ", ", cia402_profiles[i]->name);
    }
    return error_set(out_error, error_usage, "--drive: profile=%s: expected one of %s", name, names);
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
    struct cia402_master_options options = cia402_master_defaults();
    options.node_id = (uint8_t)query.node;
    options.bitrate = (uint32_t)query.bitrate;
    options.profile = query.profile[0] == '\0' ? NULL : cia402_profile_find(query.profile);
    if (query.profile[0] != '\0' && !options.profile) {
        return refuse_profile(query.profile, out_error);
    }
    struct remote_drive *self = calloc(1, sizeof *self);
    if (!self) {
        return error_set(out_error, error_refused, "out of memory");
    }
    status = door_bus_open(&self->remote, scheme, &query, options.node_id, out_error);
    if (status) {
        free(self);
        return status;
    }
    const struct can_port port = can_bus_port(&self->remote.bus);
    self->sync_timeout_s = 1e-3 * (double)query.sync_timeout_ms;
    cia402_master_init(&self->master, &port, &options);
    const struct drive master = cia402_master_drive(&self->master);
    *out_door = (struct door){.owner = self, .patience_s = fmax(door_bus_patience_s, self->sync_timeout_s)};
    door_bus_wrap(&self->remote, &master, open_remote, close_remote, &out_door->drive);
    return 0;
}

static void read_statistics(const struct door *door, struct door_statistics *out_statistics)
{
    struct remote_drive *self = door->owner;
    const struct cia402_master *master = &self->master;
    const struct bus_watch *watch = can_bus_watch(&self->remote.bus);
    door_bus_count(&self->remote, cia402_master_cycle_bits(master->configuration.mode, master->checked),
                   master->configuration.sample_rate_hz, master->options.bitrate, out_statistics);
    out_statistics->setpoints_clipped = master->saturated;
    out_statistics->syncs_late = watch->syncs_late;
    out_statistics->sync_timeout_us = master->options.sync_timeout_us;
    out_statistics->spacing = watch->spacing;
    out_statistics->reply = watch->reply;
}

static void free_door(struct door *door)
{
    struct remote_drive *self = door->owner;
    can_bus_close(&self->remote.bus);
    free(self);
}

const struct door_scheme door_can = {
    .prefix = "can:",
    .bus = "",
    .form = "can:IFACE?node=N",
    .asked = "node bitrate profile sync_timeout_ms",
    .node_default = 5,
    .node_lowest = 1,
    .node_highest = 127,
    .open = open_door,
    .read_statistics = read_statistics,
    .free = free_door,
};

const struct door_scheme door_slcan = {
    .prefix = "slcan:",
    .bus = "slcan:",
    .form = "slcan:HOST:PORT?node=N",
    .asked = "node bitrate profile sync_timeout_ms",
    .node_default = 5,
    .node_lowest = 1,
    .node_highest = 127,
    .open = open_door,
    .read_statistics = read_statistics,
    .free = free_door,
};
