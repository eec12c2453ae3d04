/* SPDX-License-Identifier: MIT */
/// Whether a drive was the same at the end of a measurement as at its beginning: friction warms up, a mass is moved, an
/// axis is touched.
#ifndef SERVOSCOPE_MEASURE_DRIFT_H
#define SERVOSCOPE_MEASURE_DRIFT_H

#include "lab/measure/summary.h"

#include <stdbool.h>
#include <stddef.h>

/// Arrays are owned; NaN where there is nothing to compare.
struct measure_drift {
    size_t periods[2]; ///< counted periods without lost samples in each half; fewer than 2 in one: nothing is compared
    size_t line_count;
    double *over_two_std[measure_velocity + 1]; ///< torque and velocity, of each line
    size_t beyond[measure_velocity + 1];        ///< lines above 1
    double chance;                              ///< that noise alone puts a line there
};

/// Compares the mean of the later half of the counted periods with that of the earlier half, line by line.
/// Equation: d_k = |Y2_k - Y1_k| / (2 sqrt(s_k^2 (1/n1 + 1/n2))), s_k^2 the scatter of the periods of each half around
///           its mean, both together: n1 + n2 - 2 complex degrees of freedom; chance: F(2, 2 (n1 + n2 - 2)) above 4
/// Errors:   false if memory is short; nothing to free then
/// Test:     tests/unit/test_measure_drift.c
bool measure_drift_find(const struct measure_summary *summary, struct measure_drift *out_self);

void measure_drift_free(struct measure_drift *self);

#endif
