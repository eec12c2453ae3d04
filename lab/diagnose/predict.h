/* SPDX-License-Identifier: MIT */
/// The simulation's one-step prediction of a recording: where diagnosis meets the model, and the only place where it
/// does.
#ifndef SERVOSCOPE_DIAGNOSE_PREDICT_H
#define SERVOSCOPE_DIAGNOSE_PREDICT_H

#include "lab/diagnose/recording.h"
#include "sim/model.h"

/// Sets the simulated motor to the measured position and speed at every sampling instant and lets the simulator run to
/// the next one, under the torque that the model's actuator makes of the recorded reference (or under the measured
/// torque where no reference was recorded). Friction, sticking and whatever effects are on act between the instants as
/// in any simulation; only the load, which was not measured, keeps its state.
/// Equation:  mechanics[n] = J f_s (v_measured[n+1] - v_predicted[n+1]),   J = scale_inertia
///            actuator[n]  = torque_measured[n] - torque_predicted[n]
/// Shapes:    out arrays hold stretch->samples values; out_actuator may be NULL; it is zero without a reference
/// Units:     Nm, or N on a linear axis: torque that the model lacks (mechanics) or makes too little of (actuator)
/// Range:     cyclic: the stretch is one period and is run through until the hidden state repeats; otherwise the last
///            mechanics value is 0
void predict(const struct sim_model *model, const struct stretch *stretch, bool cyclic, double scale_inertia,
             double *out_mechanics, double *out_actuator);

/// What is left of the contradiction between speed column and position column after the model's sensors have explained
/// their part.
/// Equation:  out[n] = kinematics[n] - (v_said - v - d(th_said - th)/dt),   kinematics: speed column - d(position)/dt
/// Shapes:    stretch->samples values; stretch->kinematics must be there
/// Units:     rad/s or m/s
void predict_kinematics(const struct sim_model *model, const struct stretch *stretch, double *out_kinematics);

/// Whether a model has a limit on what its actuator makes.
bool predict_limits(const struct sim_model *model);

/// What the limits on the actuator add to predict()'s residuals, to first order: cheap, and enough to say what the mean
/// of periods that were clipped one by one has over the clipped mean of the periods.
/// Range:     a stretch with a reference
/// Shapes:    stretch->samples each
void predict_limited(const struct sim_model *model, const struct stretch *stretch, bool cyclic, double scale_inertia,
                     double *out_mechanics, double *out_actuator);

#endif
