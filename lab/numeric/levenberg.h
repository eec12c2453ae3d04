/* SPDX-License-Identifier: MIT */
/// Nonlinear least squares after Levenberg and Marquardt on the singular values of the column-scaled Jacobian: for
/// badly conditioned unknowns such as a polynomial's coefficients, where J'J would lose half of the digits
/// (trust_region.h), and for models with a known redundancy.
#ifndef SERVOSCOPE_NUMERIC_LEVENBERG_H
#define SERVOSCOPE_NUMERIC_LEVENBERG_H

#include "lab/numeric/tall_qr.h"

/// Minimise |r(x)|^2.
struct levenberg_problem {
    size_t unknowns;
    size_t redundant; ///< directions of x that do not change r, such as a factor common to all coefficients
    const void *context;
    /// Returns |r(x)|^2, not finite where x is out of the question; unless io_rows is NULL adds a row of J and r,
    /// unknowns + 1 values, for each residual.
    double (*evaluate)(const void *context, const double *x, struct tall_qr *io_rows);
};

struct levenberg_outcome {
    size_t iterations; ///< Jacobians
    double cost;
    bool converged; ///< false: the iterations ran out
};

/// Improves x until no step promises a relative decrease above `tolerance`, or rounding hides what steps change.
/// Method: (J'J + damping^2 D^2) step = -J'r, D the lengths of J's columns; undamped while that works, and after a step
///         that does not come true ten times the damping
/// Errors: false if memory is short or the cost of the first x is not finite; x is untouched then
/// Test:   tests/unit/test_levenberg.c
bool levenberg_minimise(const struct levenberg_problem *problem, size_t iterations_max, double tolerance,
                        double *inout_x, struct levenberg_outcome *out_outcome);

#endif
