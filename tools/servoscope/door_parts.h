/* SPDX-License-Identifier: MIT */
/// What stands behind door.c: one entry of its table for each kind of drive. Internal to the doors.
#ifndef SERVOSCOPE_TOOLS_DOOR_PARTS_H
#define SERVOSCOPE_TOOLS_DOOR_PARTS_H

#include "tools/servoscope/door.h"

#include <stdbool.h>
#include <stddef.h>

/// The door to one kind of drive.
struct door_scheme {
    const char *prefix;                           ///< "can:"
    const char *bus;                              ///< what can_bus_open wants in front of the address; NULL: no CAN
    const char *form;                             ///< how a whole URL looks, for messages
    const char *asked;                            ///< names that may stand behind its '?', separated by blanks
    long node_default, node_lowest, node_highest; ///< of door_read_query
    /// Makes the door of what follows the prefix. `model` as door_open has it.
    int (*open)(const struct door_scheme *self, const char *rest, const struct sim_model *model, struct door *out_door,
                struct error *out_error);
    /// NULL: there is nothing to count but what drive->counters has.
    void (*read_statistics)(const struct door *self, struct door_statistics *out_statistics);
    /// Frees what is behind the door; the drive is closed before.
    void (*free)(struct door *self);
};

extern const struct door_scheme door_simulated;    ///< sim:
extern const struct door_scheme door_can;          ///< can:
extern const struct door_scheme door_slcan;        ///< slcan:
extern const struct door_scheme door_odrive;       ///< odrive: on an interface
extern const struct door_scheme door_odrive_slcan; ///< odrive-slcan:

/// What stands behind the `?` of a URL; 0 and empty are what was not said.
struct door_query {
    char address[256]; ///< what stands before it
    long node;
    long bitrate;
    long sync_timeout_ms;
    double torque_constant_Nm_per_A;
    char profile[32];
};

/// Takes a URL behind its prefix apart: ADDRESS?node=N&bitrate=B&sync_timeout_ms=T&profile=P&kt=K.
/// Errors: error_usage: an unknown name, a number out of range (node: the scheme's, bitrate 10000..1000000), no address
int door_read_query(const struct door_scheme *scheme, const char *rest, struct door_query *out_query,
                    struct error *out_error);

#endif
