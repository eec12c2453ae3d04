/* SPDX-License-Identifier: MIT */
#include "lab/numeric/polynomial.h"

#include "unity.h"

#include <math.h>

/// Simple roots at distances near 1: a few roundings.
static const double exact = 1e-12;

void setUp(void) {}

void tearDown(void) {}

static void test_polynomial_value_and_slope_follow_the_coefficients(void)
{
    const double c[4] = {1.0, -2.0, 0.5, 3.0};
    double complex x = 0.3 - 0.7 * I;
    double complex value = 1.0 - 2.0 * x + 0.5 * x * x + 3.0 * x * x * x;
    double complex slope = -2.0 + x + 9.0 * x * x;
    TEST_ASSERT_DOUBLE_WITHIN(exact, 0.0, cabs(polynomial_value(c, 3, x) - value));
    TEST_ASSERT_DOUBLE_WITHIN(exact, 0.0, cabs(polynomial_slope(c, 3, x) - slope));
}

static void test_polynomial_roots_come_as_exact_pairs(void)
{
    // (x - 2) (x + 1/2) (x^2 - 2 x + 5): 2, -1/2, 1 +- 2j
    const double c[5] = {-5.0, -5.5, 7.0, -3.5, 1.0};
    double complex roots[4];
    size_t count = 0;
    TEST_ASSERT_TRUE(polynomial_roots(c, 4, roots, &count));
    TEST_ASSERT_EQUAL_size_t(4, count);
    const double complex wanted[4] = {2.0, -0.5, 1.0 + 2.0 * I, 1.0 - 2.0 * I};
    for (size_t w = 0; w < 4; w++) {
        double nearest = INFINITY;
        for (size_t i = 0; i < 4; i++) {
            nearest = fmin(nearest, cabs(roots[i] - wanted[w]));
        }
        TEST_ASSERT_DOUBLE_WITHIN(exact, 0.0, nearest);
    }
    for (size_t i = 0; i < 4; i++) {
        if (cimag(roots[i]) > 0.0) {
            TEST_ASSERT_TRUE(i + 1 < 4 && roots[i + 1] == conj(roots[i]));
        }
    }
}

static void test_polynomial_roots_of_widely_spread_size_keep_their_digits(void)
{
    // (x + 1e-6) (x + 1) (x + 1e6)
    const double c[4] = {1.0, 1e6 + 1.0 + 1e-6, 1e6 + 1.0 + 1e-6, 1.0};
    const double wanted[3] = {-1e-6, -1.0, -1e6};
    double complex roots[3];
    size_t count = 0;
    TEST_ASSERT_TRUE(polynomial_roots(c, 3, roots, &count));
    for (size_t w = 0; w < 3; w++) {
        double nearest = INFINITY;
        for (size_t i = 0; i < count; i++) {
            nearest = fmin(nearest, cabs(roots[i] - wanted[w]));
        }
        TEST_ASSERT_DOUBLE_WITHIN(1e-9 * fabs(wanted[w]), 0.0, nearest);
    }
}

static void test_polynomial_roots_leave_out_absent_high_powers(void)
{
    const double c[4] = {-6.0, 2.0, 0.0, 0.0};
    double complex roots[3];
    size_t count = 9;
    TEST_ASSERT_TRUE(polynomial_roots(c, 3, roots, &count));
    TEST_ASSERT_EQUAL_size_t(1, count);
    TEST_ASSERT_DOUBLE_WITHIN(exact, 3.0, creal(roots[0]));
    TEST_ASSERT_TRUE(polynomial_roots(c, 0, roots, &count));
    TEST_ASSERT_EQUAL_size_t(0, count);
}

static void test_polynomial_roots_refuse_what_is_not_finite(void)
{
    const double c[3] = {1.0, NAN, 1.0};
    double complex roots[2];
    size_t count = 0;
    TEST_ASSERT_FALSE(polynomial_roots(c, 2, roots, &count));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_polynomial_value_and_slope_follow_the_coefficients);
    RUN_TEST(test_polynomial_roots_come_as_exact_pairs);
    RUN_TEST(test_polynomial_roots_of_widely_spread_size_keep_their_digits);
    RUN_TEST(test_polynomial_roots_leave_out_absent_high_powers);
    RUN_TEST(test_polynomial_roots_refuse_what_is_not_finite);
    return UNITY_END();
}
