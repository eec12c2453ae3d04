/* SPDX-License-Identifier: MIT */
/// Finds the period of a recording that does not say it, and checks one that somebody said.
#ifndef SERVOSCOPE_ESTIMATE_PERIOD_SEARCH_H
#define SERVOSCOPE_ESTIMATE_PERIOD_SEARCH_H

#include <stdbool.h>
#include <stddef.h>

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

/// What a signal says to a period that somebody gave.
struct period_check {
    struct period_search found; ///< what period_search_run finds; zeros if nothing
    double correlation;         ///< of the signal with itself one given period later
    bool refuted; ///< the given one is no multiple of the one found, and misses more than twice as much of 1
};

/// Compares a given period with what the signal repeats after. Where nothing repeats nothing is refuted.
/// Errors: as period_search_run; period_search_err_none also with less than one given period
/// Test:   tests/unit/test_period_search.c
enum period_search_status period_search_check(const double *signal, size_t rows, size_t given,
                                              struct period_check *out_check);

#endif
