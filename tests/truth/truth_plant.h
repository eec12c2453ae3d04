/* SPDX-License-Identifier: MIT */
#ifndef TRUTH_PLANT_H
#define TRUTH_PLANT_H

#include "tests/truth/truth_random.h"

/// The drive that diagnosis is judged against: continuous time, integrated much finer than the control sample, with
/// its own friction law. It shares no code with sim/, and must not: a mistake made in both would never be found.
///
/// Motor:    Jm dv/dt = k(T, t) + w + d(t) + bias + a cos(n th + phase) - G (th - origin) - R - belt
///           k(T, t) = T (1 - c T^2) (1 + m (1 - exp(-t/Tm)))
/// Load:     Jl dvl/dt = belt - third - Fl sign(vl)
///           belt = K (1 + slope th) u (1 + h u^2) + D (v - vl), u = e beyond the half gap on its side; 0 in the gap;
///           e = th - thl; rigid: one body of Jm + Jl
/// Third:    J3 dv3/dt = third = K3 (thl - th3) + D3 (vl - v3)
/// Friction: R = f(t) (1 + asym s) [ B v + q v |v| + s (Fc (1 + g (th - origin)) + Fs exp(-(v/vs)^2) + p |T|) ],
///           s = sign(v), f(t) = 1 + r (1 - exp(-t/Tr)).
///           At v = 0 the body sticks, and v stays exactly 0, while the rest of the torque does not exceed the
///           breakaway torque |R| of the direction it pushes in. Zero crossings and breakaway are located inside the
///           step, so friction never changes sign at the wrong moment.
///           With a presliding distance x0 a bristle z in -1..1 takes the place of s in front of the dry part:
///           Dahl             dz/dt = (v - |v| z) / x0
///           LuGre            the same, with z + Tb dz/dt as the force (Canudas de Wit 1995, no Stribeck part)
///           elasto-plastic   dz/dt = v (1 - alpha z s) / x0, alpha from 0 below zb to 1 (Dupont 2002)
/// Actuator: the reference is clipped and limited in its slope where asked, then delayed (any fraction of a sample) and
///           lagged, both solved exactly; what comes out is clipped, and loses its dead band: T.
/// d(t):     A sin(2 pi f t + phase); a step of bias at a time; bursts of a sinusoid at random times.
/// Noise w:  white torque, four independent values a sample, with a standard deviation of the sample's mean of
///           process_noise_Nm.

enum { TRUTH_PLANT_HISTORY = 32, TRUTH_PLANT_STATES = 8, TRUTH_PLANT_BURSTS = 64 };

enum truth_bristle { truth_bristle_dahl, truth_bristle_lugre, truth_bristle_elastoplastic };

/// All quantities seen from the motor. Zero switches a term off.
struct truth_plant_spec {
    int two_mass;
    double motor_inertia_kgm2, load_inertia_kgm2;
    double belt_stiffness_Nm_per_rad, belt_damping_Nms_per_rad;
    double stiffness_slope_per_rad, stiffness_cubic_per_rad2, gap_rad;
    double third_inertia_kgm2, third_stiffness_Nm_per_rad, third_damping_Nms_per_rad; ///< on the load of two masses
    double viscous_friction_Nms_per_rad, coulomb_friction_Nm;
    double stribeck_excess_Nm, stribeck_velocity_rad_per_s;
    double asymmetry_ratio;
    double presliding_distance_rad, bristle_damping_s, bristle_elastic_share;
    enum truth_bristle bristle;
    double friction_drift_ratio, friction_drift_s;
    double bias_Nm;
    double cogging_amplitude_Nm, cogging_periods_per_rev, cogging_phase_rad;
    double disturbance_amplitude_Nm, disturbance_hz, disturbance_phase_rad;
    double torque_lag_s, dead_time_s;
    double torque_limit_Nm, command_limit_Nm; ///< of what the actuator gives; of what it is asked for
    // Not in the catalogue of causes
    double quadratic_drag_Nms2_per_rad2;
    double coulomb_slope_per_rad, coulomb_origin_rad;
    double torque_saturation_per_Nm2;
    double torque_drift_ratio, torque_drift_s;
    double load_coulomb_Nm; ///< a bristle of TRUTH_LOAD_BRISTLE_RAD stands for sticking
    double friction_per_torque;
    double step_bias_Nm, step_bias_s;
    double burst_amplitude_Nm, burst_hz, burst_length_s, burst_every_s;
    double torque_dead_band_Nm;
    double torque_rate_Nm_per_s;
    double ground_stiffness_Nm_per_rad;
    double process_noise_Nm;
    double sample_s; ///< control period; the dead time is below (TRUTH_PLANT_HISTORY - 2) of it
    double step_s;   ///< longest integration step
};

#define TRUTH_LOAD_BRISTLE_RAD 1e-4

/// Read-only for the caller.
struct truth_plant {
    struct truth_plant_spec spec;
    double position_rad, velocity_rad_per_s;           ///< motor
    double load_position_rad, load_velocity_rad_per_s; ///< equal to the motor's in a rigid drive
    double third_position_rad, third_velocity_rad_per_s;
    double bristle, load_bristle; ///< deflection over its greatest, -1..1
    double time_s;
    int direction;                      ///< +1 or -1 while slipping, 0 while stuck
    double torque_Nm;                   ///< behind dead time and lag; truth_plant_output_Nm is T
    double asked_Nm;                    ///< last reference after clip and slope limit
    double burst_s[TRUTH_PLANT_BURSTS]; ///< where bursts begin
    double noise_Nm;
    double history_Nm[TRUTH_PLANT_HISTORY]; ///< held references, newest first
    struct truth_random random;
};

/// Put the drive at rest at `position_rad`, all references zero. `seed` feeds the process noise only.
void truth_plant_init(struct truth_plant *self, const struct truth_plant_spec *spec, double position_rad,
                      uint64_t seed);
/// Give it motion by hand: motor and load at one speed, belt relaxed.
void truth_plant_launch(struct truth_plant *self, double velocity_rad_per_s);
/// Put the motor alone where it is said to be; all else goes on from where it is. A rigid load goes along.
void truth_plant_place(struct truth_plant *self, double position_rad, double velocity_rad_per_s);
/// Motor torque now, behind everything in the actuator.
double truth_plant_output_Nm(const struct truth_plant *self);
/// Begin to hold `torque_ref_Nm`; torque_Nm is then the actuator's output just after that instant.
void truth_plant_hold(struct truth_plant *self, double torque_ref_Nm);
/// Go on by one control period under what is held.
void truth_plant_advance(struct truth_plant *self);

/// Torque that acts against the motor at (position, velocity) at time zero while slipping in `direction` (+1, -1):
/// friction, minus bias, minus cogging, plus the spring to ground.
double truth_plant_resistance_Nm(const struct truth_plant_spec *spec, double position_rad, double velocity_rad_per_s,
                                 int direction);

#endif
