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
            out_spectra[p * bin_count + b] = CMPLX(real, imaginary);
        }
    }
    free(table);
    return true;
}

/// Two real signals share a complex transform, so that rounding of the larger reaches the smaller; powers of two bring
/// both to about size 1 without rounding. A few samples tell the size well enough.
static int exponent_of(const double *x, size_t length)
{
    enum { step = 7 };
    double power = 0.0;
    double count = 0.0;
    int exponent = 0;
    for (size_t n = 0; n < length; n += step) {
        power += x[n] * x[n];
        count += 1.0;
    }
    if (isfinite(power) && power > 0.0) {
        (void)frexp(sqrt(power / count), &exponent);
    }
    return exponent;
}

/// Room for one transform.
struct workspace {
    struct fft_plan *plan;
    double *out;
};

static bool make_workspace(size_t length, struct workspace *out)
{
    out->plan = fft_plan_create(length);
    out->out = malloc(2 * length * sizeof *out->out);
    return out->plan && out->out;
}

static void free_workspace(struct workspace *self)
{
    fft_plan_destroy(self->plan);
    free(self->out);
}

/// Z = A + jB, so that A_k = (Z_k + conj Z_{N-k})/2 and B_k = (Z_k - conj Z_{N-k})/2j. bins NULL: every bin from 0.
static bool transform_pair(const struct workspace *self, size_t length, const double *a, const double *b,
                           const uint32_t *bins, size_t bin_count, double complex *out_a, double complex *out_b)
{
    int exponent_a = exponent_of(a, length);
    int exponent_b = exponent_of(b, length);
    double down_a = ldexp(1.0, -exponent_a);
    double down_b = ldexp(1.0, -exponent_b);
    double up_a = ldexp(0.5, exponent_a);
    double up_b = ldexp(0.5, exponent_b);
    if (!fft_forward_pair(self->plan, a, down_a, b, down_b, self->out)) {
        return false;
    }
    for (size_t i = 0; i < bin_count; i++) {
        size_t k = bins ? bins[i] : i;
        const double *z = self->out + 2 * k;
        const double *mirror = self->out + 2 * (k > 0 ? length - k : 0);
        double real_a = up_a * (z[0] + mirror[0]);
        double imag_a = up_a * (z[1] - mirror[1]);
        double real_b = up_b * (z[1] + mirror[1]);
        double imag_b = up_b * (mirror[0] - z[0]);
        out_a[i] = CMPLX(real_a, imag_a);
        out_b[i] = CMPLX(real_b, imag_b);
    }
    return true;
}

/// A transform of each whole period, two at a time; bins NULL: every bin from 0.
static bool transform_by_fft(const double *signal, size_t length, size_t periods, const uint32_t *bins,
                             size_t bin_count, double complex *out_spectra)
{
    struct workspace workspace;
    bool done = make_workspace(length, &workspace);
    for (size_t p = 0; p < periods && done; p += 2) {
        /* The last of an odd number is transformed beside itself. */
        size_t other = p + 1 < periods ? p + 1 : p;
        done = transform_pair(&workspace, length, signal + p * length, signal + other * length, bins, bin_count,
                              out_spectra + p * bin_count, out_spectra + other * bin_count);
    }
    free_workspace(&workspace);
    return done;
}

bool spectra_transform_periods(const double *signal, size_t period_samples, size_t periods, const uint32_t *bins,
                               size_t bin_count, double complex *out_spectra)
{
    if (spectra_prefers_fft(period_samples, bin_count)) {
        return transform_by_fft(signal, period_samples, periods, bins, bin_count, out_spectra);
    }
    return transform_by_sums(signal, period_samples, periods, bins, bin_count, out_spectra);
}

bool spectra_transform_both(const double *first, const double *second, size_t period_samples, size_t periods,
                            const uint32_t *bins, size_t bin_count, double complex *out_first,
                            double complex *out_second)
{
    if (!spectra_prefers_fft(period_samples, bin_count)) {
        return transform_by_sums(first, period_samples, periods, bins, bin_count, out_first) &&
               transform_by_sums(second, period_samples, periods, bins, bin_count, out_second);
    }
    struct workspace workspace;
    bool done = make_workspace(period_samples, &workspace);
    for (size_t p = 0; p < periods && done; p++) {
        done = transform_pair(&workspace, period_samples, first + p * period_samples, second + p * period_samples, bins,
                              bin_count, out_first + p * bin_count, out_second + p * bin_count);
    }
    free_workspace(&workspace);
    return done;
}

bool spectra_transform_all(const double *signal, size_t period_samples, size_t periods, double complex *out_spectra)
{
    return transform_by_fft(signal, period_samples, periods, NULL, period_samples / 2 + 1, out_spectra);
}

bool spectra_transform_two(const double *first, const double *second, size_t rows, double complex *out_first,
                           double complex *out_second)
{
    struct workspace workspace;
    bool done = make_workspace(rows, &workspace);
    done = done && transform_pair(&workspace, rows, first, second, NULL, rows / 2 + 1, out_first, out_second);
    free_workspace(&workspace);
    return done;
}
