/* SPDX-License-Identifier: MIT */
#include "lab/measure/amplitudes.h"

#include <math.h>
#include <stddef.h>
#include <stdint.h>

void measure_find_amplitudes(struct fft_plan *plan, const struct msgen_table *table, const double *period,
                             double *scratch, double *const out_amplitudes[2])
{
    const size_t length = table->period_samples;
    fft_forward_pair(plan, period, 1.0, period + length, 1.0, scratch);
    for (uint32_t i = 0; i < table->bin_count; i++) {
        // X_k = A_k + j B_k and conj X_(N-k) = A_k - j B_k, because both signals are real.
        const size_t k = msgen_table_bin(table, i);
        const double *up = scratch + 2 * k;
        const double *down = scratch + 2 * (length - k);
        out_amplitudes[0][i] = hypot(up[0] + down[0], up[1] - down[1]) / (double)length;
        out_amplitudes[1][i] = hypot(up[0] - down[0], up[1] + down[1]) / (double)length;
    }
}
