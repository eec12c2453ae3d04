/* SPDX-License-Identifier: MIT */
/// Nonlinear least squares by Gauss-Newton steps inside a trust region, for problems whose Jacobian is too long to hand
/// over: the caller gives J'J and J'e. (levenberg.h takes J itself.)
#ifndef SERVOSCOPE_NUMERIC_TRUST_REGION_H
#define SERVOSCOPE_NUMERIC_TRUST_REGION_H

#include <stdbool.h>
#include <stddef.h>

/// Minimise |e(x)|^2.
struct trust_region_problem {
    size_t unknowns;
    void *context;
    /// |e(x)|^2; an infinite or NaN value marks an x that is out of the question.
    double (*cost)(void *context, const double *x);
    /// H = J'J (lower triangle, column after column; out_H comes zeroed) and g = J'e at x.
    void (*normal_equations)(void *context, const double *x, double *out_H, double *out_g);
    /// Asked before every step; true ends the search with the best so far. NULL: never.
    bool (*stop)(void *context, size_t step);
};

/// When it is enough; a tolerance of 0 never is.
struct trust_region_limits {
    size_t steps;              ///< evaluations of the cost after the first
    double cost_tolerance;     ///< relative decrease of the cost in a step that went as predicted
    double step_tolerance;     ///< length of a step, relative to that of x
    double gradient_tolerance; ///< largest |g_i|
};

struct trust_region_outcome {
    size_t steps;
    double cost;
    bool stopped; ///< by problem->stop
};

/// Improves x until a tolerance or the number of steps is reached.
/// Method:  step s minimises |J s + e|^2 over |s| <= radius: (H + lambda I) s = -g, lambda by Newton's method on
///          1 / |s| = 1 / radius (More and Sorensen), Cholesky of LAPACK. The radius shrinks to a quarter of the step
///          where less than a quarter of the predicted decrease came true, and doubles where more than three quarters
///          did.
/// Errors:  false if memory is short; x is untouched then.
/// Test:    tests/unit/test_trust_region.c
bool trust_region_minimise(const struct trust_region_problem *problem, const struct trust_region_limits *limits,
                           double *inout_x, struct trust_region_outcome *out_outcome);

#endif
