/* SPDX-License-Identifier: MIT */
/// Descent on the p-norm of all limited signals, p doubled step by step towards the largest value.
#ifndef SERVOSCOPE_DESIGN_POLISH_H
#define SERVOSCOPE_DESIGN_POLISH_H

#include "lab/design/search.h"

struct design_polish_plan {
    unsigned first_exponent; ///< p = 2^exponent, from here
    unsigned last_exponent;  ///< to here, one by one
    size_t iterations;       ///< of L-BFGS for each p
};

/// Minimises log ||u||_p (norm.h) by L-BFGS (20 pairs, weak Wolfe line search) for each p in turn, and offers
/// every point that is evaluated to the search.
/// Shapes: inout_c: 2 line_count doubles; on return the minimum for the last p
/// Returns false if memory is short.
bool design_polish_run(struct design_search *search, const struct design_polish_plan *plan, double *inout_c);

#endif
