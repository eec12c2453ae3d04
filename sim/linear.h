/* SPDX-License-Identifier: MIT */
/// The linear part of a model in the frequency domain: masses, belt and viscous friction, in continuous time. Dry
/// friction, effects, sensors and controllers are not in it. Units are the model's (m and N on a linear axis).
///     Z (v_m, v_l)' = (torque, 0)',   Z = [ j w J_m + B + D   -D ;   -D   j w J_l + D ],   D = d + k / (j w)
/// A rigid model is one mass J_m + J_l with viscous friction B.
#ifndef SERVOSCOPE_SIM_LINEAR_H
#define SERVOSCOPE_SIM_LINEAR_H

#include "sim/model.h"

#include <complex.h>
#include <stddef.h>

/// Speeds per motor torque at one frequency.
struct sim_linear_response {
    double complex motor_velocity;
    double complex load_velocity; ///< rigid: the motor's
};

/// Parameters that motor_velocity depends on, in this order; a rigid model has the first two.
enum sim_linear_parameter {
    sim_linear_inertia, ///< the motor's; rigid: all of it
    sim_linear_viscous_friction,
    sim_linear_load_inertia,
    sim_linear_belt_stiffness,
    sim_linear_belt_damping,
    sim_linear_parameters_max,
};

/// Response from motor torque to speeds.
/// Range:  omega_rad_per_s > 0; not finite exactly at an undamped resonance
/// Test:   tests/unit/test_linear.c
void sim_linear_response(const struct sim_model *model, double omega_rad_per_s, struct sim_linear_response *out);

/// Torque per torque reference: exp(-j w dead time) / (1 + j w lag). The hold between samples is not in it.
double complex sim_linear_actuator(const struct sim_model *model, double omega_rad_per_s);

/// Derivatives of motor_velocity, each per unit of its parameter, by the exact formula -v' (dZ / dparameter) v.
/// Returns how many there are: 2 for a rigid model, else sim_linear_parameters_max.
size_t sim_linear_sensitivities(const struct sim_model *model, double omega_rad_per_s,
                                double complex out_sensitivities[sim_linear_parameters_max]);

#endif
