/* SPDX-License-Identifier: MIT */
/// Whether lines lie on a smooth curve as well as their std says: responses of two masses with noise of known size.
#include "lab/estimate/smoothness.h"
#include "lab/numeric/statistics.h"

#include "unity.h"

#include <complex.h>
#include <math.h>
#include <stdlib.h>

static const double two_pi = 6.283185307179586476925;

/* A median over some 200 lines, nine of them sharing neighbours, is within 15 % in all of thousands of draws. */
static const double median_share = 0.15;

enum { lines_max = 400 };

static struct frf frf;
static double distance[lines_max];
static struct smoothness smoothness;

void setUp(void) {}

void tearDown(void)
{
    frf_free(&frf);
}

/* Motor speed over torque: antiresonance at 50 Hz, resonance at 80 Hz, damping 2 %. */
static double complex two_masses(double frequency_hz)
{
    const double complex s = I * two_pi * frequency_hz;
    const double a = two_pi * 50.0, r = two_pi * 80.0;
    return (s * s + 0.04 * a * s + a * a) / (s * s + 0.04 * r * s + r * r) / (0.005 * s + 0.01);
}

/// Lines at first_hz, then `ratio` times and `step_hz` further each; std is `noise` of |G|, what moves lines `scatter`.
static void make(size_t count, double first_hz, double ratio, double step_hz, double noise, double scatter)
{
    struct error error;
    struct random random;
    double frequency = first_hz;
    random_seed(&random, 5);
    TEST_ASSERT_TRUE(count <= lines_max);
    TEST_ASSERT_EQUAL_INT(0, frf_alloc(&frf, count, &error));
    for (size_t k = 0; k < count; k++) {
        const double complex response = two_masses(frequency);
        const double sigma = hypot(noise, scatter) * cabs(response) / sqrt(2.0);
        frf.frequency_hz[k] = frequency;
        frf.real[k] = creal(response) + sigma * random_normal(&random);
        frf.imag[k] = cimag(response) + sigma * random_normal(&random);
        frf.std[k] = noise * cabs(response);
        frf.valid[k] = true;
        frequency = frequency * ratio + step_hz;
    }
    TEST_ASSERT_TRUE(smoothness_measure(&frf, distance, &smoothness));
}

static void test_smoothness_is_one_with_noise_alone(void)
{
    make(200, 2.0, 1.0, 1.0, 0.01, 0.0);
    TEST_ASSERT_EQUAL_UINT(200, smoothness.lines);
    TEST_ASSERT_DOUBLE_WITHIN(median_share, 1.0, smoothness.ratio);
    TEST_ASSERT_LESS_THAN_UINT(20, smoothness.beyond); // 2 % of 200, the curve's own error at the peak included
    TEST_ASSERT_FALSE(smoothness_is_rough(&smoothness));
}

static void test_smoothness_takes_std_as_small_as_rounding(void)
{
    make(200, 2.0, 1.0, 1.0, 1e-9, 0.0);
    TEST_ASSERT_TRUE(isfinite(smoothness.ratio));
}

/* 3 % of scatter that no period shows, against 0.5 % of noise. */
static void test_smoothness_finds_scatter_that_std_does_not_hold(void)
{
    make(200, 2.0, 1.0, 1.0, 0.005, 0.03);
    TEST_ASSERT_TRUE(smoothness_is_rough(&smoothness));
    TEST_ASSERT_DOUBLE_WITHIN(median_share * 6.08, 6.08, smoothness.ratio); // hypot(3, 0.5) / 0.5
    TEST_ASSERT_DOUBLE_WITHIN(median_share * 0.0304, 0.0304, smoothness.level);
}

/* The same scatter as part of std, as several realisations put it there. */
static void test_smoothness_believes_a_std_that_holds_the_scatter(void)
{
    make(200, 2.0, 1.0, 1.0, 0.03, 0.0);
    TEST_ASSERT_DOUBLE_WITHIN(median_share, 1.0, smoothness.ratio);
}

/* Seven lines in a decade, far more exact than any curve between them. */
static void test_smoothness_does_not_blame_lines_that_are_coarse(void)
{
    make(24, 1.0, 1.3, 0.0, 0.001, 0.0);
    TEST_ASSERT_EQUAL_UINT(24, smoothness.lines);
    TEST_ASSERT_FALSE(smoothness_is_rough(&smoothness));
}

static void test_smoothness_needs_nine_lines(void)
{
    make(8, 2.0, 1.0, 1.0, 0.01, 0.0);
    TEST_ASSERT_EQUAL_UINT(0, smoothness.lines);
    for (size_t k = 0; k < 8; k++) {
        TEST_ASSERT_TRUE(isnan(distance[k]));
    }
    TEST_ASSERT_FALSE(smoothness_is_rough(&smoothness));
}

static void test_smoothness_leaves_out_what_cannot_be_compared(void)
{
    make(30, 2.0, 1.0, 1.0, 0.01, 0.0);
    frf.valid[3] = false;
    frf.std[7] = FRF_UNKNOWN;
    frf.std[9] = 0.0;
    TEST_ASSERT_TRUE(smoothness_measure(&frf, distance, &smoothness));
    TEST_ASSERT_EQUAL_UINT(27, smoothness.lines);
    TEST_ASSERT_TRUE(isnan(distance[3]) && isnan(distance[7]) && isnan(distance[9]) && !isnan(distance[8]));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_smoothness_is_one_with_noise_alone);
    RUN_TEST(test_smoothness_takes_std_as_small_as_rounding);
    RUN_TEST(test_smoothness_finds_scatter_that_std_does_not_hold);
    RUN_TEST(test_smoothness_believes_a_std_that_holds_the_scatter);
    RUN_TEST(test_smoothness_does_not_blame_lines_that_are_coarse);
    RUN_TEST(test_smoothness_needs_nine_lines);
    RUN_TEST(test_smoothness_leaves_out_what_cannot_be_compared);
    return UNITY_END();
}
