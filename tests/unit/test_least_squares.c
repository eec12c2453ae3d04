/* SPDX-License-Identifier: MIT */
#include "lab/numeric/least_squares.h"

#include "lab/numeric/statistics.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>

enum { rows = 40, columns = 3 };

/// Relative: the normal equations square a condition number of a few tens.
static const double exact = 1e-11;

static double A[rows * columns];
static double b[rows];

void setUp(void)
{
    // Columns of very different size, as masses and friction forces are.
    for (size_t i = 0; i < rows; i++) {
        double t = (double)i / rows;
        A[i] = 1.0;
        A[rows + i] = 1e4 * t;
        A[2 * rows + i] = 1e-5 * sin(9.0 * t);
    }
}

void tearDown(void) {}

static void fill_right_side(const double *x)
{
    for (size_t i = 0; i < rows; i++)
        b[i] = x[0] * A[i] + x[1] * A[rows + i] + x[2] * A[2 * rows + i];
}

static void test_least_squares_recovers_an_exact_solution(void)
{
    const double truth[columns] = {-2.0, 3e-4, 7e5};
    double x[columns];
    fill_right_side(truth);
    TEST_ASSERT_TRUE(least_squares_solve(rows, columns, A, b, NULL, NULL, x, NULL));
    for (size_t i = 0; i < columns; i++)
        TEST_ASSERT_DOUBLE_WITHIN(exact * fabs(truth[i]), truth[i], x[i]);
}

static void test_least_squares_residual_is_orthogonal_to_the_columns(void)
{
    double x[columns];
    for (size_t i = 0; i < rows; i++)
        b[i] = cos(0.9 * (double)i) + 0.1 * (double)(i % 5);
    TEST_ASSERT_TRUE(least_squares_solve(rows, columns, A, b, NULL, NULL, x, NULL));
    for (size_t c = 0; c < columns; c++) {
        double sum = 0.0, size = 0.0;
        for (size_t i = 0; i < rows; i++) {
            double rest = b[i] - x[0] * A[i] - x[1] * A[rows + i] - x[2] * A[2 * rows + i];
            sum += rest * A[c * rows + i];
            size += fabs(rest * A[c * rows + i]);
        }
        TEST_ASSERT_DOUBLE_WITHIN(exact * size, 0.0, sum);
    }
}

static void test_least_squares_prior_pulls_by_its_weight(void)
{
    // One column of ones: rows b-s of 1 against one prior of weight w at c, the mean of all weighted: (n + w^2 c) / (n
    // + w^2).
    const double weight = 5.0, centre = 4.0;
    double x, variance;
    for (size_t i = 0; i < rows; i++)
        b[i] = 1.0;
    TEST_ASSERT_TRUE(least_squares_solve(rows, 1, A, b, &weight, &centre, &x, &variance));
    double total = rows + weight * weight;
    TEST_ASSERT_DOUBLE_WITHIN(exact, (rows + weight * weight * centre) / total, x);
    TEST_ASSERT_DOUBLE_WITHIN(exact, 1.0 / total, variance);
}

static void test_least_squares_prior_without_centre_shrinks_to_zero(void)
{
    const double weight = 1e9;
    double x;
    for (size_t i = 0; i < rows; i++)
        b[i] = 1.0;
    TEST_ASSERT_TRUE(least_squares_solve(rows, 1, A, b, &weight, NULL, &x, NULL));
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, rows / (rows + weight * weight), x);
}

static void test_least_squares_empty_column_gives_zero_and_no_variance(void)
{
    const double truth[columns] = {-2.0, 3e-4, 0.0};
    double x[columns], covariance[columns * columns];
    for (size_t i = 0; i < rows; i++)
        A[2 * rows + i] = 0.0;
    fill_right_side(truth);
    TEST_ASSERT_TRUE(least_squares_solve(rows, columns, A, b, NULL, NULL, x, covariance));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, x[2]);
    TEST_ASSERT_DOUBLE_WITHIN(exact * 2.0, -2.0, x[0]);
    for (size_t i = 0; i < columns; i++) {
        TEST_ASSERT_EQUAL_DOUBLE(0.0, covariance[2 * columns + i]);
        TEST_ASSERT_EQUAL_DOUBLE(0.0, covariance[i * columns + 2]);
    }
}

static void test_least_squares_empty_column_with_prior_gives_the_prior(void)
{
    const double truth[columns] = {-2.0, 3e-4, 0.0}, weight[columns] = {0.0, 0.0, 0.5},
                 centre[columns] = {0.0, 0.0, 6.0};
    double x[columns], covariance[columns * columns];
    for (size_t i = 0; i < rows; i++)
        A[2 * rows + i] = 0.0;
    fill_right_side(truth);
    TEST_ASSERT_TRUE(least_squares_solve(rows, columns, A, b, weight, centre, x, covariance));
    TEST_ASSERT_DOUBLE_WITHIN(exact * 6.0, 6.0, x[2]);
    TEST_ASSERT_DOUBLE_WITHIN(exact * 4.0, 4.0, covariance[8]);
}

static void test_least_squares_refuses_dependent_columns_and_leaves_the_outputs(void)
{
    // Whatever the rounding of the scaled system: many multiples, all of them dependent.
    for (int k = 1; k <= 200; k++) {
        double x[columns] = {11.0, 12.0, 13.0}, covariance[columns * columns] = {14.0};
        for (size_t i = 0; i < rows; i++)
            A[2 * rows + i] = A[rows + i] * (double)k / 7.0 - A[i] * 0.3 * (double)k;
        TEST_ASSERT_FALSE_MESSAGE(least_squares_solve(rows, columns, A, b, NULL, NULL, x, covariance),
                                  "dependent columns");
        TEST_ASSERT_EQUAL_DOUBLE(11.0, x[0]);
        TEST_ASSERT_EQUAL_DOUBLE(13.0, x[2]);
        TEST_ASSERT_EQUAL_DOUBLE(14.0, covariance[0]);
    }
}

static void test_least_squares_solves_dependent_columns_with_a_prior(void)
{
    const double weight[columns] = {0.0, 1.0, 1.0};
    double x[columns];
    for (size_t i = 0; i < rows; i++) {
        A[rows + i] = (double)i / rows;
        A[2 * rows + i] = A[rows + i];
        b[i] = 1.0 + 4.0 * A[rows + i];
    }
    TEST_ASSERT_TRUE(least_squares_solve(rows, columns, A, b, weight, NULL, x, NULL));
    TEST_ASSERT_DOUBLE_WITHIN(exact * 4.0, x[1], x[2]);
}

static void test_least_squares_refuses_nan(void)
{
    double x[columns] = {11.0, 12.0, 13.0};
    A[5] = NAN;
    TEST_ASSERT_FALSE(least_squares_solve(rows, columns, A, b, NULL, NULL, x, NULL));
    TEST_ASSERT_EQUAL_DOUBLE(11.0, x[0]);
    setUp();
    const double truth[columns] = {1.0, 1.0, 1.0};
    fill_right_side(truth);
    b[7] = NAN;
    TEST_ASSERT_FALSE(least_squares_solve(rows, columns, A, b, NULL, NULL, x, NULL));
    TEST_ASSERT_EQUAL_DOUBLE(11.0, x[0]);
}

/// Scatter of estimates from fresh noise, in units of the predicted standard deviations, as covariances over draws.
static void test_least_squares_covariance_is_the_scatter_of_estimates(void)
{
    enum { draws = 4000 };
    const uint64_t seed = 20;
    // Five standard deviations of a variance estimated from that many draws: 5 sqrt(2 / draws).
    const double chance = 0.112;
    struct random random;
    double covariance[columns * columns], sums[columns * columns] = {0};
    random_seed(&random, seed);
    for (size_t d = 0; d < draws; d++) {
        double x[columns];
        for (size_t i = 0; i < rows; i++)
            b[i] = random_normal(&random);
        TEST_ASSERT_TRUE(least_squares_solve(rows, columns, A, b, NULL, NULL, x, covariance));
        for (size_t i = 0; i < columns; i++)
            for (size_t j = 0; j < columns; j++)
                sums[i * columns + j] += x[i] * x[j] / draws;
    }
    char message[64];
    snprintf(message, sizeof message, "seed %u", (unsigned)seed);
    for (size_t i = 0; i < columns; i++)
        for (size_t j = 0; j < columns; j++) {
            double scale = sqrt(covariance[i * columns + i] * covariance[j * columns + j]);
            TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(chance, covariance[i * columns + j] / scale,
                                              sums[i * columns + j] / scale, message);
            TEST_ASSERT_EQUAL_DOUBLE(covariance[i * columns + j], covariance[j * columns + i]);
        }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_least_squares_recovers_an_exact_solution);
    RUN_TEST(test_least_squares_residual_is_orthogonal_to_the_columns);
    RUN_TEST(test_least_squares_prior_pulls_by_its_weight);
    RUN_TEST(test_least_squares_prior_without_centre_shrinks_to_zero);
    RUN_TEST(test_least_squares_empty_column_gives_zero_and_no_variance);
    RUN_TEST(test_least_squares_empty_column_with_prior_gives_the_prior);
    RUN_TEST(test_least_squares_refuses_dependent_columns_and_leaves_the_outputs);
    RUN_TEST(test_least_squares_solves_dependent_columns_with_a_prior);
    RUN_TEST(test_least_squares_refuses_nan);
    RUN_TEST(test_least_squares_covariance_is_the_scatter_of_estimates);
    return UNITY_END();
}
