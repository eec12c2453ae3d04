/* SPDX-License-Identifier: MIT */
/// Whether the columns of a recording count in the same direction: a sensor that counts the other way round turns the
/// response by 180 degrees, which no standard deviation shows.
#ifndef SERVOSCOPE_ESTIMATE_DIRECTION_H
#define SERVOSCOPE_ESTIMATE_DIRECTION_H

#include "lab/estimate/periodic.h"

#include <stdbool.h>
#include <stddef.h>

enum { direction_found_max = 4 };

struct direction {
    size_t count; ///< columns that count the other way round
    struct direction_finding {
        const char *name;    ///< owned by the run
        const char *against; ///< column that it disagrees with
        double cosine;       ///< -1: opposite in every line, 0: nothing in common
    } found[direction_found_max];
};

/// Compares the columns that tell a motion, at the excited lines, as velocities.
///
/// c(T) = sum Re(A conj(B) turn exp(j w T)) / sum |A| |B|, T up to 0.1 s, at most an eighth of a period: opposite
/// where max -c > 0.6 and max c < 0.4, so that no delay explains what a sign does. Otherwise nothing is said.
///
/// velocity, position:    of one sensor, turn 1, T of either sign
/// load, motor:           they move together below the antiresonance, where their ratio is largest: of the lines below
///                        half of its frequency (at least 3), turn 1, T of either sign
/// motion, input:         a motor drives what it moves: but for a delay a response to torque, force, current or voltage
///                        lies between -90 degrees (inertia) and 0 (friction), turn exp(j pi/4), T >= 0. Of the
///                        motor's columns only, over lines that span a factor of 5, where the response does not rise
///                        with frequency as a spring's does; where the surest of them is opposite, the other is too
///                        unless they are opposite to each other
/// Errors: false if memory is short
/// Test:   tests/unit/test_direction.c
bool direction_measure(const struct periodic *recording, struct direction *out);

#endif
