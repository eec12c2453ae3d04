/* SPDX-License-Identifier: MIT */
/// A drive and what moves it as one linear system that is sampled once per sample of the table.
///     x[n+1] = A x[n] + B u[n],   u = (position reference, velocity reference, torque reference), held over the sample
/// It is sim_belt_drive without noise, dry friction, effects and limits: two masses (or one), viscous friction, torque
/// lag, dead time, and in cascade mode the position and velocity controllers of the model. The discretisation is exact,
/// parts of a sample of dead time included.
#ifndef SERVOSCOPE_DESIGN_LOOP_H
#define SERVOSCOPE_DESIGN_LOOP_H

#include "sim/model.h"

#include <stddef.h>

enum design_loop_mode {
    design_loop_cascade, ///< position controller with velocity and torque feed-forward
    design_loop_torque,  ///< the torque alone; the position is no state then, nothing depends on it
};

enum {
    design_loop_inputs = 3,
    design_loop_plant_states = 5,
    design_loop_dead_samples_max = 62,
    design_loop_states_max = design_loop_plant_states + 2 + design_loop_dead_samples_max,
};

enum design_loop_status {
    design_loop_ok,
    design_loop_unstable,  ///< what is there grows from sample to sample
    design_loop_dead_time, ///< more than design_loop_dead_samples_max samples
    design_loop_memory,
};

/// Matrices are stored column after column. State 0 is the motor's velocity.
struct design_loop {
    size_t states;
    double *transition; ///< A, states x states
    double *input;      ///< B, states x design_loop_inputs
    /// States of the drive at rest per unit of each input, states x design_loop_inputs: in cascade mode motor and load
    /// stand where the position reference is.
    double *rest;
    double *hessenberg;  ///< H = U' A U, zero below the first subdiagonal
    double *basis;       ///< U, orthogonal
    double *eigenvalues; ///< of A, states complex numbers
    double growth;       ///< largest |eigenvalue|
};

/// Builds the system for references that change every 1 / rate_hz; the model's own sample rate is not looked at.
/// `model` has to pass sim_model_check(). An unstable system is built all the same, so that `growth` can be told.
/// Errors: see the enumeration; nothing is held after design_loop_dead_time and design_loop_memory
/// Test:   tests/unit/test_design_start.c
enum design_loop_status design_loop_create(const struct sim_model *model, double rate_hz, enum design_loop_mode mode,
                                           struct design_loop *out_loop);
void design_loop_free(struct design_loop *loop);

/// Finite-horizon Gramian of the motor's velocity: sum over `samples` of (row 0 of A^n)' (row 0 of A^n), so that x' Q x
/// is the energy that a state x leaves in it.
/// Shapes: out_gramian: states x states
/// Errors: false if memory is short
bool design_loop_gramian(const struct design_loop *self, size_t samples, double *out_gramian);

/// Steady state under u[n] = Re(amplitudes exp(j angle n)): x[n] = Re(X exp(j angle n)), X = (exp(j angle) I - A)^-1 B
/// amplitudes.
/// Shapes: amplitudes: design_loop_inputs complex numbers; scratch: states (states + 1) complex numbers;
///         out_state: states complex numbers
/// Errors: false if there is none: an undamped resonance lies at this angle (nearer than 1e-9 to it); out_state is
///         undefined then
/// Cost:   about 4 states^2 complex multiplications
bool design_loop_steady_state(const struct design_loop *self, double angle_rad, const double *amplitudes,
                              double *scratch, double *out_state);

#endif
