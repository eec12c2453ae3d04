/* SPDX-License-Identifier: MIT */
/// Overlapping Hann-windowed segments of a recording without a period, after Welch.
#ifndef SERVOSCOPE_ESTIMATE_SEGMENTS_H
#define SERVOSCOPE_ESTIMATE_SEGMENTS_H

#include "lab/estimate/arbitrary.h"

#include <complex.h>
#include <stddef.h>

struct segments {
    size_t samples;     ///< of one segment
    size_t count;       ///< segments without a lost sample
    size_t lost;        ///< segments left out because of lost samples
    size_t lines;       ///< 1 .. (samples - 1)/2
    double independent; ///< segments that would tell as much if they did not overlap
    double complex *input;
    double complex *output; ///< count x lines each
    double complex *reference;
};

/// Transforms every segment that lost no sample, half of it shared with the next one.
///
/// Equation:  X_m(k) = sum w(n) (x(mN/2 + n) - mean_m) exp(-j 2 pi k n / N), w = (1 - cos(2 pi n / N))/2
///            From a position its segment's line is taken out too: what it drifts is in no bin.
///            Neighbours share noise, correlation of their powers (1/6)^2: independent = M / (1 + 2 (M-1)/(36 M))
///
/// Length:    segment_samples 0: the power of two that leaves 16 segments or more, 16 .. 16384
/// Errors:    error_refused with fewer than 4 segments, or if memory is short; *out_self needs no freeing then
/// Test:      tests/unit/test_frf_h1.c
int segments_transform(const struct arbitrary *recording, size_t segment_samples, struct segments *out_self,
                       struct error *out_error);

void segments_free(struct segments *self);

#endif
