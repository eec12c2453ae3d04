/* SPDX-License-Identifier: MIT */
/// Variances to weigh lines by: the scatter of few periods, pooled over lines that scatter alike, and what repeats with
/// every period but follows no transfer function.
#ifndef SERVOSCOPE_ESTIMATE_PARAMETRIC_VARIANCE_H
#define SERVOSCOPE_ESTIMATE_PARAMETRIC_VARIANCE_H

#include "lab/estimate/parametric.h"

/// Variances of data whose arrays may be written; frequencies ascend.
struct parametric_weights {
    double *output_variance, *input_variance; ///< input_variance NULL: 0
    double complex *output_covariance;        ///< NULL: 0
    double *noise_share;                      ///< what of the variance is noise; parametric_weights_add_distortion
};

/// Replaces each line's variances by their mean over as many neighbours as bring 20 complex degrees of freedom, fewer
/// where the lines do not scatter alike: weights from two periods scatter so much themselves that they say little.
/// Raises io_data->variance_dof accordingly. Returns the number of lines that are pooled, 1: none.
///
/// Alike:  log s^2 of v degrees of freedom has the variance psi'(v). Within groups of as many lines it must not be
///         larger beyond chance (four standard deviations, allowing for the kurtosis psi'''(v) / psi'(v)^2)
/// Loops:  where output or input by itself does not scatter alike, but Y - G U does, as in a closed loop, that is
///         pooled
///         and counted as the output's, if the input's noise is below a thousandth of its power at every line
/// Runs:   where the variances are not noise alone and do not scatter alike, how many times the noise they are may:
///         that
///         is pooled then
/// Test:   tests/unit/test_parametric_variance.c
size_t parametric_weights_pool(const struct parametric_weights *self, struct parametric_data *io_data);

/// Adds to each line's variance what the residual of a model has beyond it, averaged over neighbouring lines, and notes
/// in noise_share what is left for noise: a response that is off by the same amount in each period, as friction makes
/// it, would be believed too much by its noise alone.
///
/// Equation: D_k = max(0, 2K / (2K - p) mean |e|^2 - mean s^2) over 11 lines around k, K lines, p parameters
/// Errors:   false if memory is short
bool parametric_weights_add_distortion(const struct parametric_weights *self, const struct parametric_model *model,
                                       struct parametric_data *io_data);

#endif
