/* SPDX-License-Identifier: MIT */
#include "lab/estimate/settle.h"
#include "lab/numeric/statistics.h"

#include "unity.h"

#include <math.h>

void setUp(void) {}

void tearDown(void) {}

/// Periods of a constant spectrum with scatter 1, and a transient of size `start` that falls by `decay` per period.
static void make_periods(double complex *spectra, size_t periods, size_t bins, double start, double decay,
                         uint64_t seed)
{
    struct random random;
    random_seed(&random, seed);
    for (size_t p = 0; p < periods; p++) {
        for (size_t b = 0; b < bins; b++) {
            double real = random_normal(&random);
            double imaginary = random_normal(&random);
            spectra[p * bins + b] = 100.0 + start * pow(decay, (double)p) + (real + imaginary * I) * sqrt(0.5);
        }
    }
}

static void test_settle_counts_periods_of_a_decaying_transient(void)
{
    enum { periods = 12, bins = 50 };
    static double complex spectra[periods * bins];
    bool usable[periods];
    double level[periods];
    for (size_t p = 0; p < periods; p++) {
        usable[p] = true;
    }
    for (uint64_t seed = 1; seed <= 50; seed++) {
        struct settle settle;
        /* 100, 10, 1, 0.1 times the scatter: the first two for certain, the fourth never. */
        make_periods(spectra, periods, bins, 100.0, 0.1, seed);
        TEST_ASSERT_TRUE(settle_measure(spectra, periods, bins, usable, &settle, level));
        TEST_ASSERT_TRUE_MESSAGE(settle.periods == 2 || settle.periods == 3, "periods left out");
        TEST_ASSERT_TRUE(settle.settled);
        TEST_ASSERT_DOUBLE_WITHIN(0.02, 0.1, settle.decay_per_period);
        TEST_ASSERT_DOUBLE_WITHIN(0.02, 1.0, level[0]);
    }
}

/// Chances of many lines are multiplied; a product of such deviations would be beyond the largest double.
static void test_settle_counts_periods_of_a_transient_beyond_measure(void)
{
    enum { periods = 8, bins = 50 };
    static double complex spectra[periods * bins];
    const bool usable[periods] = {true, true, true, true, true, true, true, true};
    double level[periods];
    struct settle settle;
    make_periods(spectra, periods, bins, 1e120, 1e-61, 3);
    TEST_ASSERT_TRUE(settle_measure(spectra, periods, bins, usable, &settle, level));
    TEST_ASSERT_EQUAL_size_t(2, settle.periods);
    TEST_ASSERT_TRUE(settle.settled);
    TEST_ASSERT_DOUBLE_WITHIN(1e116, 1e118, level[0]);
}

static void test_settle_leaves_nothing_out_without_a_transient(void)
{
    enum { periods = 10, bins = 50, runs = 1000 };
    static double complex spectra[periods * bins];
    bool usable[periods];
    double level[periods];
    size_t left_out = 0;
    for (size_t p = 0; p < periods; p++) {
        usable[p] = true;
    }
    for (uint64_t seed = 1; seed <= runs; seed++) {
        struct settle settle;
        make_periods(spectra, periods, bins, 0.0, 1.0, seed);
        TEST_ASSERT_TRUE(settle_measure(spectra, periods, bins, usable, &settle, level));
        left_out += settle.periods > 0;
    }
    /* One in a thousand by design; more than six of a thousand would come by chance once in 10^4. */
    TEST_ASSERT_TRUE(left_out <= 6);
}

static void test_settle_stops_at_half_of_a_recording_that_never_settles(void)
{
    enum { periods = 10, bins = 50 };
    static double complex spectra[periods * bins];
    bool usable[periods];
    double level[periods];
    struct settle settle;
    for (size_t p = 0; p < periods; p++) {
        usable[p] = true;
    }
    /* 1000 times the scatter, falling so slowly that the later half still moves by its hundredfold. */
    make_periods(spectra, periods, bins, 1000.0, 0.9, 2);
    TEST_ASSERT_TRUE(settle_measure(spectra, periods, bins, usable, &settle, level));
    TEST_ASSERT_EQUAL_size_t(periods / 2, settle.periods);
    TEST_ASSERT_FALSE(settle.settled);
    /* A jump after the later half has begun: the period before it is unlike the rest, but no start transient. */
    make_periods(spectra, periods, bins, 0.0, 1.0, 3);
    for (size_t i = 0; i < 6 * bins; i++) {
        spectra[i] += 1000.0;
    }
    TEST_ASSERT_TRUE(settle_measure(spectra, periods, bins, usable, &settle, level));
    TEST_ASSERT_TRUE(settle.periods <= periods / 2);
}

/// Whatever stands in a period with lost samples, it is neither a transient nor a level.
static void test_settle_looks_at_no_period_with_lost_samples(void)
{
    enum { periods = 8, bins = 50 };
    static double complex spectra[periods * bins];
    bool usable[periods] = {false, true, true, true, true, true, true, false};
    double level[periods];
    struct settle settle;
    make_periods(spectra, periods, bins, 0.0, 1.0, 4);
    for (size_t b = 0; b < bins; b++) {
        spectra[b] = 1e9;
        spectra[(periods - 1) * bins + b] = -1e9;
    }
    TEST_ASSERT_TRUE(settle_measure(spectra, periods, bins, usable, &settle, level));
    TEST_ASSERT_EQUAL_size_t(0, settle.periods);
    TEST_ASSERT_TRUE(settle.settled);
    TEST_ASSERT_TRUE(isnan(level[0]) && isnan(level[periods - 1]));
    for (size_t p = 1; p + 1 < periods; p++) {
        TEST_ASSERT_TRUE(level[p] < 1.0);
    }
}

static void test_settle_says_when_it_cannot_tell(void)
{
    enum { periods = 3, bins = 4 };
    double complex spectra[periods * bins];
    bool usable[periods] = {true, true, true};
    double level[periods];
    struct settle settle;
    make_periods(spectra, periods, bins, 100.0, 0.1, 1);
    TEST_ASSERT_TRUE(settle_measure(spectra, periods, bins, usable, &settle, level));
    TEST_ASSERT_FALSE(settle.settled);
    TEST_ASSERT_EQUAL_size_t(0, settle.periods);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_settle_counts_periods_of_a_decaying_transient);
    RUN_TEST(test_settle_counts_periods_of_a_transient_beyond_measure);
    RUN_TEST(test_settle_leaves_nothing_out_without_a_transient);
    RUN_TEST(test_settle_stops_at_half_of_a_recording_that_never_settles);
    RUN_TEST(test_settle_looks_at_no_period_with_lost_samples);
    RUN_TEST(test_settle_says_when_it_cannot_tell);
    return UNITY_END();
}
