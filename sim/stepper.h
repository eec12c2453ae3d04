/* SPDX-License-Identifier: MIT */
/// A model made ready for many steps of one width: which effects act where is looked up once, and what is the same at
/// every step is computed once. A stepper is plain data: it may be copied.
#ifndef SERVOSCOPE_SIM_STEPPER_H
#define SERVOSCOPE_SIM_STEPPER_H

#include "sim/model.h"

#include <stdbool.h>
#include <stddef.h>

enum { sim_substeps = 4, sim_masses_max = 3 };

/// The drive as a chain of masses: motor (or the one body), load, attached mass.
struct sim_chain {
    size_t masses;
    double inertia[sim_masses_max];
    double stiffness[sim_masses_max - 1]; ///< between each mass and the next
    double damping[sim_masses_max - 1];
};

/// The chain's motion over one step under a constant torque, exact while friction keeps its direction. Positions count
/// from where the motor was. Rows: position and speed of each mass; columns: the same without the motor's position.
struct sim_transition {
    double state[2 * sim_masses_max][2 * sim_masses_max - 1];
    double input[2 * sim_masses_max]; ///< per Nm on the motor
};

/// One piece of a substep during which the delayed reference is constant.
struct sim_actuator_part {
    size_t ago;       ///< how many references ago this one began to hold
    double samples;   ///< how long
    double approach;  ///< share of the way to it that the lag goes meanwhile
    double fading[3]; ///< of what the lag has to go: the integrals over it of 1, (end - t), (end - t)^2 / 2
};

/// Indices in sim_effects of the effects that are on and have one of the hooks.
struct sim_hooked {
    size_t count;
    size_t effects[sim_effects_max];
};

struct sim_stepper {
    struct sim_model model;
    double dt_s;
    struct sim_chain chain;
    double chain_rate;  ///< rad/s, bound on the fastest mode
    size_t inner_steps; ///< that Runge-Kutta needs for it
    double build_up;    ///< distance over which dry friction builds up; 0: it switches
    double build_up_exponent;
    double build_up_damping_s;  ///< of the bristles: what it adds, over the rate at which the friction changes
    struct sim_opposing steady; ///< the model's friction and the effects that are the same at every instant
    struct sim_hooked oppose;   ///< the others
    struct sim_hooked bend, limit, sense, lose;
    bool quick;                           ///< for looks ahead from measured states: sim_stepper_init_quick
    bool split;                           ///< `transitions` move the linear parts, the rest acts as it is half way
    bool exact;                           ///< and there is no rest but constant dry friction
    bool one_way;                         ///< and friction does not ask for the direction of motion
    struct sim_transition transitions[3]; ///< motor moves backward, sticks, moves forward
    struct sim_actuator_part parts[sim_substeps][2];
    size_t part_count[sim_substeps];
    size_t now_ago;     ///< the reference that is the torque at a sampling instant, without lag
    double lag_samples; ///< 0: none
};

/// Makes a model ready for steps of dt_s.
/// Range:  dt_s > 0; a valid model (sim_model_check)
/// Cost:   about as much as a hundred steps
void sim_stepper_init(struct sim_stepper *self, const struct sim_model *model, double dt_s);

/// The same for many short looks ahead from measured states: effects on the motor that are not linear are taken at each
/// step as they are half way through it, the linear parts exactly. A third of the work; every friction and ripple
/// together were off by 1e-4 Nm of 0.5 Nm. Friction that builds up counts so, too, where it changes little over a step;
/// where it does not, steps are as fine as its torque asks for. A belt that is not linear is integrated as ever.
void sim_stepper_init_quick(struct sim_stepper *self, const struct sim_model *model, double dt_s);

/// The same without what only pays over many steps: every step is integrated numerically.
void sim_stepper_init_once(struct sim_stepper *self, const struct sim_model *model, double dt_s);

/// Steps in dt_s that keep the Runge-Kutta error of a mode of this rate (rad/s) below 1e-5 of its swing.
size_t sim_stepper_inner_steps(double rate, double dt_s);

/// What the motor's sensors say, without noise.
void sim_stepper_sense(const struct sim_stepper *self, const struct sim_motion *motion, struct sim_sensed *out_sensed);

/// The motion for which the sensors say what they say: sim_stepper_sense backward. io_motion brings the time.
void sim_stepper_unsense(const struct sim_stepper *self, const struct sim_sensed *sensed, struct sim_motion *io_motion);

#endif
