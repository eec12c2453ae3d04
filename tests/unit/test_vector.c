/* SPDX-License-Identifier: MIT */
#include "lab/numeric/vector.h"

#include "unity.h"

#include <math.h>

enum { longest = 40 };

void setUp(void) {}

void tearDown(void) {}

/// Whole numbers add up exactly in any order, and so every length tells whether one was left out or counted twice.
static void test_vector_sums_count_every_number_once(void)
{
    double a[longest];
    double sum = 0.0, power = 0.0;
    for (size_t n = 0; n < longest; n++) {
        a[n] = (double)(n * n % 17) - 6.0;
        sum += a[n];
        power += a[n] * a[n];
        TEST_ASSERT_TRUE(vector_sum(n + 1, a) == sum);
        TEST_ASSERT_TRUE(vector_power(n + 1, a) == power);
        TEST_ASSERT_TRUE(vector_dot(n + 1, a, a) == power);
        TEST_ASSERT_TRUE(vector_length(n + 1, a) == sqrt(power));
    }
}

static void test_vector_sums_of_nothing_are_zero(void)
{
    const double a[1] = {3.0};
    TEST_ASSERT_TRUE(vector_sum(0, a) == 0.0);
    TEST_ASSERT_TRUE(vector_power(0, a) == 0.0);
}

static void test_vector_sums_pass_on_what_is_not_finite(void)
{
    double a[longest] = {0.0};
    for (size_t n = 0; n < longest; n++) {
        a[n] = NAN;
        TEST_ASSERT_TRUE(isnan(vector_sum(longest, a)) && isnan(vector_power(longest, a)));
        a[n] = INFINITY;
        TEST_ASSERT_TRUE(isinf(vector_sum(longest, a)) && isinf(vector_power(longest, a)));
        a[n] = 0.0;
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_vector_sums_count_every_number_once);
    RUN_TEST(test_vector_sums_of_nothing_are_zero);
    RUN_TEST(test_vector_sums_pass_on_what_is_not_finite);
    return UNITY_END();
}
