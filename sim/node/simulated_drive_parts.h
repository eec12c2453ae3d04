/* SPDX-License-Identifier: MIT */
/// How the simulated drive's files share their work. Internal to sim/node.
#ifndef SERVOSCOPE_SIM_NODE_SIMULATED_DRIVE_PARTS_H
#define SERVOSCOPE_SIM_NODE_SIMULATED_DRIVE_PARTS_H

#include "sim/node/simulated_drive.h"

/// Whether a fault leaves something to brake with.
enum simulated_reaction {
    simulated_reaction_by_option, ///< 605E
    simulated_reaction_coast,     ///< the encoder is not to be trusted: no torque at once
};

/// Goes to fault with a code, in objects and on the bus. A second fault changes nothing, but for torque off.
void simulated_drive_detect(struct simulated_drive *self, uint16_t code, uint8_t register_bits,
                            enum simulated_reaction reaction);

/// Makes object 6041 from the state and the last sample.
void simulated_drive_update_status(struct simulated_drive *self);

/// Objects at their power-on values; the scaling is there.
void simulated_drive_set_defaults(struct simulated_drive *self);

/// Takes one sample and does what follows from it.
void simulated_drive_take_sample(struct simulated_drive *self, bool targets_fresh);

/// Objects and masks of the profile for canopen_node_init.
extern const struct od_entry simulated_drive_entries[];
extern const size_t simulated_drive_entry_count;

/// Whether the motor turns, as far as it is measured.
bool simulated_drive_is_moving(const struct simulated_drive *self);

uint32_t simulated_drive_period_us(const struct simulated_drive *self);

#endif
