/* SPDX-License-Identifier: MIT */
/// Fitting a hypothesis to evidence: Levenberg-Marquardt on whitened one-step prediction errors, within boxes.
#ifndef SERVOSCOPE_DIAGNOSE_FIT_H
#define SERVOSCOPE_DIAGNOSE_FIT_H

#include "lab/diagnose/hypothesis.h"
#include "lab/diagnose/noise.h"

struct search_memo;

/// What is fitted: one or several runs of one drive.
struct fit_data {
    size_t runs;
    const struct evidence *evidence; ///< runs of them
    size_t values;                   ///< whitened residuals of all together
    size_t contrasts;         ///< what differs between periods, for hypotheses with an effect in time; contrast.h
    struct search_memo *memo; ///< fits that need not be repeated; NULL: none is remembered
    struct evidence *renewed; ///< the evidence, where its noise is that of whatever model is tried; NULL: it stays
};

struct fit {
    double cost;        ///< sum of squares of whitened residuals and priors: -2 log likelihood but for a constant
    double prior;       ///< the priors' part of it
    size_t rows;        ///< data->values, and data->contrasts after them if the hypothesis has an effect in time
    double *residual;   ///< rows, at the hypothesis' x
    double *jacobian;   ///< rows x count, column after column, at the same x
    double *covariance; ///< count x count, of the coordinates; coordinates at a bound have zero
};

bool fit_init(struct fit *self, const struct fit_data *data);
void fit_free(struct fit *self);

/// Whitened residuals of all runs under a model: data->values, and where the model has an effect in time the contrasts
/// of all runs after them. Returns how many were written.
size_t fit_residual(const struct fit_data *data, const struct sim_model *model, double *out_residual);

/// Improves hypothesis->x from where it is; at most `iterations` steps. On return residual, jacobian, covariance and
/// cost belong to the returned x. Errors: false if memory is short or the linear system cannot be solved; x is then the
/// best so far.
bool fit_run(struct fit *self, const struct fit_data *data, struct hypothesis *io_hypothesis, size_t iterations);

/// The same without derivatives and covariance at the end: a look at what could be had. If `base` (NULL: nothing),
/// which the hypothesis extends, has the same structure, derivatives by those numbers of the given model that move by a
/// few percent at most are taken from `base_fit`. It is given up when as much as the last step brought, in each of
/// those that are left, would not bring the cost below `goal` (INFINITY: any will do).
bool fit_roughly(struct fit *self, const struct fit_data *data, const struct hypothesis *base,
                 const struct fit *base_fit, struct hypothesis *io_hypothesis, size_t iterations, double goal);

/// One step of a hypothesis that extends `base`: derivatives by the coordinates that both share are taken from
/// `base_fit`, only those of the new ones are computed. Leaves cost and x of the better of start and step; no
/// covariance.
/// Errors: as fit_run.
bool fit_step(struct fit *self, const struct fit_data *data, const struct hypothesis *base, const struct fit *base_fit,
              struct hypothesis *io_trial);

/// Linear least squares about a fit, on the blocks alone: columns of the Jacobian, and for each coordinate a weight and
/// a centre that stand for its prior and for what the contrasts say of it.
/// Shapes: out_A: data->values x count; out_weight, out_centre: count
void fit_linear(const struct fit *self, const struct fit_data *data, const struct hypothesis *hypothesis, double *out_A,
                double *out_weight, double *out_centre);

/// The part of the cost that neither blocks nor priors have: the contrasts', less what they had under the model that
/// the noise was estimated with.
double fit_contrast_cost(const struct fit *self, const struct fit_data *data);

/// Cost of the hypothesis at x without derivatives.
double fit_cost(struct fit *self, const struct fit_data *data, const struct hypothesis *hypothesis, const double *x);

#endif
