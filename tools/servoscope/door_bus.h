/* SPDX-License-Identifier: MIT */
/// What doors to drives on a CAN bus outside of the program share: the bus itself, real-time rights while the drive is
/// open, and what is counted on the way. Internal to the doors.
#ifndef SERVOSCOPE_TOOLS_DOOR_BUS_H
#define SERVOSCOPE_TOOLS_DOOR_BUS_H

#include "ports/real_time.h"
#include "tools/servoscope/can_bus.h"
#include "tools/servoscope/door_parts.h"

/// How long a program without real-time rights may be held up by other work, in s.
extern const double door_bus_patience_s;

/// A bus and a master's operations, two of which do more here.
struct door_bus {
    struct can_bus bus;
    struct real_time rights;
    struct drive_operations operations; ///< the master's, but for open and close
    enum drive_status (*open)(void *self, const struct drive_configuration *configuration); ///< the master's own
    void (*close)(void *self);
};

/// Opens the bus that a URL asks for; `listened`: the one node that is listened to, 0 all.
/// Errors: error_usage, error_refused; nothing to close then
int door_bus_open(struct door_bus *self, const struct door_scheme *scheme, const struct door_query *query,
                  uint8_t listened, struct error *out_error);

/// Takes a master's operations over, with `open` and `close` in place of two of them, and makes the door's drive of
/// them. `master` is what the operations work on.
void door_bus_wrap(struct door_bus *self, const struct drive *master,
                   enum drive_status (*open)(void *self, const struct drive_configuration *configuration),
                   void (*close)(void *self), struct drive *out_drive);

/// Samples that may be missing in a row: those of `patience_s`, at least `least`.
uint16_t door_bus_lost_in_a_row(double patience_s, double rate_hz, uint16_t least);

/// Fills in what does not depend on the protocol; `cycle_bits` on the wire at worst.
void door_bus_count(const struct door_bus *self, unsigned cycle_bits, double rate_hz, uint32_t bitrate,
                    struct door_statistics *out_statistics);

#endif
