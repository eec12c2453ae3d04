/* SPDX-License-Identifier: MIT */
/// Whether what a name stands for is the same in every period. A gain that creeps looks like an inertia in the mean of
/// the periods, and takes another one in each of them.
#ifndef SERVOSCOPE_DIAGNOSE_CONSTANCY_H
#define SERVOSCOPE_DIAGNOSE_CONSTANCY_H

#include "lab/diagnose/fit.h"

/// Evidence that a coordinate of a named effect that does not depend on time changes slowly over the periods: of all
/// its coordinates and runs the largest.
/// Equation:  nats = sum_q (sum_p c_q[p] (J . d_p) / |J|)^2 / 2,  d_p the contrasts (F18) that the fit leaves, J the
///            mechanics of the coordinate's column of the Jacobian, c_q the slow courses (slow.h): chance gives 1/2
///            each
/// Range:     runs of four periods or more; 0 in others
double constancy_nats(const struct fit_data *data, const struct hypothesis *hypothesis, const struct fit *fit,
                      int effect);

/// What an effect in time takes out of the contrasts, in nats, less what a number of the given model that creeps would
/// take instead of a line: beside a line of the excitation a slow change of the gain is another line. What such an
/// effect gains in the mean of the periods alone any constant friction or torque would gain as well.
/// Returns: 0 if memory is short
double constancy_nats_in_time(const struct fit_data *data, const struct hypothesis *hypothesis, const struct fit *fit,
                              int effect);

/// Whether constancy_nats is beyond chance and no small part of what was found: a tenth of it comes and goes.
/// evidence: nats of the effect
bool constancy_is_broken(double nats, double evidence);

#endif
