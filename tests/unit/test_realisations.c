/* SPDX-License-Identifier: MIT */
#include "lab/estimate/circle.h"
#include "lab/estimate/method.h"
#include "lab/estimate/realisations.h"
#include "lab/numeric/cmplx.h"
#include "lab/numeric/statistics.h"

#include "unity.h"

#include <complex.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;

enum { lines = 20, length = 500, runs_most = 4 };

static struct frf runs[runs_most];
static struct excitations excitations[runs_most];
static struct frf combined;
static struct agreement agreement;
static struct error error;

void setUp(void) {}

void tearDown(void)
{
    for (int r = 0; r < runs_most; r++) {
        frf_free(&runs[r]);
        excitations_free(&excitations[r]);
    }
    frf_free(&combined);
}

static double complex truth(size_t line)
{
    return 2.0 * cexp(-0.1 * I * (double)line);
}

/// A run of `periods` periods with phases by `table`; its response is off by noise, and by `distortion` that the phases
/// set.
static void make(int r, uint64_t table, size_t periods, double noise, double distortion, struct random *random)
{
    struct random phases;
    struct excitation one = {.period_samples = length,
                             .count = lines,
                             .bins = malloc(lines * sizeof *one.bins),
                             .mean = malloc(lines * sizeof *one.mean)};
    frf_free(&runs[r]);
    excitations_free(&excitations[r]);
    random_seed(&phases, table);
    TEST_ASSERT_EQUAL_INT(0, frf_alloc(&runs[r], lines, &error));
    runs[r].periods = periods;
    runs[r].degrees_of_freedom = 2.0 * (double)(periods - 1);
    TEST_ASSERT_TRUE(frf_set_text(&runs[r].input, "torque_Nm") && frf_set_text(&runs[r].output, "position_rad"));
    TEST_ASSERT_TRUE(estimate_set_key(&runs[r], "sample_rate_hz", "%.17g", 1000.0 + r) &&
                     estimate_set_key(&runs[r], "period_samples", "%d", length) &&
                     estimate_set_key(&runs[r], "settle_periods", "%d", r));
    for (size_t k = 0; k < lines; k++) {
        const double mean_noise = noise / sqrt((double)periods);
        const double complex own = CMPLX(random_normal(&phases), random_normal(&phases)) * sqrt(0.5);
        const double complex error_of = CMPLX(random_normal(random), random_normal(random)) * sqrt(0.5);
        double power = 0.0;
        for (size_t m = 0; m + 1 < periods; m++) {
            const double a = random_normal(random);
            const double b = random_normal(random);
            power += 0.5 * (a * a + b * b) / (double)(periods - 1);
        }
        runs[r].frequency_hz[k] = 2.0 * (double)(k + 1);
        estimate_set_line(&runs[r], k, truth(k) + distortion * own + mean_noise * error_of, mean_noise * sqrt(power));
        one.bins[k] = (uint32_t)(k + 1);
        one.mean[k] = cexp(I * two_pi * random_uniform(&phases));
    }
    TEST_ASSERT_TRUE(excitations_add(&excitations[r], &one));
}

static int combine(size_t count)
{
    frf_free(&combined);
    return realisations_combine(runs, excitations, count, &combined, &agreement, &error);
}

/// Two runs of one table are more periods: std is that of all of them, its degrees of freedom too.
static void test_realisations_pool_runs_of_one_excitation_honestly(void)
{
    enum { draws = 400 };
    struct random random;
    double covered = 0.0;
    double predicted = 0.0;
    double empirical = 0.0;
    random_seed(&random, 1);
    for (int i = 0; i < draws; i++) {
        make(0, 7, 4, 0.3, 0.1, &random);
        make(1, 7, 8, 0.3, 0.1, &random);
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, combine(2), error.message);
        const double factor = circle_confidence_factor(0.95, combined.degrees_of_freedom / 2.0);
        struct random phases;
        random_seed(&phases, 7);
        for (size_t k = 0; k < lines; k++) {
            const double complex own = CMPLX(random_normal(&phases), random_normal(&phases)) * sqrt(0.5);
            const double complex expected = truth(k) + 0.1 * own;
            const double miss = cabs(CMPLX(combined.real[k], combined.imag[k]) - expected);
            random_uniform(&phases);
            covered += (miss <= factor * combined.std[k]) / (double)(draws * lines);
            predicted += combined.std[k] * combined.std[k];
            empirical += miss * miss;
        }
    }
    printf("pooled, seed 1: predicted/empirical variance %.3f, coverage %.2f %%\n", predicted / empirical,
           100.0 * covered);
    TEST_ASSERT_EQUAL_DOUBLE(20.0, combined.degrees_of_freedom);
    TEST_ASSERT_EQUAL_size_t(12, combined.periods);
    /* 8000 values: 1 %; coverage .25 %. */
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 1.0, predicted / empirical);
    TEST_ASSERT_DOUBLE_WITHIN(0.012, 0.95, covered);
    TEST_ASSERT_EQUAL_STRING("1", estimate_key(&combined, "realisations"));
    TEST_ASSERT_EQUAL_STRING("2", estimate_key(&combined, "runs"));
    TEST_ASSERT_NOT_NULL(
        strstr(estimate_key(&combined, "warning_realisations"), "2 runs are 1 realisation; std holds"));
    TEST_ASSERT_EQUAL_size_t(0, agreement.lines);
}

/// Three runs, two of one table: two realisations, and what all say alike is kept.
static void test_realisations_count_excitations_not_runs(void)
{
    struct random random;
    random_seed(&random, 2);
    make(0, 1, 5, 0.01, 0.1, &random);
    make(1, 2, 5, 0.01, 0.1, &random);
    make(2, 1, 5, 0.01, 0.1, &random);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, combine(3), error.message);
    TEST_ASSERT_EQUAL_STRING("2", estimate_key(&combined, "realisations"));
    TEST_ASSERT_EQUAL_STRING("3", estimate_key(&combined, "runs"));
    TEST_ASSERT_EQUAL_STRING("1001", estimate_key(&combined, "sample_rate_hz"));
    TEST_ASSERT_EQUAL_STRING("500", estimate_key(&combined, "period_samples"));
    TEST_ASSERT_EQUAL_STRING("", estimate_key(&combined, "settle_periods"));
    TEST_ASSERT_EQUAL_DOUBLE(2.0, combined.degrees_of_freedom);
    TEST_ASSERT_EQUAL_size_t(2, agreement.realisations);
    TEST_ASSERT_TRUE(agreement_differs(&agreement));
    TEST_ASSERT_NOT_NULL(strstr(estimate_key(&combined, "warning_realisations"), "3 runs are 2 realisations"));
}

static void test_realisations_of_their_own_are_averaged_without_a_warning(void)
{
    struct random random;
    random_seed(&random, 3);
    for (int r = 0; r < 3; r++) {
        make(r, (uint64_t)r + 1, 5, 0.01, 0.1, &random);
    }
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, combine(3), error.message);
    TEST_ASSERT_EQUAL_STRING("3", estimate_key(&combined, "realisations"));
    TEST_ASSERT_EQUAL_STRING("", estimate_key(&combined, "warning_realisations"));
    TEST_ASSERT_EQUAL_DOUBLE(4.0, combined.degrees_of_freedom);
}

/// The same table on a drive that has changed in between.
static void test_realisations_say_that_pooled_runs_differ(void)
{
    struct random random;
    random_seed(&random, 4);
    make(0, 1, 5, 0.01, 0.0, &random);
    make(1, 1, 5, 0.01, 0.2, &random);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, combine(2), error.message);
    TEST_ASSERT_NOT_NULL(strstr(estimate_key(&combined, "warning_realisations"), "the drive has changed"));
}

static void test_realisations_refuse_the_same_recording_again(void)
{
    struct random random;
    random_seed(&random, 5);
    make(0, 1, 5, 0.1, 0.0, &random);
    make(1, 2, 5, 0.1, 0.0, &random);
    random_seed(&random, 5);
    make(2, 1, 5, 0.1, 0.0, &random);
    TEST_ASSERT_EQUAL_INT(error_refused, combine(3));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "run 3 is run 1 again"), error.message);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_realisations_pool_runs_of_one_excitation_honestly);
    RUN_TEST(test_realisations_count_excitations_not_runs);
    RUN_TEST(test_realisations_of_their_own_are_averaged_without_a_warning);
    RUN_TEST(test_realisations_say_that_pooled_runs_differ);
    RUN_TEST(test_realisations_refuse_the_same_recording_again);
    return UNITY_END();
}
