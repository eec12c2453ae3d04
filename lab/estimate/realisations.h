/* SPDX-License-Identifier: MIT */
/// One response of several runs. Runs with phases of their own are realisations, whose scatter holds the stochastic
/// nonlinear distortion; runs of the same excitation only add periods to one realisation.
#ifndef SERVOSCOPE_ESTIMATE_REALISATIONS_H
#define SERVOSCOPE_ESTIMATE_REALISATIONS_H

#include "lab/estimate/agreement.h"
#include "lab/estimate/excitation.h"
#include "lab/record/error.h"
#include "lab/record/frf_file.h"

#include <stddef.h>

/// Pools runs of one excitation, weighed by their periods (alike where there are none).
/// Equation:  G = sum q_r G_r,  std^2 = sum q_r^2 std_r^2, noise_std alike;  q_r = periods_r / sum periods
///            distortion levels: root of their mean power
/// Validity:  a line is valid if it is in every run; degrees of freedom: the sum of all runs'
/// Keys:      what all runs say alike, sample_rate_hz as their mean, `runs`
/// Errors:    as estimate_average()
int realisations_pool(const struct frf *runs, size_t count, struct frf *out_frf, struct error *out_error);

/// Pools what excitations_compare calls the same and averages what remains (estimate_average).
///
/// Agreement: of the realisations (agreement.h); with a single one, empty (lines 0)
/// Keys:      realisations; warning_realisations if runs were pooled, and whether these agree; or if two runs have the
///            same phases at other levels
/// Errors:    error_refused if two runs are the same recording (their responses differ by less than a hundredth of the
///            noise, median over at least 3 lines), as estimate_average(), or if memory is short; *out_frf is empty
///            then
/// Test:      tests/unit/test_realisations.c
int realisations_combine(const struct frf *runs, const struct excitations *excitations, size_t count,
                         struct frf *out_frf, struct agreement *out_agreement, struct error *out_error);

#endif
