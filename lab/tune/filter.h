/* SPDX-License-Identifier: MIT */
/// The fixed filter of a loop: a pair of zeros that cancels the drive's resonance, and a pair of poles to replace it.
#ifndef SERVOSCOPE_TUNE_FILTER_H
#define SERVOSCOPE_TUNE_FILTER_H

#include <complex.h>
#include <stdbool.h>

/// Equation:  C(s) = (s^2/wz^2 + 2 dz s/wz + 1) / (s^2/wp^2 + 2 dp s/wp + 1), gain 1 at 0 Hz; a notch has wz = wp.
///            Numerator and denominator are discretised apart, each exact at its own frequency (bilinear, prewarped).
struct tune_filter {
    bool on;
    double zero_hz, zero_damping;
    double pole_hz, pole_damping;
    double b[3], a[3]; ///< (b0 + b1 z^-1 + b2 z^-2) / (1 + a1 z^-1 + a2 z^-2)
};

/// Fills in the coefficients from the four numbers.
/// Range:  both frequencies above 0 and below half the rate, dampings above 0
/// Errors: false outside; `self` is then as it was
/// Test:   tests/unit/test_tune_controller.c
bool tune_filter_make(struct tune_filter *self, double rate_hz);

/// Evaluates the filter at delay = exp(-j w Ts); 1 if it is off.
double complex tune_filter_at(const struct tune_filter *self, double complex delay);

#endif
