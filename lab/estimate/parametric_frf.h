/* SPDX-License-Identifier: MIT */
/// Parametric models from recordings and from measured responses, and back: as frequency response and as JSON.
#ifndef SERVOSCOPE_ESTIMATE_PARAMETRIC_FRF_H
#define SERVOSCOPE_ESTIMATE_PARAMETRIC_FRF_H

#include "lab/estimate/options.h"
#include "lab/estimate/parametric_identify.h"
#include "lab/estimate/periodic.h"
#include "lab/record/frf_file.h"

#include <cjson/cJSON.h>

/// Data for parametric_fit with the memory behind them.
struct parametric_spectra {
    struct parametric_data data;
    double *frequency_hz, *output_variance, *input_variance, *noise_share;
    double complex *input, *output, *output_covariance;
};

/// Mean spectra over periods first .. first + count - 1 of those used, with the variances and covariance of the means;
/// lines without power in the input are left out. Where nothing scatters from period to period the weights are equal.
/// Errors: error_refused: fewer than 2 periods, no line with power, memory; *out_self needs no freeing then
int parametric_spectra_from_periodic(const struct periodic *recording, size_t first, size_t count,
                                     struct parametric_spectra *out_self, struct error *out_error);

/// Valid lines of a response with their total standard deviations, of which noise_std is the noise's share. Without
/// standard deviations, and so without unit_weights, parametric_fit refuses. sample_rate_hz is for discrete models, 0
/// if there is none.
int parametric_spectra_from_frf(const struct frf *frf, const char *name, double sample_rate_hz, bool unit_weights,
                                struct parametric_spectra *out_self, struct error *out_error);

/// The arrays of `self` that parametric_identify may change.
struct parametric_weights parametric_spectra_weights(struct parametric_spectra *self);

void parametric_spectra_free(struct parametric_spectra *self);

/// Model as a JSON object: domain, coefficients with standard deviations (discrete: of z^0, z^-1, ...; continuous: of
/// s^0, s^1, ... with time in seconds), delay, poles and zeros as frequency and damping, gain, cost and its expected
/// value, whiteness; with `orders` (may be NULL) every pair that was tried and why one was chosen.
/// Errors: NULL if memory is short; the caller frees it with cJSON_Delete
cJSON *parametric_json(const struct parametric_model *model, const struct parametric_orders *orders);

/// The same with what identification adds: misfit, lines pooled, the drive in s (`continuous`), hint.
/// `with_orders`: the table of orders too
cJSON *parametric_outcome_json(const struct parametric_outcome *outcome, bool with_orders);

/// Method `parametric` of lab/estimate/method.h: a model whose orders and delay come from the data, evaluated at the
/// recording's lines; discrete (the input is held between samples) unless options->continuous.
/// Test: tests/unit/test_parametric_frf.c
int frf_parametric_estimate(const struct periodic *recording, const struct estimate_options *options,
                            struct frf *out_frf, struct error *out_error);

/// The same of a response that is there already, from its standard deviations: that of a sequence, whose segments have
/// lines of their own, or the mean of several realisations. Keys of `measured` are kept. `name` is for messages.
/// Errors: as parametric_identify; too few degrees of freedom behind the standard deviations. *out_frf is empty then
int frf_parametric_fit(const struct frf *measured, const char *name, const struct estimate_options *options,
                       struct frf *out_frf, struct error *out_error);

#endif
