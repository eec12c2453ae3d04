/* SPDX-License-Identifier: MIT */
#include "lab/estimate/period_search.h"
#include "lab/numeric/statistics.h"

#include "unity.h"

#include <math.h>
#include <stdio.h>
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

/// A period one sample off, a part of one, or any other is refuted with what the signal repeats after; a multiple, the
/// true one, and one that a clock moved are not.
static void test_period_check_refutes_other_periods_only(void)
{
    static const struct {
        double period;
        size_t given;
        bool refuted;
    } cases[] = {{500.0, 500, false},  {500.0, 1000, false}, {500.0, 499, true},   {500.0, 501, true},
                 {500.0, 250, true},   {500.0, 480, true},   {500.0, 750, true},   {500.3, 500, false},
                 {500.3, 1001, false}, {501.0, 500, true},   {500.0, 1500, false}, {500.0, 1499, true}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        for (uint64_t seed = 1; seed <= 5; seed++) {
            char text[80];
            struct period_check check;
            double *signal = multisine(5500, cases[i].period, seed % 2 ? 0.05 : 0.5, seed);
            period_search_check(signal, 5500, cases[i].given, &check);
            snprintf(text, sizeof text, "period %g, given %zu, seed %d, correlation %g of %g", cases[i].period,
                     cases[i].given, (int)seed, check.correlation, check.found.correlation);
            TEST_ASSERT_EQUAL_INT_MESSAGE(cases[i].refuted, check.refuted, text);
            TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(0.05, cases[i].period, check.found.exact_samples, text);
            free(signal);
        }
    }
}

/// Where nothing repeats nothing is refuted.
static void test_period_check_of_noise_refutes_nothing(void)
{
    double *signal = random_signal(5000, 9);
    struct period_check check;
    TEST_ASSERT_EQUAL_INT(period_search_err_none, period_search_check(signal, 5000, 500, &check));
    TEST_ASSERT_FALSE(check.refuted);
    free(signal);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_period_search_finds_whole_period_in_noise);
    RUN_TEST(test_period_search_refuses_fraction_with_figure);
    RUN_TEST(test_period_search_refuses_noise_and_short_signals);
    RUN_TEST(test_period_check_refutes_other_periods_only);
    RUN_TEST(test_period_check_of_noise_refutes_nothing);
    return UNITY_END();
}
