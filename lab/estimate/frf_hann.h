/* SPDX-License-Identifier: MIT */
/// Frequency response through a Hann window over all periods: what is left of a transient falls off much faster from
/// line to line than without a window, for 1.76 dB more noise.
#ifndef SERVOSCOPE_ESTIMATE_FRF_HANN_H
#define SERVOSCOPE_ESTIMATE_FRF_HANN_H

#include "lab/estimate/options.h"
#include "lab/estimate/periodic.h"
#include "lab/record/frf_file.h"

/// Divides windowed spectra of the longest stretch of P consecutive usable periods.
/// Equation:  X_H(q) = X(q)/2 - X(q-1)/4 - X(q+1)/4 with X the transform of all P periods, resolution 1/P bin
///            G(k) = Y_H(kP) / U_H(kP);   var G = mean_m |Y_H(kP+m) - G U_H(kP+m)|^2 / |U_H(kP)|^2, m = +-2 .. +-P/2,
///            lines that a periodic signal does not reach: what is there is noise and transient
///            Neighbours share noise (correlations -2/3 and 1/6), so that the degrees of freedom are fewer than lines:
///            2 n / (1 + 2 ((4/9)(n-1) + (1/36)(n-2)) / n) for each side's n = P/2 - 1 lines
/// Errors:    error_refused if fewer than 4 consecutive periods are usable, no line has power, or memory is short
/// Test:      tests/unit/test_frf_hann.c
int frf_hann_estimate(const struct periodic *recording, const struct estimate_options *options, struct frf *out_frf,
                      struct error *out_error);

#endif
