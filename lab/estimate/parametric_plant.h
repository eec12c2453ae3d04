/* SPDX-License-Identifier: MIT */
/// From a model of samples to the drive behind its hold: the transfer function in s whose response to a held input is
/// the model's at every sample.
#ifndef SERVOSCOPE_ESTIMATE_PARAMETRIC_PLANT_H
#define SERVOSCOPE_ESTIMATE_PARAMETRIC_PLANT_H

#include "lab/estimate/parametric.h"

/// Turns a discrete model into a continuous one without the hold, standard deviations included.
///
/// Equation: poles s_i = f_s log z_i; with r_i the residue at z_i of G without its whole samples of delay, a part e of
///           a sample late, c_i = r_i s_i / (exp(s_i (1 - e) / f_s) (1 - 1 / z_i)), G(s) = exp(-s delay) sum c_i / (s -
///           s_i). With one coefficient more in the numerator than there are poles, e is where the first sample fits:
///           sum c_i / s_i (exp(s_i (1 - e) / f_s) - 1) = b_0; else e = 0.
/// Standard deviations: the Jacobian of all this by differences
/// Errors: false where there is no such drive: a pole at or left of z = 0 (it has no logarithm that is real), no e from
///         0 to 1, several poles in one place, or memory is short; *out_model is zeroed then
/// Test:   tests/unit/test_parametric_plant.c
bool parametric_plant_of(const struct parametric_model *discrete, struct parametric_model *out_model);

#endif
