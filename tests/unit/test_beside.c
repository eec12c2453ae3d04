/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/beside.h"

#include "lab/numeric/least_squares.h"
#include "unity.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

enum { rows = 40, coordinates = 3 };

// Both sides solve the same normal equations in double precision.
static const double rounding = 1e-9;

static struct fit_data data;
static struct hypothesis hypothesis;
static struct fit fit;
static double residual[rows], jacobian[rows * coordinates], columns[2 * rows];
static uint32_t state;

static double draw(void)
{
    state = state * 1664525u + 1013904223u;
    return (double)(state >> 8) / 8388608.0 - 1.0;
}

void setUp(void)
{
    state = 7;
    memset(&hypothesis, 0, sizeof hypothesis);
    data = (struct fit_data){.values = rows};
    fit = (struct fit){.rows = rows, .residual = residual, .jacobian = jacobian};
    hypothesis.count = coordinates;
    for (size_t i = 0; i < coordinates; i++)
        hypothesis.coordinates[i] = (struct coordinate){.effect = -1, .lower = -1.0, .upper = 1.0, .weight = 0.5 * i};
    for (size_t i = 0; i < rows * coordinates; i++)
        jacobian[i] = draw();
    for (size_t i = 0; i < rows; i++)
        residual[i] = draw();
    for (size_t i = 0; i < 2 * rows; i++)
        columns[i] = draw();
}

void tearDown(void) {}

/// The same by one least squares over coordinates and columns; `first` coordinates are left out.
static double cost_of_all(size_t first, size_t count, double *out_sizes)
{
    double A[rows * (coordinates + 2)], b[rows], weight[coordinates + 2] = {0}, x[coordinates + 2];
    size_t kept = coordinates - first;
    memcpy(A, jacobian + first * rows, kept * rows * sizeof *A);
    memcpy(A + kept * rows, columns, count * rows * sizeof *A);
    for (size_t i = 0; i < kept; i++)
        weight[i] = hypothesis.coordinates[first + i].weight;
    for (size_t j = 0; j < rows; j++)
        b[j] = -residual[j];
    TEST_ASSERT_TRUE(least_squares_solve(rows, kept + count, A, b, weight, NULL, x, NULL));
    double cost = 0.0;
    for (size_t j = 0; j < rows; j++) {
        for (size_t i = 0; i < kept + count; i++)
            b[j] -= A[i * rows + j] * x[i];
        cost += b[j] * b[j];
    }
    for (size_t i = 0; i < kept; i++)
        cost += weight[i] * weight[i] * x[i] * x[i];
    memcpy(out_sizes, x + kept, count * sizeof *out_sizes);
    return cost;
}

static void test_beside_cost_is_that_of_one_least_squares_over_everything(void)
{
    for (size_t count = 1; count <= 2; count++) {
        struct beside beside;
        double sizes[2], expected[2];
        TEST_ASSERT_TRUE(beside_init(&beside, &data, &hypothesis, &fit));
        double cost = beside_cost(&beside, columns, count, sizes);
        TEST_ASSERT_DOUBLE_WITHIN(rounding, cost_of_all(0, count, expected), cost);
        TEST_ASSERT_TRUE(cost < beside.cost);
        for (size_t i = 0; i < count; i++)
            TEST_ASSERT_DOUBLE_WITHIN(rounding, expected[i], sizes[i]);
        beside_free(&beside);
    }
}

static void test_beside_leaves_a_coordinate_at_its_wall_where_it_is(void)
{
    struct beside beside;
    double size, expected;
    hypothesis.x[0] = 1.0;
    TEST_ASSERT_TRUE(beside_init(&beside, &data, &hypothesis, &fit));
    TEST_ASSERT_EQUAL_size_t(coordinates - 1, beside.columns);
    double cost = beside_cost(&beside, columns, 1, &size);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, cost_of_all(1, 1, &expected), cost);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, expected, size);
    beside_free(&beside);
}

static void test_beside_a_column_that_the_coordinates_make_gains_nothing(void)
{
    struct beside beside;
    double sizes[2];
    hypothesis.coordinates[1].weight = 0.0;
    memcpy(columns, jacobian + rows, rows * sizeof *columns);
    memcpy(columns + rows, columns, rows * sizeof *columns);
    TEST_ASSERT_TRUE(beside_init(&beside, &data, &hypothesis, &fit));
    TEST_ASSERT_DOUBLE_WITHIN(rounding, beside.cost, beside_cost(&beside, columns, 2, sizes));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, sizes[0]);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, sizes[1]);
    beside_free(&beside);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_beside_cost_is_that_of_one_least_squares_over_everything);
    RUN_TEST(test_beside_leaves_a_coordinate_at_its_wall_where_it_is);
    RUN_TEST(test_beside_a_column_that_the_coordinates_make_gains_nothing);
    return UNITY_END();
}
