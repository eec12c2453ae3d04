/* SPDX-License-Identifier: MIT */
#include "lab/estimate/agreement.h"

#include "lab/estimate/method.h"
#include "lab/numeric/statistics.h"

#include "unity.h"

#include <complex.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

enum { realisations = 5, lines = 60, periods = 8, trials = 400 };

/// Lines with less than 5 % chance: 24000 of them scatter by 0.14 %.
static const double share_tolerance = 0.006;
/// Stated chance of a false alarm 1e-3: more than 4 of 400 happen once in 10 000.
enum { false_alarms_most = 4 };
/// 300 known levels, each from 5 realisations: the median scatters by less.
static const double level_tolerance_db = 1.5;

static struct frf responses[realisations];
static struct error error;
static struct random random_numbers;

void setUp(void)
{
    random_seed(&random_numbers, 61);
}

static void drop(void)
{
    for (size_t r = 0; r < realisations; r++) {
        frf_free(&responses[r]);
    }
}

void tearDown(void)
{
    drop();
}

static double complex circular(void)
{
    const double real = random_normal(&random_numbers);
    return (real + random_normal(&random_numbers) * I) * sqrt(0.5);
}

/// Means of `periods` noisy values around 2 + distortion, and their standard deviations as a method estimates them.
static void make_responses(double distortion, double noise)
{
    for (size_t r = 0; r < realisations; r++) {
        struct frf *frf = &responses[r];
        TEST_ASSERT_EQUAL_INT(0, frf_alloc(frf, lines, &error));
        frf_set_text(&frf->input, "torque_Nm");
        frf_set_text(&frf->output, "velocity_rad_per_s");
        frf_set_text(&frf->units, "rad_per_s/Nm");
        frf_set_text(&frf->method, "mean");
        frf->periods = periods;
        frf->degrees_of_freedom = 2.0 * (periods - 1);
        for (size_t k = 0; k < lines; k++) {
            double complex values[periods];
            double complex mean = 0.0;
            double scatter = 0.0;
            const double complex own = 2.0 + distortion * circular();
            for (size_t p = 0; p < periods; p++) {
                values[p] = own + noise * circular();
                mean += values[p] / periods;
            }
            for (size_t p = 0; p < periods; p++) {
                scatter += creal((values[p] - mean) * conj(values[p] - mean)) / (periods - 1) / periods;
            }
            frf->frequency_hz[k] = (double)(k + 1);
            estimate_set_line(frf, k, mean, sqrt(scatter));
        }
    }
}

static void test_agreement_of_linear_drive_alarms_as_often_as_stated(void)
{
    size_t alarms = 0;
    double share = 0.0;
    for (int t = 0; t < trials; t++) {
        struct agreement agreement;
        make_responses(0.0, 0.1);
        TEST_ASSERT_TRUE(agreement_measure(responses, realisations, &agreement));
        TEST_ASSERT_EQUAL_size_t(lines, agreement.lines);
        alarms += agreement_differs(&agreement);
        share += (double)agreement.lines_beyond / lines / trials;
        drop();
    }
    printf("seed 61: %zu alarms in %d, %.2f %% of lines beyond 5 %%\n", alarms, trials, 100.0 * share);
    TEST_ASSERT_LESS_OR_EQUAL_size_t(false_alarms_most, alarms);
    TEST_ASSERT_DOUBLE_WITHIN(share_tolerance, 0.05, share);
}

static void test_agreement_finds_distortion_and_its_level(void)
{
    struct agreement agreement;
    make_responses(0.2, 0.05);
    TEST_ASSERT_TRUE(agreement_measure(responses, realisations, &agreement));
    TEST_ASSERT_TRUE(agreement_differs(&agreement));
    TEST_ASSERT_TRUE(agreement.ratio > 3.0);
    printf("seed 61: level %.2f dB, known -20 dB\n", 20.0 * log10(agreement.level));
    TEST_ASSERT_DOUBLE_WITHIN(level_tolerance_db, -20.0, 20.0 * log10(agreement.level));
}

/// std from 2(R-1) degrees of freedom holds noise and distortion, noise_std the noise alone.
static void test_agreement_goes_with_what_the_average_says(void)
{
    struct frf average;
    double total = 0.0;
    double noise = 0.0;
    make_responses(0.2, 0.05);
    responses[1].odd_distortion[3] = 0.3;
    for (size_t r = 0; r < realisations; r++) {
        responses[r].odd_distortion[4] = r == 0 ? 0.5 : 0.0;
    }
    TEST_ASSERT_EQUAL_INT(0, estimate_average(responses, realisations, &average, &error));
    TEST_ASSERT_EQUAL_DOUBLE(2.0 * (realisations - 1), average.degrees_of_freedom);
    for (size_t k = 0; k < lines; k++) {
        total += average.std[k] * average.std[k] / lines;
        noise += average.noise_std[k] * average.noise_std[k] / lines;
    }
    /* 60 lines of 8 (70) degrees of freedom: 6 % (2 %). */
    TEST_ASSERT_DOUBLE_WITHIN(0.25, 1.0, total * realisations / (0.2 * 0.2 + 0.05 * 0.05 / periods));
    TEST_ASSERT_DOUBLE_WITHIN(0.08, 1.0, noise * realisations / (0.05 * 0.05 / periods));
    TEST_ASSERT_EQUAL_STRING("70", estimate_key(&average, "noise_degrees_of_freedom"));
    /* Levels are averaged as powers, where all realisations have one. */
    TEST_ASSERT_FALSE(frf_known(average.odd_distortion[3]));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.5 / sqrt(realisations), average.odd_distortion[4]);
    frf_free(&average);
}

/// Clocks differ; lines do not.
static void test_agreement_of_average_takes_lines_that_clocks_have_moved(void)
{
    struct frf average;
    make_responses(0.0, 0.1);
    for (size_t k = 0; k < lines; k++) {
        responses[3].frequency_hz[k] *= 1.0 + 1.6e-4;
    }
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, estimate_average(responses, realisations, &average, &error), error.message);
    TEST_ASSERT_EQUAL_DOUBLE(60.0, average.frequency_hz[59]);
    frf_free(&average);
    responses[3].frequency_hz[59] = 60.0 * 1.0011;
    TEST_ASSERT_EQUAL_INT(error_refused, estimate_average(responses, realisations, &average, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "line 60 is at 60.066 Hz"), error.message);
    responses[3].frequency_hz[59] = 60.0;
    responses[3].frequency_hz[0] = 1.002;
    TEST_ASSERT_EQUAL_INT(error_refused, estimate_average(responses, realisations, &average, &error));
}

static void test_agreement_leaves_lines_out_that_are_not_valid_everywhere(void)
{
    struct agreement agreement;
    make_responses(0.0, 0.1);
    responses[2].valid[7] = false;
    responses[3].noise_std[8] = FRF_UNKNOWN;
    TEST_ASSERT_TRUE(agreement_measure(responses, realisations, &agreement));
    TEST_ASSERT_EQUAL_size_t(lines - 2, agreement.lines);
}

static void test_agreement_of_responses_without_noise_is_no_alarm(void)
{
    struct agreement agreement;
    make_responses(0.0, 0.0);
    TEST_ASSERT_TRUE(agreement_measure(responses, realisations, &agreement));
    TEST_ASSERT_FALSE(agreement_differs(&agreement));
    drop();
    make_responses(0.01, 0.0);
    TEST_ASSERT_TRUE(agreement_measure(responses, realisations, &agreement));
    TEST_ASSERT_TRUE(agreement_differs(&agreement));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_agreement_of_linear_drive_alarms_as_often_as_stated);
    RUN_TEST(test_agreement_finds_distortion_and_its_level);
    RUN_TEST(test_agreement_goes_with_what_the_average_says);
    RUN_TEST(test_agreement_of_average_takes_lines_that_clocks_have_moved);
    RUN_TEST(test_agreement_leaves_lines_out_that_are_not_valid_everywhere);
    RUN_TEST(test_agreement_of_responses_without_noise_is_no_alarm);
    return UNITY_END();
}
