/* SPDX-License-Identifier: MIT */
/// Stability of a closed loop from its measured open loop, or the reason why the measurement cannot tell.
#ifndef SERVOSCOPE_TUNE_NYQUIST_H
#define SERVOSCOPE_TUNE_NYQUIST_H

#include "lab/tune/controller.h"
#include "lab/tune/plant.h"

#include <complex.h>
#include <stdbool.h>

enum { nyquist_assumptions = 5 };

enum nyquist_verdict { nyquist_stable, nyquist_unstable, nyquist_undecided };

struct nyquist {
    enum nyquist_verdict verdict;
    int unstable_poles;    ///< of the closed loop; 0 if stable or undecided
    double worst_hz;       ///< where L comes nearest to -1
    double worst_distance; ///< |1 + L| there
    double first_gain_db;  ///< |L| at the lowest line: what the extrapolation to 0 Hz rests on
    double last_gain_db;   ///< |L| at the highest line: what the extrapolation to half the rate rests on
    char reason[512];      ///< undecided: why, with figures
    char assumptions[nyquist_assumptions][192]; ///< what the verdict takes for granted, with figures
};

/// Counts the turns of 1 + L around 0 from 0 Hz to half the rate.
///
/// Equation:  unstable poles = -(arg(1 + L) at half the rate) / pi, arg followed from 0 Hz, where it is -90 degrees for
///            each integrator of the loop                                                     (docs/theory.md F30)
///
/// For a plant without unstable poles. Undecided, with the reason, if
/// - all gains but the derivative's are 0: nothing holds the drive at 0 Hz;
/// - |L| is below 2 at the lowest line or above 1/2 at the highest: the turns beyond them would be guesses;
/// - the plant's phase at the lowest line is not that of a drive (a sign that is wrong);
/// - the known delay turns L by more than 90 degrees between two lines where |L| > 0.1, or below the lowest line: full
///   turns do not show on the lines;
/// - 1 + L turns by more than 90 degrees between two lines, or L lags by 90 degrees more where |L| > 0.1, or leads by
/// 90
///   degrees more where |L| > 0.5: a resonance or delay may hide there;
/// - the plant's phase rises by more than 270 degrees where |L| > 0.1: the lines show a delay's turns backwards;
/// - `measured`, and a resonance between two lines could bring L to -1 without showing on them (lab/tune/gap.h);
/// - `measured`, and -1 lies in the 95 % circle of a line, or within the plant's doubt: noise decides.
/// `measured` is false for a response that is drawn from a measured one, whose lines have been judged.
/// Shapes:    response, loop: plant->count lines; `loop` = K G of `response`
/// Test:      tests/unit/test_tune_nyquist.c, against the poles of known plants
void nyquist_judge(const struct tune_plant *plant, const double complex *response, const double complex *loop,
                   const struct tune_controller *controller, bool measured, struct nyquist *out_nyquist);

#endif
