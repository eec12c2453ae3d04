/* SPDX-License-Identifier: MIT */
/// How well models do on data that no fit has seen.
#ifndef SERVOSCOPE_DIAGNOSE_VALIDATE_H
#define SERVOSCOPE_DIAGNOSE_VALIDATE_H

#include "lab/diagnose/diagnosis.h"
#include "lab/diagnose/fit.h"

/// Figures of one model over all runs of `data`, whose noise must have been estimated.
/// Equation:  nrmse^2 = sum_k (|A_k - M_k|^2 + |A_k|^2) / sum_k |T_k|^2 over the excited bins and, at half
///            weight, the constant part (gravity and friction's asymmetry live there), with M, A, T the DFTs of
///            the
///            mechanics residual, the actuator residual and the measured torque. The first term is what the model's
///            torque
///            for the measured motion is off from the measured torque; the second, there only with a torque reference,
///            is
///            what the model's actuator is off, which the first cannot see.
///            whitened_rms^2 = (X + S) / (P n),  mean_rms^2 = X / n,  with X the sum of the n squared whitened
///            residuals
///            of the mean of P periods and S that of what differs between the periods, under the model that the noise
///            was estimated with, and what effects in time change of it.
struct diagnosis_figures validate_figures(const struct fit_data *data, const struct sim_model *model);

/// What noise lets mean_rms of a perfect model exceed once in twenty.
/// Equation:  (1 + 1.645 sqrt(2 P / ((P - 1) n)))^(1/2): n squares of variance 2, and as much again over P - 1 because
///            the noise was estimated from the scatter of P periods
double validate_mean_rms_chance(const struct fit_data *data);

/// The same nrmse for a perfect model: from the noise; without periods from the spectrum above the excited band.
double validate_noise_floor(const struct fit_data *data, const struct sim_model *model);

/// Curves of the first run of `data` for the report. Errors: false if memory is short.
bool validate_curves(const struct fit_data *data, const struct diagnosis *models, struct diagnosis_curves *out_curves);

void validate_curves_free(struct diagnosis_curves *self);

/// Share of the given model's squared excess over `floor` that another model leaves, 0..1.
double validate_share_left(double given, double left, double floor);

#endif
