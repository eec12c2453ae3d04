/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/motion.h"

#include "lab/diagnose/recording.h"
#include "lab/numeric/statistics.h"
#include "unity.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586;
static const double rate_hz = 1000.0;
static const uint64_t seed = 5;

enum { period = 1000, periods = 4, rows = period * periods };

static double true_position[rows], true_velocity[rows];
static double position[rows], velocity[rows], out_position[rows], out_velocity[rows];
static struct stretch out;
static char text[160];

/// A motion of some lines up to a fortieth of the sample rate, whole periods of all of them.
void setUp(void)
{
    static const double lines_hz[] = {1.0, 3.0, 7.0, 15.0, 25.0};
    memset(true_position, 0, sizeof true_position);
    memset(true_velocity, 0, sizeof true_velocity);
    for (size_t i = 0; i < rows; i++)
        for (size_t l = 0; l < sizeof lines_hz / sizeof lines_hz[0]; l++) {
            double w = two_pi * lines_hz[l], angle = w * (double)i / rate_hz + (double)l;
            true_position[i] += sin(angle) / w;
            true_velocity[i] += cos(angle);
        }
    memcpy(position, true_position, sizeof position);
    memcpy(velocity, true_velocity, sizeof velocity);
    out = (struct stretch){.samples = rows, .position = out_position, .velocity = out_velocity};
    text[0] = 0;
}

void tearDown(void)
{
    free(out.kinematics);
    out.kinematics = NULL;
}

static void add_noise(double position_rad, double velocity_rad_per_s)
{
    struct random random;
    random_seed(&random, seed);
    for (size_t i = 0; i < rows; i++) {
        position[i] += position_rad * random_normal(&random);
        velocity[i] += velocity_rad_per_s * random_normal(&random);
    }
}

static double error_rms(const double *values, const double *truth, size_t from, size_t to)
{
    double sum = 0.0;
    for (size_t i = from; i < to; i++)
        sum += (values[i] - truth[i]) * (values[i] - truth[i]) / (double)(to - from);
    return sqrt(sum);
}

static void estimate(const double *p, const double *v, size_t samples_per_period)
{
    free(out.kinematics);
    out.kinematics = NULL;
    TEST_ASSERT_TRUE(motion_estimate(rows, rate_hz, p, v, samples_per_period, &out, text, sizeof text));
    TEST_ASSERT_TRUE(strlen(text) > 20 && text[strlen(text) - 1] == '.');
}

static void test_motion_of_a_periodic_position_is_its_derivative_up_to_the_last_sample(void)
{
    estimate(position, NULL, period);
    TEST_ASSERT_EQUAL_MEMORY(position, out_position, sizeof position);
    // Differences of order 8: (w dt)^8 / 630 of a line at 25 Hz.
    for (size_t i = 4; i < rows; i++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-8, true_velocity[i], out_velocity[i]);
    TEST_ASSERT_NOT_NULL(strstr(text, "derivative"));
}

static void test_motion_of_a_position_without_periods_is_filtered_and_differentiated(void)
{
    add_noise(1e-5, 0.0);
    estimate(position, NULL, 0);
    TEST_ASSERT_NOT_NULL(strstr(text, "low-pass at 100 Hz"));
    // White noise through differences would be 1e-5 * 1000 * sqrt(2 * 0.7) rad/s; the low-pass leaves a small part of
    // it.
    double left = error_rms(out_velocity, true_velocity, 50, rows - 50);
    TEST_ASSERT_TRUE(left < 0.35 * 1e-5 * rate_hz);
    TEST_ASSERT_TRUE(left > 0.05 * 1e-5 * rate_hz);
    TEST_ASSERT_TRUE(error_rms(out_position, true_position, 50, rows - 50) < 0.6e-5);
}

static void test_motion_of_a_speed_alone_has_its_integral_as_position(void)
{
    estimate(NULL, velocity, 0);
    TEST_ASSERT_EQUAL_MEMORY(velocity, out_velocity, sizeof velocity);
    // The trapezoidal rule: (w dt)^2 / 12 of a swing of 1 / w, at 25 Hz.
    for (size_t i = 0; i < rows; i++)
        TEST_ASSERT_DOUBLE_WITHIN(5e-5, true_position[i] - true_position[0], out_position[i]);
    TEST_ASSERT_NOT_NULL(strstr(text, "integral"));
}

static void test_motion_of_both_is_right_without_noise(void)
{
    // At the ends of a recording differences are of first order, dt / 2 of the acceleration; the blend forgets them
    // within some twenty time constants of eight samples, or more slowly where rounding passes for the noise of the two
    // columns.
    const size_t end = 160;
    for (size_t p = 0; p <= period; p += period) {
        estimate(position, velocity, p);
        size_t last = p > 0 ? rows : rows - end;
        for (size_t i = end; i < last; i++)
            TEST_ASSERT_DOUBLE_WITHIN(1e-6, true_velocity[i], out_velocity[i]);
        for (size_t i = 0; i < rows; i++)
            TEST_ASSERT_DOUBLE_WITHIN(0.05, true_velocity[i], out_velocity[i]);
    }
}

static void test_motion_of_both_is_less_noisy_than_either(void)
{
    const double sigma_p = 1e-4, sigma_v = 0.01;
    add_noise(sigma_p, sigma_v);
    estimate(position, NULL, period);
    double from_position = error_rms(out_velocity, true_velocity, 50, rows - 50);
    estimate(position, velocity, period);
    double fused = error_rms(out_velocity, true_velocity, 50, rows - 50);
    // L is 1 / (1 + (w / wc)^2); of white noises the fused speed keeps the integral of (1-L)^2 sv^2 + L^2 w^2 sp^2.
    double wc = sigma_v / (sigma_p * rate_hz), expected = 0.0;
    for (size_t k = 0; k < 2000; k++) {
        double w = two_pi * 0.5 * ((double)k + 0.5) / 2000.0, low = 1.0 / (1.0 + w * w / (wc * wc));
        double speed = (1.0 - low) * sigma_v, derivative = low * w * sigma_p * rate_hz;
        expected += (speed * speed + derivative * derivative) / 2000.0;
    }
    // Kalman gain of a position that walks by sigma_v / rate per sample, from its own noise: P = K R, P^2 = Q (P + R).
    double q = sigma_v / rate_hz * (sigma_v / rate_hz), r = sigma_p * sigma_p, gain = out.position_gain;
    double predicted = gain * r / (1.0 - gain);
    TEST_ASSERT_DOUBLE_WITHIN(0.1 * q, q, predicted * predicted / (predicted + r));
    TEST_ASSERT_TRUE(fused < 0.98 * sigma_v && fused < 0.2 * from_position);
    TEST_ASSERT_DOUBLE_WITHIN(0.05 * sqrt(expected), sqrt(expected), fused);
    TEST_ASSERT_NULL(strstr(text, "left out"));
}

static void test_motion_follows_position_at_low_frequencies_when_the_speed_column_drifts(void)
{
    // An offset of the speed column is no motion: the position tells, at frequencies below where the two are blended.
    add_noise(1e-6, 0.01);
    for (size_t i = 0; i < rows; i++)
        velocity[i] += 0.05;
    estimate(position, velocity, period);
    double mean = 0.0;
    for (size_t i = period; i < 3 * period; i++)
        mean += (out_velocity[i] - true_velocity[i]) / (2.0 * period);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0.0, mean);
}

static void assert_left_out(void)
{
    estimate(position, velocity, period);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "left out"), text);
    for (size_t i = 4; i < rows; i++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-8, true_velocity[i], out_velocity[i]);
}

static void test_motion_leaves_out_a_speed_column_of_another_gain_and_says_so(void)
{
    for (size_t i = 0; i < rows; i++)
        velocity[i] = 1.05 * true_velocity[i];
    assert_left_out();
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "1.05 times"), text);
    for (size_t i = 0; i < rows; i++)
        velocity[i] = -true_velocity[i];
    assert_left_out();
    for (size_t i = 0; i < rows; i++)
        velocity[i] = 60.0 / two_pi * true_velocity[i]; // revolutions per minute under a wrong name
    assert_left_out();
}

static void test_motion_leaves_out_a_late_speed_column_and_says_how_late(void)
{
    for (size_t i = 1; i < rows; i++)
        velocity[i] = true_velocity[i - 1];
    velocity[0] = true_velocity[rows - 1];
    assert_left_out();
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "1 samples late") ? text : strstr(text, "0.99 samples late"), text);
}

static void test_motion_names_the_low_pass_that_a_speed_column_went_through(void)
{
    // A first-order low-pass at 8 Hz, in the middle of the lines, settled over a period before the first row.
    double keep = exp(-two_pi * 8.0 / rate_hz), state = 0.0;
    for (size_t i = 0; i < period + rows; i++) {
        state = keep * state + (1.0 - keep) * true_velocity[i % period];
        if (i >= period)
            velocity[i - period] = state;
    }
    assert_left_out();
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "low-pass at 8 Hz"), text);
}

static void test_motion_of_a_position_that_travels_has_no_jump_at_the_end(void)
{
    const double speed = 0.3;
    for (size_t i = 0; i < rows; i++)
        position[i] += speed * (double)i / rate_hz;
    estimate(position, NULL, period);
    for (size_t i = 4; i < rows; i++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-8, true_velocity[i] + speed, out_velocity[i]);
}

static void test_motion_keeps_a_speed_column_within_the_tolerances(void)
{
    for (size_t i = 0; i < rows; i++)
        velocity[i] = 1.01 * true_velocity[i];
    estimate(position, velocity, period);
    TEST_ASSERT_NULL_MESSAGE(strstr(text, "left out"), text);
}

/// The position column's sensor runs out of true: wrong by position, which passes over several turns here.
static void spoil_position(double amplitude)
{
    for (size_t i = 0; i < rows; i++)
        position[i] += amplitude * cos(20.0 * true_position[i]);
}

static void test_motion_keeps_a_right_speed_column_beside_a_noisy_position(void)
{
    add_noise(3e-4, 0.0); // the derivative has a twentieth more power than the speed: plainly regressed, 0.95
    TEST_ASSERT_TRUE(motion_estimate(rows, rate_hz, position, velocity, period, &out, text, sizeof text));
    TEST_ASSERT_NULL_MESSAGE(strstr(text, "left out"), text);
    TEST_ASSERT_NOT_NULL(out.kinematics);
}

static void test_motion_takes_the_speed_column_alone_where_a_position_is_wrong_by_position(void)
{
    add_noise(1e-6, 1e-3);
    spoil_position(5e-4);
    estimate(position, velocity, period);
    TEST_ASSERT_EQUAL_MEMORY(velocity, out_velocity, sizeof velocity);
    TEST_ASSERT_NOT_NULL(out.kinematics);
    // What the columns differ by is the sensor's error, less the noise of both: 1e-3 and sqrt(1.6) * 1e-6 * 1000 Hz.
    double sum = 0.0;
    for (size_t i = period; i < 3 * period; i++) {
        double expected = 5e-4 * 20.0 * sin(20.0 * true_position[i]) * true_velocity[i];
        sum += (out.kinematics[i] - expected) * (out.kinematics[i] - expected) / (2.0 * period);
    }
    TEST_ASSERT_DOUBLE_WITHIN(2e-3, 0.0, sqrt(sum));
}

static void test_motion_keeps_a_speed_column_whose_gain_errs_both_ways_over_the_travel(void)
{
    // A tenth of the speed at the ends of the travel, which is far more than a column in a wrong unit is let pass.
    for (size_t i = 0; i < rows; i++)
        velocity[i] *= 1.0 + 0.1 * sin(6.0 * true_position[i] + 1.0);
    estimate(position, velocity, period);
    TEST_ASSERT_NULL(strstr(text, "left out"));
    TEST_ASSERT_NOT_NULL(out.kinematics);
}

static void test_motion_of_one_column_has_no_kinematics(void)
{
    estimate(position, NULL, period);
    TEST_ASSERT_NULL(out.kinematics);
    estimate(NULL, velocity, period);
    TEST_ASSERT_NULL(out.kinematics);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_motion_of_a_periodic_position_is_its_derivative_up_to_the_last_sample);
    RUN_TEST(test_motion_of_a_position_without_periods_is_filtered_and_differentiated);
    RUN_TEST(test_motion_of_a_speed_alone_has_its_integral_as_position);
    RUN_TEST(test_motion_of_both_is_right_without_noise);
    RUN_TEST(test_motion_of_both_is_less_noisy_than_either);
    RUN_TEST(test_motion_follows_position_at_low_frequencies_when_the_speed_column_drifts);
    RUN_TEST(test_motion_leaves_out_a_speed_column_of_another_gain_and_says_so);
    RUN_TEST(test_motion_leaves_out_a_late_speed_column_and_says_how_late);
    RUN_TEST(test_motion_names_the_low_pass_that_a_speed_column_went_through);
    RUN_TEST(test_motion_of_a_position_that_travels_has_no_jump_at_the_end);
    RUN_TEST(test_motion_keeps_a_speed_column_within_the_tolerances);
    RUN_TEST(test_motion_keeps_a_right_speed_column_beside_a_noisy_position);
    RUN_TEST(test_motion_takes_the_speed_column_alone_where_a_position_is_wrong_by_position);
    RUN_TEST(test_motion_keeps_a_speed_column_whose_gain_errs_both_ways_over_the_travel);
    RUN_TEST(test_motion_of_one_column_has_no_kinematics);
    return UNITY_END();
}
