/* SPDX-License-Identifier: MIT */
/// A port that does harm: hands another port's frames on, both ways, but for those that a plan of faults hits. The
/// faults are those of the bus inside the program (ports/inproc.h), seen from one participant: what it sends and what
/// reaches it. What it cannot do from there: inproc_bus_error (a real bus repeats such a frame by itself).
#ifndef SERVOSCOPE_PORTS_FAULT_PORT_H
#define SERVOSCOPE_PORTS_FAULT_PORT_H

#include "drivers/can/can_port.h"
#include "ports/inproc.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { fault_port_late_max = 32, fault_port_ready_max = 64 };

/// A frame held back: until due_us, or until one more has gone the same way.
struct fault_port_late {
    struct can_frame frame;
    bool outgoing, swapped;
    uint64_t due_us;
};

/// Read-only for the application.
struct fault_port {
    struct can_port base;
    const struct inproc_fault *faults;
    size_t fault_count;
    uint32_t frames; ///< both ways
    uint32_t seen[can_id_max + 1];
    uint32_t injected[inproc_fault_kinds];
    uint32_t undone; ///< faults that found no room
    bool off;
    uint64_t back_us;
    size_t late_count;
    struct fault_port_late late[fault_port_late_max];
    size_t ready_first, ready_count; ///< received frames for the owner, oldest first
    struct can_frame ready[fault_port_ready_max];
};

/// Puts itself before `base`. `faults` must outlive self; positions count the frames that pass here, both ways.
/// The field `endpoint` means nothing here. Errors: false if the plan has a kind that is none here
bool fault_port_init(struct fault_port *self, const struct can_port *base, const struct inproc_fault *faults,
                     size_t count);

/// The port; self must not move while it is used.
struct can_port fault_port_port(struct fault_port *self);

#endif
