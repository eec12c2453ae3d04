/* SPDX-License-Identifier: MIT */
/// Fitting a hypothesis to evidence: Levenberg-Marquardt on whitened one-step prediction errors, within boxes.
#ifndef SERVOSCOPE_DIAGNOSE_FIT_H
#define SERVOSCOPE_DIAGNOSE_FIT_H

#include "lab/diagnose/hypothesis.h"
#include "lab/diagnose/noise.h"

/// What is fitted: one or several runs of one drive.
struct fit_data {
    size_t runs;
    const struct evidence *evidence; ///< runs of them
    size_t values;                   ///< whitened residuals of all together
};

struct fit {
    double cost;        ///< sum of squares of whitened residuals and priors: -2 log likelihood but for a constant
    double prior;       ///< the priors' part of it
    double *residual;   ///< data->values, at the hypothesis' x
    double *jacobian;   ///< values x count, column after column, at the same x
    double *covariance; ///< count x count, of the coordinates; coordinates at a bound have zero
};

bool fit_init(struct fit *self, const struct fit_data *data);
void fit_free(struct fit *self);

/// Whitened residuals of all runs under a model.
void fit_residual(const struct fit_data *data, const struct sim_model *model, double *out_residual);

/// Improves hypothesis->x from where it is; at most `iterations` steps. On return residual, jacobian, covariance and
/// cost belong to the returned x. Errors: false if memory is short or the linear system cannot be solved; x is then the
/// best so far.
bool fit_run(struct fit *self, const struct fit_data *data, struct hypothesis *io_hypothesis, size_t iterations);

/// The same without derivatives and covariance at the end: a look at what could be had.
bool fit_roughly(struct fit *self, const struct fit_data *data, struct hypothesis *io_hypothesis, size_t iterations);

/// One step of a hypothesis that extends `base`: derivatives by the coordinates that both share are taken from
/// `base_fit`, only those of the new ones are computed. Leaves cost and x of the better of start and step; no
/// covariance.
/// Errors: as fit_run.
bool fit_step(struct fit *self, const struct fit_data *data, const struct hypothesis *base, const struct fit *base_fit,
              struct hypothesis *io_trial);

/// Cost of the hypothesis at x without derivatives.
double fit_cost(struct fit *self, const struct fit_data *data, const struct hypothesis *hypothesis, const double *x);

#endif
