/* SPDX-License-Identifier: MIT */
/// A run as another clock would have sampled it.
#ifndef SERVOSCOPE_ESTIMATE_RESAMPLE_H
#define SERVOSCOPE_ESTIMATE_RESAMPLE_H

#include "lab/record/error.h"
#include "lab/record/run.h"

#include <stddef.h>

/// Highest frequency that survives, over the sample rate.
#define RESAMPLE_BAND 0.45

/// Sample m of the new run lies at sample m + stretch m + bend m^2 of the old one.
struct resample_warp {
    double stretch;
    double bend;
};

/// Interpolates every known column but time_s, which is left out as unknown ones are; other rate, same keys.
///
/// Equation:  y[m] = sum_i x[i] sinc(t - i) w(t - i), w a Kaiser window of half width 32, beta = 10: wrong by 1e-5 of a
///            sine below 0.4 times the rate, by 2e-5 up to RESAMPLE_BAND
/// Ends:      what lies beyond the recording is taken from `period_samples` away; new samples up to half a sample
///            beyond
///            it, no further
/// valid:     0 where more than a hundredth of a new sample's weights is on lost ones
/// Rate:      that of the old run over 1 + stretch: frequencies stay those of the clock that sampled
/// Errors:    error_refused if memory is short; *out_run is empty then
/// Test:      tests/unit/test_resample.c
int resample_run(const struct run *run, const struct resample_warp *warp, size_t period_samples, struct run *out_run,
                 struct error *out_error);

#endif
