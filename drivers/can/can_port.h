/* SPDX-License-Identifier: MIT */
/// What drivers/can asks of a CAN interface, and what a bus that calls back asks of a participant.
/// A port is a const table of functions and the object they work on. It owns the time: drivers read it here and pass
/// times on as arguments. Times are microseconds since the port was made; they never run backwards.
#ifndef SERVOSCOPE_DRIVERS_CAN_PORT_H
#define SERVOSCOPE_DRIVERS_CAN_PORT_H

#include "drivers/can/can_frame.h"

#include <stdbool.h>
#include <stdint.h>

enum can_status {
    can_ok = 0,
    can_err_full = -1,    ///< the send queue has no room; nothing was sent
    can_err_bus_off = -2, ///< the controller is off the bus
    can_err_gone = -3,    ///< the interface is no longer there
};

/// A time that never comes.
#define CAN_NEVER_US UINT64_MAX

struct can_port_operations {
    /// Queues one frame; does not wait. Frames of one identifier keep their order, others may overtake by priority.
    enum can_status (*send)(void *self, const struct can_frame *frame);
    /// Takes the oldest received frame; false if there is none. Does not wait.
    bool (*receive)(void *self, struct can_frame *out_frame);
    /// Waits until a frame can be received or until the time is `until_us`, whichever is first.
    enum can_status (*wait)(void *self, uint64_t until_us);
    uint64_t (*time_us)(const void *self);
};

struct can_port {
    const struct can_port_operations *operations;
    void *self;
};

/// Something that lives on a bus and is called by it: the simulated drive.
struct can_participant {
    void *self;
    /// A frame of somebody else has arrived.
    void (*receive)(void *self, const struct can_frame *frame, uint64_t now_us);
    /// The time of deadline_us has come (or more).
    void (*advance)(void *self, uint64_t now_us);
    /// When advance wants to be called next; CAN_NEVER_US if nothing is pending.
    uint64_t (*deadline_us)(const void *self);
};

#endif
