/* SPDX-License-Identifier: MIT */
/// The simulated drive: plant, actuator, cascade of position, velocity and torque control, sensors. One call is one
/// sample. No clock: time is the number of calls. Same model and seed, same run, bit for bit.
#ifndef SERVOSCOPE_SIM_BELT_DRIVE_H
#define SERVOSCOPE_SIM_BELT_DRIVE_H

#include "sim/model.h"
#include "sim/plant.h"

#include <stdbool.h>
#include <stdint.h>

enum sim_control {
    sim_control_off,      ///< no torque
    sim_control_cascade,  ///< position reference, velocity and torque feed-forward
    sim_control_torque,   ///< torque reference
    sim_control_stop,     ///< velocity control to standstill: quick stop
    sim_control_velocity, ///< velocity reference, torque feed-forward
};

/// What is wrong with the motor's encoder. It acts where the signal is made: the controllers see it too.
enum sim_encoder {
    sim_encoder_good,
    sim_encoder_stuck,    ///< the position at the onset for ever, no speed
    sim_encoder_reversed, ///< counts backwards from the onset on
    sim_encoder_dead,     ///< delivers no number; the drive then gives no torque
};

struct sim_command {
    enum sim_control control;
    double position; ///< rad or m
    double velocity; ///< rad/s or m/s
    double torque;   ///< Nm or N
};

struct sim_sample {
    double torque_ref;    ///< asked for from this sample on
    double torque;        ///< measured motor torque at the sampling instant
    double position;      ///< measured
    double velocity;      ///< measured
    double load_position; ///< measured at the load, by an encoder of its own; rigid: of the motor's position
};

struct sim_belt_drive {
    const struct sim_model *model;
    struct sim_stepper stepper; ///< of the model as it was when a sample last began
    struct sim_plant plant;
    struct sim_actuator actuator;
    uint64_t random[4];
    uint64_t record_random[4]; ///< what befalls the record has numbers of its own: noise stays the same
    struct sim_sample last;    ///< what was recorded last
    bool has_last;
    double velocity_integral; ///< of the velocity controller, Nm
    double velocity_filtered; ///< state of the speed signal's filter
    double stop_velocity;     ///< set-point of the quick-stop ramp
    double torque_limit;      ///< clips the reference; infinity if there is none
    double stop_deceleration; ///< of the quick-stop ramp, rad/s2 or m/s2
    bool hit_end_stop;        ///< sticky
    enum sim_encoder encoder; ///< may be set between two samples
    double encoder_onset;     ///< position when it last was good
};

/// Puts the drive at rest at `position`. `model` must outlive it.
void sim_belt_drive_init(struct sim_belt_drive *self, const struct sim_model *model, double position);

/// Samples the sensors, runs the controllers on them, then moves the plant to the next sampling instant.
void sim_belt_drive_step(struct sim_belt_drive *self, const struct sim_command *command, struct sim_sample *out_sample);

#endif
