/* SPDX-License-Identifier: MIT */
/// Exact motion of a chain of masses over one step: the matrix exponential.
#ifndef SERVOSCOPE_SIM_TRANSITION_H
#define SERVOSCOPE_SIM_TRANSITION_H

#include "sim/stepper.h"

/// Transition of the chain over dt_s with viscous friction on the motor, or with the motor held.
/// Equation: exp([A B; 0 0] dt) by scaling and squaring of its Taylor series (Higham 2008, ch. 10), A of docs/theory.md
///           F16
/// Range:    rate is a bound on the fastest mode, rad/s, or 0; the relative error is below 1e-13
/// Test:     tests/unit/test_effect_physics.c
void sim_transition_init(struct sim_transition *self, const struct sim_chain *chain, double viscous, bool held,
                         double rate, double dt_s);

#endif
