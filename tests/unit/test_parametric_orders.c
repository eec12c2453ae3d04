/* SPDX-License-Identifier: MIT */
#include "lab/estimate/parametric_orders.h"

#include "lab/numeric/statistics.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { lines = 80, trials = 10 };

static double frequency_hz[lines];
static double variance[lines];
static double complex output[lines];
static double complex other_periods[lines];

void setUp(void)
{
    for (size_t k = 0; k < lines; k++) {
        frequency_hz[k] = 1.0 + (double)k;
        variance[k] = 1e-4;
    }
}

void tearDown(void) {}

/// A two-mass drive's velocity: order 2 over 3.
static double complex plant(double f)
{
    double complex s = I * f / 30.0;
    return (1.0 + 0.1 * s + 2.5 * s * s) / ((s + 0.1) * (1.0 + 0.08 * s + s * s));
}

static void draw(struct random *random, double complex *out_output)
{
    for (size_t k = 0; k < lines; k++) {
        double real = random_normal(random);
        double imag = random_normal(random);
        out_output[k] = plant(frequency_hz[k]) + sqrt(0.5 * variance[k]) * (real + I * imag);
    }
}

static const struct parametric_orders_options continuous = {.structure = {.domain = parametric_continuous},
                                                            .denominator_max = 5};

static struct parametric_data response(const double complex *values)
{
    return (struct parametric_data){
        .name = "made", .count = lines, .frequency_hz = frequency_hz, .output = values, .output_variance = variance};
}

/// A larger neighbour is believed by chance in one of two hundred draws, so that 9 of 10 is a loose bound; never is a
/// smaller one.
static void test_parametric_orders_find_the_order_of_a_noisy_plant(void)
{
    static struct parametric_orders orders;
    struct random random;
    struct parametric_model model;
    size_t right = 0;
    random_seed(&random, 1);
    for (size_t trial = 0; trial < trials; trial++) {
        struct error error = {0};
        struct parametric_data data = response(output);
        draw(&random, output);
        int status = parametric_orders_choose(&data, &continuous, &orders, &model, &error);
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, status, error.message);
        const struct parametric_order_row *row = &orders.rows[orders.chosen];
        TEST_ASSERT_TRUE(row->numerator_order >= 2 && row->denominator_order >= 3);
        TEST_ASSERT_EQUAL_size_t(row->numerator_order, model.structure.numerator_order);
        TEST_ASSERT_EQUAL_size_t(row->denominator_order, model.structure.denominator_order);
        right += row->numerator_order == 2 && row->denominator_order == 3;
    }
    TEST_ASSERT_TRUE(right >= 9);
    TEST_ASSERT_NOT_NULL(strstr(orders.why, "over"));
    TEST_ASSERT_NOT_NULL(strstr(orders.why, "held-out lines"));
}

/// The expected squared error of lines not fitted is just above 1 for the right order; a lower one is out of the
/// question.
static void test_parametric_orders_judge_by_periods_not_fitted(void)
{
    static struct parametric_orders orders;
    struct random random;
    struct parametric_model model;
    random_seed(&random, 2);
    draw(&random, output);
    draw(&random, other_periods);
    struct parametric_data data = response(output);
    struct parametric_data held_out = response(other_periods);
    struct parametric_orders_options options = continuous;
    options.held_out = &held_out;
    TEST_ASSERT_EQUAL_INT(0, parametric_orders_choose(&data, &options, &orders, &model, NULL));
    for (size_t i = 0; i < orders.count; i++) {
        const struct parametric_order_row *row = &orders.rows[i];
        if (row->numerator_order == 2 && row->denominator_order == 3) {
            TEST_ASSERT_DOUBLE_WITHIN(4.0 / sqrt(lines), 1.0, row->held_out);
        } else if (row->denominator_order < 3) {
            TEST_ASSERT_TRUE(row->fitted && !row->judged);
        }
    }
    TEST_ASSERT_NOT_NULL(strstr(orders.why, "held-out periods"));
}

static void test_parametric_orders_of_exact_data_are_the_exact_ones(void)
{
    static struct parametric_orders orders;
    struct parametric_model model;
    struct parametric_data data = response(output);
    data.unit_weights = true;
    for (size_t k = 0; k < lines; k++) {
        output[k] = plant(frequency_hz[k]);
    }
    TEST_ASSERT_EQUAL_INT(0, parametric_orders_choose(&data, &continuous, &orders, &model, NULL));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.0, cabs(parametric_response(&model, 33.3, NULL) - plant(33.3)));
    TEST_ASSERT_EQUAL_size_t(3, model.structure.denominator_order);
    TEST_ASSERT_EQUAL_size_t(2, model.structure.numerator_order);
}

/// A mode that one line shows in excess of its noise is no mode: description length would take it.
static void test_parametric_orders_leave_a_single_line_alone(void)
{
    static struct parametric_orders orders;
    const double outlier = 6.0; // standard deviations
    struct random random;
    struct parametric_model model;
    struct parametric_data data = response(output);
    random_seed(&random, 3);
    draw(&random, output);
    output[50] += outlier * sqrt(variance[50]);
    TEST_ASSERT_EQUAL_INT(0, parametric_orders_choose(&data, &continuous, &orders, &model, NULL));
    TEST_ASSERT_EQUAL_size_t(3, model.structure.denominator_order);
}

static void test_parametric_orders_refuse_an_empty_range(void)
{
    static struct parametric_orders orders;
    struct parametric_model model;
    struct error error = {0};
    struct parametric_data data = response(output);
    struct parametric_orders_options options = continuous;
    options.denominator_min = 4;
    options.denominator_max = 3;
    TEST_ASSERT_EQUAL_INT(error_refused, parametric_orders_choose(&data, &options, &orders, &model, &error));
    TEST_ASSERT_NOT_NULL(strstr(error.message, "denominator orders 4 to 3"));
    options.denominator_min = 1;
    data.output_variance = NULL;
    TEST_ASSERT_EQUAL_INT(error_refused, parametric_orders_choose(&data, &options, &orders, &model, &error));
    TEST_ASSERT_NOT_NULL(strstr(error.message, "no standard deviations"));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_parametric_orders_find_the_order_of_a_noisy_plant);
    RUN_TEST(test_parametric_orders_judge_by_periods_not_fitted);
    RUN_TEST(test_parametric_orders_of_exact_data_are_the_exact_ones);
    RUN_TEST(test_parametric_orders_leave_a_single_line_alone);
    RUN_TEST(test_parametric_orders_refuse_an_empty_range);
    return UNITY_END();
}
