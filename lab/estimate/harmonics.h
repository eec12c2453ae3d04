/* SPDX-License-Identifier: MIT */
/// Harmonics of a single sine: what a dwell shows of a nonlinear drive.
#ifndef SERVOSCOPE_ESTIMATE_HARMONICS_H
#define SERVOSCOPE_ESTIMATE_HARMONICS_H

#include "lab/estimate/periodic.h"

#include <stdbool.h>
#include <stddef.h>

struct harmonics {
    double frequency_hz;
    size_t count;     ///< harmonics below half the sample rate; 0: there is none, or more than one line is excited
    double output_db; ///< NaN: harmonics are not above the noise
    double
        input_db; ///< the same of the input: in a closed loop the drive's own distortion, in an open one the source's
};

/// Total harmonic distortion of a recording with one excited line k.
///
/// Equation:  THD = sum_h P(hk) / P(k), h = 2, 3, ... up to half the rate, in dB (10 log10 of a ratio of powers);
///            P(b) = |Ybar(b)|^2 - s^2(b)/M: noise is taken off  (second paper, 10)
/// Noise:     not known where noise alone would be as strong with a chance above 5 %: sum M |Ybar|^2 / sum s^2 over the
///            H harmonics ~ F(2H, 2H(M-1))
/// Needs:     a settled drive: what is left of a transient counts as harmonics
/// Errors:    false if memory is short
/// Test:      tests/unit/test_harmonics.c
bool harmonics_measure(const struct periodic *recording, struct harmonics *out);

#endif
