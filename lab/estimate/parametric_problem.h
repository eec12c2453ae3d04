/* SPDX-License-Identifier: MIT */
/// Inside of the parametric estimator: the vector of unknowns theta and what a line contributes.
/// theta: coefficients of A from its lowest power to its order, of B alike, of I, then a free delay in seconds.
#ifndef SERVOSCOPE_ESTIMATE_PARAMETRIC_PROBLEM_H
#define SERVOSCOPE_ESTIMATE_PARAMETRIC_PROBLEM_H

#include "lab/estimate/parametric.h"
#include "lab/numeric/tall_qr.h"

/// How many unknowns of each kind a structure has.
struct parametric_layout {
    size_t denominators, numerators, transients;
    size_t unknowns;
};

struct parametric_problem {
    const struct parametric_data *data;
    struct parametric_structure structure;
    struct parametric_layout layout;
    double scale_rad_per_s;
    double complex *x;       ///< per line
    double *omega_rad_per_s; ///< per line
    double complex *delay;   ///< per line: exp(-j w delay) of a fixed delay
};

/// One line at one theta.
struct parametric_line {
    double complex x;
    double omega_rad_per_s;
    double complex inverse, delay; ///< 1 / A; exp(-j w delay)
    double complex response;       ///< G
    double complex transient;      ///< T
    double complex error;          ///< Y - G U - T
    double variance;               ///< s^2
};

struct parametric_layout parametric_layout_of(const struct parametric_structure *structure);

/// Copies the model's coefficients into a vector of unknowns, and back.
void parametric_pack(const struct parametric_model *model, double *out_theta);
void parametric_unpack(const double *theta, struct parametric_model *io_model);

/// scale_rad_per_s: of s; 0: the middle of the lines.
/// Errors: error_refused as parametric_fit says; *out_self needs no freeing then.
int parametric_problem_init(const struct parametric_data *data, const struct parametric_structure *structure,
                            double scale_rad_per_s, struct parametric_problem *out_self, struct error *out_error);
void parametric_problem_free(struct parametric_problem *self);

/// A line of a model: x, omega_rad_per_s and, for a fixed delay, its factor.
void parametric_line_begin(const struct parametric_model *model, double frequency_hz, struct parametric_line *out_line);

/// Fills in G and what it is made of; x, omega_rad_per_s and the factor of a fixed delay are given.
void parametric_line_response(const struct parametric_structure *structure, const double *theta,
                              struct parametric_line *io_line);

/// dG/dtheta and, with `input`, d(G input + T)/dtheta at a line whose response is filled in.
void parametric_line_gradient(const struct parametric_structure *structure, const struct parametric_line *line,
                              double complex *out_response, double complex input, double complex *out_output);

void parametric_problem_line(const struct parametric_problem *self, const double *theta, size_t k,
                             struct parametric_line *out_line);

/// For levenberg_minimise: cost, and rows of the Jacobian with the residual.
double parametric_problem_evaluate(const void *problem, const double *theta, struct tall_qr *io_rows);

/// Adds the rows of Fisher's information: the derivative of G U + T alone, at the most likely input. `share` (NULL: 1)
/// weighs the lines.
void parametric_problem_information(const struct parametric_problem *self, const double *theta, const double *share,
                                    struct tall_qr *io_rows);

/// Of the data's line k, 0 and 1 where there is none.
double complex parametric_input(const struct parametric_data *data, size_t k);
double parametric_input_variance(const struct parametric_data *data, size_t k);
double complex parametric_covariance(const struct parametric_data *data, size_t k);
/// s^2 at a response.
double parametric_error_variance(const struct parametric_data *data, size_t k, double complex response);

/// A cost that noise alone explains: four standard deviations above the number of lines; 0 if the noise is not known.
double parametric_plausible_cost(const struct parametric_data *data);

/// parametric_fit with 20 steps from one start: enough to compare structures, most of which are wrong; a wrong one
/// takes the full fit longest.
int parametric_fit_quickly(const struct parametric_data *data, const struct parametric_structure *structure,
                           struct parametric_model *out_model, struct error *out_error);

/// Finds where to start for one delay by iterated linear least squares, the first weights those of the theta
/// `weigh_by`, or with NULL those of the measured response. Returns the cost there, not finite if there is none.
double parametric_start_find(const struct parametric_problem *self, double delay_s, const double *weigh_by,
                             double *out_theta);

/// Factor between (J'J)^-1 of the rows and the covariance: real and imaginary parts apart, and what estimated variances
/// cost.
double parametric_covariance_factor(const struct parametric_data *data, double noise_std);

/// Fills in standard deviations, poles, zeros and gain of a model that has its coefficients and covariance.
/// Errors: error_refused if memory is short or roots are not found
int parametric_derive(struct parametric_model *io_model, struct error *out_error);

#endif
