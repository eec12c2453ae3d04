/* SPDX-License-Identifier: MIT */
#include "lab/estimate/parametric_delay.h"

#include "lab/numeric/statistics.h"
#include "unity.h"

#include <math.h>

enum { lines = 90, order_max = 4 };

static const double two_pi = 6.283185307179586476925;
static const double sample_rate_hz = 1000.0;
static double frequency_hz[lines];
static double variance[lines];
static double complex output[lines];

void setUp(void) {}

void tearDown(void) {}

/// A held first-order lag of 50 rad/s, or in continuous time one beside a resonance of 80 Hz; 46 dB above the noise.
static struct parametric_data respond(bool held, double delay_s, uint64_t seed)
{
    struct random random;
    random_seed(&random, seed);
    for (size_t k = 0; k < lines; k++) {
        double f = 2.0 + 3.0 * (double)k;
        double complex s = I * two_pi * f;
        double complex z = cexp(s / sample_rate_hz);
        double pole = exp(-50.0 / sample_rate_hz);
        double complex slow = 1.0 / (1.0 + s / 50.0) + 0.3 / (1.0 + 0.1 * s / 500.0 + s * s / 250000.0);
        double complex response = (held ? (1.0 - pole) / (z - pole) : slow) * cexp(-s * delay_s);
        frequency_hz[k] = f;
        variance[k] = 25e-6 * (held ? 0.1 : 1.0);
        double real = random_normal(&random);
        output[k] = response + sqrt(0.5 * variance[k]) * (real + I * random_normal(&random));
    }
    return (struct parametric_data){.name = "made",
                                    .count = lines,
                                    .frequency_hz = frequency_hz,
                                    .output = output,
                                    .output_variance = variance,
                                    .sample_rate_hz = sample_rate_hz};
}

/// Held input acts one sample later at the earliest.
static void test_parametric_delay_counts_whole_samples(void)
{
    for (int samples = 0; samples <= 12; samples += 3) {
        struct parametric_data data = respond(true, samples / sample_rate_hz, 1 + (uint64_t)samples);
        struct parametric_structure structure = {.domain = parametric_discrete};
        parametric_delay_find(&data, order_max, &structure);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, samples + 1.0, structure.delay_s * sample_rate_hz);
        TEST_ASSERT_FALSE(structure.delay_free);
    }
}

static void test_parametric_delay_is_free_in_continuous_time(void)
{
    struct parametric_data data = respond(false, 0.0042, 1);
    struct parametric_structure structure = {.domain = parametric_continuous};
    parametric_delay_find(&data, order_max, &structure);
    TEST_ASSERT_TRUE(structure.delay_free);
    TEST_ASSERT_TRUE(structure.delay_s < 0.0042 && structure.delay_s + structure.delay_limit_s > 0.0042);
}

static void test_parametric_delay_is_none_where_there_is_none(void)
{
    struct parametric_data data = respond(false, 0.0, 1);
    struct parametric_structure structure = {.domain = parametric_continuous};
    parametric_delay_find(&data, order_max, &structure);
    TEST_ASSERT_FALSE(structure.delay_free);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, structure.delay_s);
}

static void test_parametric_delay_that_is_given_stays(void)
{
    struct parametric_data data = respond(true, 0.003, 1);
    struct parametric_structure structure = {.domain = parametric_discrete, .delay_s = 0.001};
    parametric_delay_find(&data, order_max, &structure);
    TEST_ASSERT_EQUAL_DOUBLE(0.001, structure.delay_s);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_parametric_delay_counts_whole_samples);
    RUN_TEST(test_parametric_delay_is_free_in_continuous_time);
    RUN_TEST(test_parametric_delay_is_none_where_there_is_none);
    RUN_TEST(test_parametric_delay_that_is_given_stays);
    return UNITY_END();
}
