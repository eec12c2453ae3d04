/* SPDX-License-Identifier: MIT */
/// The closed loop that is asked for.
#ifndef SERVOSCOPE_TUNE_REFERENCE_H
#define SERVOSCOPE_TUNE_REFERENCE_H

#include <complex.h>

/// Equation:  M(s) = (2 d w s + w^2) / (s^2 + 2 d w s + w^2), w = 2 pi times the bandwidth; behind a zero-order hold,
///            and `delay_samples` later                                                   (docs/theory.md F26)
/// Range:     all above 0 but the delay, which may be 0 and need not be whole; bandwidth below half the rate
struct tune_reference {
    double bandwidth_hz; ///< natural frequency; |M| falls to -3 dB at about 2.3 times that with damping .9
    double damping;
    double delay_samples;
    double rate_hz;
};

/// Evaluates M at a frequency.
/// Test:  tests/unit/test_tune_controller.c
double complex tune_reference_at(const struct tune_reference *self, double frequency_hz);

/// Returns the lowest frequency at which |M| is -3 dB; NaN if there is none below half the rate.
double tune_reference_cutoff_hz(const struct tune_reference *self);

#endif
