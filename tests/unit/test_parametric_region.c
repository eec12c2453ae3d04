/* SPDX-License-Identifier: MIT */
#include "lab/estimate/parametric_region.h"

#include "lab/numeric/statistics.h"
#include "unity.h"

#include <math.h>

void setUp(void) {}

void tearDown(void) {}

/// The mean over angles of a smooth function converges fast; that of a line has a corner of no size.
static const double exact = 1e-12;
static const double numerical = 1e-4;

static void test_parametric_ellipse_of_a_circle_and_of_a_line(void)
{
    const struct parametric_ellipse circle = {.real = 2.0, .imag = 2.0};
    const struct parametric_ellipse line = {.real = 1.0, .imag = 3.0, .cross = sqrt(3.0)};
    for (double c = 0.5; c < 3.0; c += 0.5) {
        TEST_ASSERT_DOUBLE_WITHIN(exact, exp(-c * c), parametric_ellipse_chance(&circle, c, 0.0));
        TEST_ASSERT_DOUBLE_WITHIN(exact, pow(1.0 + c * c / 9.0, -9.0), parametric_ellipse_chance(&circle, c, 18.0));
        TEST_ASSERT_DOUBLE_WITHIN(numerical, erfc(c / sqrt(2.0)), parametric_ellipse_chance(&line, c, 0.0));
    }
}

/// Against drawn numbers, 40000 of them: a standard deviation of .0011.
static void test_parametric_ellipse_holds_what_is_drawn(void)
{
    enum { draws = 40000 };
    const double four_std = 0.0045;
    const struct parametric_ellipse ellipse = {.real = 4.0, .imag = 1.0, .cross = 1.2};
    struct random random;
    size_t outside = 0;
    const double c = 1.8;
    random_seed(&random, 1);
    for (size_t i = 0; i < draws; i++) {
        double first = random_normal(&random);
        double real = 2.0 * first;
        double imag = 0.6 * first + sqrt(1.0 - 0.36) * random_normal(&random);
        outside += hypot(real, imag) > c * sqrt(5.0);
    }
    TEST_ASSERT_DOUBLE_WITHIN(four_std, parametric_ellipse_chance(&ellipse, c, 0.0), (double)outside / draws);
}

/// One unknown, the gain: all errors lie along G, and 95 % are within 1.96 std, not within 1.73.
static void test_parametric_confidence_factor_of_one_real_unknown(void)
{
    struct parametric_model model = {.structure = {.domain = parametric_continuous},
                                     .scale_rad_per_s = 1.0,
                                     .numerator = {2.0},
                                     .denominator = {1.0},
                                     .unknowns = 2,
                                     .covariance = {0.0, 0.0, 0.0, 0.01}};
    const double frequency_hz[3] = {1.0, 2.0, 3.0};
    struct parametric_ellipse ellipse = parametric_response_ellipse(&model, 2.0);
    double std;
    parametric_response(&model, 2.0, &std);
    TEST_ASSERT_DOUBLE_WITHIN(exact, std * std, ellipse.real + ellipse.imag);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 1.95996, parametric_confidence_factor(&model, frequency_hz, 3, 0.95, 0.0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-2, 2.2281, parametric_confidence_factor(&model, frequency_hz, 3, 0.95, 10.0));
    model.covariance[3] = 0.0;
    TEST_ASSERT_TRUE(isnan(parametric_confidence_factor(&model, frequency_hz, 3, 0.95, 0.0)));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_parametric_ellipse_of_a_circle_and_of_a_line);
    RUN_TEST(test_parametric_ellipse_holds_what_is_drawn);
    RUN_TEST(test_parametric_confidence_factor_of_one_real_unknown);
    return UNITY_END();
}
