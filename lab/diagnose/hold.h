/* SPDX-License-Identifier: MIT */
/// When the torque of a row acts: a measured torque at its row, a command from its row on until the next.
#ifndef SERVOSCOPE_DIAGNOSE_HOLD_H
#define SERVOSCOPE_DIAGNOSE_HOLD_H

#include "lab/diagnose/recording.h"

struct hold {
    double delay;     ///< by which the torque acts later than straight lines between its rows say, samples
    double deviation; ///< its standard deviation
    double explained; ///< share of the torque's power that inertia and friction explain, 0..1
};

/// Least squares of the torque on what moves a rigid body with friction, and on the torque's own slope.
/// Equation:  T = J a + B v + C sign(v) + b + delay dT/dn, all averaged over an eighth of the shortest excited period
/// Errors: false if memory is short or the columns are not independent.
bool hold_find(const struct recording *recording, struct hold *out_hold);

#endif
