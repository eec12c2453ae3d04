/* SPDX-License-Identifier: MIT */
#include "lab/estimate/method.h"
#include "lab/estimate/periodic.h"
#include "lab/numeric/statistics.h"

#include "unity.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;

enum { length = 120, periods = 6, lines = 10 };

static struct run run;
static struct periodic recording;
static struct error error;

static void make_run(void)
{
    static char path[] = "made.csv";
    struct random random;
    random_seed(&random, 1);
    run = (struct run){.path = path, .sample_rate_hz = 1000.0, .rows = length * periods};
    double *torque = run_add_column(&run, "torque_Nm");
    double *velocity = run_add_column(&run, "velocity_rad_per_s");
    for (size_t n = 0; n < run.rows; n++) {
        for (int k = 1; k <= lines; k++) {
            torque[n] += cos(two_pi * k * (double)n / length + 0.3 * k * k);
        }
        velocity[n] = 3.0 * torque[n] + 0.01 * random_normal(&random);
    }
}

void setUp(void)
{
    make_run();
}

void tearDown(void)
{
    run.path = NULL;
    run_free(&run);
}

static void expect_refusal(const struct periodic_options *options, const char *text)
{
    TEST_ASSERT_EQUAL_INT(error_refused, periodic_cut(&run, options, &recording, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, text), error.message);
}

static void test_periodic_finds_period_and_lines_nobody_said(void)
{
    TEST_ASSERT_EQUAL_INT(0, periodic_cut(&run, &(struct periodic_options){0}, &recording, &error));
    TEST_ASSERT_TRUE(recording.period_found && recording.bins_found);
    TEST_ASSERT_EQUAL_size_t(length, recording.period_samples);
    TEST_ASSERT_EQUAL_size_t(lines, recording.bin_count);
    periodic_free(&recording);
}

static void test_periodic_refuses_columns_that_are_not_there(void)
{
    expect_refusal(&(struct periodic_options){.input = "force_N"}, "no column 'force_N'");
    free(run.columns[1].name);
    run.columns[1].name = strdup("speed");
    expect_refusal(&(struct periodic_options){0}, "--output COLUMN");
}

static void test_periodic_refuses_numbers_that_are_not_finite(void)
{
    run.columns[1].data[400] = NAN;
    expect_refusal(&(struct periodic_options){0}, "row 401 of velocity_rad_per_s");
    run.columns[1].data[400] = INFINITY;
    expect_refusal(&(struct periodic_options){0}, "row 401 of velocity_rad_per_s");
}

static void test_periodic_refuses_aperiodic_input(void)
{
    struct random random;
    random_seed(&random, 2);
    for (size_t n = 0; n < run.rows; n++) {
        run.columns[0].data[n] = random_normal(&random);
    }
    expect_refusal(&(struct periodic_options){0}, "--period SAMPLES");
}

static void test_periodic_refuses_fewer_than_two_periods(void)
{
    expect_refusal(&(struct periodic_options){.period_samples = length * periods - 1}, "expected at least 2");
    expect_refusal(
        &(struct periodic_options){.period_samples = length, .settle = periodic_settle_given, .settle_periods = 5},
        "1 of 6 periods count (5 left out for settling, 0 for lost samples)");
    expect_refusal(
        &(struct periodic_options){.period_samples = length, .settle = periodic_settle_given, .settle_periods = 99},
        "0 of 6 periods count");
    double *valid = run_add_column(&run, "valid");
    for (size_t n = 0; n < run.rows; n++) {
        valid[n] = n % length != 3 || n < length;
    }
    expect_refusal(&(struct periodic_options){.period_samples = length}, "1 of 6 periods count");
}

static void test_periodic_refuses_lines_beyond_half_the_period(void)
{
    const uint32_t beyond[] = {1, 60};
    const uint32_t zero[] = {0, 5};
    const uint32_t falling[] = {5, 4};
    expect_refusal(&(struct periodic_options){.period_samples = length, .bins = beyond, .bin_count = 2},
                   "excited bin 60");
    expect_refusal(&(struct periodic_options){.period_samples = length, .bins = zero, .bin_count = 2}, "excited bin 0");
    expect_refusal(&(struct periodic_options){.period_samples = length, .bins = falling, .bin_count = 2},
                   "excited bin 4");
}

static void test_method_names_that_are_not_there_are_refused_with_a_list(void)
{
    TEST_ASSERT_NULL(estimate_method_find("lpm", &error));
    TEST_ASSERT_EQUAL_INT(error_usage, error.status);
    TEST_ASSERT_NOT_NULL(strstr(error.message, "'lpm' is not in this build: expected one of mean, hann"));
    TEST_ASSERT_NOT_NULL(estimate_method_find("hann", &error));
}

static void test_average_refuses_other_lines_and_names(void)
{
    struct frf both[2];
    struct frf average;
    for (size_t r = 0; r < 2; r++) {
        struct periodic_options options = {.period_samples = length};
        TEST_ASSERT_EQUAL_INT(0, periodic_cut(&run, &options, &recording, &error));
        TEST_ASSERT_EQUAL_INT(0, estimate_methods[0].estimate(&recording, &both[r], &error));
        periodic_free(&recording);
    }
    TEST_ASSERT_EQUAL_INT(0, estimate_average(both, 2, &average, &error));
    TEST_ASSERT_EQUAL_DOUBLE(both[0].real[4], average.real[4]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, both[0].noise_std[4] / sqrt(2.0), average.noise_std[4]);
    frf_free(&average);
    both[1].frequency_hz[4] *= 1.001;
    TEST_ASSERT_EQUAL_INT(error_refused, estimate_average(both, 2, &average, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "line 5"), error.message);
    TEST_ASSERT_TRUE(frf_set_text(&both[1].output, "position_rad"));
    TEST_ASSERT_EQUAL_INT(error_refused, estimate_average(both, 2, &average, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "position_rad"), error.message);
    frf_free(&both[0]);
    frf_free(&both[1]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_periodic_finds_period_and_lines_nobody_said);
    RUN_TEST(test_periodic_refuses_columns_that_are_not_there);
    RUN_TEST(test_periodic_refuses_numbers_that_are_not_finite);
    RUN_TEST(test_periodic_refuses_aperiodic_input);
    RUN_TEST(test_periodic_refuses_fewer_than_two_periods);
    RUN_TEST(test_periodic_refuses_lines_beyond_half_the_period);
    RUN_TEST(test_method_names_that_are_not_there_are_refused_with_a_list);
    RUN_TEST(test_average_refuses_other_lines_and_names);
    return UNITY_END();
}
