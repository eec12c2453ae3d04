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
/// velocity, position:    of one sensor: sum Re(V conj(j w P)) / sum |V| |j w P|, opposite below -0.7
/// load, motor:           they move together below the antiresonance, where their ratio is largest: of the lines below
///                        half of its frequency (at least 3, else nothing is said), opposite below -0.7
/// motion, input:         a motor drives what it moves: without lag a response to torque, force, current or voltage
/// lies
///                        between 90 (spring) and -90 degrees (inertia), around 0 for friction.
///                        sum Re(V conj(U) exp(j pi/4)) / sum |V| |U|, which leaves room for a sensor's lag, is far
///                        above
///                        0 then, and opposite below -0.4. Of the motor's columns only; where one of them is opposite,
///                        the other is too unless they are opposite to each other
/// Errors: false if memory is short
/// Test:   tests/unit/test_direction.c
bool direction_measure(const struct periodic *recording, struct direction *out);

#endif
