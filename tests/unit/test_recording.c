/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/recording.h"

#include "unity.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { period = 500, periods = 6, rows = period * periods + 37 };

static const double two_pi = 6.283185307179586;
static const double rate_hz = 1000.0;

static struct run run;
static struct recording recording;
static struct error error;
static double *torque, *position;

/// Lines 3, 8 and 20 of the torque; the motion repeats after a transient in the first period.
void setUp(void)
{
    memset(&run, 0, sizeof run);
    memset(&error, 0, sizeof error);
    run.path = malloc(8);
    strcpy(run.path, "run.csv");
    run.sample_rate_hz = rate_hz;
    run.rows = rows;
    run.period_samples = period;
    torque = run_add_column(&run, "torque_Nm");
    position = run_add_column(&run, "position_rad");
    for (size_t n = 0; n < rows; n++) {
        double turn = two_pi * (double)n / period;
        torque[n] = 0.5 + 1.0 * cos(3 * turn) + 0.6 * cos(8 * turn + 1.0) + 0.3 * sin(20 * turn);
        position[n] = 2.0 * sin(3 * turn) + 5.0 * exp(-(double)n / 30.0);
    }
}

void tearDown(void)
{
    recording_free(&recording);
    run_free(&run);
}

static void prepare(void)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, recording_prepare(&run, &recording, &error), error.message);
}

static void assert_refused(const char *part)
{
    TEST_ASSERT_EQUAL_INT(error_refused, recording_prepare(&run, &recording, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, part), error.message);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "run.csv"), error.message);
    TEST_ASSERT_NULL(recording.all.torque);
}

static void test_recording_leaves_out_the_first_period_unless_the_file_says_how_many_settled(void)
{
    prepare();
    TEST_ASSERT_TRUE(recording.periodic);
    TEST_ASSERT_EQUAL_UINT(period, recording.lead);
    TEST_ASSERT_EQUAL_UINT(periods - 1, recording.periods);
    recording_free(&recording);
    run.has_settle_periods = true;
    run.settle_periods = 3;
    prepare();
    TEST_ASSERT_EQUAL_UINT(3 * period, recording.lead);
    TEST_ASSERT_EQUAL_UINT(periods - 3, recording.periods);
    recording_free(&recording);
    run.periods = 2;
    prepare();
    TEST_ASSERT_EQUAL_UINT(2, recording.periods);
    recording_free(&recording);
    run.settle_periods = 50; // more than there are: two are left to compare
    prepare();
    TEST_ASSERT_EQUAL_UINT(2, recording.periods);
    TEST_ASSERT_EQUAL_UINT((periods - 2) * period, recording.lead);
}

static void test_recording_block_is_the_mean_of_the_counted_periods(void)
{
    for (size_t n = 0; n < rows; n++)
        torque[n] += 0.01 * (double)(n / period);
    prepare();
    TEST_ASSERT_EQUAL_UINT(period, recording.block.samples);
    for (size_t i = 0; i < period; i++) {
        double mean = 0.0;
        for (size_t p = 1; p < periods; p++)
            mean += torque[p * period + i] / (periods - 1);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, mean, recording.block.torque[i]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, position[2 * period + i], recording.block.position[i]);
    }
    TEST_ASSERT_NULL(recording.block.torque_ref);
    TEST_ASSERT_EQUAL_UINT(rows, recording.all.samples);
    TEST_ASSERT_EQUAL_MEMORY(torque, recording.all.torque, rows * sizeof *torque);
}

static void test_recording_finds_the_excited_bins_or_takes_the_files(void)
{
    prepare();
    TEST_ASSERT_EQUAL_UINT(3, recording.bin_count);
    TEST_ASSERT_EQUAL_UINT(3, recording.bins[0]);
    TEST_ASSERT_EQUAL_UINT(8, recording.bins[1]);
    TEST_ASSERT_EQUAL_UINT(20, recording.bins[2]);
    TEST_ASSERT_EQUAL_UINT(30, recording.band);
    recording_free(&recording);
    run.bins = malloc(2 * sizeof *run.bins);
    run.bins[0] = 3;
    run.bins[1] = 8;
    run.bin_count = 2;
    prepare();
    TEST_ASSERT_EQUAL_UINT(2, recording.bin_count);
    TEST_ASSERT_EQUAL_UINT(12, recording.band);
}

static void test_recording_measures_what_was_covered(void)
{
    prepare();
    TEST_ASSERT_DOUBLE_WITHIN(1e-2, 4.0, recording.coverage.position_span);
    double w = two_pi * 3.0 * rate_hz / period;
    TEST_ASSERT_DOUBLE_WITHIN(1e-3 * w, 2.0 * w / sqrt(2.0), recording.coverage.velocity_rms);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3 * w, 2.0 * w, recording.coverage.velocity_peak);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, sqrt(0.5 * (1.0 + 0.36 + 0.09)),
                              recording.coverage.torque_rms);                                   // without the constant
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, periods * period / rate_hz, recording.coverage.duration_s); // from the run's begin
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, period / rate_hz, recording.coverage.start_s); // the first period does not count
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 20.0 * rate_hz / period, recording.coverage.frequency_max_hz);
    TEST_ASSERT_FALSE(recording.coverage.linear);
    TEST_ASSERT_TRUE(strlen(recording.motion_from) > 20);
}

static void test_recording_leaves_out_periods_with_lost_samples(void)
{
    double *valid = run_add_column(&run, "valid");
    for (size_t n = 0; n < rows; n++)
        valid[n] = n != 2 * period + 7;
    for (size_t n = 2 * period; n < 3 * period; n++)
        torque[n] = 1e3; // what a lost sample leaves behind must not reach the mean
    prepare();
    TEST_ASSERT_EQUAL_UINT(periods - 2, recording.periods);
    TEST_ASSERT_EQUAL_UINT(period, recording.starts[0]);
    TEST_ASSERT_EQUAL_UINT(3 * period, recording.starts[1]);
    TEST_ASSERT_TRUE(recording.coverage.torque_rms < 2.0);
}

static void test_recording_refuses_a_run_without_two_whole_periods(void)
{
    double *valid = run_add_column(&run, "valid");
    memset(valid, 0, rows * sizeof *valid);
    assert_refused("were lost");
}

static void test_recording_finds_a_period_that_the_file_does_not_say(void)
{
    run.period_samples = 0;
    prepare();
    TEST_ASSERT_TRUE(recording.periodic);
    TEST_ASSERT_EQUAL_UINT(period, recording.block.samples);
    TEST_ASSERT_EQUAL_UINT(periods - 1, recording.periods);
}

static void test_recording_without_periods_is_one_block(void)
{
    run.period_samples = 0;
    for (size_t n = 0; n < rows; n++) // a sweep: repeats nowhere
        torque[n] = 0.5 + cos(two_pi * 30.0 * (double)n / rows * (double)n / rows);
    prepare();
    TEST_ASSERT_FALSE(recording.periodic);
    TEST_ASSERT_EQUAL_UINT(1, recording.periods);
    TEST_ASSERT_EQUAL_UINT(0, recording.lead);
    TEST_ASSERT_EQUAL_UINT(3000, recording.block.samples); // the longest up to 3037 that transforms fast
    TEST_ASSERT_EQUAL_MEMORY(torque, recording.block.torque, 3000 * sizeof *torque);
    for (size_t i = 1; i < recording.bin_count; i++)
        TEST_ASSERT_TRUE(recording.bins[i] > recording.bins[i - 1]);
    TEST_ASSERT_TRUE(recording.bins[recording.bin_count - 1] < recording.block.samples / 2);
    TEST_ASSERT_TRUE(recording.band < recording.block.samples / 2);
}

static void test_recording_takes_the_reference_and_a_linear_axis(void)
{
    run_free(&run);
    memset(&run, 0, sizeof run);
    run.sample_rate_hz = rate_hz;
    run.rows = rows;
    run.linear = true;
    run.path = calloc(8, 1);
    double *force = run_add_column(&run, "force_N"), *reference = run_add_column(&run, "force_ref_N");
    double *speed = run_add_column(&run, "velocity_m_per_s");
    for (size_t n = 0; n < rows; n++) {
        reference[n] = cos(0.05 * (double)n);
        force[n] = 0.9 * reference[n];
        speed[n] = sin(0.05 * (double)n);
    }
    prepare();
    TEST_ASSERT_TRUE(recording.linear && recording.coverage.linear);
    TEST_ASSERT_EQUAL_DOUBLE(reference[7], recording.block.torque_ref[7]);
    TEST_ASSERT_EQUAL_DOUBLE(force[7], recording.block.torque[7]);
    TEST_ASSERT_EQUAL_DOUBLE(speed[7], recording.block.velocity[7]);
}

static void test_recording_refuses_a_run_without_torque(void)
{
    strcpy(run.columns[0].name, "whatever");
    assert_refused("torque_Nm");
}

static void test_recording_refuses_a_run_without_motion(void)
{
    strcpy(run.columns[1].name, "whatever");
    assert_refused("position_rad");
}

static void test_recording_refuses_a_run_of_few_rows(void)
{
    run.rows = 63;
    assert_refused("63");
}

/* A slow stroke under the excitation is most of the speed, and a small part of it is as slow as ever. */
static void test_recording_slow_speed_counts_samples_and_not_shares_of_the_whole(void)
{
    for (int stroke = 0; stroke <= 1; stroke++) {
        for (size_t n = 0; n < rows; n++)
            position[n] += stroke ? 60.0 * sin(two_pi * (double)n / period) : 0.0;
        prepare();
        const struct stretch *b = &recording.block;
        size_t slower = 0;
        for (size_t i = 0; i < b->samples; i++)
            slower += fabs(b->velocity[i]) <= recording.coverage.velocity_slow;
        TEST_ASSERT_TRUE_MESSAGE(slower >= 8 && slower <= 12, stroke ? "with a stroke" : "without");
        recording_free(&recording);
    }
}

static void test_recording_refuses_an_axis_that_does_not_move(void)
{
    for (size_t n = 0; n < rows; n++)
        position[n] = 1.25;
    assert_refused("does not move");
}

static void test_recording_refuses_a_torque_that_excites_nothing(void)
{
    for (size_t n = 0; n < rows; n++)
        torque[n] = 0.0;
    assert_refused("nothing was excited");
}

/* The file's bins say what the table had, not what reached the motor. */
static void test_recording_refuses_a_constant_torque_whatever_bins_the_file_has(void)
{
    run.bins = malloc(sizeof *run.bins);
    run.bins[0] = 3;
    run.bin_count = 1;
    for (int size = 1; size < 20; size++) { // the rounding of its sums is no excitation
        for (size_t n = 0; n < rows; n++)
            torque[n] = 0.1 * size;
        assert_refused("the torque is constant: nothing was excited");
    }
}

static void test_recording_looks_no_further_than_its_band_whatever_bins_the_file_has(void)
{
    // Derivatives of samples are no speeds beyond 0.4 of the rate, and spectra end with the band.
    static const uint32_t bins[] = {3, 8, 20, 199, 240};
    run.bins = malloc(sizeof bins);
    memcpy(run.bins, bins, sizeof bins);
    run.bin_count = sizeof bins / sizeof bins[0];
    prepare();
    TEST_ASSERT_EQUAL_UINT(4, recording.bin_count);
    TEST_ASSERT_EQUAL_UINT(200, recording.band);
    TEST_ASSERT_TRUE(recording.bins[recording.bin_count - 1] <= recording.band);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_recording_leaves_out_the_first_period_unless_the_file_says_how_many_settled);
    RUN_TEST(test_recording_block_is_the_mean_of_the_counted_periods);
    RUN_TEST(test_recording_finds_the_excited_bins_or_takes_the_files);
    RUN_TEST(test_recording_measures_what_was_covered);
    RUN_TEST(test_recording_slow_speed_counts_samples_and_not_shares_of_the_whole);
    RUN_TEST(test_recording_leaves_out_periods_with_lost_samples);
    RUN_TEST(test_recording_refuses_a_run_without_two_whole_periods);
    RUN_TEST(test_recording_finds_a_period_that_the_file_does_not_say);
    RUN_TEST(test_recording_without_periods_is_one_block);
    RUN_TEST(test_recording_takes_the_reference_and_a_linear_axis);
    RUN_TEST(test_recording_refuses_a_run_without_torque);
    RUN_TEST(test_recording_refuses_a_run_without_motion);
    RUN_TEST(test_recording_refuses_a_run_of_few_rows);
    RUN_TEST(test_recording_refuses_an_axis_that_does_not_move);
    RUN_TEST(test_recording_refuses_a_torque_that_excites_nothing);
    RUN_TEST(test_recording_looks_no_further_than_its_band_whatever_bins_the_file_has);
    RUN_TEST(test_recording_refuses_a_constant_torque_whatever_bins_the_file_has);
    return UNITY_END();
}
