/* SPDX-License-Identifier: MIT */
/// The actuator in front of the plant against the closed form of its response to a staircase.
#include "sim/plant.h"

#include "unity.h"

#include <math.h>
#include <stdio.h>

enum { samples = 150 };

/// Of references of about 1 Nm: rounding of a sum over all steps of the staircase.
static const double rounding = 1e-12;

static struct sim_model model;
static struct sim_actuator actuator;
static struct sim_stepper stepper;
static double reference[samples];

void setUp(void)
{
    sim_model_default(&model);
    sim_actuator_init(&actuator);
    for (size_t n = 0; n < samples; n++)
        reference[n] = sin(0.9 * (double)n) + 0.3 * (double)(n * n % 7) - 1.0;
}

void tearDown(void) {}

/// After the model has its numbers.
static void prepare(void)
{
    sim_stepper_init(&stepper, &model, 1.0 / (model.sample_rate_hz * sim_substeps));
}

/// Response at time t (samples) to the staircase of references up to number `newest`, by superposition of its steps:
/// 1 - exp(-x / lag) each, x the time since the step came through the dead time; at a step itself the new value counts.
static double staircase(double t, size_t newest, double delay, double lag)
{
    double torque = 0.0;
    for (size_t k = 0; k <= newest; k++) {
        double x = t - (double)k - delay, step = reference[k] - (k > 0 ? reference[k - 1] : 0.0);
        if (x > -1e-9)
            torque += step * (lag > 0.0 ? -expm1(-fmax(x, 0.0) / lag) : 1.0);
    }
    return torque;
}

/// Integral of that from the beginning to t, in Nm samples.
static double staircase_integral(double t, size_t newest, double delay, double lag)
{
    double sum = 0.0;
    for (size_t k = 0; k <= newest; k++) {
        double x = t - (double)k - delay, step = reference[k] - (k > 0 ? reference[k - 1] : 0.0);
        if (x > 0.0)
            sum += step * (lag > 0.0 ? x + lag * expm1(-x / lag) : x);
    }
    return sum;
}

static void assert_staircase(double delay, double lag)
{
    char message[80];
    snprintf(message, sizeof message, "dead time %g, lag %g samples", delay, lag);
    sim_actuator_init(&actuator);
    model.dead_time_s = delay / model.sample_rate_hz;
    model.torque_lag_s = lag / model.sample_rate_hz;
    prepare();
    for (size_t n = 0; n < samples; n++) {
        sim_actuator_hold(&actuator, reference[n]);
        double now = sim_actuator_now(&actuator, &stepper);
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(rounding, staircase((double)n, n, delay, lag), now, message);
        for (size_t i = 0; i < sim_substeps; i++) {
            double from = (double)n + (double)i / sim_substeps, to = (double)n + (double)(i + 1) / sim_substeps;
            double mean =
                sim_substeps * (staircase_integral(to, n, delay, lag) - staircase_integral(from, n, delay, lag));
            TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(20.0 * rounding, mean, sim_actuator_substep(&actuator, &stepper, i),
                                              message);
        }
    }
}

static void test_actuator_follows_the_staircase_exactly_for_any_dead_time_and_lag(void)
{
    static const double delays[] = {0.0,  1e-7, 0.1, 0.25, 0.3, 0.5, 0.75, 0.9, 1.0,
                                    1.25, 1.7,  2.0, 3.0,  3.6, 7.0, 29.4, 60.0};
    static const double lags[] = {0.0, 0.05, 0.3, 1.0, 4.0, 40.0};
    static const double rates_hz[] = {1000.0, 8000.0, 3333.3};
    for (size_t r = 0; r < sizeof rates_hz / sizeof rates_hz[0]; r++) {
        model.sample_rate_hz = rates_hz[r];
        for (size_t d = 0; d < sizeof delays / sizeof delays[0]; d++)
            for (size_t l = 0; l < sizeof lags / sizeof lags[0]; l++)
                assert_staircase(delays[d], lags[l]);
    }
}

static void test_actuator_without_lag_and_dead_time_gives_the_reference_at_once(void)
{
    prepare();
    for (size_t n = 0; n < samples; n++) {
        sim_actuator_hold(&actuator, reference[n]);
        TEST_ASSERT_EQUAL_DOUBLE(reference[n], sim_actuator_now(&actuator, &stepper));
        for (size_t i = 0; i < sim_substeps; i++)
            TEST_ASSERT_EQUAL_DOUBLE(reference[n], sim_actuator_substep(&actuator, &stepper, i));
    }
}

static void test_actuator_with_lag_starts_from_where_it_was(void)
{
    model.torque_lag_s = 1e-3;
    prepare();
    sim_actuator_hold(&actuator, 1.0);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, sim_actuator_now(&actuator, &stepper));
    for (size_t i = 0; i < sim_substeps; i++)
        sim_actuator_substep(&actuator, &stepper, i);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, -expm1(-1.0), sim_actuator_now(&actuator, &stepper));
}

static void test_actuator_whole_dead_time_gives_the_reference_of_that_many_samples_ago(void)
{
    // At every rate: dead times like 3 / 1100 s are no whole number of samples in floating point.
    for (double rate_hz = 100.0; rate_hz < 20000.0; rate_hz += 487.3)
        for (size_t ago = 0; ago <= 12; ago++) {
            sim_actuator_init(&actuator);
            model.sample_rate_hz = rate_hz;
            model.dead_time_s = (double)ago / rate_hz;
            prepare();
            for (size_t n = 0; n < 30; n++) {
                double expected = n >= ago ? reference[n - ago] : 0.0;
                sim_actuator_hold(&actuator, reference[n]);
                TEST_ASSERT_EQUAL_DOUBLE(expected, sim_actuator_now(&actuator, &stepper));
                for (size_t i = 0; i < sim_substeps; i++)
                    TEST_ASSERT_DOUBLE_WITHIN(rounding, expected, sim_actuator_substep(&actuator, &stepper, i));
            }
        }
}

/// The integrals over a substep that sim_torque stands for, against sums over the closed form.
static void test_actuator_says_where_its_torque_takes_the_motor(void)
{
    enum { parts = 4000 };
    const double delay = 1.15, lag = 0.4; // begins within a substep
    model.dead_time_s = delay / model.sample_rate_hz;
    model.torque_lag_s = lag / model.sample_rate_hz;
    prepare();
    for (size_t n = 0; n < 20; n++) {
        sim_actuator_hold(&actuator, reference[n]);
        for (size_t i = 0; i < sim_substeps; i++) {
            double mean = sim_actuator_substep(&actuator, &stepper, i), first = 0.0, second = 0.0;
            for (size_t j = 0; j < parts; j++) {
                double part = ((double)j + 0.5) / parts, to_end = 1.0 - part;
                double torque = staircase((double)n + ((double)i + part) / sim_substeps, n, delay, lag) - mean;
                first += to_end * torque / parts;
                second += 0.5 * to_end * to_end * torque / parts;
            }
            // The sum's error: a step of about 1 Nm within one of the parts.
            TEST_ASSERT_DOUBLE_WITHIN(1.0 / parts, first, actuator.last.before + actuator.last.after);
            TEST_ASSERT_DOUBLE_WITHIN(1.0 / parts, second, actuator.last.before);
            TEST_ASSERT_EQUAL_DOUBLE(mean, actuator.last.mean);
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_actuator_says_where_its_torque_takes_the_motor);
    RUN_TEST(test_actuator_follows_the_staircase_exactly_for_any_dead_time_and_lag);
    RUN_TEST(test_actuator_without_lag_and_dead_time_gives_the_reference_at_once);
    RUN_TEST(test_actuator_with_lag_starts_from_where_it_was);
    RUN_TEST(test_actuator_whole_dead_time_gives_the_reference_of_that_many_samples_ago);
    return UNITY_END();
}
