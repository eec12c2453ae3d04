/* SPDX-License-Identifier: MIT */
/// Speed and position of a run from whatever columns it has, without phase shift.
#ifndef SERVOSCOPE_DIAGNOSE_MOTION_H
#define SERVOSCOPE_DIAGNOSE_MOTION_H

#include <stdbool.h>
#include <stddef.h>

struct stretch;

/// Fills in out->position and out->velocity (rows each, the caller's) from a position column, a speed column or both
/// (the other is NULL).
/// Both: v = speed + L (d position/dt - speed), L the zero-phase low-pass 1 / (1 + (w/wc)^2)^2, wc = sigma_speed /
/// sigma_position: close to the minimum-variance mix for white noises; together the weights are one at every frequency,
/// so nothing is distorted. Where the two differ by more than noise, and not by gain or delay, v = speed. A speed
/// column that contradicts the position (gain off by 2 % everywhere on the travel, or late by a tenth of a sample) is
/// left out. Position alone: its derivative; in a run without periods after a zero-phase 4th-order Butterworth low-pass
/// at a tenth of the sample rate, because nothing averages the noise there. Speed alone: its integral.
/// out->kinematics becomes the difference of the two where both are used (the caller frees it), else NULL.
/// Range: period is the number of samples of one period, 0 for a run without.
/// Errors: false if memory is short.
bool motion_estimate(size_t rows, double rate_hz, const double *position, const double *velocity, size_t period,
                     struct stretch *out, char *out_text, size_t size);

#endif
