/* SPDX-License-Identifier: MIT */
/// Amplitudes of two signals at a table's lines.
#ifndef SERVOSCOPE_MEASURE_AMPLITUDES_H
#define SERVOSCOPE_MEASURE_AMPLITUDES_H

#include "lab/numeric/fft.h"
#include "msgen/table.h"

/// Equation: A_k = 2/N |sum_n y[n] exp(-j 2 pi k n / N)|, both signals in one transform
/// Shapes:   plan: of N = period_samples points; period: torque, then velocity, N each; scratch: 2 N;
///           out_amplitudes: torque's and velocity's, bin_count each
/// Units:    those of the signal, zero to peak
void measure_find_amplitudes(struct fft_plan *plan, const struct msgen_table *table, const double *period,
                             double *scratch, double *const out_amplitudes[2]);

#endif
