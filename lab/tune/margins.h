/* SPDX-License-Identifier: MIT */
/// How far a stable loop is from instability, and how fast it is. NaN: the lines have no such point.
#ifndef SERVOSCOPE_TUNE_MARGINS_H
#define SERVOSCOPE_TUNE_MARGINS_H

#include <complex.h>
#include <stddef.h>

struct margins {
    double gain_db;           ///< the loop's gain may rise by this much
    double gain_hz;           ///< where it would then oscillate
    double gain_reduction_db; ///< the gain may fall by this much (negative number); NaN: as far as one likes
    double gain_reduction_hz;
    double phase_deg; ///< smallest distance of the phase from -180 degrees where |L| = 1
    double phase_hz;
    double delay_s; ///< further delay that the loop bears
    double modulus; ///< max |S|, S = 1/(1 + L): 1 over the smallest distance of L from -1
    double modulus_hz;
    double crossover_hz; ///< the highest frequency where |L| falls through 1
    double
        cutoff_hz; ///< the lowest frequency where |T| falls through -3 dB, T = L/(1 + L): the closed loop's bandwidth
    double last_cutoff_hz; ///< the highest one; another one where T dips at an antiresonance
};

/// Finds the margins; between lines, log |L| and phase are taken as straight, but in a gap (lab/tune/gap.h), where
/// nothing is found. Crossings of -3 dB within 10 % of each
/// other are noise on one crossing.
/// Shapes: frequency_hz, loop: count; frequencies ascend
/// Test:   tests/unit/test_tune_margins.c
void margins_find(size_t count, const double *frequency_hz, const double complex *loop, struct margins *out_margins);

#endif
