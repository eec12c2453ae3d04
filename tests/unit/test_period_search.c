/* SPDX-License-Identifier: MIT */
#include "lab/estimate/period_search.h"
#include "lab/estimate/spectra.h"
#include "lab/numeric/statistics.h"

#include "unity.h"

#include <math.h>
#include <stdlib.h>

static const double two_pi = 6.283185307179586476925;

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

/// Random-phase multisine on bins 3, 7, 11 .. of a period that may be a fraction of a sample, plus white noise.
static double *multisine(size_t rows, double period, double noise, uint64_t seed)
{
    double *signal = calloc(rows, sizeof *signal);
    struct random random;
    random_seed(&random, seed);
    for (int k = 3; k < 60; k += 4) {
        double phase = two_pi * random_uniform(&random);
        for (size_t n = 0; n < rows; n++) {
            signal[n] += cos(two_pi * k * (double)n / period + phase);
        }
    }
    for (size_t n = 0; n < rows; n++) {
        signal[n] += noise * random_normal(&random);
    }
    return signal;
}

static void test_period_search_finds_whole_period_in_noise(void)
{
    for (uint64_t seed = 1; seed <= 20; seed++) {
        double *signal = multisine(5500, 500.0, 1.0, seed);
        struct period_search found;
        TEST_ASSERT_EQUAL_INT_MESSAGE(period_search_ok, period_search_run(signal, 5500, &found),
                                      "see seed in the loop");
        TEST_ASSERT_EQUAL_size_t(500, found.period_samples);
        free(signal);
    }
}

static void test_period_search_refuses_fraction_with_figure(void)
{
    double *signal = multisine(5500, 500.3, 0.1, 4);
    struct period_search found;
    TEST_ASSERT_EQUAL_INT(period_search_err_fraction, period_search_run(signal, 5500, &found));
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 500.3, found.exact_samples);
    free(signal);
}

static void test_period_search_refuses_noise_and_short_signals(void)
{
    double *signal = random_signal(5000, 9);
    struct period_search found;
    TEST_ASSERT_EQUAL_INT(period_search_err_none, period_search_run(signal, 5000, &found));
    TEST_ASSERT_EQUAL_INT(period_search_err_none, period_search_run(signal, 15, &found));
    for (size_t n = 0; n < 5000; n++) {
        signal[n] = 1.5;
    }
    TEST_ASSERT_EQUAL_INT(period_search_err_none, period_search_run(signal, 5000, &found));
    free(signal);
}

static void test_period_search_finds_excited_bins_only(void)
{
    enum { length = 500, periods = 8, all = length / 2 + 1 };
    double *signal = multisine(length * periods, length, 0.3, 5);
    double complex *spectra = malloc(periods * all * sizeof *spectra);
    uint32_t bins[all];
    TEST_ASSERT_TRUE(spectra_transform_all(signal, length, periods, spectra));
    size_t count;
    TEST_ASSERT_TRUE(period_search_bins(spectra, periods, all, all, bins, &count));
    TEST_ASSERT_EQUAL_size_t(15, count);
    for (uint32_t b = 0; b < count; b++) {
        TEST_ASSERT_EQUAL_UINT32(3 + 4 * b, bins[b]);
    }
    free(signal);
    free(spectra);
}

/// In a loop the lines between the excited ones repeat as well, and are far above the noise.
static void test_period_search_tells_distortion_from_excitation(void)
{
    enum { length = 500, periods = 8, all = length / 2 + 1 };
    double *signal = multisine(length * periods, length, 0.001, 6);
    double complex *spectra = malloc(periods * all * sizeof *spectra);
    uint32_t bins[all];
    size_t count;
    for (size_t n = 0; n < length * periods; n++) {
        signal[n] += 0.004 * signal[n] * signal[n] + 0.1 * cos(two_pi * 5.0 * (double)n / length);
    }
    TEST_ASSERT_TRUE(spectra_transform_all(signal, length, periods, spectra));
    TEST_ASSERT_TRUE(period_search_bins(spectra, periods, all, all, bins, &count));
    TEST_ASSERT_EQUAL_size_t(15, count);
    TEST_ASSERT_EQUAL_UINT32(7, bins[1]);
    free(signal);
    free(spectra);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_period_search_finds_whole_period_in_noise);
    RUN_TEST(test_period_search_refuses_fraction_with_figure);
    RUN_TEST(test_period_search_refuses_noise_and_short_signals);
    RUN_TEST(test_period_search_finds_excited_bins_only);
    RUN_TEST(test_period_search_tells_distortion_from_excitation);
    return UNITY_END();
}
