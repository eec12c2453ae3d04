/* SPDX-License-Identifier: MIT */
/* A CiA 402 drive on a CAN bus outside of the program, in real time. */
#include "drivers/can/cia402_master.h"
#include "ports/real_time.h"
#include "tools/servoscope/can_bus.h"
#include "tools/servoscope/door_parts.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/// Where other work may come in between, the drive waits this long for a SYNC, and the program this long for samples.
static const double patience_s = 0.05;

/// Master and bus in one piece. The master is first: a pointer to it is a pointer to this.
struct remote_drive {
    struct cia402_master master;
    struct drive_operations operations; ///< the master's, but for open and close
    enum drive_status (*open)(void *self, const struct drive_configuration *configuration);
    void (*close)(void *self);
    struct can_bus bus;
    struct real_time rights;
    double sync_timeout_s; ///< asked for; 0: by the rights
};

static enum drive_status open_remote(void *object, const struct drive_configuration *configuration)
{
    struct remote_drive *self = object;
    real_time_enter(&self->rights);
    const double patient_s = self->sync_timeout_s > 0.0 ? self->sync_timeout_s : self->rights.fifo ? 0.0 : patience_s;
    self->master.options.sync_timeout_us = (uint32_t)(1e6 * patient_s);
    self->master.options.reply_patience_us = self->master.options.sync_timeout_us / 4;
    if (patient_s > 0.0) {
        double samples = ceil(patient_s * configuration->sample_rate_hz);
        self->master.options.lost_in_a_row = (uint16_t)fmin(fmax(samples, self->master.options.lost_in_a_row), 10000.0);
    }
    enum drive_status status = self->open(object, configuration);
    // What came while it was set up is not the measurement's.
    bus_watch_start(can_bus_watch(&self->bus), self->master.period_us,
                    (uint16_t)(0x280 + self->master.options.node_id));
    return status;
}

static void close_remote(void *object)
{
    struct remote_drive *self = object;
    self->close(object);
    real_time_leave(&self->rights);
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

static int open_bus(const struct door_scheme *scheme, const char *rest, struct door *out_door, struct error *out_error)
{
    struct door_query query;
    char name[sizeof query.address + 8];
    int status = door_read_query(scheme, rest, &query, out_error);
    if (status) {
        return status;
    }
    struct cia402_master_options options = cia402_master_defaults();
    options.profile = query.profile[0] == '\0' ? NULL : cia402_profile_find(query.profile);
    if (query.profile[0] != '\0' && !options.profile) {
        return refuse_profile(query.profile, out_error);
    }
    struct remote_drive *self = calloc(1, sizeof *self);
    if (!self) {
        return error_set(out_error, error_refused, "out of memory");
    }
    options.node_id = (uint8_t)query.node;
    options.bitrate = (uint32_t)query.bitrate;
    snprintf(name, sizeof name, "%s%s", scheme == &door_slcan ? scheme->prefix : "", query.address);
    status = can_bus_open(&self->bus, name, "--drive", can_bus_master, options.node_id, options.bitrate, out_error);
    if (status) {
        free(self);
        return status;
    }
    const struct can_port port = can_bus_port(&self->bus);
    self->sync_timeout_s = 1e-3 * (double)query.sync_timeout_ms;
    cia402_master_init(&self->master, &port, &options);
    self->operations = *cia402_master_drive(&self->master).operations;
    self->open = self->operations.open;
    self->close = self->operations.close;
    self->operations.open = open_remote;
    self->operations.close = close_remote;
    *out_door = (struct door){.drive = {.operations = &self->operations, .self = self},
                              .owner = self,
                              .patience_s = fmax(patience_s, self->sync_timeout_s)};
    return 0;
}

static int open_interface(const char *rest, const struct sim_model *model, struct door *out_door,
                          struct error *out_error)
{
    (void)model;
    return open_bus(&door_can, rest, out_door, out_error);
}

static int open_adapter(const char *rest, const struct sim_model *model, struct door *out_door, struct error *out_error)
{
    (void)model;
    return open_bus(&door_slcan, rest, out_door, out_error);
}

static void read_statistics(const struct door *door, struct door_statistics *out_statistics)
{
    struct remote_drive *self = door->owner;
    const struct cia402_master *master = &self->master;
    const struct can_bus_statistics bus = can_bus_read_statistics(&self->bus);
    const struct bus_watch *watch = can_bus_watch(&self->bus);
    unsigned bits = cia402_master_cycle_bits(master->configuration.mode, master->checked);
    double rate_hz = master->configuration.sample_rate_hz;
    *out_statistics = (struct door_statistics){
        .bitrate = master->options.bitrate,
        .bus_load = bits * rate_hz / master->options.bitrate,
        .frames = bus.sent + bus.received,
        .setpoints_clipped = master->saturated,
        .in_real_time = true,
        .cycle_bits = bits,
        .rate_hz = rate_hz,
        .syncs_late = watch->syncs_late,
        .frames_unsent = bus.unsent,
        .frames_lost = bus.overflowed,
        .error_frames = bus.error_frames,
        .sync_timeout_us = master->options.sync_timeout_us,
        .spacing = watch->spacing,
        .reply = watch->reply,
    };
    snprintf(out_statistics->rights, sizeof out_statistics->rights, "%s", self->rights.text);
}

static void free_bus(struct door *door)
{
    struct remote_drive *self = door->owner;
    can_bus_close(&self->bus);
    free(self);
}

const struct door_scheme door_can = {
    .prefix = "can:",
    .form = "can:IFACE?node=N",
    .asked = "node bitrate profile sync_timeout_ms",
    .node_default = 5,
    .node_lowest = 1,
    .node_highest = 127,
    .open = open_interface,
    .read_statistics = read_statistics,
    .free = free_bus,
};

const struct door_scheme door_slcan = {
    .prefix = "slcan:",
    .form = "slcan:HOST:PORT?node=N",
    .asked = "node bitrate profile sync_timeout_ms",
    .node_default = 5,
    .node_lowest = 1,
    .node_highest = 127,
    .open = open_adapter,
    .read_statistics = read_statistics,
    .free = free_bus,
};
