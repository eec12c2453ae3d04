/* SPDX-License-Identifier: MIT */
#include "lab/numeric/statistics.h"

#include "unity.h"

#include <math.h>
#include <stdlib.h>

/// Relative: 20 times the rounding of a sum of some tens of terms.
static const double exact = 1e-12;
/// Against printed tables with this many digits.
static const double four_digits = 1e-4;

void setUp(void) {}

void tearDown(void) {}

static void test_statistics_f_quantile_is_closed_form_with_two_degrees(void)
{
    /* P(X > x) = (1 + 2 x / d2)^(-d2/2) for F(2, d2). */
    for (double d2 = 2.0; d2 < 300.0; d2 *= 1.7) {
        double expected = 0.5 * d2 * expm1(-log(0.05) * 2.0 / d2);
        TEST_ASSERT_DOUBLE_WITHIN(exact * expected, expected, statistics_f_quantile(0.95, 2.0, d2));
    }
}

static void test_statistics_f_quantile_matches_tables(void)
{
    /* Printed tables of the F distribution, 95 % and 99 %. */
    TEST_ASSERT_DOUBLE_WITHIN(four_digits * 3.3258, 3.3258, statistics_f_quantile(0.95, 5.0, 10.0));
    TEST_ASSERT_DOUBLE_WITHIN(four_digits * 5.6363, 5.6363, statistics_f_quantile(0.99, 5.0, 10.0));
    TEST_ASSERT_DOUBLE_WITHIN(four_digits * 161.4476, 161.4476, statistics_f_quantile(0.95, 1.0, 1.0));
}

static void test_statistics_chi2_quantile_matches_tables_and_closed_form(void)
{
    TEST_ASSERT_DOUBLE_WITHIN(exact * 6.0, -2.0 * log(0.05), statistics_chi2_quantile(0.95, 2.0));
    TEST_ASSERT_DOUBLE_WITHIN(four_digits * 18.3070, 18.3070, statistics_chi2_quantile(0.95, 10.0));
    TEST_ASSERT_DOUBLE_WITHIN(four_digits * 3.9403, 3.9403, statistics_chi2_quantile(0.05, 10.0));
    TEST_ASSERT_DOUBLE_WITHIN(four_digits * 124.3421, 124.3421, statistics_chi2_quantile(0.95, 100.0));
}

static void test_statistics_tail_keeps_digits_where_it_is_tiny(void)
{
    /* dof 2: P(X > x) = exp(-x/2). */
    TEST_ASSERT_DOUBLE_WITHIN(1e-10 * exp(-300.0), exp(-300.0), statistics_chi2_tail(600.0, 2.0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-10 * pow(1.0 + 1e5, -10.0), pow(1.0 + 1e5, -10.0), statistics_f_tail(1e6, 2.0, 20.0));
}

static void test_statistics_cdf_and_tail_add_to_one(void)
{
    for (double x = 0.01; x < 100.0; x *= 1.9) {
        for (double dof = 0.7; dof < 500.0; dof *= 2.3) {
            TEST_ASSERT_DOUBLE_WITHIN(exact, 1.0, statistics_chi2_cdf(x, dof) + statistics_chi2_tail(x, dof));
            TEST_ASSERT_DOUBLE_WITHIN(exact, 1.0, statistics_f_cdf(x, dof, 3.3) + statistics_f_tail(x, dof, 3.3));
        }
    }
}

static void test_statistics_refuses_nan_and_ranges(void)
{
    TEST_ASSERT_TRUE(isnan(statistics_f_quantile(NAN, 2.0, 2.0)));
    TEST_ASSERT_TRUE(isnan(statistics_f_quantile(1.0, 2.0, 2.0)));
    TEST_ASSERT_TRUE(isnan(statistics_chi2_quantile(0.5, 0.0)));
    TEST_ASSERT_TRUE(isnan(statistics_chi2_cdf(-1.0, 2.0)));
    TEST_ASSERT_TRUE(isnan(statistics_f_tail(NAN, 2.0, 2.0)));
}

static void test_statistics_median_is_middle_of_sorted(void)
{
    double odd[] = {5.0, -1.0, 3.0};
    double even[] = {4.0, 1.0, 3.0, 2.0};
    TEST_ASSERT_EQUAL_DOUBLE(3.0, statistics_median(odd, 3));
    TEST_ASSERT_EQUAL_DOUBLE(2.5, statistics_median(even, 4));
    TEST_ASSERT_TRUE(isnan(statistics_median(odd, 0)));
}

static int compare_doubles(const void *left, const void *right)
{
    const double a = *(const double *)left;
    const double b = *(const double *)right;
    return (a > b) - (a < b);
}

/// All lengths, values in any order, in order, against it, and with many of the same.
static void test_statistics_median_is_that_of_sorting(void)
{
    enum { longest = 70, orders = 4 };
    double values[longest];
    double sorted[longest];
    struct random random;
    random_seed(&random, 5);
    for (size_t n = 1; n <= longest * orders; n++) {
        const size_t count = (n - 1) / orders + 1;
        for (size_t i = 0; i < count; i++) {
            const double draw = random_normal(&random);
            const double in_order[orders] = {draw, (double)i, -(double)i, round(draw)};
            values[i] = in_order[n % orders];
            sorted[i] = values[i];
        }
        qsort(sorted, count, sizeof *sorted, compare_doubles);
        const double expected = 0.5 * (sorted[(count - 1) / 2] + sorted[count / 2]);
        TEST_ASSERT_TRUE(statistics_median(values, count) == expected);
    }
}

static void test_random_normal_has_moments_of_a_normal(void)
{
    enum { draws = 1000000 };
    struct random random;
    random_seed(&random, 1);
    double sums[5] = {0};
    for (int i = 0; i < draws; i++) {
        double x = random_normal(&random);
        sums[1] += x / draws;
        sums[2] += x * x / draws;
        sums[4] += x * x * x * x / draws;
    }
    /* Five standard deviations of each moment's estimate: 1, sqrt 2, sqrt 96 over the root of the draws. */
    TEST_ASSERT_DOUBLE_WITHIN(5.0 / 1000.0, 0.0, sums[1]);
    TEST_ASSERT_DOUBLE_WITHIN(5.0 * 1.4143 / 1000.0, 1.0, sums[2]);
    TEST_ASSERT_DOUBLE_WITHIN(5.0 * 9.798 / 1000.0, 3.0, sums[4]);
}

static void test_random_is_the_same_for_the_same_seed(void)
{
    struct random a;
    struct random b;
    random_seed(&a, 7);
    random_seed(&b, 7);
    for (int i = 0; i < 100; i++) {
        TEST_ASSERT_EQUAL_HEX64(random_bits(&a), random_bits(&b));
    }
    random_seed(&b, 8);
    TEST_ASSERT_TRUE(random_bits(&a) != random_bits(&b));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_statistics_f_quantile_is_closed_form_with_two_degrees);
    RUN_TEST(test_statistics_f_quantile_matches_tables);
    RUN_TEST(test_statistics_chi2_quantile_matches_tables_and_closed_form);
    RUN_TEST(test_statistics_tail_keeps_digits_where_it_is_tiny);
    RUN_TEST(test_statistics_cdf_and_tail_add_to_one);
    RUN_TEST(test_statistics_refuses_nan_and_ranges);
    RUN_TEST(test_statistics_median_is_middle_of_sorted);
    RUN_TEST(test_statistics_median_is_that_of_sorting);
    RUN_TEST(test_random_normal_has_moments_of_a_normal);
    RUN_TEST(test_random_is_the_same_for_the_same_seed);
    return UNITY_END();
}
