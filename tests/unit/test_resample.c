/* SPDX-License-Identifier: MIT */
#include "lab/estimate/resample.h"

#include "unity.h"

#include <math.h>
#include <stdlib.h>

enum { rows = 4000, period = 500, edge = 40 };

static const double two_pi = 6.283185307179586476925;

static struct run run;
static struct run resampled;
static struct error error;

void setUp(void)
{
    static char path[] = "made";
    run = (struct run){.path = path, .sample_rate_hz = 1000.0, .rows = rows};
}

void tearDown(void)
{
    run.path = NULL;
    run_free(&run);
    run_free(&resampled);
}

static void resample(double stretch, double bend)
{
    const struct resample_warp warp = {.stretch = stretch, .bend = bend};
    run_free(&resampled);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, resample_run(&run, &warp, period, &resampled, &error), error.message);
}

static double place(double m, double stretch, double bend)
{
    return m + stretch * m + bend * m * m;
}

/// The largest error of a sine of size 1, away from the ends.
static double error_of_sine(double frequency, double stretch, double bend)
{
    double *x = run_add_column(&run, "torque_Nm");
    for (size_t n = 0; n < rows; n++) {
        x[n] = sin(two_pi * frequency * (double)n + 1.0);
    }
    resample(stretch, bend);
    const double *y = run_column(&resampled, "torque_Nm");
    double largest = 0.0;
    for (size_t m = edge; m + edge < resampled.rows; m++) {
        const double expected = sin(two_pi * frequency * place((double)m, stretch, bend) + 1.0);
        largest = fmax(largest, fabs(y[m] - expected));
    }
    run.path = NULL;
    run_free(&run);
    setUp();
    return largest;
}

/// As the header promises: a Kaiser window of beta = 10 ripples by 1e-5.
static void test_resample_keeps_sines_up_to_its_band(void)
{
    static const double warps[][2] = {{1.5e-4, 0.0}, {-0.013, 0.0}, {3e-4, -2e-8}};
    for (size_t i = 0; i < sizeof warps / sizeof warps[0]; i++) {
        for (double frequency = 0.001; frequency < 0.4; frequency += 0.037) {
            TEST_ASSERT_DOUBLE_WITHIN(1e-5, 0.0, error_of_sine(frequency, warps[i][0], warps[i][1]));
        }
        TEST_ASSERT_DOUBLE_WITHIN(2e-5, 0.0, error_of_sine(RESAMPLE_BAND, warps[i][0], warps[i][1]));
    }
}

static void test_resample_keeps_constants_and_ramps(void)
{
    double *constant = run_add_column(&run, "torque_Nm");
    double *ramp = run_add_column(&run, "position_rad");
    for (size_t n = 0; n < rows; n++) {
        constant[n] = 3.0;
        ramp[n] = 0.5 * (double)n;
    }
    resample(-1e-3, 0.0);
    for (size_t m = edge; m + edge < resampled.rows; m++) {
        /* Weights that add up to 1 in rounding. */
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, 3.0, run_column(&resampled, "torque_Nm")[m]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.5 * 0.999 * (double)m, run_column(&resampled, "position_rad")[m]);
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1000.0 / 0.999, resampled.sample_rate_hz);
}

/// A signal with the period that the ends are continued by has no ends.
static void test_resample_continues_both_ends_by_a_period(void)
{
    double *x = run_add_column(&run, "torque_Nm");
    for (size_t n = 0; n < rows; n++) {
        x[n] = cos(two_pi * 7.0 * (double)n / period) + 0.3 * sin(two_pi * 90.0 * (double)n / period);
    }
    resample(2e-5, 0.0);
    TEST_ASSERT_EQUAL_UINT(rows, resampled.rows);
    for (size_t m = 0; m < resampled.rows; m++) {
        const double t = place((double)m, 2e-5, 0.0);
        const double expected = cos(two_pi * 7.0 * t / period) + 0.3 * sin(two_pi * 90.0 * t / period);
        TEST_ASSERT_DOUBLE_WITHIN(1e-5, expected, run_column(&resampled, "torque_Nm")[m]);
    }
    resample(1.0 / 1000.0, 0.0);
    TEST_ASSERT_EQUAL_UINT(rows - 4, resampled.rows);
}

static void test_resample_marks_what_lost_samples_reach(void)
{
    (void)run_add_column(&run, "torque_Nm");
    double *valid = run_add_column(&run, "valid");
    for (size_t n = 0; n < rows; n++) {
        valid[n] = n == 2000 ? 0.0 : 1.0;
    }
    resample(1e-4, 0.0);
    const double *flags = run_column(&resampled, "valid");
    size_t lost = 0;
    for (size_t m = 0; m < resampled.rows; m++) {
        TEST_ASSERT_TRUE(flags[m] == 0.0 || flags[m] == 1.0);
        TEST_ASSERT_TRUE_MESSAGE(flags[m] == 1.0 || fabs((double)m - 2000.0) < 32.0, "lost where nothing was");
        lost += flags[m] == 0.0;
    }
    TEST_ASSERT_EQUAL_DOUBLE(0.0, flags[2000]);
    TEST_ASSERT_GREATER_THAN_UINT(2, lost);
}

static void test_resample_keeps_keys_bins_and_what_it_knows(void)
{
    (void)run_add_column(&run, "torque_Nm");
    (void)run_add_column(&run, "time_s");
    (void)run_add_column(&run, "note");
    TEST_ASSERT_TRUE(run_set_key(&run, "segment", "2 of 8"));
    run.period_samples = period;
    run.settle_periods = 1;
    run.has_settle_periods = true;
    run.periods = 7;
    run.bins = malloc(2 * sizeof *run.bins);
    run.bins[0] = 3;
    run.bins[1] = 9;
    run.bin_count = 2;
    resample(1e-3, 0.0);
    TEST_ASSERT_EQUAL_UINT(1, resampled.column_count);
    TEST_ASSERT_EQUAL_STRING("2 of 8", run_key(&resampled, "segment"));
    TEST_ASSERT_EQUAL_UINT32(9, resampled.bins[1]);
    /* 3996 rows are 7 whole periods of 500. */
    TEST_ASSERT_EQUAL_UINT(6, resampled.periods);
    TEST_ASSERT_EQUAL_STRING("made", resampled.path);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_resample_keeps_sines_up_to_its_band);
    RUN_TEST(test_resample_keeps_constants_and_ramps);
    RUN_TEST(test_resample_continues_both_ends_by_a_period);
    RUN_TEST(test_resample_marks_what_lost_samples_reach);
    RUN_TEST(test_resample_keeps_keys_bins_and_what_it_knows);
    return UNITY_END();
}
