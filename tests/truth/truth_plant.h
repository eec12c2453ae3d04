/* SPDX-License-Identifier: MIT */
#ifndef TRUTH_PLANT_H
#define TRUTH_PLANT_H

#include "tests/truth/truth_random.h"

/// The drive that diagnosis is judged against: continuous time, integrated much finer than the control sample, with
/// its own friction law. It shares no code with sim/, and must not: a mistake made in both would never be found.
///
/// Motor:    Jm dv/dt = k(T) + w + bias + a cos(n th + phase) - R(th, v) - belt,   k(T) = T (1 - c T^2)
/// Load:     Jl dvl/dt = belt,   belt = K (th - thl) + D (v - vl);   rigid: one body of Jm + Jl
/// Friction: R = (1 + asym s) [ B v + q v |v| + s Fc (1 + g (th - origin)) + s Fs exp(-(v/vs)^2) ],  s = sign(v).
///           At v = 0 the body sticks, and v stays exactly 0, while the rest of the torque does not exceed the
///           breakaway torque |R| of the direction it pushes in. Zero crossings and breakaway are located inside the
///           step, so friction never changes sign at the wrong moment.
/// Actuator: T follows torque_ref through a dead time (any fraction of a sample) and then a first-order lag, both
///           solved exactly.
/// Noise w:  white torque, four independent values a sample, with a standard deviation of the sample's mean of
///           process_noise_Nm.

enum { TRUTH_PLANT_HISTORY = 32 };

/// All quantities seen from the motor. Zero switches a term off.
struct truth_plant_spec {
    int two_mass;
    double motor_inertia_kgm2, load_inertia_kgm2;
    double belt_stiffness_Nm_per_rad, belt_damping_Nms_per_rad;
    double viscous_friction_Nms_per_rad, coulomb_friction_Nm;
    double stribeck_excess_Nm, stribeck_velocity_rad_per_s;
    double asymmetry_ratio;
    double bias_Nm;
    double cogging_amplitude_Nm, cogging_periods_per_rev, cogging_phase_rad;
    double quadratic_drag_Nms2_per_rad2;
    double coulomb_slope_per_rad, coulomb_origin_rad;
    double torque_saturation_per_Nm2;
    double torque_lag_s, dead_time_s;
    double process_noise_Nm;
    double sample_s; ///< control period; the dead time is below (TRUTH_PLANT_HISTORY - 2) of it
    double step_s;   ///< longest integration step
};

/// Read-only for the caller.
struct truth_plant {
    struct truth_plant_spec spec;
    double position_rad, velocity_rad_per_s;           ///< motor
    double load_position_rad, load_velocity_rad_per_s; ///< equal to the motor's in a rigid drive
    int direction;                                     ///< +1 or -1 while slipping, 0 while stuck
    double torque_Nm;                                  ///< behind dead time and lag
    double noise_Nm;
    double history_Nm[TRUTH_PLANT_HISTORY]; ///< held references, newest first
    struct truth_random random;
};

/// Put the drive at rest at `position_rad`, all references zero. `seed` feeds the process noise only.
void truth_plant_init(struct truth_plant *self, const struct truth_plant_spec *spec, double position_rad,
                      uint64_t seed);
/// Give it motion by hand: motor and load at one speed, belt relaxed.
void truth_plant_launch(struct truth_plant *self, double velocity_rad_per_s);
/// Begin to hold `torque_ref_Nm`; torque_Nm is then the actuator's output just after that instant.
void truth_plant_hold(struct truth_plant *self, double torque_ref_Nm);
/// Go on by one control period under what is held.
void truth_plant_advance(struct truth_plant *self);

/// Torque that acts against the motor at (position, velocity) while slipping in `direction` (+1, -1): friction, minus
/// bias, minus cogging.
double truth_plant_resistance_Nm(const struct truth_plant_spec *spec, double position_rad, double velocity_rad_per_s,
                                 int direction);

#endif
