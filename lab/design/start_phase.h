/* SPDX-License-Identifier: MIT */
/// Where in the period to begin so that a drive at rest is disturbed least.
#ifndef SERVOSCOPE_DESIGN_START_PHASE_H
#define SERVOSCOPE_DESIGN_START_PHASE_H

#include "lab/design/transient.h"
#include "lab/record/error.h"

#include <stddef.h>

/// Of all zero crossings of the velocity (the sample nearer to zero of the two around it) the one with the least
/// absolute acceleration (first paper, 3.3). The period is cyclic; without a crossing, which a signal of zero mean does
/// not have, 0.
size_t design_start_phase_paper(size_t samples, const double *velocity_rad_per_s,
                                const double *acceleration_rad_per_s2);

/// Finds the sample with the least transient: energy in the motor's velocity over the first period when the table
/// begins there without a fade and the drive is at rest (cascade: at the reference's position), as a share of what the
/// steady state has in a period.
/// `drive` NULL: mean over the bank of nominal drives (start_bank.h), for the mode the table is meant for; a start for
///             one mode is not the best for the other.
/// out_share:  that transient at *out_start_index
/// Errors:     error_refused if memory is short, or for a drive that is unstable in this mode, has more dead time than
///             design_loop_dead_samples_max samples, or has an undamped resonance on a line
/// Cost:       per drive K systems of 3 to 9 equations and 2 or 3 FFT of N; 10 000 lines, N = 2^17, bank: 1.4 s (a
///             quarter of that for design_start_expect)
/// Test:       tests/unit/test_design_start.c, tests/golden/test_design_start.c
int design_start_choose(const struct design_transient_table *table, const struct sim_model *drive,
                        enum design_loop_mode mode, size_t *out_start_index, double *out_share,
                        struct error *out_error);

/// The share for each sample of the period, instead of the least of them.
/// Shapes: out_shares: table->period_samples
int design_start_map(const struct design_transient_table *table, const struct sim_model *drive,
                     enum design_loop_mode mode, double *out_shares, struct error *out_error);

/// The same share at a given sample, whatever chose it. No FFT.
int design_start_expect(const struct design_transient_table *table, const struct sim_model *drive,
                        enum design_loop_mode mode, size_t start_index, double *out_share, struct error *out_error);

#endif
