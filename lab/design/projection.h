/* SPDX-License-Identifier: MIT */
/// Relaxed averaged alternating reflections between two sets: signals within the limits, signals with the given
/// spectrum.
#ifndef SERVOSCOPE_DESIGN_PROJECTION_H
#define SERVOSCOPE_DESIGN_PROJECTION_H

#include "lab/design/search.h"

/// Improves phases and offers every iterate to the search.
/// Equation:  p = clip(x, t);  c = directions of G'(2 p - x);  u = G c;  x <- beta (x + u - p) + (1 - beta) p
///            with beta = 0.9, t = (0.75 + 0.25 i / iterations) times the smallest peak of this call so far.
/// Shapes:    inout_c: 2 line_count doubles; on return the best of this call.
/// Cost:      two transforms of each pair of signals per iteration.
/// Returns false if memory is short.
bool design_projection_run(struct design_search *search, size_t iterations, double *inout_c);

#endif
