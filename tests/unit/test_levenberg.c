/* SPDX-License-Identifier: MIT */
#include "lab/numeric/levenberg.h"

#include "unity.h"

#include <math.h>

void setUp(void) {}

void tearDown(void) {}

/// Rosenbrock's valley: residuals 10 (y - x^2) and 1 - x, minimum 0 at (1, 1); units of y are a millionth.
static double valley(const void *context, const double *x, struct tall_qr *io_rows)
{
    (void)context;
    double y = 1e-6 * x[1];
    double first = 10.0 * (y - x[0] * x[0]);
    double second = 1.0 - x[0];
    if (io_rows) {
        tall_qr_add(io_rows, (const double[3]){-20.0 * x[0], 10.0 * 1e-6, first});
        tall_qr_add(io_rows, (const double[3]){-1.0, 0.0, second});
    }
    return first * first + second * second;
}

static void test_levenberg_follows_a_curved_valley(void)
{
    const struct levenberg_problem problem = {.unknowns = 2, .evaluate = valley};
    struct levenberg_outcome outcome;
    double x[2] = {-1.2, 1e6};
    TEST_ASSERT_TRUE(levenberg_minimise(&problem, 100, 1e-13, x, &outcome));
    TEST_ASSERT_TRUE(outcome.converged);
    TEST_ASSERT_DOUBLE_WITHIN(1e-10, 1.0, x[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 1e6, x[1]);
}

static void test_levenberg_says_when_iterations_run_out(void)
{
    const struct levenberg_problem problem = {.unknowns = 2, .evaluate = valley};
    struct levenberg_outcome outcome;
    double x[2] = {-1.2, 1e6};
    double start = valley(NULL, x, NULL);
    TEST_ASSERT_TRUE(levenberg_minimise(&problem, 2, 1e-13, x, &outcome));
    TEST_ASSERT_FALSE(outcome.converged);
    TEST_ASSERT_TRUE(outcome.cost < start);
    TEST_ASSERT_EQUAL_DOUBLE(valley(NULL, x, NULL), outcome.cost);
}

/// Fits a/b to 3, 3.1, 2.9: the common factor of a and b does not matter; b = 0 is out of the question.
static double ratio(const void *context, const double *x, struct tall_qr *io_rows)
{
    (void)context;
    const double data[3] = {3.0, 3.1, 2.9};
    double cost = 0.0;
    for (size_t i = 0; i < 3; i++) {
        double residual = x[0] / x[1] - data[i];
        cost += residual * residual;
        if (io_rows) {
            tall_qr_add(io_rows, (const double[3]){1.0 / x[1], -x[0] / (x[1] * x[1]), residual});
        }
    }
    return cost;
}

static void test_levenberg_takes_no_step_along_a_redundant_direction(void)
{
    const struct levenberg_problem problem = {.unknowns = 2, .redundant = 1, .evaluate = ratio};
    struct levenberg_outcome outcome;
    double x[2] = {5.0, -4.0};
    TEST_ASSERT_TRUE(levenberg_minimise(&problem, 50, 1e-13, x, &outcome));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 3.0, x[0] / x[1]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.02, outcome.cost);
    TEST_ASSERT_TRUE(fabs(x[0]) < 1e3 && fabs(x[1]) < 1e3);
}

static void test_levenberg_refuses_a_start_without_a_cost(void)
{
    const struct levenberg_problem problem = {.unknowns = 2, .redundant = 1, .evaluate = ratio};
    struct levenberg_outcome outcome;
    double x[2] = {5.0, 0.0};
    TEST_ASSERT_FALSE(levenberg_minimise(&problem, 50, 1e-13, x, &outcome));
    TEST_ASSERT_EQUAL_DOUBLE(5.0, x[0]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_levenberg_follows_a_curved_valley);
    RUN_TEST(test_levenberg_says_when_iterations_run_out);
    RUN_TEST(test_levenberg_takes_no_step_along_a_redundant_direction);
    RUN_TEST(test_levenberg_refuses_a_start_without_a_cost);
    return UNITY_END();
}
