/* SPDX-License-Identifier: MIT */
/// Whether a response repeats with its excitation, or only after two or more of its periods, as some nonlinear drives'
/// do. The mean over periods and its scatter mean nothing then.
#ifndef SERVOSCOPE_ESTIMATE_REPETITION_H
#define SERVOSCOPE_ESTIMATE_REPETITION_H

#include "lab/estimate/periodic.h"

#include <stdbool.h>

enum { repetition_multiple_max = 4 };

struct repetition {
    unsigned tested;   ///< largest multiple of the period that was tested; 0: fewer than 4 periods in a row
    unsigned multiple; ///< 1: the response repeats every period, as far as scatter lets it be seen; else 2 .. 4
    double chance;     ///< at most, that scatter alone does as much on any line; 1 without a test
    double level;      ///< RMS of what repeats after `multiple` periods only, over that of what repeats every period
};

/// Tests the output's spectra at the excited bins, over the longest stretch of consecutive settled periods.
///
/// Equation:  a part of the response with m times the period lies between the bins, at k + j/m, and changes sign (m =
///            2)
///            or turns (m > 2) from period to period. Over P periods, the greatest multiple of m,
///            B_k(j) = 1/P sum_p Y_p,k exp(-j 2 pi j p / P): rows j = P/m, 2P/m, ... prime to m hold that part, all
///            others but 0 (and multiples of lower tests) the scatter, which is the same in every row if it is noise:
///            F_k = (mean |B|^2 of those rows) / (mean |B|^2 of the others) ; its chance is at most that of
///            F(n, n_others), half the degrees of freedom of circular noise, because what slow noise leaks into a line
///            has the same phase in all periods
///            Slow noise leaks into all lines at once, so that they are not independent: the smallest chance of all
///            lines, times their number and that of multiples tested, is believed below 1e-3
///            A transient that dies away, a drift or slow noise is strong in the rows near 0 and never alarms.
/// Needs:     4 periods in a row for m = 2, 6 for 3, 8 for 4
/// Limits:    a disturbance that happens to lie at k + 1/m lines looks the same, and so does an oscillation there that
///            hardly decays
/// Errors:    false if memory is short
/// Test:      tests/unit/test_repetition.c
bool repetition_test(const struct periodic *recording, struct repetition *out);

#endif
