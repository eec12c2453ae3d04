/* SPDX-License-Identifier: MIT */
#include "lab/estimate/spectra.h"

#include "lab/numeric/clones.h"
#include "lab/numeric/fft.h"
#include "lab/numeric/vector.h"

#include <math.h>
#include <stdlib.h>

/// Two real signals share a complex transform, so that rounding of the larger reaches the smaller; powers of two bring
/// both to about size 1 without rounding. Every sample counts: a sine may be zero wherever one would look.
static int exponent_of(const double *x, size_t length)
{
    double power = vector_power(length, x);
    int exponent = 0;
    if (isfinite(power) && power > 0.0) {
        (void)frexp(sqrt(power / (double)length), &exponent);
    }
    return exponent;
}

/// A complex number where it lies, both parts worked on at once: the compiler does not see it by itself below.
typedef double pair __attribute__((vector_size(2 * sizeof(double)), aligned(sizeof(double)), may_alias));

/// Room for one transform.
struct workspace {
    struct fft_plan *plan;
    double complex *out;
};

static bool make_workspace(size_t length, struct workspace *out)
{
    out->plan = fft_plan_create(length);
    out->out = malloc(length * sizeof *out->out);
    return out->plan && out->out;
}

static void free_workspace(struct workspace *self)
{
    fft_plan_destroy(self->plan);
    free(self->out);
}

/// bins NULL: every bin from 0.
CLONED_FOR_AVX2 static void transform_pair(const struct workspace *self, size_t length, const double *a,
                                           const double *b, const uint32_t *bins, size_t bin_count,
                                           double complex *out_a, double complex *out_b)
{
    const int exponent_a = exponent_of(a, length);
    const int exponent_b = exponent_of(b, length);
    const double half_a = ldexp(0.5, exponent_a);
    const double half_b = ldexp(0.5, exponent_b);
    const double complex *z = self->out;
    fft_forward_pair(self->plan, a, ldexp(1.0, -exponent_a), b, ldexp(1.0, -exponent_b), (double *)self->out);
    /* Z = A + jB, so that A_k = (Z_k + conj Z_{N-k})/2 and B_k = (Z_k - conj Z_{N-k})/2j. */
    for (size_t i = 0; i < bin_count; i++) {
        const size_t k = bins ? bins[i] : i;
        const pair line = *(const pair *)(z + k);
        const pair mirror = *(const pair *)(z + (k > 0 ? length - k : 0)) * (pair){1.0, -1.0};
        const pair difference = line - mirror;
        *(pair *)(out_a + i) = (line + mirror) * half_a;
        *(pair *)(out_b + i) = (pair){difference[1], difference[0]} * (pair){half_b, -half_b};
    }
}

bool spectra_transform_periods(const double *signal, size_t period_samples, size_t periods, const uint32_t *bins,
                               size_t bin_count, double complex *out_spectra)
{
    struct workspace workspace;
    bool done = make_workspace(period_samples, &workspace);
    for (size_t p = 0; p < periods && done; p += 2) {
        /* The last of an odd number is transformed beside itself. */
        size_t other = p + 1 < periods ? p + 1 : p;
        transform_pair(&workspace, period_samples, signal + p * period_samples, signal + other * period_samples, bins,
                       bin_count, out_spectra + p * bin_count, out_spectra + other * bin_count);
    }
    free_workspace(&workspace);
    return done;
}

bool spectra_transform_both(const double *first, const double *second, size_t period_samples, size_t periods,
                            const uint32_t *bins, size_t bin_count, double complex *out_first,
                            double complex *out_second)
{
    struct workspace workspace;
    bool done = make_workspace(period_samples, &workspace);
    for (size_t p = 0; p < periods && done; p++) {
        transform_pair(&workspace, period_samples, first + p * period_samples, second + p * period_samples, bins,
                       bin_count, out_first + p * bin_count, out_second + p * bin_count);
    }
    free_workspace(&workspace);
    return done;
}

bool spectra_transform_all(const double *signal, size_t period_samples, size_t periods, double complex *out_spectra)
{
    return spectra_transform_periods(signal, period_samples, periods, NULL, period_samples / 2 + 1, out_spectra);
}

bool spectra_transform_two(const double *first, const double *second, size_t rows, double complex *out_first,
                           double complex *out_second)
{
    struct workspace workspace;
    bool done = make_workspace(rows, &workspace);
    if (done) {
        transform_pair(&workspace, rows, first, second, NULL, rows / 2 + 1, out_first, out_second);
    }
    free_workspace(&workspace);
    return done;
}
