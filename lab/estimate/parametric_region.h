/* SPDX-License-Identifier: MIT */
/// How far the response of a model may be off: no circle, because a few real parameters move it along preferred
/// directions.
#ifndef SERVOSCOPE_ESTIMATE_PARAMETRIC_REGION_H
#define SERVOSCOPE_ESTIMATE_PARAMETRIC_REGION_H

#include "lab/estimate/parametric.h"

/// Covariance of real and imaginary part of G at a frequency.
struct parametric_ellipse {
    double real, imag, cross; ///< E dRe^2, E dIm^2, E dRe dIm
};

struct parametric_ellipse parametric_response_ellipse(const struct parametric_model *self, double frequency_hz);

/// Chance that |dG| exceeds c sqrt(E|dG|^2), for an estimate of the variance with `dof` real degrees of freedom (0:
/// known).
/// Equation: with E|dG|^2 = t and q(a) the variance along the ellipse at the angle a, mean over a of
///           (1 + c^2 t / (dof q))^(-dof/2), without limit exp(-c^2 t / (2 q)): exp(-c^2) for a circle, that of a real
///           normal number for a line
double parametric_ellipse_chance(const struct parametric_ellipse *self, double c, double dof);

/// Factor c for which |dG| <= c std holds at `probability` of the lines, on average: between 1.73 (all errors are
/// circles) and 1.96 (all are lines) at 95 % with a known variance.
/// Range: 0 < probability < 1, count > 0; NaN where no line has an error
/// Test:  tests/unit/test_parametric_region.c
double parametric_confidence_factor(const struct parametric_model *self, const double *frequency_hz, size_t count,
                                    double probability, double dof);

#endif
