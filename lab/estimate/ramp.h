/* SPDX-License-Identifier: MIT */
/// What a drift leaks into the lines of a periodic recording: the same in every period, so that no scatter betrays it.
#ifndef SERVOSCOPE_ESTIMATE_RAMP_H
#define SERVOSCOPE_ESTIMATE_RAMP_H

#include <complex.h>
#include <stddef.h>

/// Transform of a ramp of one per sample over one period.
/// Equation:  sum_n n exp(-jwn) = N / (exp(-jw) - 1),  w = 2 pi k / N
/// Range:     1 <= bin < period_samples
double complex ramp_transform(size_t bin, size_t period_samples);

/// Slope per sample of the line through the periods' means.
/// Shapes:    spectra: periods x stride, the first of each row that of bin 0; numbers: periods, ascending, NULL: 0, 1,
///            2, ...
/// Range:     periods >= 2
double ramp_slope(const double complex *spectra, size_t stride, const size_t *numbers, size_t periods,
                  size_t period_samples);

#endif
