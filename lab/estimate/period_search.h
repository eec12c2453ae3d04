/* SPDX-License-Identifier: MIT */
/// Finds the period and the excited lines of a recording that does not say them.
#ifndef SERVOSCOPE_ESTIMATE_PERIOD_SEARCH_H
#define SERVOSCOPE_ESTIMATE_PERIOD_SEARCH_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum period_search_status {
    period_search_ok = 0,
    period_search_err_memory = -1,
    period_search_err_none = -2,     ///< nothing repeats: best correlation below 0.5, or fewer than two periods
    period_search_err_fraction = -3, ///< it repeats, but not after a whole number of samples
};

struct period_search {
    size_t period_samples; ///< the nearest whole number
    double exact_samples;  ///< from the latest repetition, parabola through the correlation's peak
    double correlation;    ///< of the signal with itself one period later, 0..1
};

/// Finds the shortest time after which a signal repeats itself.
///
/// Equation:  r(L) = sum x[n] x[n+L] / sqrt(sum x[n]^2 sum x[n+L]^2) over the rows both have, mean removed;
///            the period is the first peak as high as the highest, less 2 % and a tenth of what is missing to 1
///
/// Range:     rows >= 16; periods of 8 samples to half the rows
/// Errors:    see period_search_status; *out_search is filled in with period_search_err_fraction too
/// Test:      tests/unit/test_period_search.c
enum period_search_status period_search_run(const double *signal, size_t rows, struct period_search *out_search);

/// Finds the excited bins from the input's spectra at all bins.
/// A bin is a candidate if its mean over periods is at least 1 % of the largest bin's, and if its scatter from period
/// to period cannot explain it (F test at 1e-6, two periods or more). In a loop other bins repeat too, as distortion:
/// where the candidates' sizes have a gap of a factor 3 or more, only those above the widest one are excited. The mean
/// (bin 0) is never one.
///
/// Shapes: spectra: periods x stride, of which the first bin_total bins are looked at; out_bins: bin_total
/// Errors: false if memory is short
/// Test:   tests/unit/test_period_search.c
bool period_search_bins(const double complex *spectra, size_t periods, size_t bin_total, size_t stride,
                        uint32_t *out_bins, size_t *out_count);

#endif
