/* SPDX-License-Identifier: MIT */
/// Relaxed averaged alternating reflections between two sets: signals within the limits, signals with the given
/// spectrum.
#ifndef SERVOSCOPE_DESIGN_PROJECTION_H
#define SERVOSCOPE_DESIGN_PROJECTION_H

#include "lab/design/search.h"

/// Improves phases and offers every iterate to the search.
/// Equation:  p = clip(x, t);  c = directions of G'(2 p - x);  u = G c;  x <- beta (x + u - p) + (1 - beta) p
///            with beta = 0.82, t = (0.68 + 0.32 i / iterations) times the smallest peak of this call so far.
///            With a tolerance the lengths |c_k| are those of the least-squares fit to 2 p - x, brought to unit power
///            and then within the tolerance.
/// Shapes:    inout_c: 2 line_count doubles; on return the best of this call.
/// Cost:      two transforms of each pair of signals per iteration.
/// Returns false if memory is short.
bool design_projection_run(struct design_search *search, size_t iterations, double *inout_c);

#endif
