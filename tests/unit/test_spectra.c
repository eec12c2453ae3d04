/* SPDX-License-Identifier: MIT */
#include "lab/estimate/spectra.h"
#include "lab/numeric/statistics.h"

#include "unity.h"

#include <math.h>
#include <stdlib.h>

static const double two_pi = 6.283185307179586476925;
/// Rounding of a sum of N = 2003 products of size 1, in units of that sum's scale: N^(1/2) * 1e-16, with room.
static const double rounding = 1e-11;

void setUp(void) {}

void tearDown(void) {}

static double *random_signal(size_t rows, uint64_t seed)
{
    double *signal = malloc(rows * sizeof *signal);
    struct random random;
    random_seed(&random, seed);
    for (size_t n = 0; n < rows; n++) {
        signal[n] = random_normal(&random);
    }
    return signal;
}

/// The definition, term by term.
static double complex by_definition(const double *signal, size_t length, size_t bin)
{
    double complex sum = 0.0;
    for (size_t n = 0; n < length; n++) {
        sum += signal[n] * cexp(-I * two_pi * (double)(n * bin % length) / (double)length);
    }
    return sum;
}

static void check_length(size_t length, size_t bin_count)
{
    enum { periods = 3 };
    double *signal = random_signal(periods * length, length);
    uint32_t *bins = malloc(bin_count * sizeof *bins);
    double complex *spectra = malloc(periods * bin_count * sizeof *spectra);
    for (size_t b = 0; b < bin_count; b++) {
        bins[b] = (uint32_t)(b * (length / 2) / bin_count);
    }
    TEST_ASSERT_TRUE(spectra_transform_periods(signal, length, periods, bins, bin_count, spectra));
    for (size_t p = 0; p < periods; p++) {
        for (size_t b = 0; b < bin_count; b++) {
            double complex expected = by_definition(signal + p * length, length, bins[b]);
            TEST_ASSERT_TRUE(cabs(spectra[p * bin_count + b] - expected) < rounding * sqrt((double)length) * 10.0);
        }
    }
    free(signal);
    free(bins);
    free(spectra);
}

static void test_spectra_equal_definition_by_sums_and_by_fft(void)
{
    TEST_ASSERT_FALSE(spectra_prefers_fft(2003, 200));
    check_length(2003, 200);
    TEST_ASSERT_FALSE(spectra_prefers_fft(2000, 9));
    check_length(2000, 9);
    TEST_ASSERT_TRUE(spectra_prefers_fft(2000, 200));
    check_length(2000, 200);
}

static void test_spectra_all_bins_equal_chosen_ones(void)
{
    enum { length = 60, all = length / 2 + 1 };
    double *signal = random_signal(2 * length, 3);
    uint32_t bins[all];
    double complex chosen[2 * all];
    double complex every[2 * all];
    for (uint32_t k = 0; k < all; k++) {
        bins[k] = k;
    }
    TEST_ASSERT_TRUE(spectra_transform_periods(signal, length, 2, bins, all, chosen));
    TEST_ASSERT_TRUE(spectra_transform_all(signal, length, 2, every));
    for (size_t i = 0; i < 2 * all; i++) {
        TEST_ASSERT_TRUE(cabs(chosen[i] - every[i]) < rounding * length);
    }
    free(signal);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_spectra_equal_definition_by_sums_and_by_fft);
    RUN_TEST(test_spectra_all_bins_equal_chosen_ones);
    return UNITY_END();
}
