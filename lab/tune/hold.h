/* SPDX-License-Identifier: MIT */
/// A response as a controller at another rate than the recording's sees it: behind its own hold, at its own samples.
#ifndef SERVOSCOPE_TUNE_HOLD_H
#define SERVOSCOPE_TUNE_HOLD_H

#include "lab/tune/plant.h"

#include <stdbool.h>

/// Rates that differ by less than this share are the same: a recording's own clock.
#define HOLD_SAME_RATE 1e-3

/// Carries the lines over from plant->response_rate_hz to plant->rate_hz. What of other frequencies the samples fold
/// onto a line, and no line shows, becomes doubt; above the last line the response counts as falling at least like 1/f.
///
/// Held input, controller m times slower, exact:
/// Equation:  G'(f) = sum_{k<m} D(f + k f') G(f + k f'),  D(v) = (1 - exp(-2 pi j v/f'))/(m (1 - exp(-2 pi j v/f0))),
///            f0 the recording's rate, f' = f0/m the controller's; G between its lines from its neighbours
/// Held input, any other rate: the quotient of the holds, known as far as neither rate folds:
/// Equation:  G'(f) = G(f) H'(f)/H(f),  H(f) = sin(x)/x exp(-j x), x = pi f/f0
/// Band-limited: the same with H = 1; also at the recording's own rate, because the response has no hold then.
///                                                                                          (docs/theory.md F25)
/// Shapes:    lines of all frequencies below half the recording's rate; those from half of rate_hz on only serve here
/// Errors:    false if memory is short
/// Test:      tests/unit/test_tune_hold.c
bool hold_carry(struct tune_plant *io_plant);

#endif
