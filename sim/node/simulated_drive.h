/* SPDX-License-Identifier: MIT */
/// The simulated drive on a CAN bus: a CiA 402 servo around sim/belt_drive.h, behaving like a real one, faults
/// included. One SYNC is one plant sample: on SYNC it takes the set-points received before it, samples its sensors at
/// that instant, runs its controllers, sends what it measured with the torque demand that holds from that instant on,
/// and moves the plant by one sample period. Without SYNC it stands still, unless it was under torque: then it runs on
/// its own period until the quick stop is done. Its sample rate is what object 60C2 says, at first the model's.
/// States and control: operation enabled in CSP (8) the cascade, in CST (10) torque, halt and quick stop a ramp to
/// standstill, otherwise no torque. Missing SYNC (1.5 periods) or master's heartbeat while enabled: ramp, EMCY, fault.
#ifndef SERVOSCOPE_SIM_NODE_SIMULATED_DRIVE_H
#define SERVOSCOPE_SIM_NODE_SIMULATED_DRIVE_H

#include "drivers/can/canopen_node.h"
#include "drivers/can/cia402.h"
#include "drivers/can/cia402_scaling.h"
#include "sim/belt_drive.h"

#include <stdbool.h>
#include <stdint.h>

/// Values of the profile's objects, in the units of the wire.
struct simulated_drive_objects {
    uint16_t error_code, control_word, status_word;
    int16_t quick_stop_option; ///< 605A: 2 ramp, then switch-on disabled; 6 ramp, then hold
    int8_t mode, mode_display;
    int32_t position_actual, velocity_actual, following_error_actual;
    uint32_t following_error_window;     ///< 6065: 0 and FFFFFFFF watch nothing
    uint16_t following_error_timeout_ms; ///< 6066
    int16_t target_torque, torque_demand, torque_actual, torque_offset;
    uint16_t max_torque;   ///< 6072, permille
    uint32_t rated_torque; ///< 6076, mNm (mN of a linear drive)
    int32_t target_position, velocity_offset;
    uint32_t max_velocity;            ///< 607F: clips the set-points' speed, 0 does not
    uint32_t quick_stop_deceleration; ///< 6085, 1/1000 rad/s2 (m/s2)
    uint32_t increments, revolutions; ///< 608F
    uint32_t unit_position, unit_velocity, unit_acceleration;
    uint8_t period_units;   ///< 60C2:1
    int8_t period_exponent; ///< 60C2:2
    uint32_t supported_modes;
    uint32_t saturated; ///< 2000:1 values that did not fit their object and were clipped
};

struct simulated_drive {
    struct canopen_node node;
    struct sim_model model; ///< own copy: the sample rate is the bus's
    struct sim_belt_drive drive;
    struct cia402_machine machine;
    struct cia402_scaling scaling;
    struct simulated_drive_objects objects;
    bool period_valid;          ///< 60C2 says a period that the model can run at
    bool own_cycle;             ///< SYNC is missing: runs on its own period until without torque
    uint64_t next_us;           ///< of the own cycle
    uint32_t stopping_samples;  ///< since the ramp of a stop has reached standstill
    uint32_t following_samples; ///< that the following error has been outside its window
    int32_t followed_position;  ///< last set-point that took effect, after the speed limit
    bool limited;               ///< a set-point was clipped in this sample
    struct sim_command command; ///< what the last sample was controlled with
    struct sim_sample sample;   ///< what the last sample measured
    uint32_t samples;           ///< taken since init
};

/// Makes the drive at rest at position 0, in its pre-operational state once the bus runs.
/// Units:    increments of model.sensors.counts_per_rev per turn (2^20 if that is 0, no whole number or above 2^24);
///           a linear drive counts 10 nm. Velocity in 1e-6 rad/s (1e-7 m/s). Torque in permille of 6076, which is the
///           torque
///           for 80 rad/s2 (1.3 m/s2) rounded up to 1, 2 or 5 times a power of ten: 500 mNm, so 0.5 mNm per unit and
///           +-16 Nm, for the default model.
/// Lifetime: self must not move; `port` must be bound to it by `simulated_drive_participant`.
void simulated_drive_init(struct simulated_drive *self, const struct sim_model *model, uint8_t node_id,
                          const struct can_port *port);

/// How a bus calls the drive.
struct can_participant simulated_drive_participant(struct simulated_drive *self);

#endif
