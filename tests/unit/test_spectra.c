/* SPDX-License-Identifier: MIT */
#include "lab/estimate/spectra.h"
#include "lab/estimate/stretch.h"
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

static void test_spectra_equal_definition_for_many_and_few_bins(void)
{
    check_length(2003, 200);
    check_length(2000, 9);
    check_length(2000, 200);
    check_length(1250, 1);
}

/// A sine that is zero at every seventh sample must not be taken for a small signal.
static void test_spectra_keep_a_signal_beside_a_sine_with_many_zeros(void)
{
    enum { length = 1400, bin = 100 };
    double *noise = random_signal(length, 8);
    double *sine = malloc(length * sizeof *sine);
    const uint32_t bins[] = {3, bin};
    double complex spectra[2][2];
    for (size_t n = 0; n < length; n++) {
        sine[n] = sin(two_pi * (double)(bin * n % length) / length);
    }
    TEST_ASSERT_TRUE(spectra_transform_both(sine, noise, length, 1, bins, 2, spectra[0], spectra[1]));
    for (size_t b = 0; b < 2; b++) {
        TEST_ASSERT_TRUE(cabs(spectra[0][b] - by_definition(sine, length, bins[b])) < rounding);
        TEST_ASSERT_TRUE(cabs(spectra[1][b] - by_definition(noise, length, bins[b])) < rounding);
    }
    free(noise);
    free(sine);
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

/// Rounding of the larger of two signals in one transform must not reach the smaller one.
static void test_spectra_of_both_keep_a_small_signal_beside_a_large_one(void)
{
    enum { length = 240, bin_count = 60, periods = 2 };
    double *large = random_signal(periods * length, 5);
    double *small = random_signal(periods * length, 6);
    uint32_t bins[bin_count];
    double complex spectra[2][periods * bin_count];
    for (uint32_t b = 0; b < bin_count; b++) {
        bins[b] = 2 * b;
    }
    for (size_t n = 0; n < periods * length; n++) {
        large[n] *= 3e9;
        small[n] *= 2e-9;
    }
    TEST_ASSERT_TRUE(spectra_transform_both(large, small, length, periods, bins, bin_count, spectra[0], spectra[1]));
    for (size_t i = 0; i < periods * bin_count; i++) {
        size_t start = i / bin_count * length;
        double complex of_large = by_definition(large + start, length, bins[i % bin_count]);
        double complex of_small = by_definition(small + start, length, bins[i % bin_count]);
        TEST_ASSERT_TRUE(cabs(spectra[0][i] - of_large) < 3e9 * rounding);
        TEST_ASSERT_TRUE(cabs(spectra[1][i] - of_small) < 2e-9 * rounding);
    }
    free(large);
    free(small);
}

/// Near multiples of P, and everywhere if P is small, the short way equals the long one.
static void check_near(size_t length, size_t periods, size_t reach)
{
    size_t rows = length * periods;
    size_t lines = rows / 2 + 1;
    double *input = random_signal(rows, rows);
    double *output = random_signal(rows, rows + 1);
    char input_name[] = "u";
    char output_name[] = "y";
    struct run_column columns[] = {{input_name, input}, {output_name, output}};
    uint32_t bins[] = {1, (uint32_t)(length - 1) / 2};
    const struct run run = {.rows = rows, .columns = columns, .column_count = 2};
    const struct periodic recording = {.run = &run,
                                       .input = "u",
                                       .output = "y",
                                       .period_samples = length,
                                       .bins = bins,
                                       .bin_count = 2,
                                       .trend_per_sample = 0.01};
    const struct stretch stretch = {.periods = periods, .rows = rows};
    double complex *whole = malloc(4 * lines * sizeof *whole);
    double complex *near = whole + 2 * lines;
    TEST_ASSERT_TRUE(stretch_transform(&recording, &stretch, whole, whole + lines));
    TEST_ASSERT_TRUE(stretch_transform_near(&recording, &stretch, reach, near, near + lines));
    for (size_t line = 0; line < lines; line++) {
        size_t beyond = line % periods;
        beyond = beyond < periods - beyond ? beyond : periods - beyond;
        if (beyond <= reach) {
            TEST_ASSERT_TRUE(cabs(near[line] - whole[line]) < rounding * (double)rows);
            TEST_ASSERT_TRUE(cabs(near[lines + line] - whole[lines + line]) < rounding * (double)rows);
        }
    }
    free(whole);
    free(input);
    free(output);
}

static void test_stretch_near_equals_the_whole_transform(void)
{
    check_near(60, 2, 6);
    check_near(61, 3, 6);
    check_near(540, 8, 6);
    check_near(61, 50, 7);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_spectra_equal_definition_for_many_and_few_bins);
    RUN_TEST(test_spectra_keep_a_signal_beside_a_sine_with_many_zeros);
    RUN_TEST(test_spectra_all_bins_equal_chosen_ones);
    RUN_TEST(test_spectra_of_both_keep_a_small_signal_beside_a_large_one);
    RUN_TEST(test_stretch_near_equals_the_whole_transform);
    return UNITY_END();
}
