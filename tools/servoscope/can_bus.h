/* SPDX-License-Identifier: MIT */
/// The CAN buses that the program reaches outside of itself, by name, from either end.
///   IFACE             a CAN interface of this machine
///   slcan:HOST:PORT   slcan over TCP: the master connects to an adapter, the drive is one and listens
///   slcan:/PATH       slcan over a serial line: the master opens the device, the drive makes a pty and PATH a link to
///   it
///   slcan-connect:HOST:PORT, slcan-connect:/PATH   the drive behind somebody else's adapter
#ifndef SERVOSCOPE_TOOLS_CAN_BUS_H
#define SERVOSCOPE_TOOLS_CAN_BUS_H

#include "lab/record/error.h"
#include "ports/slcan.h"
#include "ports/socketcan.h"

#include <stdbool.h>
#include <stdint.h>

enum can_bus_side { can_bus_master, can_bus_drive };

/// Read-only for the application. Too large for a stack.
struct can_bus {
    bool is_slcan;
    struct socketcan socketcan;
    struct slcan slcan;
};

/// Frames and losses, whatever the bus is.
struct can_bus_statistics {
    uint32_t sent, received;
    uint32_t unsent;
    uint32_t overflowed;   ///< received frames that were lost for want of room
    uint32_t error_frames; ///< of the controller; slcan: malformed lines
    uint32_t bus_offs;
    uint32_t clients, turned_away; ///< of a listening side
};

/// Opens a bus. `name` is as above; `option` is what the command line calls it, for messages. `node_id`: of the one
/// node that a master listens to. `bitrate` is set at slcan adapters; an interface has its own.
/// Errors: error_usage (no name of a bus), error_refused; nothing to close then
int can_bus_open(struct can_bus *self, const char *name, const char *option, enum can_bus_side side, uint8_t node_id,
                 uint32_t bitrate, struct error *out_error);

/// The port; self must not move while it is used.
struct can_port can_bus_port(struct can_bus *self);

struct bus_watch *can_bus_watch(struct can_bus *self);

struct can_bus_statistics can_bus_read_statistics(const struct can_bus *self);

/// One line: where others find this bus ("slcan at 127.0.0.1:29536").
void can_bus_describe(const struct can_bus *self, const char *name, char *out_text, size_t size);

void can_bus_close(struct can_bus *self);

#endif
