/* SPDX-License-Identifier: MIT */
/// The plant in continuous time, moved over one substep of constant torque, and the actuator in front of it.
/// Friction sticks: at rest under less than breakaway torque the motor's speed is exactly zero, unless the model has
/// friction that builds up (presliding).
#ifndef SERVOSCOPE_SIM_PLANT_H
#define SERVOSCOPE_SIM_PLANT_H

#include "sim/model.h"
#include "sim/stepper.h"

#include <stddef.h>

enum { sim_actuator_history = 64 };

struct sim_plant {
    double position, velocity;                   ///< motor
    double load_position, load_velocity;         ///< of a two-mass drive; copies of the motor's for a rigid one
    double attached_position, attached_velocity; ///< of the mass that an effect hangs on the load
    double bristle;                              ///< dry friction now, Nm against the motor, where it has to build up
    double time_s;
};

/// Torque over one step. Where a reference begins to act within it, or lags, the motor is not where a constant torque
/// would have taken it: next to nothing for the motor, but a load near its antiresonance swings with that. Shifts
/// by `before` ahead of the step and by `after` behind it, times T^2 / J, leave it there and pull the belt as much.
/// Equation:  before = I2 / T^3, before + after = I1 / T^2,  I1 = integral (T - t)(torque - mean) dt,
///            I2 = integral (T - t)^2 / 2 (torque - mean) dt over a step of length T
struct sim_torque {
    double mean, before, after; ///< Nm
};

/// Torque command to torque: dead time (fractions of a sample too), first-order lag, limit.
struct sim_actuator {
    double held[sim_actuator_history]; ///< the last references, newest at `newest`
    size_t newest;
    double torque;          ///< state of the lag, Nm
    struct sim_torque last; ///< over the last substep
};

/// At rest, everything in one place, friction unloaded.
void sim_plant_init(struct sim_plant *self, double position);

/// Moves the plant by the stepper's dt_s under a motor torque that is constant meanwhile. Exact where the drive is
/// linear but for dry friction; else fourth-order Runge-Kutta with as many inner steps as belt, attached mass and
/// friction need. Instants at which the motor comes to rest are located, so are those at which a belt goes slack or
/// tight.
void sim_plant_move(struct sim_plant *self, const struct sim_stepper *stepper, double torque);

/// The same under a torque that changes meanwhile.
void sim_plant_move_under(struct sim_plant *self, const struct sim_stepper *stepper, const struct sim_torque *torque);

/// Moves over substep `index` of a sample under what the actuator makes, and `torque` beside it that is constant.
void sim_plant_drive(struct sim_plant *self, const struct sim_stepper *stepper, struct sim_actuator *actuator,
                     size_t index, double torque);

/// The same for a single step of any width.
void sim_plant_step(struct sim_plant *self, const struct sim_model *model, double torque, double dt_s);

void sim_actuator_init(struct sim_actuator *self);

/// Takes the reference that holds from this sampling instant on.
void sim_actuator_hold(struct sim_actuator *self, double torque_ref);

/// The motor torque at the sampling instant just begun (after sim_actuator_hold).
double sim_actuator_now(const struct sim_actuator *self, const struct sim_stepper *stepper);

/// Mean motor torque over substep `index` (0 .. sim_substeps-1) of the current sample; moves the lag's state to its
/// end. Limits act on what comes out of the lag.
double sim_actuator_substep(struct sim_actuator *self, const struct sim_stepper *stepper, size_t index);

/// What the motor has to overcome at an instant, summed over the model and its effects.
void sim_plant_opposing(const struct sim_model *model, const struct sim_motion *motion,
                        struct sim_opposing *out_opposing);

#endif
