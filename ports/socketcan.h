/* SPDX-License-Identifier: MIT */
/// A CAN interface of this machine (can0, vcan0, ...) through Linux' raw sockets, as a struct can_port.
/// Only frames with 11-bit identifiers pass. The watch sees each with the kernel's time stamp. A port that listens to
/// one node gets its own SYNC back when it has left, for the watch alone: that is when it really went out.
#ifndef SERVOSCOPE_PORTS_SOCKETCAN_H
#define SERVOSCOPE_PORTS_SOCKETCAN_H

#include "drivers/can/can_port.h"
#include "ports/bus_watch.h"
#include "ports/wall_clock.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { socketcan_batch_max = 16 }; ///< frames that one call to the kernel fetches

/// Since the port was opened.
struct socketcan_counters {
    uint32_t sent, received;
    uint32_t unsent;       ///< refused: the interface's queue was full, or the bus off or gone
    uint32_t overflowed;   ///< frames that the kernel dropped because nobody took them (SO_RXQ_OVFL)
    uint32_t error_frames; ///< of the controller: bus errors, warnings, lost arbitration
    uint32_t bus_offs, restarts;
};

/// Read-only for the application, but for `watch`, which it may start.
struct socketcan {
    int socket; ///< -1: closed
    enum can_status status;
    struct wall_clock clock;
    uint64_t woken_us; ///< end of the last wait: frames taken since have come before, or a little later
    struct bus_watch watch;
    size_t waiting_first, waiting_count;
    struct can_frame waiting[socketcan_batch_max];
    bool drained; ///< the last batch was short: there was no more
    struct socketcan_counters counters;
};

/// Opens `interface`. `node_id` 1..127: only frames of that node (and SYNC) are received, 0: all of them.
/// Errors: false, with one line in out_reason: no such interface, not CAN, down, no rights. Nothing to close then.
bool socketcan_open(struct socketcan *self, const char *interface, uint8_t node_id, char *out_reason, size_t size);

/// The port; self must not move while it is used.
struct can_port socketcan_port(struct socketcan *self);

/// Harmless twice.
void socketcan_close(struct socketcan *self);

#endif
