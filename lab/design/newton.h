/* SPDX-License-Identifier: MIT */
/// Newton's method on the p-norm: for the last doublings of p, which a descent without curvature cannot follow.
#ifndef SERVOSCOPE_DESIGN_NEWTON_H
#define SERVOSCOPE_DESIGN_NEWTON_H

#include "lab/design/search.h"

struct design_newton_plan {
    unsigned first_exponent; ///< p = 2^exponent, from here
    unsigned last_exponent;  ///< to here, one by one
    size_t steps;            ///< at most so many for each p
};

/// Minimises log ||u||_p for each p in turn with the exact second derivatives (norm.h), damped until they are
/// positive definite and the value falls; offers every point to the search.
/// Shapes: inout_c: 2 line_count doubles; on return the minimum for the last p
/// Cost:   variables^3 / 3 per step, memory 2 variables^2
/// Returns false if memory is short.
bool design_newton_run(struct design_search *search, const struct design_newton_plan *plan, double *inout_c);

#endif
