/* SPDX-License-Identifier: MIT */
/// An output that oscillates by itself: a multisine's response with a sine, noise or a drift added.
#include "lab/estimate/oscillation.h"
#include "lab/numeric/statistics.h"

#include "unity.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;

/* A tenth of a bin of the whole recording, 1/8 s long periods eight times: 0.1 Hz. */
static const double frequency_hz = 0.1;
/* The mean period keeps an eighth of what the sine does on average, the window's edge and noise the rest. */
static const double level_share = 0.15;

enum { length = 500, periods = 8, lines = 10 };

static struct run run;
static struct periodic recording;
static struct oscillation oscillation;

void setUp(void) {}

void tearDown(void)
{
    periodic_free(&recording);
    run.path = NULL;
    run_free(&run);
}

/// RMS 1 from the excitation, `level` from a sine of its own, `noise` of normal noise, a drift of `drift` per sample.
static void make(double level, double sine_hz, double noise, double drift)
{
    static char path[] = "made.csv";
    struct random random;
    struct error error = {0};
    random_seed(&random, 4);
    run = (struct run){.path = path, .sample_rate_hz = 1000.0, .rows = length * periods};
    double *torque = run_add_column(&run, "torque_Nm");
    double *position = run_add_column(&run, "position_rad");
    for (size_t n = 0; n < run.rows; n++) {
        for (int k = 1; k <= lines; k++) {
            torque[n] += sqrt(2.0 / lines) * cos(two_pi * 3 * k * (double)n / length + 0.3 * k * k);
        }
        position[n] = torque[n] + sqrt(2.0) * level * sin(two_pi * sine_hz * 1e-3 * (double)n) +
                      noise * random_normal(&random) + drift * (double)n;
    }
    TEST_ASSERT_EQUAL_INT_MESSAGE(
        0, periodic_cut(&run, &(struct periodic_options){.period_samples = length}, &recording, &error), error.message);
    TEST_ASSERT_TRUE(oscillation_measure(&recording, &oscillation));
}

static void test_oscillation_is_named_with_frequency_and_size(void)
{
    make(0.3, 37.3, 0.02, 0.0);
    TEST_ASSERT_TRUE(oscillation.found);
    TEST_ASSERT_DOUBLE_WITHIN(frequency_hz, 37.3, oscillation.frequency_hz);
    TEST_ASSERT_DOUBLE_WITHIN(0.3 * level_share, 0.3, oscillation.level);
    TEST_ASSERT_TRUE(oscillation.share > 0.9 && oscillation.share <= 1.0);
}

static void test_oscillation_is_seen_under_noise_of_its_size(void)
{
    make(0.1, 61.7, 0.1, 0.0);
    TEST_ASSERT_TRUE(oscillation.found);
    TEST_ASSERT_DOUBLE_WITHIN(frequency_hz, 61.7, oscillation.frequency_hz);
}

static void test_oscillation_is_not_seen_in_noise(void)
{
    make(0.0, 0.0, 0.3, 0.0);
    TEST_ASSERT_FALSE(oscillation.found);
}

static void test_oscillation_is_not_a_drift(void)
{
    make(0.0, 0.0, 0.01, 1e-3);
    TEST_ASSERT_FALSE(oscillation.found);
}

/// A transient of 3 s in 4 s, and the ringing of a resonance: both die away.
static void test_oscillation_is_not_a_transient(void)
{
    for (int ringing = 0; ringing <= 1; ringing++) {
        make(0.0, 0.0, 0.02, 0.0);
        double *position = run.columns[1].data;
        for (size_t n = 0; n < run.rows; n++) {
            const double t = 1e-3 * (double)n;
            position[n] += ringing ? 5.0 * exp(-t / 1.0) * sin(two_pi * 37.3 * t) : 20.0 * exp(-t / 3.0);
        }
        TEST_ASSERT_TRUE(oscillation_measure(&recording, &oscillation));
        TEST_ASSERT_FALSE(oscillation.found);
        tearDown();
    }
}

static void test_oscillation_too_small_to_matter_is_not_told(void)
{
    make(0.01, 37.3, 0.001, 0.0);
    TEST_ASSERT_FALSE(oscillation.found);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_oscillation_is_named_with_frequency_and_size);
    RUN_TEST(test_oscillation_is_seen_under_noise_of_its_size);
    RUN_TEST(test_oscillation_is_not_seen_in_noise);
    RUN_TEST(test_oscillation_is_not_a_drift);
    RUN_TEST(test_oscillation_is_not_a_transient);
    RUN_TEST(test_oscillation_too_small_to_matter_is_not_told);
    return UNITY_END();
}
