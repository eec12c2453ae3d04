/* SPDX-License-Identifier: MIT */
/// Transfer function by maximum likelihood in the frequency domain: a rational function in s or 1/z with its delay, its
/// poles and how sure all of it is.
///
/// Model:     Y_k = G(x_k) U_k + T(x_k),  G = exp(-j w delay) B(x) / A(x),  T = I(x) / A(x)
///            x = s / w_scale (continuous) or 1/z (discrete); T: what is left of a start transient
/// Estimate:  minimises V = sum_k |Y_k - G U_k - T|^2 / s_k^2,
///            s_k^2 = var Y + |G|^2 var U - 2 Re(conj(G) cov(Y, U)),
///            which is the likelihood of noisy input and output: no bias in closed loop, none from input noise
/// Start:     iterated weighted total least squares (Sanathanan, Koerner), each column with the size of its own noise
/// Covariance: Cramer and Rao's bound at the estimate; variances that are estimates themselves, with v complex degrees
///            of freedom (v = M - 1 periods), raise the expected cost by v / (v - 1) and the covariance by v / (v - 2)
#ifndef SERVOSCOPE_ESTIMATE_PARAMETRIC_H
#define SERVOSCOPE_ESTIMATE_PARAMETRIC_H

#include "lab/record/error.h"

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

enum {
    parametric_order_max = 12,
    parametric_terms_max = parametric_order_max + 1,
    parametric_unknowns_max = 3 * parametric_terms_max + 1,
};

/// What is fitted: spectra at `count` lines, or a frequency response (input NULL: U = 1). All arrays are borrowed.
/// Without `unit_weights` each line needs a variance above 0.
struct parametric_data {
    const char *name; ///< for messages: the file
    size_t count;
    const double *frequency_hz;
    const double complex *input;
    const double complex *output;
    const double *output_variance;           ///< E|dY|^2 of these values (of a mean over periods: the mean's)
    const double *input_variance;            ///< NULL: 0
    const double complex *output_covariance; ///< E dY conj(dU); NULL: 0
    double variance_dof;                     ///< complex degrees of freedom of the variances; 0: they are exact
    bool unit_weights;                       ///< equal noise on all outputs, of unknown size
    double sample_rate_hz;                   ///< discrete models only
};

enum parametric_domain { parametric_continuous, parametric_discrete };

/// Orders of a model. Powers below the lowest ones are absent: whole samples of delay or differentiation in B,
/// integration in A (continuous only).
struct parametric_structure {
    enum parametric_domain domain;
    size_t numerator_order, denominator_order;
    size_t numerator_lowest, denominator_lowest;
    bool transient; ///< with T, its order max(orders) - 1 (discrete) or max(orders) (continuous: aliases too)
    bool delay_free;
    double delay_s;       ///< fixed delay; the least one to look at with delay_free
    double delay_limit_s; ///< with delay_free: the largest start; 0: 4 / highest frequency above the least
};

/// A pole or zero on or above the real axis; `pair`: its conjugate is one too.
struct parametric_root {
    double complex s_rad_per_s; ///< of a discrete model: f_s log z
    double frequency_hz, frequency_std_hz;
    double damping, damping_std; ///< -Re s / |s|; 1 and -1 on the real axis
    double real_std_rad_per_s;   ///< of Re s
    bool pair;
    bool cancels; ///< a zero may lie on this pole, or a pole on this zero: parametric_mark_cancelling
};

struct parametric_model {
    struct parametric_structure structure;
    double sample_rate_hz;
    double scale_rad_per_s; ///< continuous: x = s / scale
    /// Coefficients of x^0, x^1, ..., so that the denominator's constant (discrete) or highest one (continuous) is 1.
    double numerator[parametric_terms_max], numerator_std[parametric_terms_max];
    double denominator[parametric_terms_max], denominator_std[parametric_terms_max];
    double transient[parametric_terms_max];
    double delay_s, delay_std_s;
    size_t pole_count, zero_count;
    struct parametric_root poles[parametric_order_max], zeros[parametric_order_max];
    bool stable; ///< no pole is right of the axis (discrete: outside the circle) by more than three standard deviations
    bool dc_gain_known; ///< false with an integrator, or where the denominator at 0 Hz could be 0
    double dc_gain, dc_gain_std;
    size_t lines, parameters;
    double cost, cost_expected, cost_std; ///< of V; unit weights: expected and std 0
    double noise_std;                     ///< unit weights: of the outputs, from the residual; else 0
    double residual_correlation;          ///< largest |autocorrelation| of the residual from line to line
    double whiteness_chance; ///< that white noise is as correlated: below .01 the model misses something, or the
                             ///< variances do not hold
    double condition;        ///< of the scaled Jacobian
    size_t iterations;
    bool converged;
    size_t unknowns;                                                      ///< A, B, I, delay, as in `covariance`
    double covariance[parametric_unknowns_max * parametric_unknowns_max]; ///< unknowns x unknowns
};

/// Fits a model of given orders. `start` (may be NULL) is a model of the same structure to start from.
/// Errors:    error_refused with the figure and what to do: too few lines for the orders, orders above
///            parametric_order_max, a value that is not finite, no or impossible variances, under 4 periods behind
///            them, coefficients that the data do not determine; *out_model is zeroed then
/// Cost:      2 (lines) (unknowns)^2 multiply-adds an iteration, memory for the lines times 10 doubles
/// Test:      tests/unit/test_parametric.c, tests/golden/test_parametric.c
int parametric_fit(const struct parametric_data *data, const struct parametric_structure *structure,
                   const struct parametric_model *start, struct parametric_model *out_model, struct error *out_error);

/// How many times the variances the residual is: cost over its expected value where that is beyond chance (four
/// standard deviations), else 1. Above 1 the response is not rational of these orders: nonlinear, more modes, or a
/// local minimum. The standard deviations of the model are those of noise alone; times the root of this they allow for
/// what the model misses.
double parametric_misfit(const struct parametric_model *self);

/// Multiplies covariance and squares of all standard deviations, for what the model misses (parametric_misfit).
void parametric_inflate(struct parametric_model *io_model, double factor);

/// Marks poles and zeros that lie on each other within their uncertainty: the model may have both for noise alone. They
/// are less than .3 of their size apart, and by its covariance the difference has a chance above 1 % (chi-square of two
/// degrees of freedom for pairs, one for real ones). Returns whether there are any.
bool parametric_mark_cancelling(struct parametric_model *io_model);

/// The same model with the covariance that the noise alone gives it, where the variances that the lines were weighed by
/// hold something else too: noise_share[k] of line k's is noise.
/// Equation: C_n = C (sum_k share_k J_k' J_k) C / f, C = f (J'J)^-1
/// Errors:   as parametric_fit
int parametric_noise_bound(const struct parametric_data *data, const double *noise_share,
                           const struct parametric_model *self, struct parametric_model *out_model,
                           struct error *out_error);

/// Returns G at a frequency and, unless out_std is NULL, its standard deviation sqrt(E|dG|^2).
double complex parametric_response(const struct parametric_model *self, double frequency_hz, double *out_std);

/// Cost V of a model on data that may be others than those it was fitted to; `transient`: with the model's T.
double parametric_cost(const struct parametric_model *self, const struct parametric_data *data, bool transient);

/// Puts (Y - G U - T) / s of every line into out_residual; white with E|r|^2 = 1 if model and variances hold.
void parametric_residual(const struct parametric_model *self, const struct parametric_data *data,
                         double complex *out_residual);

/// Cramer and Rao's bound for a model that is known: fills in covariance and all standard deviations of *io_model
/// (whose structure, sample rate or scale, coefficients and delay are given) for the data's inputs and variances;
/// outputs are not looked at.
/// Errors: as parametric_fit
int parametric_bound(const struct parametric_data *data, struct parametric_model *io_model, struct error *out_error);

#endif
