/* SPDX-License-Identifier: MIT */
/// Recordings whose input is a current or a voltage: what torque a unit of it makes is one more unknown number.
#ifndef SERVOSCOPE_DIAGNOSE_GAIN_H
#define SERVOSCOPE_DIAGNOSE_GAIN_H

#include "lab/diagnose/fit.h"
#include "lab/record/run.h"

/// The columns that drive the motion; NULL where there is none.
struct gain_input {
    const double *measured, *reference;
    const char *unit; ///< "A", "V": the gain is free; NULL: a torque or a force
};

/// Torque or force if the run has it, else current, else voltage.
struct gain_input gain_find_input(const struct run *run);

/// Multiplies the input of a recording, and what is said about its size.
void gain_scale(struct recording *io_recording, double factor);

/// One step towards the gain that fits best: how much larger its logarithm should be, beside all coordinates of the
/// hypothesis that `fit` belongs to, and the standard deviation of that.
/// Equation:  least squares of r + A y + (d r_m / d ln g) x, r the whitened residual, r_m its mechanics, A y the
///            hypothesis' own coordinates with their priors
/// Shapes:    recordings: data->runs, those of data->evidence; as they were on return
/// Errors:    false if memory is short or the data cannot tell
bool gain_step(const struct fit_data *data, const struct fit *fit, const struct hypothesis *hypothesis,
               struct recording *recordings, double *out_step, double *out_deviation);

#endif
