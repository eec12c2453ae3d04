/* SPDX-License-Identifier: MIT */
/// The smooth measure that the descents work on: the logarithm of the p-norm of all limited signals together.
/// Variables are the phases, followed, if the amplitudes have a tolerance, by one angle per line:
/// c_k = exp(tolerance sin(angle_k) + j phi_k), which stays within the tolerance by itself.
#ifndef SERVOSCOPE_DESIGN_NORM_H
#define SERVOSCOPE_DESIGN_NORM_H

#include "lab/design/search.h"

struct design_norm {
    struct design_search *search;
    size_t lines;
    size_t variables;    ///< lines, or 2 lines with a tolerance
    unsigned exponent;   ///< p = 2^exponent; set by the owner before each evaluation
    double *c;           ///< 2 lines: of the last evaluation
    double *y;           ///< 2 lines: G' r^(p-1) of the last evaluation
    double *weight;      ///< packed: r^(p-2) of the last evaluation; NULL without curvature
    double *correlation; ///< as many doubles as a packed buffer: transforms of the weights; NULL without curvature
    double *z;           ///< 2 lines: of one signal; NULL without curvature
    double *raw;         ///< variables: gradient of the norm alone by phase and log |c_k|; NULL without curvature
    double *share;       ///< lines: of the torque's power at the last evaluation; with a tolerance
    double peak;         ///< largest value of the last evaluation, in units of its limit
    double sum;          ///< of r^p
};

/// `curvature`: whether design_norm_find_curvature() will be called. Returns false if memory is short.
bool design_norm_create(struct design_search *search, bool curvature, struct design_norm *out_norm);
void design_norm_free(struct design_norm *self);

/// Variables that stand for c, and back. Lengths of c at the very edge of the tolerance are moved in by a little: there
/// the angle has no slope.
void design_norm_get_variables(const struct design_norm *self, const double *c, double *out_x);
void design_norm_get_directions(const struct design_norm *self, const double *x, double *out_c);

/// Value and gradient at x; offers the point to the search.
/// Equation:  f = log(||u||_p / sqrt(mean power)),  r = u / max|u|,  S = sum r^p,  y = G' r^(p-1)
///            d f / d phi_k = -Im(c_k conj y_k) / (S max|u|),
///            d f / d log|c_k| = Re(c_k conj y_k) / (S max|u|) - share_k
double design_norm_evaluate(struct design_norm *self, const double *x, double *out_gradient);

/// Second derivatives at the point of the last evaluation, whose gradient is given.
/// Equation:  (p-1)/(S max^2) sum_n r^(p-2) u_k u_l needs only the transform W of r^(p-2) at the sums and differences
///            of the bins (Toeplitz plus Hankel); a diagonal from y; - p g g'.
/// Shapes:    out_matrix: variables x variables, lower triangle of a column-major matrix.
/// Cost:      one transform per pair of signals and O(variables^2).
void design_norm_find_curvature(struct design_norm *self, const double *x, const double *gradient, double *out_matrix);

#endif
