/* SPDX-License-Identifier: MIT */
/// A first guess of the inertia from torque and acceleration, before any model.
#ifndef SERVOSCOPE_DIAGNOSE_INERTIA_GUESS_H
#define SERVOSCOPE_DIAGNOSE_INERTIA_GUESS_H

#include "lab/diagnose/recording.h"

/// Torque against acceleration: Newton's law over stretches of a quarter of the excitation's middle period, in which
/// the noise of a speed matters less than from sample to sample.
struct inertia_guess {
    double inertia;     ///< of a rigid body by least squares; negative: positive torque accelerates backward
    double correlation; ///< -1..1
    double least;       ///< correlation below which nothing accelerates: more of it is chance at constant speed
    double negligible;  ///< an inertia that takes a hundredth of the torque for the accelerations there are
};

struct inertia_guess inertia_guess_make(const struct recording *recording);

/// Whether the torque and the acceleration have anything in common. Where a controller holds a constant speed, or the
/// axis was held at one place after the other, the motion says nothing of the inertia, and a free one would explain it
/// by having none of the torque act.
bool inertia_guess_accelerates(const struct inertia_guess *self);

#endif
