/* SPDX-License-Identifier: MIT */
/// The door to an ODrive on a CAN port: drivers/drive.h over its CAN Simple protocol. Nothing in that protocol ties a
/// reply to a set-point or to a common instant, so:
///   - if the drive sends encoder estimates at the table's rate by itself (its encoder and torque message rates), they
///     are the clock: one exchange sends a set-point and takes the next pair of messages;
///   - if it sends none, they are asked for by remote frames at the table's rate.
/// Either way torque_ref_Nm is the target that the drive says it follows, which shows a lost set-point for what it is.
/// A sample is valid if estimates and torques, in this order and once each, came within half a period of when they were
/// due; asked for, within 0.8 of a period after that.
/// For three samples after one that was lost, the missing reply may still come and look like a new one: then a sample
/// is judged at the end of its time only, and one reply too many makes it invalid. A reply later than that passes.
/// Modes: torque (input torque), cascade (input position with velocity and torque feed-forward, the latter two in
/// thousandths of rev/s and Nm: what does not fit is clipped and counted).
/// Test: tests/api/test_odrive.c
#ifndef SERVOSCOPE_DRIVERS_CAN_ODRIVE_MASTER_H
#define SERVOSCOPE_DRIVERS_CAN_ODRIVE_MASTER_H

#include "drivers/can/can_port.h"
#include "drivers/can/odrive_message.h"
#include "drivers/drive.h"

#include <stdbool.h>
#include <stdint.h>

struct odrive_master_options {
    uint8_t node_id;                 ///< 0 .. odrive_node_max
    uint32_t bitrate;                ///< of the bus, for the load
    double torque_constant_Nm_per_A; ///< 0: not known; then torque mode only, with torques in Nm (firmware 0.6)
    uint32_t answer_timeout_us;      ///< for one answer
    uint32_t arm_timeout_us;         ///< for the way to closed loop
    double stop_time_s;              ///< the speed is ramped down over this time
    uint16_t lost_in_a_row;          ///< samples; one more ends the measurement
};

/// Node 0, 1 Mbit/s, unknown torque constant, 200 ms, 2 s, 0.2 s, 5 samples.
struct odrive_master_options odrive_master_defaults(void);

/// Share of the bus that this door plans with at most.
#define ODRIVE_BUS_LOAD_LIMIT 0.7

/// Bits on the wire of one exchange at worst.
unsigned odrive_master_cycle_bits(enum drive_mode mode, bool polled);

struct odrive_master {
    struct odrive_master_options options;
    struct can_port port;
    struct drive_configuration configuration;
    struct drive_counters counters;
    uint32_t saturated;     ///< set-points that were clipped
    enum can_status status; ///< sticky: bus off or gone
    bool opened, armed;
    bool polled;      ///< the drive sends no estimates by itself
    bool has_torques; ///< Get_Torques is answered; else Get_Iq is used
    uint32_t period_us;
    uint64_t due_us; ///< when the next sample is due
    double zero_rev; ///< position at arm
    struct odrive_status drive;
    uint32_t heartbeats;
    uint64_t heartbeat_us;                     ///< when the last one came
    uint64_t estimates_us;                     ///< when they came last
    uint64_t window_us;                        ///< messages from this time on belong to the sample that is due
    unsigned window_estimates, window_torques; ///< such messages; more than one of a kind is one too many
    struct can_frame last_estimates, last_torques;
    unsigned doubtful;                     ///< samples from which on a reply that is missing cannot come any more
    uint32_t estimates, torques, currents; ///< how many have come
    double position_rev, velocity_rev_per_s, torque_ref_Nm, torque_Nm;
    uint32_t missing_in_a_row;
    char detail[240];
};

/// Prepares the door; nothing is sent.
/// Lifetime: the port's object must outlive self, and self must not move.
void odrive_master_init(struct odrive_master *self, const struct can_port *port,
                        const struct odrive_master_options *options);

/// The door as everybody else sees it.
/// stop: velocity control down a ramp of stop_time_s, then idle; an emergency stop if the drive does not say idle.
struct drive odrive_master_drive(struct odrive_master *self);

#endif
