/* SPDX-License-Identifier: MIT */
/// Spectra of a periodic recording, period by period.
#ifndef SERVOSCOPE_ESTIMATE_SPECTRA_H
#define SERVOSCOPE_ESTIMATE_SPECTRA_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// Transforms `periods` consecutive periods at chosen bins.
/// Equation:  Y_{p,b} = sum_{n=0}^{N-1} y[p N + n] exp(-j 2 pi k_b n / N)
/// Shapes:    signal: periods x period_samples; bins: bin_count; out_spectra: periods x bin_count, period-major
/// Units:     those of the signal times samples: a sine of amplitude A on bin k gives |Y| = A N / 2
/// Range:     bins below period_samples (0 is the sum of the samples; NULL: 0 .. bin_count - 1); period_samples >= 1
/// Errors:    false if memory is short
/// Cost:      one complex FFT for two periods, also where few bins are wanted: the twiddles of direct sums alone would
///            take longer
/// Test:      tests/unit/test_spectra.c
bool spectra_transform_periods(const double *signal, size_t period_samples, size_t periods, const uint32_t *bins,
                               size_t bin_count, double complex *out_spectra);

/// Transforms the periods of two signals at the same bins, a period of one beside that of the other.
/// Shapes: first, second: periods x period_samples; out_first, out_second: periods x bin_count, period-major
bool spectra_transform_both(const double *first, const double *second, size_t period_samples, size_t periods,
                            const uint32_t *bins, size_t bin_count, double complex *out_first,
                            double complex *out_second);

/// Transforms one signal at every bin from 0 to period_samples/2; out_spectra: periods x (period_samples/2 + 1).
bool spectra_transform_all(const double *signal, size_t period_samples, size_t periods, double complex *out_spectra);

/// Transforms two real signals of `rows` samples at every bin from 0 to rows/2, in the time of one complex transform.
/// Shapes: first, second: rows; out_first, out_second: rows/2 + 1
/// Errors: false if memory is short
bool spectra_transform_two(const double *first, const double *second, size_t rows, double complex *out_first,
                           double complex *out_second);

#endif
