/* SPDX-License-Identifier: MIT */
/// Least squares by trust region on problems whose minimum is known. lab/numeric/trust_region.h.
#include "lab/numeric/trust_region.h"

#include "unity.h"

#include <math.h>
#include <string.h>

/// The gradient's tolerance below leaves an error of this order in x.
static const double converged = 1e-6;

/// Rounding of H over the damping that keeps it solvable, per step.
static const double drift = 1e-2;

static const struct trust_region_limits exact = {.steps = 200, .gradient_tolerance = 1e-9};

static struct trust_region_outcome outcome;
static size_t cost_calls;

void setUp(void)
{
    outcome = (struct trust_region_outcome){0};
    cost_calls = 0;
}

void tearDown(void) {}

/// J'J and J'e of a small J, rows x columns, row after row.
static void accumulate(size_t rows, size_t columns, const double *J, const double *e, double *H, double *g)
{
    for (size_t i = 0; i < columns; i++) {
        g[i] = 0;
        for (size_t n = 0; n < rows; n++) {
            g[i] += J[n * columns + i] * e[n];
            for (size_t j = 0; j <= i; j++) {
                H[j * columns + i] += J[n * columns + i] * J[n * columns + j];
            }
        }
    }
}

/// Rosenbrock's valley: e = (10 (x1 - x0^2), 1 - x0), minimum 0 at (1, 1).
static double valley_cost(void *context, const double *x)
{
    (void)context;
    cost_calls++;
    double a = 10 * (x[1] - x[0] * x[0]);
    double b = 1 - x[0];
    return a * a + b * b;
}

static void valley_equations(void *context, const double *x, double *out_H, double *out_g)
{
    (void)context;
    const double e[] = {10 * (x[1] - x[0] * x[0]), 1 - x[0]};
    const double J[] = {-20 * x[0], 10, -1, 0};
    accumulate(2, 2, J, e, out_H, out_g);
}

static const struct trust_region_problem valley = {
    .unknowns = 2, .cost = valley_cost, .normal_equations = valley_equations};

static void test_trust_region_follows_a_curved_valley_to_its_end(void)
{
    double x[] = {-1.2, 1};
    TEST_ASSERT_TRUE(trust_region_minimise(&valley, &exact, x, &outcome));
    TEST_ASSERT_DOUBLE_WITHIN(converged, 1, x[0]);
    TEST_ASSERT_DOUBLE_WITHIN(converged, 1, x[1]);
    TEST_ASSERT_DOUBLE_WITHIN(converged, 0, outcome.cost);
    TEST_ASSERT_EQUAL_size_t(outcome.steps + 1, cost_calls);
    TEST_ASSERT_LESS_THAN_size_t(exact.steps, outcome.steps);
}

static void test_trust_region_stays_where_the_gradient_is_zero(void)
{
    double x[] = {1, 1};
    TEST_ASSERT_TRUE(trust_region_minimise(&valley, &exact, x, &outcome));
    TEST_ASSERT_EQUAL_size_t(0, outcome.steps);
    TEST_ASSERT_EQUAL_DOUBLE(1, x[0]);
    TEST_ASSERT_EQUAL_DOUBLE(1, x[1]);
}

static void test_trust_region_keeps_the_best_when_the_steps_run_out(void)
{
    double x[] = {-1.2, 1};
    const struct trust_region_limits short_of_it = {.steps = 7, .gradient_tolerance = 1e-9};
    double first = valley_cost(NULL, x);
    TEST_ASSERT_TRUE(trust_region_minimise(&valley, &short_of_it, x, &outcome));
    TEST_ASSERT_EQUAL_size_t(7, outcome.steps);
    TEST_ASSERT_TRUE(outcome.cost < first);
    TEST_ASSERT_EQUAL_DOUBLE(valley_cost(NULL, x), outcome.cost);
}

/// A cost tolerance ends the search once steps bring little; without it they go on to the gradient's.
static void test_trust_region_stops_at_the_tolerance_of_the_cost(void)
{
    double x[] = {-1.2, 1};
    const struct trust_region_limits loose = {.steps = 200, .cost_tolerance = 0.9};
    TEST_ASSERT_TRUE(trust_region_minimise(&valley, &loose, x, &outcome));
    TEST_ASSERT_GREATER_THAN_size_t(0, outcome.steps);
    TEST_ASSERT_TRUE(outcome.cost > converged);
}

static void test_trust_region_stops_at_the_tolerance_of_the_step(void)
{
    double x[] = {-1.2, 1};
    const struct trust_region_limits loose = {.steps = 200, .step_tolerance = 0.05};
    TEST_ASSERT_TRUE(trust_region_minimise(&valley, &loose, x, &outcome));
    TEST_ASSERT_LESS_THAN_size_t(200, outcome.steps);
    TEST_ASSERT_TRUE(outcome.cost > 0);
}

/// Only the sum of two unknowns matters: H is singular everywhere. e = (x0 + x1)^2 - 4, and x2 - 3.
static double sum_cost(void *context, const double *x)
{
    (void)context;
    double a = (x[0] + x[1]) * (x[0] + x[1]) - 4;
    return a * a + (x[2] - 3) * (x[2] - 3);
}

static void sum_equations(void *context, const double *x, double *out_H, double *out_g)
{
    (void)context;
    double s = x[0] + x[1];
    const double e[] = {s * s - 4, x[2] - 3};
    const double J[] = {2 * s, 2 * s, 0, 0, 0, 1};
    accumulate(2, 3, J, e, out_H, out_g);
}

static void test_trust_region_takes_unknowns_that_depend_on_each_other(void)
{
    const struct trust_region_problem problem = {.unknowns = 3, .cost = sum_cost, .normal_equations = sum_equations};
    double x[] = {5, -1, 100};
    TEST_ASSERT_TRUE(trust_region_minimise(&problem, &exact, x, &outcome));
    TEST_ASSERT_DOUBLE_WITHIN(converged, 2, fabs(x[0] + x[1]));
    TEST_ASSERT_DOUBLE_WITHIN(converged, 3, x[2]);
    TEST_ASSERT_DOUBLE_WITHIN(drift, 6, x[0] - x[1]); // what does not matter is not moved
}

/// e = log(x), out of the question for x <= 0: the Gauss-Newton step from x = 10 goes to -13.
static double logarithm_cost(void *context, const double *x)
{
    (void)context;
    return log(x[0]) * log(x[0]);
}

static void logarithm_equations(void *context, const double *x, double *out_H, double *out_g)
{
    (void)context;
    out_H[0] = 1 / (x[0] * x[0]);
    out_g[0] = log(x[0]) / x[0];
}

static void test_trust_region_comes_back_from_where_the_cost_is_not_a_number(void)
{
    const struct trust_region_problem problem = {
        .unknowns = 1, .cost = logarithm_cost, .normal_equations = logarithm_equations};
    double x = 10;
    // The first radius is |x|, so that the first step would end at or below zero.
    TEST_ASSERT_TRUE(trust_region_minimise(&problem, &exact, &x, &outcome));
    TEST_ASSERT_DOUBLE_WITHIN(converged, 1, x);
}

static bool stop_at_three(void *context, size_t step)
{
    (void)context;
    return step == 3;
}

static void test_trust_region_ends_when_it_is_told_to(void)
{
    struct trust_region_problem problem = valley;
    problem.stop = stop_at_three;
    double x[] = {-1.2, 1};
    TEST_ASSERT_TRUE(trust_region_minimise(&problem, &exact, x, &outcome));
    TEST_ASSERT_TRUE(outcome.stopped);
    TEST_ASSERT_EQUAL_size_t(3, outcome.steps);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_trust_region_follows_a_curved_valley_to_its_end);
    RUN_TEST(test_trust_region_stays_where_the_gradient_is_zero);
    RUN_TEST(test_trust_region_keeps_the_best_when_the_steps_run_out);
    RUN_TEST(test_trust_region_stops_at_the_tolerance_of_the_cost);
    RUN_TEST(test_trust_region_stops_at_the_tolerance_of_the_step);
    RUN_TEST(test_trust_region_takes_unknowns_that_depend_on_each_other);
    RUN_TEST(test_trust_region_comes_back_from_where_the_cost_is_not_a_number);
    RUN_TEST(test_trust_region_ends_when_it_is_told_to);
    return UNITY_END();
}
