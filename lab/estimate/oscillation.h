/* SPDX-License-Identifier: MIT */
/// Whether the output of a periodic recording oscillates by itself: a limit cycle, a loop close to instability, a
/// disturbance of its own frequency. It is no transient, so that nothing about the periods says "not settled", and on
/// the lines it looks like noise.
#ifndef SERVOSCOPE_ESTIMATE_OSCILLATION_H
#define SERVOSCOPE_ESTIMATE_OSCILLATION_H

#include "lab/estimate/periodic.h"

#include <stdbool.h>

struct oscillation {
    bool found;
    double frequency_hz;
    double level; ///< its RMS over that of what repeats with the excitation
    double share; ///< of its power in that of everything that does not repeat
};

/// Looks for one oscillation in what is left of the output without its mean period and its drift, over the longest
/// stretch of periods that count (of at most 2^20 samples).
///
/// Equation:  e[n] = y[n] - ybar[n mod N] - drift,  E its Hann spectrum;  power of the five bins around the peak
///            (docs/theory.md, F61)
/// Found:     at least 0.3 of the power of e in them, and a level of at least 0.02; below five cycles of the stretch
///            nothing is looked for, nor where the spectrum rises towards there: that is drift or decay; nor
///            what falls below 0.4 of itself from the first half to the second, nor, unless settled, within two bins of
///            one cycle per period: that is a transient
/// Errors:    false if memory is short; fewer than two consecutive periods: nothing is found
/// Test:      tests/unit/test_oscillation.c
bool oscillation_measure(const struct periodic *recording, struct oscillation *out);

#endif
