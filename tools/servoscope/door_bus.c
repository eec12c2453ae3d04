/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/door_bus.h"

#include <math.h>
#include <stdio.h>

const double door_bus_patience_s = 0.05;

int door_bus_open(struct door_bus *self, const struct door_scheme *scheme, const struct door_query *query,
                  uint8_t listened, struct error *out_error)
{
    char name[sizeof query->address + 8];
    snprintf(name, sizeof name, "%s%s", scheme->bus, query->address);
    return can_bus_open(&self->bus, name, "--drive", can_bus_master, listened, (uint32_t)query->bitrate, out_error);
}

void door_bus_wrap(struct door_bus *self, const struct drive *master,
                   enum drive_status (*open)(void *self, const struct drive_configuration *configuration),
                   void (*close)(void *self), struct drive *out_drive)
{
    self->operations = *master->operations;
    self->open = self->operations.open;
    self->close = self->operations.close;
    self->operations.open = open;
    self->operations.close = close;
    *out_drive = (struct drive){.operations = &self->operations, .self = master->self};
}

uint16_t door_bus_lost_in_a_row(double patience_s, double rate_hz, uint16_t least)
{
    const double most = 10000.0;
    return (uint16_t)fmin(fmax(ceil(patience_s * rate_hz), least), most);
}

void door_bus_count(const struct door_bus *self, unsigned cycle_bits, double rate_hz, uint32_t bitrate,
                    struct door_statistics *out_statistics)
{
    const struct can_bus_statistics bus = can_bus_read_statistics(&self->bus);
    *out_statistics = (struct door_statistics){
        .bitrate = bitrate,
        .bus_load = cycle_bits * rate_hz / bitrate,
        .frames = bus.sent + bus.received,
        .in_real_time = true,
        .cycle_bits = cycle_bits,
        .rate_hz = rate_hz,
        .frames_unsent = bus.unsent,
        .frames_lost = bus.overflowed,
        .error_frames = bus.error_frames,
    };
    snprintf(out_statistics->rights, sizeof out_statistics->rights, "%s", self->rights.text);
}
