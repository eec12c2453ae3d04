/* SPDX-License-Identifier: MIT */
#include "lab/numeric/scaled_svd.h"

#include "unity.h"

#include <math.h>
#include <string.h>

enum { n = 3 };

/// A few roundings of numbers near 1.
static const double exact = 1e-13;

static struct scaled_svd svd;

void setUp(void)
{
    TEST_ASSERT_TRUE(scaled_svd_init(&svd, n));
}

void tearDown(void)
{
    scaled_svd_free(&svd);
}

/// Upper triangular, columns of very different length.
static const double factor[n * n] = {2e-6, 0.0, 0.0, 1.0, 3.0, 0.0, -4e7, 1e7, 5e7};

static void test_scaled_svd_solves_whatever_the_units(void)
{
    const double truth[n] = {3e5, -2.0, 1e-7};
    double b[n] = {0.0, 0.0, 0.0};
    double x[n];
    for (size_t j = 0; j < n; j++) {
        for (size_t i = 0; i < n; i++) {
            b[i] += factor[j * n + i] * truth[j];
        }
    }
    TEST_ASSERT_TRUE(scaled_svd_factorise(&svd, factor, n));
    scaled_svd_solve(&svd, b, n, 0.0, x);
    for (size_t i = 0; i < n; i++) {
        TEST_ASSERT_DOUBLE_WITHIN(1e2 * exact * fabs(truth[i]), truth[i], x[i]);
    }
    scaled_svd_solve(&svd, b, n, 1e6, x); // damped: next to nothing is left of it
    TEST_ASSERT_DOUBLE_WITHIN(1e-9 * truth[0], 0.0, x[0]);
}

static void test_scaled_svd_inverts_the_gram_matrix(void)
{
    double inverse[n * n];
    TEST_ASSERT_TRUE(scaled_svd_factorise(&svd, factor, n));
    scaled_svd_inverse_gram(&svd, n, inverse);
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < n; j++) {
            double sum = 0.0;
            for (size_t k = 0; k < n; k++) {
                double gram = 0.0;
                for (size_t r = 0; r < n; r++) {
                    gram += factor[i * n + r] * factor[k * n + r];
                }
                sum += gram * inverse[k * n + j];
            }
            double unit = svd.length[i] / svd.length[j];
            TEST_ASSERT_DOUBLE_WITHIN(1e2 * exact * unit, i == j ? 1.0 : 0.0, sum);
        }
    }
}

static void test_scaled_svd_finds_the_null_vector_and_the_rank(void)
{
    double dependent[n * n];
    double x[n];
    memcpy(dependent, factor, sizeof dependent);
    for (size_t i = 0; i < n; i++) {
        dependent[2 * n + i] = 1e9 * factor[i] + 1e7 * factor[n + i];
    }
    TEST_ASSERT_TRUE(scaled_svd_factorise(&svd, dependent, n));
    TEST_ASSERT_EQUAL_size_t(2, scaled_svd_rank(&svd, n, 1e-12));
    TEST_ASSERT_EQUAL_size_t(1, scaled_svd_rank(&svd, 1, 1e-12));
    scaled_svd_null_vector(&svd, x);
    TEST_ASSERT_DOUBLE_WITHIN(1e3 * exact, -1.0, x[0] / x[2] / 1e9);
    TEST_ASSERT_DOUBLE_WITHIN(1e3 * exact, -1.0, x[1] / x[2] / 1e7);
}

static void test_scaled_svd_refuses_what_is_not_finite(void)
{
    double broken[n * n];
    memcpy(broken, factor, sizeof broken);
    broken[4] = NAN;
    TEST_ASSERT_FALSE(scaled_svd_factorise(&svd, broken, n));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_scaled_svd_solves_whatever_the_units);
    RUN_TEST(test_scaled_svd_inverts_the_gram_matrix);
    RUN_TEST(test_scaled_svd_finds_the_null_vector_and_the_rank);
    RUN_TEST(test_scaled_svd_refuses_what_is_not_finite);
    return UNITY_END();
}
