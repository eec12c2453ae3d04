/* SPDX-License-Identifier: MIT */
#include "lab/estimate/spectra.h"

#include "lab/numeric/fft.h"

#include <math.h>
#include <stdlib.h>

static const double two_pi = 6.283185307179586476925;

/// Multiplications of an FFT per sample and prime factor, over those of the direct sum per sample and bin; measured at
/// N = 2000 and 65536.
static const double fft_cost_per_factor = 2.5;

static size_t sum_of_prime_factors(size_t n)
{
    size_t sum = 0;
    for (size_t factor = 2; factor * factor <= n; factor++) {
        while (n % factor == 0) {
            sum += factor;
            n /= factor;
        }
    }
    return n > 1 ? sum + n : sum;
}

bool spectra_prefers_fft(size_t period_samples, size_t bin_count)
{
    return fft_cost_per_factor * (double)sum_of_prime_factors(period_samples) < (double)bin_count;
}

/// Direct sums: the twiddles' index runs modulo N, so that every factor is as exact as the table.
static bool transform_by_sums(const double *signal, size_t length, size_t periods, const uint32_t *bins,
                              size_t bin_count, double complex *out_spectra)
{
    double *table = malloc(2 * length * sizeof *table);
    if (!table) {
        return false;
    }
    for (size_t n = 0; n < length; n++) {
        double angle = two_pi * (double)n / (double)length;
        table[2 * n] = cos(angle);
        table[2 * n + 1] = -sin(angle);
    }
    for (size_t p = 0; p < periods; p++) {
        const double *x = signal + p * length;
        for (size_t b = 0; b < bin_count; b++) {
            double real = 0.0;
            double imaginary = 0.0;
            size_t index = 0;
            for (size_t n = 0; n < length; n++) {
                real += x[n] * table[2 * index];
                imaginary += x[n] * table[2 * index + 1];
                index += bins[b];
                index -= index >= length ? length : 0;
            }
            out_spectra[p * bin_count + b] = real + imaginary * I;
        }
    }
    free(table);
    return true;
}

/// A transform of each whole period; bins NULL: every bin from 0.
static bool transform_by_fft(const double *signal, size_t length, size_t periods, const uint32_t *bins,
                             size_t bin_count, double complex *out_spectra)
{
    double *buffer = malloc(4 * length * sizeof *buffer);
    struct fft_plan *plan = fft_plan_create(length);
    if (!buffer || !plan) {
        free(buffer);
        fft_plan_destroy(plan);
        return false;
    }
    double *in = buffer;
    double *out = buffer + 2 * length;
    for (size_t p = 0; p < periods; p++) {
        for (size_t n = 0; n < length; n++) {
            in[2 * n] = signal[p * length + n];
            in[2 * n + 1] = 0.0;
        }
        fft_forward(plan, in, out);
        for (size_t b = 0; b < bin_count; b++) {
            size_t k = bins ? bins[b] : b;
            out_spectra[p * bin_count + b] = out[2 * k] + out[2 * k + 1] * I;
        }
    }
    free(buffer);
    fft_plan_destroy(plan);
    return true;
}

bool spectra_transform_periods(const double *signal, size_t period_samples, size_t periods, const uint32_t *bins,
                               size_t bin_count, double complex *out_spectra)
{
    if (spectra_prefers_fft(period_samples, bin_count)) {
        return transform_by_fft(signal, period_samples, periods, bins, bin_count, out_spectra);
    }
    return transform_by_sums(signal, period_samples, periods, bins, bin_count, out_spectra);
}

bool spectra_transform_all(const double *signal, size_t period_samples, size_t periods, double complex *out_spectra)
{
    return transform_by_fft(signal, period_samples, periods, NULL, period_samples / 2 + 1, out_spectra);
}
