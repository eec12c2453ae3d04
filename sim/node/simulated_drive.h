/* SPDX-License-Identifier: MIT */
/// The simulated drive on a CAN bus: a CiA 402 servo around sim/belt_drive.h, behaving like a real one, faults
/// included. One SYNC is one plant sample: on SYNC it takes the set-points received before it, samples its sensors at
/// that instant, runs its controllers, sends what it measured with the torque demand that holds from that instant on,
/// and moves the plant by one sample period. Without SYNC it stands still, unless it is under torque or still moving:
/// then it runs on its own period. Its sample rate is what object 60C2 says, at first the model's.
/// Modes: 4 profile torque, 8 CSP (the cascade), 9 CSV, 10 CST; no homing. Set-points written before "enable operation"
/// are forgotten: it holds its position until the first new one, so that an old one is never a jump.
/// What it watches, and what it does then: docs/safety.md.
#ifndef SERVOSCOPE_SIM_NODE_SIMULATED_DRIVE_H
#define SERVOSCOPE_SIM_NODE_SIMULATED_DRIVE_H

#include "drivers/can/canopen_node.h"
#include "drivers/can/cia402.h"
#include "drivers/can/cia402_scaling.h"
#include "sim/belt_drive.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// Values of the profile's objects, in the units of the wire.
struct simulated_drive_objects {
    uint16_t error_code, control_word, status_word;
    int8_t mode, mode_display;
    int32_t position_actual, velocity_actual, following_error_actual;
    uint32_t following_error_window;     ///< 6065: 0 and FFFFFFFF watch nothing
    uint16_t following_error_timeout_ms; ///< 6066
    int16_t target_torque, torque_demand, torque_actual, torque_offset;
    uint16_t max_torque;   ///< 6072, permille
    uint32_t rated_torque; ///< 6076, mNm (mN of a linear drive)
    uint32_t torque_slope; ///< 6087, permille per second, of profile torque
    int32_t target_position, target_velocity, velocity_offset;
    int32_t position_min, position_max; ///< 607D: clips CSP's set-points, stops the other modes
    uint32_t max_velocity;              ///< 607F: clips the set-points' speed, 0 does not
    uint32_t max_motor_speed;           ///< 6080, rpm (mm/s of a linear drive): faster is a fault; FFFFFFFF: never
    uint32_t profile_deceleration;      ///< 6084, 1/1000 rad/s2 (m/s2), of the slow-down ramp
    uint32_t quick_stop_deceleration;   ///< 6085, likewise, of the quick-stop ramp
    uint32_t increments, revolutions;   ///< 608F
    uint32_t unit_position, unit_velocity, unit_acceleration;
    uint8_t period_units;   ///< 60C2:1
    int8_t period_exponent; ///< 60C2:2
    uint32_t supported_modes;
    uint32_t saturated;       ///< 2000:1 values that did not fit their object and were clipped
    uint16_t blocked_torque;  ///< 2004:1, permille: no count of motion under at least this
    uint16_t blocked_time_ms; ///< 2004:2, for longer than this is a fault; 0: never
};

/// What can be made to go wrong in a drive; what goes wrong on its way is the bus's (ports/inproc.h).
enum simulated_fault_kind {
    simulated_fault_encoder_stuck,
    simulated_fault_encoder_reversed,
    simulated_fault_encoder_dead, ///< it delivers no number
    simulated_fault_heartbeat_stops,
    simulated_fault_reset,       ///< restarts, as after a gap in its supply
    simulated_fault_sync_missed, ///< SYNC does not reach it
    simulated_fault_silent,      ///< hears, controls, and sends nothing
    simulated_fault_kinds,
};

struct simulated_fault {
    enum simulated_fault_kind kind;
    uint32_t sync;  ///< begins with this SYNC in operation enabled, counted from 1 since init
    uint32_t count; ///< for so many SYNCs; 0: for ever. Of no meaning for heartbeat_stops (for ever) and reset (once)
};

enum { simulated_replies_max = 8 };

/// Read-only for the application.
struct simulated_drive {
    struct canopen_node node;
    struct can_port port;   ///< of the bus; the node sends through `delayed`
    struct sim_model model; ///< own copy: the sample rate is the bus's
    struct sim_belt_drive drive;
    struct cia402_machine machine;
    struct cia402_scaling scaling;
    struct simulated_drive_objects objects;
    bool period_valid;          ///< 60C2 says a period that the model can run at
    bool own_cycle;             ///< SYNC is missing: runs on its own period until at rest without torque
    uint64_t next_us;           ///< of the own cycle
    uint32_t stopping_samples;  ///< since the ramp of a stop has reached standstill
    bool ramping;               ///< the last sample was one of a stop
    bool stood_still;           ///< and it has ended in standstill
    double stop_speed;          ///< measured when the stop began
    uint32_t following_samples; ///< that the following error has been outside its window
    uint32_t blocked_samples;   ///< that nothing has moved under torque
    int32_t last_position;      ///< position_actual of the sample before
    int32_t followed_position;  ///< last set-point that took effect, after the speed limit
    double profile_torque;      ///< of profile torque, on its slope
    bool limited;               ///< a set-point was clipped in this sample
    bool follows;               ///< the last sample used the set-points of its SYNC
    struct sim_command command; ///< what the last sample was controlled with
    struct sim_sample sample;   ///< what the last sample measured
    uint32_t samples;           ///< taken since init

    double period_tolerance; ///< mean SYNC period against 60C2, relative; 0.25 after init, infinity does not look
    struct {
        uint64_t since_us;
        uint32_t periods, missed;
        bool wrong;
    } period; ///< of the SYNCs seen, against 60C2

    const struct simulated_fault *faults;
    size_t fault_count;
    uint32_t operating_syncs; ///< SYNCs seen in operation enabled
    uint32_t injected[simulated_fault_kinds];
    bool silent;

    double clock_rate; ///< of its own clock against the bus's: 1 plus its drift
    uint32_t latch_us, reply_us;
    bool holding; ///< a SYNC whose latch instant has not come
    struct can_frame held;
    uint64_t held_due_us;
    size_t reply_count;
    struct {
        struct can_frame frame;
        uint64_t due_us;
    } replies[simulated_replies_max]; ///< TPDOs on their way out, oldest first
    uint32_t commands_refused;        ///< SDO downloads from others than the one who streams set-points
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

/// Sets the plan of faults, which must outlive self.
void simulated_drive_set_faults(struct simulated_drive *self, const struct simulated_fault *faults, size_t count);

/// Sets how long after SYNC it samples and takes set-points over, and how long after that its TPDOs go out. 0 after
/// init.
void simulated_drive_set_delays(struct simulated_drive *self, uint32_t latch_us, uint32_t reply_us);

/// Sets by how much its own clock is fast, in parts per million: it drives time-outs, heartbeats, the own cycle and
/// the look at 60C2; samples stay locked to SYNC. Before the bus runs.
/// Range: -900000 .. 900000
void simulated_drive_set_drift(struct simulated_drive *self, double drift_ppm);

#endif
