/* SPDX-License-Identifier: MIT */
#ifndef TRUTH_RUN_H
#define TRUTH_RUN_H

#include <stdio.h>

#include "tests/truth/truth_excitation.h"
#include "tests/truth/truth_plant.h"

/// Position P, velocity PI, with speed and inertia torque fed forward:
/// torque_ref = J a_ref + K [ e + w_i int e ],  e = v_ref + Kp (th_ref - th) - v,  from measured th and v.
struct truth_controller {
    double position_gain_per_s, velocity_gain_Nms_per_rad, integral_rate_per_s, inertia_kgm2;
    int late_samples; ///< 0: the torque computed from sample n is held from n; 1: from n + 1
};

/// What stands between the drive and the file. Standard deviations are of white noise; the encoder rounds to whole
/// counts after its noise, and not at all with 0 counts.
struct truth_sensors {
    double position_rad, velocity_rad_per_s, torque_Nm;
    double counts_per_rev;
    double eccentricity_rad, eccentricity_phase_rad; ///< the angle shows th + a cos(th + phase)
    int speed_from_encoder;                          ///< and the speed its derivative, v (1 - a sin(th + phase))
    double filter_s;                                 ///< first-order lag of angle and speed alike
    double lost_share;                               ///< of rows that repeat the one before; the controller sees all
};

/// Measured columns of a run, and what really moved. Owned by whoever makes it; free with truth_run_free.
struct truth_run {
    int samples, periods; ///< periods: all of them, the transient one included
    double *torque_ref_Nm, *torque_Nm, *position_rad, *velocity_rad_per_s;
    double *true_position_rad, *true_velocity_rad_per_s, *true_torque_Nm;
    int lost; ///< rows that repeat the one before
};

/// Choose gains as high as keeps max |1/(1+L)| of the linear loop (all delays included) below 1.9, at most those asked
/// for: the velocity loop's bandwidth up to 200 rad/s, the position gain up to `position_gain_per_s`.
void truth_controller_tune(struct truth_controller *self, const struct truth_plant_spec *plant,
                           double position_gain_per_s);
/// Play `periods` periods of `excitation` from rest and record. Returns 0, or -1 when memory is short or the motion
/// left the reference by more than 1 rad, which a stable loop never does.
int truth_run_make(struct truth_run *self, const struct truth_plant_spec *plant,
                   const struct truth_controller *controller, const struct truth_sensors *sensors,
                   const struct truth_excitation *excitation, int periods, uint64_t seed);
/// Write the run file. Returns 0, or -1 on a write error.
int truth_run_write(const struct truth_run *self, FILE *file);
void truth_run_free(struct truth_run *self);

#endif
