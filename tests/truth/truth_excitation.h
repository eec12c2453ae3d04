/* SPDX-License-Identifier: MIT */
#ifndef TRUTH_EXCITATION_H
#define TRUTH_EXCITATION_H

#include "tests/truth/truth_random.h"

enum { TRUTH_PERIOD_SAMPLES = 2000, TRUTH_LINES = 200, TRUTH_RATE_HZ = 1000 };

/// What a motion reference should be like.
struct truth_excitation_wish {
    double inertia_kgm2;        ///< turns acceleration into torque
    double torque_rms_Nm;       ///< of inertia times acceleration
    double speed_max_rad_per_s; ///< of the multisine alone, without the stroke
    double corner_hz;           ///< speed lines are flat below it, torque lines above it
    double stroke_rad;          ///< amplitude of the travel added on line 1; 0 for none
    double centre_rad;          ///< middle of the travelled range
};

/// One period of the motion reference: lines 1..TRUTH_LINES of 0.5 Hz, at TRUTH_RATE_HZ. Sample 0 is a moment of low
/// speed and acceleration, so that a start from rest there is gentle.
struct truth_excitation {
    double position_rad[TRUTH_PERIOD_SAMPLES];
    double velocity_rad_per_s[TRUTH_PERIOD_SAMPLES];
    double acceleration_rad_per_s2[TRUTH_PERIOD_SAMPLES];
};

/// Draw phases (random, or Schroeder's with a random start) and make the period.
/// Line k of the speed has the amplitude V / sqrt(1 + (f_k / corner)^2). V gives the wished torque; where that is too
/// fast the corner goes up, to 60 Hz, and then the level goes down.
void truth_excitation_make(struct truth_excitation *self, const struct truth_excitation_wish *wish,
                           struct truth_random *random);
/// Largest minus smallest position.
double truth_excitation_range_rad(const struct truth_excitation *self);

#endif
