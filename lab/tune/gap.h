/* SPDX-License-Identifier: MIT */
/// What a resonance that no line shows could do to a loop between two neighbouring lines.
///
/// A drive's resonance and the antiresonance beside it, apart by d = (fp^2 - fz^2)/fp^2, turn L into a circle through L
/// of diameter |L| d/(2 zeta). Beside the pair they shift the response by at least e = 2 d (f2^2 + f1^2)/(f2^2 - f1^2)
/// from one line to the next, which the lines around show, as far as their own trend is known.
#ifndef SERVOSCOPE_TUNE_GAP_H
#define SERVOSCOPE_TUNE_GAP_H

#include "lab/tune/plant.h"

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

/// Neighbouring lines further apart than by this ratio are a gap into which nothing is interpolated: a loop that is
/// drawn from one to the other through |L| = 1 would not pass gap_find_worst() either.
#define GAP_RATIO_MOST 1.6

/// Two neighbouring lines, `line` and the next one.
struct gap {
    size_t line;
    double rise;  ///< what may hide there raises |L| by up to this factor, at most 30 dB
    double reach; ///< the rise from which on a circle may reach -1, smaller of both lines
};

/// The lower end of a grid goes up to here: equally spaced lines are further apart than by a factor 1.2 there. Steps of
/// at most a factor 3 that belong to the grid (a few lines may be missing) are taken to hide no more than a resonance
/// behind its antiresonance, which turns L away from -1.
double gap_lower_end_hz(const struct tune_plant *plant);

/// Looks at the step from `line` to the next one.
/// Equation:  rise = e (f2^2 - f1^2)/(4 zeta (f2^2 + f1^2)), zeta = .01; e is how far off the straight continuation of
///            its neighbours the step is, relative (log |G| over log f, phase over f, each from as far outside as the
///            lines are apart), but at least (f2/f1 - 1)^2/4;
///            reach = |1 + L| max(1, |1 + L|)/|L|, at most 1 where |L| passes 1 in between, infinite at the lower end
///            where |L| >= 2 and L lags by less than 180 degrees                                   (docs/theory.md F30)
/// Shapes:    response, loop: plant->count lines, line + 1 < plant->count; `loop` = K G
/// Test:      tests/unit/test_tune_gap.c
struct gap gap_look(const struct tune_plant *plant, const double complex *response, const double complex *loop,
                    size_t line);

/// Fills in the step with the largest rise over reach, and returns how many have a rise above their reach.
size_t gap_find_worst(const struct tune_plant *plant, const double complex *response, const double complex *loop,
                      struct gap *out_worst);

#endif
