/* SPDX-License-Identifier: MIT */
/// The simulated drive behind ODrive's CAN Simple protocol: a small one, to prove that drivers/drive.h is a door and
/// not CANopen. It runs on its own period, as the real one does on its own crystal: every tick it samples its sensors,
/// controls on the last set-point received, and sends estimates and torques if it is asked to do so by itself.
/// Watchdog: closed loop without a set-point for 100 ms, estimates that are no numbers, and an emergency stop lead to
///           an
/// error without torque, which stays until errors are cleared.
#ifndef SERVOSCOPE_SIM_NODE_ODRIVE_NODE_H
#define SERVOSCOPE_SIM_NODE_ODRIVE_NODE_H

#include "drivers/can/can_port.h"
#include "drivers/can/odrive_message.h"
#include "sim/belt_drive.h"

#include <stdbool.h>
#include <stdint.h>

enum { odrive_node_watchdog_us = 100000 };

struct odrive_node_options {
    uint8_t node_id;
    double torque_constant_Nm_per_A;
    bool cyclic;        ///< sends estimates and torques every tick by itself
    bool has_torques;   ///< answers Get_Torques (firmware 0.6); else Get_Iq alone
    double clock_ratio; ///< its seconds per second; 1 is exact
};

struct odrive_node {
    struct odrive_node_options options;
    struct can_port port; ///< only `send` is used
    struct sim_model model;
    struct sim_belt_drive drive;
    struct odrive_status status;
    uint32_t control_mode;
    double input_position_rev, input_velocity_rev_per_s, input_torque_Nm;
    double speed_limit_rev_per_s;
    double period_us; ///< of a tick, by the bus's clock
    double tick_us;   ///< of the next one
    uint64_t heartbeat_us, input_us;
    struct sim_sample sample; ///< of the last tick
    uint32_t ticks, frames_unsent, requests_refused;
};

/// Node 0, 0.05 Nm/A, cyclic, with torques, an exact clock.
struct odrive_node_options odrive_node_defaults(void);

/// Makes the drive at rest and idle.
/// Range:    model rotary, clock_ratio 0.9 .. 1.1; false otherwise
/// Lifetime: self must not move
bool odrive_node_init(struct odrive_node *self, const struct sim_model *model,
                      const struct odrive_node_options *options, const struct can_port *port);

/// How a bus calls it.
struct can_participant odrive_node_participant(struct odrive_node *self);

#endif
