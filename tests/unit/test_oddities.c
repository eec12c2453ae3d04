/* SPDX-License-Identifier: MIT */
/// What is odd about a recording is said, and what cannot be meant is refused with what to do about it.
#include "lab/diagnose/oddities.h"

#include "lab/diagnose/recording.h"
#include "unity.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { period = 500, periods = 6, rows = periods * period };

static const double two_pi = 6.283185307179586;
static const double rate_hz = 1000.0, inertia = 0.004;

static struct run run;
static struct recording recording;
static struct error error;
static double *torque, *position, *velocity;

/// A frictionless rigid body: torque is inertia times acceleration.
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
    velocity = run_add_column(&run, "velocity_rad_per_s");
    double w = two_pi * rate_hz / period;
    for (size_t n = 0; n < rows; n++) {
        double phase = two_pi * (double)n / period;
        position[n] = 0.2 * sin(3 * phase) + 0.05 * cos(8 * phase);
        velocity[n] = w * (0.6 * cos(3 * phase) - 0.4 * sin(8 * phase));
        torque[n] = -inertia * w * w * (1.8 * sin(3 * phase) + 3.2 * cos(8 * phase));
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

static void scale(double *column, double factor)
{
    for (size_t n = 0; n < rows; n++)
        column[n] *= factor;
}

static void assert_said(const char *part)
{
    for (size_t i = 0; i < recording.oddities.count; i++)
        if (strstr(recording.oddities.texts[i], part)) {
            TEST_ASSERT_NOT_NULL_MESSAGE(strstr(recording.oddities.texts[i], "run.csv"), "names the file");
            return;
        }
    TEST_FAIL_MESSAGE(recording.oddities.count > 0 ? recording.oddities.texts[0] : "nothing was said");
}

static void test_oddities_of_a_good_run_are_none(void)
{
    prepare();
    TEST_ASSERT_EQUAL_INT(0, oddities_of_inertia(&run, &recording, inertia, true, &recording.oddities, &error));
    TEST_ASSERT_EQUAL_UINT(0, recording.oddities.count);
}

static void test_oddities_take_the_period_that_repeats(void)
{
    for (int off = -1; off <= 1; off += 2) {
        run.period_samples = (size_t)(period + off);
        prepare();
        TEST_ASSERT_EQUAL_UINT(period, recording.block.samples);
        assert_said("repeats every 500 rows");
        recording_free(&recording);
    }
}

static void test_oddities_say_that_the_speed_has_the_wrong_sign(void)
{
    scale(velocity, -1.0);
    prepare();
    assert_said("sign is wrong");
    TEST_ASSERT_TRUE(recording.block.velocity[0] > 0.0); // the derivative of the position, not the column
}

static void test_oddities_say_that_the_speed_looks_like_rpm(void)
{
    scale(velocity, 60.0 / two_pi);
    prepare();
    assert_said("rpm instead of rad/s");
    assert_said("0.10472");
}

static void test_oddities_refuse_a_position_in_degrees(void)
{
    scale(position, 360.0 / two_pi);
    scale(velocity, 360.0 / two_pi);
    prepare();
    TEST_ASSERT_EQUAL_INT(error_refused,
                          oddities_of_inertia(&run, &recording, inertia, true, &recording.oddities, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "degrees instead of rad"), error.message);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "position_rad=COLUMN*0.0174533"), error.message);
}

static void test_oddities_refuse_a_torque_of_the_wrong_sign(void)
{
    scale(torque, -1.0);
    prepare();
    TEST_ASSERT_EQUAL_INT(error_refused,
                          oddities_of_inertia(&run, &recording, inertia, true, &recording.oddities, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "accelerate backward"), error.message);
}

static void test_oddities_say_that_the_model_is_of_something_else(void)
{
    prepare();
    TEST_ASSERT_EQUAL_INT(0, oddities_of_inertia(&run, &recording, 4.0 * inertia, true, &recording.oddities, &error));
    assert_said("a model of something else");
}

static void test_oddities_say_that_a_signal_is_clipped(void)
{
    for (size_t n = 0; n < rows; n++)
        torque[n] = fmin(fmax(torque[n], -2.0), 2.0);
    prepare();
    assert_said("clipped");
}

static void test_oddities_say_that_time_stamps_wander(void)
{
    double *time = run_add_column(&run, "time_s");
    for (size_t n = 0; n < rows; n++)
        time[n] = ((double)n + 0.2 * sin(0.7 * (double)n)) / rate_hz;
    prepare();
    assert_said("wander");
}

static void test_oddities_take_a_period_that_is_far_from_what_the_file_says(void)
{
    run.period_samples = 430;
    prepare();
    TEST_ASSERT_EQUAL_UINT(0, period % recording.block.samples);
    assert_said("period_samples says 430, but the torque repeats");
}

static void test_oddities_tell_a_clipped_position_from_one_that_rests(void)
{
    for (size_t n = 0; n < rows; n++)
        position[n] = fmin(fmax(position[n], -0.1), 0.1);
    prepare();
    assert_said("position_rad stands at its largest value");
    recording_free(&recording);
    for (size_t n = 0; n < rows; n++) { // there and back, with a rest at both ends
        double u = fmin(fmax(1.5 * sin(two_pi * (double)n / period), -1.0), 1.0);
        position[n] = sin(0.25 * two_pi * u);
        velocity[n] = torque[n] = cos(two_pi * (double)n / period);
    }
    prepare();
    for (size_t i = 0; i < recording.oddities.count; i++)
        TEST_ASSERT_NULL_MESSAGE(strstr(recording.oddities.texts[i], "position_rad stands"),
                                 recording.oddities.texts[i]);
}

static void assert_refused(const char *part)
{
    TEST_ASSERT_EQUAL_INT(error_refused, recording_prepare(&run, &recording, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, part), error.message);
}

static void test_oddities_refuse_a_position_in_counts(void)
{
    for (size_t n = 0; n < rows; n++)
        position[n] = round(position[n] * 8192.0 / two_pi);
    assert_refused("encoder counts");
}

static void test_oddities_refuse_a_reference_of_another_unit_or_sign(void)
{
    double *reference = run_add_column(&run, "torque_ref_Nm");
    torque = (double *)run_column(&run, "torque_Nm");
    for (size_t n = 0; n < rows; n++)
        reference[n] = 1000.0 * torque[n];
    assert_refused("torque_ref_Nm is 1e+03 times torque_Nm");
    scale(reference, -1e-3);
    assert_refused("opposite sign");
    scale(reference, -1.0);
    prepare();
}

static void test_oddities_refuse_time_in_ms(void)
{
    double *time = run_add_column(&run, "time_s");
    for (size_t n = 0; n < rows; n++)
        time[n] = (double)n;
    run.sample_rate_hz = 1.0;
    assert_refused("looks like ms");
}

static void test_oddities_refuse_an_inertia_that_no_drive_is_off_by(void)
{
    prepare();
    TEST_ASSERT_EQUAL_INT(error_refused,
                          oddities_of_inertia(&run, &recording, 1e-3 * inertia, true, &recording.oddities, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "mNm instead of Nm"), error.message);
    TEST_ASSERT_EQUAL_INT(error_refused,
                          oddities_of_inertia(&run, &recording, 300.0 * inertia, true, &recording.oddities, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "a model of something else"), error.message);
}

static void test_oddities_refuse_numbers_that_no_drive_has(void)
{
    scale(torque, 1e-150);
    TEST_ASSERT_EQUAL_INT(error_refused, recording_prepare(&run, &recording, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "torque RMS"), error.message);
}

enum { long_rows = 9000 };

/// Whether a position with this noise is said to have none.
static bool is_said_to_be_hushed(double noise_rad)
{
    struct oddities said = {0};
    struct run longer = {.path = run.path, .rows = long_rows, .sample_rate_hz = rate_hz};
    double *x = run_add_column(&longer, "position_rad");
    struct recording nothing = {.filled = 0};
    uint64_t state = 3;
    for (size_t n = 0; n < long_rows; n++) {
        double random = -0.5;
        state = state * 6364136223846793005u + 1442695040888963407u;
        random += (double)(state >> 11) / 9007199254740992.0;
        x[n] = sin(two_pi * 7.3 * (double)n / rate_hz) + noise_rad * sqrt(12.0) * random;
    }
    TEST_ASSERT_EQUAL_INT(0, oddities_of_run(&longer, &nothing, &said, &error));
    longer.path = NULL;
    run_free(&longer);
    return said.count == 1 && strstr(said.texts[0], "which no sensor does") != NULL;
}

static void test_oddities_say_that_a_position_has_no_noise(void)
{
    TEST_ASSERT_TRUE(is_said_to_be_hushed(0.0));
    TEST_ASSERT_TRUE(is_said_to_be_hushed(2e-10)); // of a travel of 2: a tenth of what is believed
    TEST_ASSERT_FALSE(is_said_to_be_hushed(2e-8)); // an encoder of 25 bits
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_oddities_of_a_good_run_are_none);
    RUN_TEST(test_oddities_take_the_period_that_repeats);
    RUN_TEST(test_oddities_say_that_the_speed_has_the_wrong_sign);
    RUN_TEST(test_oddities_say_that_the_speed_looks_like_rpm);
    RUN_TEST(test_oddities_refuse_a_position_in_degrees);
    RUN_TEST(test_oddities_refuse_a_torque_of_the_wrong_sign);
    RUN_TEST(test_oddities_say_that_the_model_is_of_something_else);
    RUN_TEST(test_oddities_say_that_a_signal_is_clipped);
    RUN_TEST(test_oddities_say_that_time_stamps_wander);
    RUN_TEST(test_oddities_say_that_a_position_has_no_noise);
    RUN_TEST(test_oddities_take_a_period_that_is_far_from_what_the_file_says);
    RUN_TEST(test_oddities_tell_a_clipped_position_from_one_that_rests);
    RUN_TEST(test_oddities_refuse_a_position_in_counts);
    RUN_TEST(test_oddities_refuse_a_reference_of_another_unit_or_sign);
    RUN_TEST(test_oddities_refuse_time_in_ms);
    RUN_TEST(test_oddities_refuse_an_inertia_that_no_drive_is_off_by);
    RUN_TEST(test_oddities_refuse_numbers_that_no_drive_has);
    return UNITY_END();
}
