/* SPDX-License-Identifier: MIT */
/// Whether realisations (runs with other phases or levels, same lines) differ by more than their own noise. A linear
/// drive gives all of them one response; what differs is stochastic nonlinear distortion, or a drive that has changed.
#ifndef SERVOSCOPE_ESTIMATE_AGREEMENT_H
#define SERVOSCOPE_ESTIMATE_AGREEMENT_H

#include "lab/record/frf_file.h"

#include <stdbool.h>
#include <stddef.h>

struct agreement {
    size_t realisations;
    size_t lines;        ///< that are valid in all realisations and have a standard deviation; 0: nothing to compare
    size_t lines_beyond; ///< of those, where noise alone would differ as much with less than 5 % chance
    double chance;       ///< that noise alone makes them differ as much, over all lines
    double ratio;        ///< median of scatter between realisations over noise, as standard deviations; 1: noise alone
    double level;        ///< of the distortion in one realisation over |G|: median of sqrt(max(s^2 - s_n^2, 0)) / |G|
};

/// Compares R >= 2 responses with equal lines, as estimate_average() takes them.
///
/// Equation:  s^2 = 1/(R-1) sum |G_r - G|^2;  s_n^2 = 1/R sum noise_std_r^2
///            F = s^2 / s_n^2 ~ F(2(R-1), R dof) with dof real degrees of freedom in each; chances combine after Fisher
/// Errors:    false if memory is short
/// Test:      tests/unit/test_agreement.c
bool agreement_measure(const struct frf *realisations, size_t count, struct agreement *out);

/// Whether the realisations differ by more than noise: chance below 1e-3.
bool agreement_differs(const struct agreement *self);

#endif
