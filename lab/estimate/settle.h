/* SPDX-License-Identifier: MIT */
/// How the start transient of a periodic recording dies away, and how many leading periods to leave out for it.
#ifndef SERVOSCOPE_ESTIMATE_SETTLE_H
#define SERVOSCOPE_ESTIMATE_SETTLE_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

struct settle {
    size_t periods;          ///< leading periods that differ from the later half by more than scatter
    bool settled;            ///< false: the whole first half differs, or there are too few periods (under 4) to tell
    double decay_per_period; ///< transient of the second period over that of the first; 0: too small to be measured
};

/// Compares each period's spectrum with the mean of the later half.
///
/// Equation:  d_p,k = |Y_p,k - Ybar_k|^2 / ((1 + 1/M) s_k^2) ~ F(2, 2(M-1)) if period p is like the M of that half;
///            the chances P of all lines combine after Fisher: -2 sum log P ~ chi2(2K). Left out while below 1e-3.
///
/// Shapes:    spectra: periods x bin_count; usable: periods (false: has lost samples, taken as settled, not looked at);
///            out_level: periods, root of the lines' summed |Y_p - Ybar|^2 over that of the lines' |Ybar|^2,
///            NaN for what is not usable
/// Errors:    false if memory is short; under 4 periods, or fewer than 2 usable ones in the later half: periods = 0,
///            settled = false
/// Test:      tests/unit/test_settle.c
bool settle_measure(const double complex *spectra, size_t periods, size_t bin_count, const bool *usable,
                    struct settle *out_settle, double *out_level);

/// What settled periods look like, where they have been summed up rather than kept.
struct settle_reference {
    size_t count; ///< at least 2
    size_t bin_count;
    const double complex *mean; ///< bin_count
    const double *scatter;      ///< bin_count: sum |Y_m - mean|^2
};

/// Compares one period, which is none of the reference's, with it: the same test. Returns whether it differs;
/// *out_level and *out_excess: its deviation over the signal, and what of its power is above scatter (0: too small to
/// be measured).
bool settle_differs(const double complex *period, const struct settle_reference *reference, double *out_level,
                    double *out_excess);

#endif
