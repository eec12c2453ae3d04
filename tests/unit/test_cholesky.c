/* SPDX-License-Identifier: MIT */
/// Symmetric systems: lab/numeric/cholesky.h.
#include "lab/numeric/blas.h"
#include "lab/numeric/cholesky.h"

#include "unity.h"

#include <math.h>

static const double rounding = 1e-14;

void setUp(void)
{
    blas_use_one_thread();
}

void tearDown(void) {}

/// A = L L' by hand with L = [2 0 0; 1 3 0; -1 2 1], x = (1, -2, 3). Only the lower triangle is there to be read.
static void test_cholesky_solves_from_the_lower_triangle(void)
{
    double A[9] = {4, 2, -2, NAN, 10, 5, NAN, NAN, 6};
    double x[3] = {4 * 1 + 2 * -2 - 2 * 3, 2 * 1 + 10 * -2 + 5 * 3, -2 * 1 + 5 * -2 + 6 * 3};
    TEST_ASSERT_TRUE(cholesky_solve(3, A, x));
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 1, x[0]);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, -2, x[1]);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 3, x[2]);
}

static void test_cholesky_refuses_what_is_not_positive_definite(void)
{
    double indefinite[4] = {1, 2, 0, 1};
    double x[2] = {1, 1};
    double unknown[4] = {NAN, 0, 0, 1};
    TEST_ASSERT_FALSE(cholesky_solve(2, indefinite, x));
    TEST_ASSERT_FALSE(cholesky_solve(2, unknown, x));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_cholesky_solves_from_the_lower_triangle);
    RUN_TEST(test_cholesky_refuses_what_is_not_positive_definite);
    return UNITY_END();
}
