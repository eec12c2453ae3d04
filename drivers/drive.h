/* SPDX-License-Identifier: MIT */
/// The one door to a drive: what a measurement asks of any of them, whatever is behind it.
/// A door is a const table of functions and the object they work on. Nothing here knows a clock or an operating system:
/// a door waits through the port it was given. Calls come from one thread, in the order open, arm, exchange ..., stop,
/// close; stop and close may come at any time after open and are harmless twice.
#ifndef SERVOSCOPE_DRIVERS_DRIVE_H
#define SERVOSCOPE_DRIVERS_DRIVE_H

#include <stdbool.h>
#include <stdint.h>

enum drive_mode {
    drive_mode_cascade, ///< cyclic synchronous position, with velocity and torque feed-forward
    drive_mode_torque,  ///< cyclic synchronous torque, open loop
};

enum drive_status {
    drive_ok = 0,
    drive_err_argument = -1, ///< configuration out of range
    drive_err_timeout = -2,  ///< no answer in time
    drive_err_refused = -3,  ///< the drive refused a parameter or a transition
    drive_err_fault = -4,    ///< the drive is in fault; `detail` has its code
    drive_err_bus = -5,      ///< the bus is off or the port is gone
    drive_err_identity = -6, ///< what answers is not what the profile expects
};

/// What a measurement is about to do; the door checks it against what the drive says of itself.
struct drive_configuration {
    enum drive_mode mode;
    double sample_rate_hz;           ///< set-point and reply rate
    double torque_limit_Nm;          ///< > 0: set in the drive, clipped there
    double velocity_limit_rad_per_s; ///< > 0, 0: leave as it is
    double following_error_rad;      ///< > 0, 0: leave as it is
};

struct drive_setpoint {
    double position_rad;       ///< relative to the position at arm
    double velocity_rad_per_s; ///< feed-forward in cascade mode, unused in torque mode
    double torque_Nm;          ///< feed-forward in cascade mode, the command in torque mode
};

/// What came back with one SYNC. All values belong to the instant of that SYNC; torque_ref_Nm is what the drive's
/// controller asks for from that instant on.
struct drive_sample {
    double torque_ref_Nm;
    double torque_Nm;
    double position_rad; ///< relative to the position at arm
    double velocity_rad_per_s;
    bool valid; ///< false: this sample was lost or stale; the values are the last known ones
};

/// Sticky counters since open; a measurement writes them into the run file.
struct drive_counters {
    uint32_t samples_lost;
    uint32_t samples_late;
    uint32_t frames_unexpected;
    uint32_t emergencies;
    uint16_t last_emergency_code;
};

struct drive_operations {
    /// Finds the drive, checks identity and scaling, configures it, leaves it without torque.
    enum drive_status (*open)(void *self, const struct drive_configuration *configuration);
    /// Brings it under torque at standstill, holding its position.
    enum drive_status (*arm)(void *self);
    /// Sends one set-point, triggers one sample, returns what was measured. drive_ok with sample.valid = false is a
    /// lost sample; any other status means the drive is no longer following and the measurement has to stop.
    enum drive_status (*exchange)(void *self, const struct drive_setpoint *setpoint, struct drive_sample *out_sample);
    /// Ramps to standstill (quick stop) and takes the torque off. Bounded in time.
    enum drive_status (*stop)(void *self);
    void (*close)(void *self);
    const struct drive_counters *(*counters)(const void *self);
    /// One line for a person: what went wrong last, with the drive's own codes. Never NULL.
    const char *(*detail)(const void *self);
};

struct drive {
    const struct drive_operations *operations;
    void *self;
};

const char *drive_status_str(enum drive_status status);

#endif
