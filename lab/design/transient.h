/* SPDX-License-Identifier: MIT */
/// What a drive at rest makes of the beginning of a table, for every sample at which the table may begin.
/// A drive that starts at sample t0 differs from the periodic steady state x_ss by D(t0) = x_rest(t0) - x_ss(t0), and
/// moves away from it by A^n D(t0) after n samples. The energy of that in the motor's velocity over the first period is
///     J(t0) = D' Q D = sum_i ( Re sum_k y_ik exp(j 2 pi b_k t0 / N) )^2,   y_ik = sqrt(lambda_i) w_i' D_k,
/// with Q = sum_i lambda_i w_i w_i' the Gramian over N samples and D_k the phasors of the mismatch: one signal per
/// eigenvector, whatever the number of states, and all t0 by FFT.
#ifndef SERVOSCOPE_DESIGN_TRANSIENT_H
#define SERVOSCOPE_DESIGN_TRANSIENT_H

#include "lab/design/loop.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// A periodic reference as its lines; velocity and torque belong to the position.
struct design_transient_table {
    double rate_hz;
    size_t period_samples;
    size_t line_count;
    const uint32_t *bins;
    const double *amplitude_rad; ///< of the position
    const double *phase_rad;     ///< of the position at sample 0
    double inertia_kgm2;         ///< torque reference = inertia times acceleration
};

struct design_transient {
    size_t line_count;
    const uint32_t *bins; ///< the table's
    size_t period_samples;
    size_t component_count; ///< 1 .. states
    double *components;     ///< y, component after component, line_count complex numbers each
    double steady_energy;   ///< of the motor's velocity in steady state, sum over a period
};

enum design_transient_status {
    design_transient_ok,
    design_transient_no_steady_state, ///< an undamped resonance lies on a line
    design_transient_memory,
};

/// Prepares J(t0) of one system under one table, which has to outlive the result.
enum design_transient_status design_transient_create(const struct design_loop *loop,
                                                     const struct design_transient_table *table,
                                                     struct design_transient *out_transient);
void design_transient_free(struct design_transient *transient);

/// J(t0) / steady_energy for one t0, in samples; parts of a sample too (all phases shifted by 2 pi b_k t0 / N).
double design_transient_share(const struct design_transient *self, double t0_samples);

/// Adds J(t0) / steady_energy for t0 = 0 .. period_samples - 1 to inout_share. Returns false if memory is short.
bool design_transient_add_shares(const struct design_transient *self, double *inout_share);

#endif
