/* SPDX-License-Identifier: MIT */
/// Model reference control: the gains whose closed loop is nearest to the one asked for, by linear least squares.
///
/// With L = K G the closed loop misses M by M - L/(1 + L) = (M - (1 - M) L)/(1 + L). Where the loop is nearly M,
/// 1/(1 + L) is nearly 1 - M, and (1 - M)(M - (1 - M) L) is linear in the gains: `tune_fit_linear`. If M cannot be
/// reached (a resonance), that puts the weight in the wrong place; `tune_fit_reweighted` takes 1/(1 + L) from the
/// iteration before. Gains are never negative.                                     (docs/theory.md F25 to F28)
///
/// Noise on G is noise on the regressors, which pulls gains towards 0; its expected share of the normal equations,
/// known from the file's standard deviations, is taken out of them.
#ifndef SERVOSCOPE_TUNE_FIT_H
#define SERVOSCOPE_TUNE_FIT_H

#include "lab/tune/controller.h"
#include "lab/tune/plant.h"
#include "lab/tune/reference.h"

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

/// F of the criterion, |F|^2 per Hz: 1/f counts each octave the same, 1 counts each Hz the same.
enum tune_weighting { tune_weighting_log, tune_weighting_flat };

enum { tune_iterations = 30 };

/// Everything that does not change with the gains or the noise of the response.
struct tune_problem {
    size_t lines, gains;
    double *weight;            ///< F times the root of the line's share of the axis; squares sum to 1
    double complex *reference; ///< M
    double complex *term;      ///< gains x lines, filter included
    double *variance;          ///< of the response's complex value; 0 where it is not known
};

/// Prepares a problem; variances are the squares of the plant's std. A line stands for the frequencies up to halfway to
/// its neighbours, so that the criterion is an integral over frequency whatever the spacing; on equally spaced lines it
/// is the mean over lines.
/// Errors: false if memory is short; nothing to free then
bool tune_problem_init(struct tune_problem *self, const struct tune_plant *plant,
                       const struct tune_controller *controller, const struct tune_reference *reference,
                       enum tune_weighting weighting);
void tune_problem_free(struct tune_problem *self);

/// Criterion J_mr = sum weight^2 |M - L/(1 + L)|^2, L = sum gain_i term_i G.
double tune_fit_cost(const struct tune_problem *self, const double complex *response, const double *gain);

/// Minimises sum weight^2 |(1 - M)(M - (1 - M) L)|^2 over gains >= 0.
/// Shapes: response: lines; out_gain: gains
/// Errors: false if the terms depend on each other on these lines
/// Test:   tests/unit/test_tune_fit.c, tests/golden/test_tune_reference.c
bool tune_fit_linear(const struct tune_problem *self, const double complex *response, double *out_gain);

/// Starts from io_gain and minimises sum weight^2 |(M - (1 - M) L)/(1 + L_before)|^2, tune_iterations times over or
/// until no gain moves. A fixed point need not be a minimum of J_mr.
bool tune_fit_reweighted(const struct tune_problem *self, const double complex *response, double *io_gain);

#endif
