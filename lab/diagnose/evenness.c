/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/evenness.h"

#include "lab/numeric/fft.h"

#include <math.h>
#include <string.h>

double evenness(const struct evidence *evidence, const double *contrasts, size_t first_bin, size_t last_bin,
                double *work)
{
    const struct recording *r = evidence->recording;
    size_t n = r->block.samples, P = r->periods;
    double *spectrum = work, *time = work + 2 * n, *power = work + 4 * n, sum = 0.0, squares = 0.0;
    memset(power, 0, n * sizeof *power);
    for (size_t p = 0; p < P; p++) {
        const double *values = contrasts + p * evidence->contrast.width;
        memset(spectrum, 0, 2 * n * sizeof *spectrum);
        if (first_bin == 0)
            spectrum[0] = values[0];
        for (size_t k = first_bin > 0 ? first_bin : 1; k <= last_bin; k++) {
            spectrum[2 * k] = spectrum[2 * (n - k)] = values[2 * k - 1];
            spectrum[2 * k + 1] = values[2 * k];
            spectrum[2 * (n - k) + 1] = -values[2 * k];
        }
        fft_inverse(evidence->plan, spectrum, time);
        for (size_t i = 0; i < n; i++)
            power[i] += time[2 * i] * time[2 * i];
    }
    for (size_t i = 0; i < n; i++) {
        sum += power[i] / (double)n;
        squares += power[i] * power[i] / (double)n;
    }
    return squares > 0.0 ? fmin((1.0 + 2.0 / (double)(P - 1)) * sum * sum / squares, 1.0) : 1.0;
}
