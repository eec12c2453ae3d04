/* SPDX-License-Identifier: MIT */
/// Whether a recording repeats exactly after its period, or a little later or sooner: the drive that plays the table
/// and whoever samples the signals may run on clocks of their own, and a period need not be a whole number of samples.
#ifndef SERVOSCOPE_ESTIMATE_CLOCK_H
#define SERVOSCOPE_ESTIMATE_CLOCK_H

#include "lab/estimate/periodic.h"

#include <stdbool.h>
#include <stddef.h>

enum { clock_fewest_periods = 4 };

/// How one signal's periods are delayed against each other. Period q (x = q less the mean of all q) comes
/// offset x + drift x^2 / 2 samples later than period_samples say.
struct clock_signal {
    double offset_samples; ///< true period less period_samples, in the middle of the recording
    double offset_std;
    double drift_samples; ///< change of that from one period to the next; 0 unless it is certain
    double drift_std;     ///< 0 with fewer than 8 periods, which do not tell
    double wander;        ///< RMS of the delays that neither explains, beyond what noise makes of them; 0: none
    double slip_rad;      ///< phase by which the recording's two ends differ, RMS over lines by their information
    bool off;             ///< offset or drift are certain
};

enum clock_state {
    clock_untested, ///< fewer than 4 periods
    clock_steady,   ///< no offset, as far as noise lets it be seen
    clock_off,      ///< input and output agree on one: the true period is period_samples + offset
    clock_apart,    ///< input and output disagree: sampled by different clocks, or a drive that changes
};

struct clock {
    enum clock_state state;
    struct clock_signal input;
    struct clock_signal output;
    struct clock_signal both; ///< of the one that is more certain
    double middle_period;     ///< where the offset is that of: mean of the periods that count, plus a half
    double leakage;      ///< at most this share of a line leaks into its neighbour in a period cut at period_samples
    double relative_std; ///< of the response, median over lines
    bool matters;        ///< leakage or slip are no longer small against relative_std
    bool coherent;       ///< one period resembles the next: without that nothing here means anything
};

/// Measures the delays of the periods that count.
///
/// Equation:  a delay tau turns line k by -2 pi k tau / N. Delays of consecutive periods by the highest cross
///            correlation within 2 samples; then, turned back, each period against the mean of all by least squares,
///            tau_p = -sum_k w_k k Im(X_p,k conj Xbar_k) / sum_k w_k k^2 |Xbar_k|^2 N / 2 pi, w_k = 1/s_k^2; a line
///            through tau_p gives the offset, a parabola the drift, their residuals the standard deviations
/// Certain:   t test of both signals and both numbers at 1e-4 each: fewer than one false alarm in 1000 recordings
/// Matters:   leakage k_max |offset| / N above a tenth of relative_std, or slip above 0.05 rad
/// Errors:    false if memory is short
/// Test:      tests/unit/test_clock.c
bool clock_measure(const struct periodic *recording, struct clock *out);

#endif
