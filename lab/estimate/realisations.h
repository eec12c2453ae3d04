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
