/* SPDX-License-Identifier: MIT */
/// How far one response is from another: a drive before and after, two levels, two drives, two methods.
#ifndef SERVOSCOPE_ESTIMATE_DIFFERENCE_H
#define SERVOSCOPE_ESTIMATE_DIFFERENCE_H

#include "lab/record/frf_file.h"

#include <stdbool.h>
#include <stddef.h>

struct difference {
    size_t common;          ///< valid lines that both have; 0: nothing else means anything
    size_t compared;        ///< of these, with a standard deviation above 0
    size_t beyond;          ///< of those, further apart than 2 std of the difference
    double middle_db;       ///< median of 20 log10(|G| / |G_first|) over the common lines; NaN where all are 0
    double worst, worst_hz; ///< the largest distance, in 2 std, and where
    double chance;          ///< that noise alone puts a line beyond: F(2, dof of both) above 4
};

/// Equation: d_k = |G_k - G_first,k| / (2 sqrt(std_k^2 + std_first,k^2)) at equal frequencies (within 1e-4 of them: the
///           clocks of two recordings differ)
/// Shapes:   out_over_two_std: other->count, NaN where there is nothing to compare; may be NULL
/// Errors:   false if memory is short
/// Test:     tests/unit/test_difference.c
bool difference_measure(const struct frf *first, const struct frf *other, double *out_over_two_std,
                        struct difference *out);

/// Chance that noise moves a line by more than 2 std, which is an estimate itself: F(2, dof) above 4; exp(-4) where the
/// degrees of freedom are not known (0).
double difference_chance(double degrees_of_freedom);

/// One or two sentences without the other's name in front ("lies 0.12 dB higher than a.csv ..."), no newline.
void difference_say(const struct difference *self, const char *first_name, char *out_text, size_t size);

#endif
