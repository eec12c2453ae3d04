/* SPDX-License-Identifier: MIT */
#include "lab/estimate/repetition.h"

#include "lab/numeric/statistics.h"

#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static const double two_pi = 6.283185307179586476925;

enum { length = 100, lines = 20 };

/// Stated chance of a false alarm 1e-3: of 1000 recordings 1 is expected, more than 7 happen once in 100 000.
enum { quiet_recordings = 1000, false_alarms_most = 7 };

static struct run run;
static struct periodic recording;
static struct error error;
static struct random random_numbers;

void setUp(void)
{
    random_seed(&random_numbers, 41);
}

static void drop(void)
{
    periodic_free(&recording);
    run.path = NULL;
    run_free(&run);
}

void tearDown(void)
{
    drop();
}

/// A flat multisine through a gain of 3.
static void make_run(size_t periods, double noise)
{
    static char path[] = "made";
    run = (struct run){.path = path, .sample_rate_hz = length, .rows = periods * length};
    double *torque = run_add_column(&run, "torque_Nm");
    double *velocity = run_add_column(&run, "velocity_rad_per_s");
    TEST_ASSERT_TRUE(torque && velocity);
    for (size_t n = 0; n < run.rows; n++) {
        for (size_t b = 1; b <= lines; b++) {
            torque[n] += cos(two_pi * (double)(b * n % length) / length + 0.3 * (double)(b * b));
        }
        velocity[n] = 3.0 * torque[n] + noise * random_normal(&random_numbers);
    }
}

static struct repetition test_run(size_t settle)
{
    uint32_t bins[lines];
    struct repetition result;
    for (uint32_t b = 0; b < lines; b++) {
        bins[b] = b + 1;
    }
    const struct periodic_options cut = {.period_samples = length,
                                         .bins = bins,
                                         .bin_count = lines,
                                         .settle = periodic_settle_given,
                                         .settle_periods = settle};
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, periodic_cut(&run, &cut, &recording, &error), error.message);
    TEST_ASSERT_TRUE(repetition_test(&recording, &result));
    return result;
}

/// Adds a part that repeats after `multiple` periods only.
static void add_subharmonic(unsigned multiple, double size)
{
    for (size_t n = 0; n < run.rows; n++) {
        const double turn = two_pi * (double)n / (double)(multiple * length);
        run.columns[1].data[n] +=
            size * (cos(turn * (1.0 + 3.0 * multiple)) + 0.5 * cos(turn * (1.0 + 8.0 * multiple)));
    }
}

static void test_repetition_is_quiet_on_noise_as_often_as_stated(void)
{
    size_t alarms = 0;
    for (int r = 0; r < quiet_recordings; r++) {
        make_run(4 + (size_t)(r % 9), 0.3);
        alarms += test_run(0).multiple != 1;
        drop();
    }
    make_run(4, 0.3);
    printf("seed 41: %zu false alarms in %d recordings\n", alarms, quiet_recordings);
    TEST_ASSERT_LESS_OR_EQUAL_size_t(false_alarms_most, alarms);
}

static void test_repetition_finds_multiples_of_the_period(void)
{
    for (unsigned multiple = 2; multiple <= 4; multiple++) {
        make_run(13, 0.3);
        add_subharmonic(multiple, 0.3);
        const struct repetition found = test_run(0);
        TEST_ASSERT_EQUAL_UINT(4, found.tested);
        TEST_ASSERT_EQUAL_UINT(multiple, found.multiple);
        TEST_ASSERT_TRUE(found.chance < 1e-3);
        drop();
    }
    make_run(4, 0.0);
}

/// 0.2 sqrt(1.25 / 2) over 3 sqrt(20 / 2).
static void test_repetition_level_is_that_of_the_added_part(void)
{
    make_run(8, 0.0);
    add_subharmonic(2, 0.2);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.2 * sqrt(1.25) / (3.0 * sqrt(lines)), test_run(0).level);
}

static void test_repetition_sees_a_part_far_below_the_noise_of_one_period(void)
{
    make_run(40, 0.3);
    add_subharmonic(2, 0.1);
    const struct repetition found = test_run(0);
    TEST_ASSERT_EQUAL_UINT(2, found.multiple);
}

/// A transient, a drift of the mean and slow noise differ from period to period, but do not alternate.
static void test_repetition_does_not_take_transients_and_drift_for_it(void)
{
    make_run(12, 0.0);
    for (size_t n = 0; n < run.rows; n++) {
        run.columns[1].data[n] += 5.0 * exp(-(double)n / (4.0 * length)) + 0.01 * (double)n / length;
    }
    TEST_ASSERT_EQUAL_UINT(1, test_run(0).multiple);
    drop();
    for (int r = 0; r < 100; r++) {
        double walk = 0.0;
        make_run(12, 0.01);
        for (size_t n = 0; n < run.rows; n++) {
            walk += 0.03 * random_normal(&random_numbers);
            run.columns[1].data[n] += walk;
        }
        TEST_ASSERT_EQUAL_UINT(1, test_run(0).multiple);
        drop();
    }
    make_run(4, 0.0);
}

static void test_repetition_of_perfect_periods_is_one(void)
{
    make_run(12, 0.0);
    const struct repetition found = test_run(0);
    TEST_ASSERT_EQUAL_UINT(1, found.multiple);
    TEST_ASSERT_EQUAL_UINT(4, found.tested);
}

static void test_repetition_is_not_tested_with_few_periods(void)
{
    make_run(3, 0.0);
    add_subharmonic(2, 0.5);
    struct repetition found = test_run(0);
    TEST_ASSERT_EQUAL_UINT(0, found.tested);
    TEST_ASSERT_EQUAL_UINT(1, found.multiple);
    drop();
    make_run(9, 0.0);
    add_subharmonic(2, 0.5);
    double *valid = run_add_column(&run, "valid");
    for (size_t n = 0; n < run.rows; n++) {
        valid[n] = n != 3 * length + 7 && n != 6 * length; // three in a row at most
    }
    found = test_run(0);
    TEST_ASSERT_EQUAL_UINT(0, found.tested);
}

static void test_repetition_leaves_settling_periods_out(void)
{
    make_run(9, 0.01);
    add_subharmonic(2, 0.3);
    run.columns[1].data[0] += 1000.0;
    const struct repetition found = test_run(0);
    TEST_ASSERT_EQUAL_UINT(2, found.multiple);
    TEST_ASSERT_TRUE(found.level < 0.1);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_repetition_is_quiet_on_noise_as_often_as_stated);
    RUN_TEST(test_repetition_finds_multiples_of_the_period);
    RUN_TEST(test_repetition_level_is_that_of_the_added_part);
    RUN_TEST(test_repetition_sees_a_part_far_below_the_noise_of_one_period);
    RUN_TEST(test_repetition_does_not_take_transients_and_drift_for_it);
    RUN_TEST(test_repetition_of_perfect_periods_is_one);
    RUN_TEST(test_repetition_is_not_tested_with_few_periods);
    RUN_TEST(test_repetition_leaves_settling_periods_out);
    return UNITY_END();
}
