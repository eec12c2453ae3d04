/* SPDX-License-Identifier: MIT */
/// Whether other data give the same numbers as the fit.
#ifndef SERVOSCOPE_DIAGNOSE_REPEAT_H
#define SERVOSCOPE_DIAGNOSE_REPEAT_H

#include "lab/diagnose/fit.h"

/// Variances of the effects' parameters beyond those of the linearised fit: what noise does to an effect that is not
/// smooth (where a gap closes, where a torque is clipped), and what the model has wrong, is the same in every period of
/// a run but not in two runs of different level or place.
struct repeat {
    double variance[sim_effects_max][sim_effect_parameters_max];
};

/// Fits a hypothesis to other data as well, and holds the parameters of its effects against each other.
/// Equation:  variance = max(0, (a - b)^2 - s_a^2 - s_b^2),  a and s_a the value and the standard deviation of the fit,
///            b and s_b of the other one, each s times the root of its misfit if that is above one. An effect that does
///            not show in the other data has a large s_b, and adds nothing; neither does a phase in time, which is
///            every run's own.
/// Errors:    false if memory is short
bool repeat_compare(const struct fit_data *data, const struct hypothesis *hypothesis, const struct fit *fit,
                    struct fit_data *other, struct evidence *other_evidence, struct repeat *out_repeat);

#endif
