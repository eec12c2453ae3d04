/* SPDX-License-Identifier: MIT */
/// What the parametric estimator refuses, each with the place, the value and what was expected.
#include "lab/estimate/parametric.h"

#include "unity.h"

#include <math.h>
#include <string.h>

enum { lines = 20 };

static double frequency_hz[lines];
static double variance[lines];
static double input_variance[lines];
static double complex input[lines];
static double complex output[lines];
static double complex covariance[lines];
static struct parametric_data data;
static struct parametric_structure structure;

void setUp(void)
{
    for (size_t k = 0; k < lines; k++) {
        frequency_hz[k] = 1.0 + (double)k;
        variance[k] = 0.01;
        input_variance[k] = 0.0;
        covariance[k] = 0.0;
        input[k] = 1.0;
        // Not rational of low order, so that every order has something left to fit.
        output[k] = 1.0 / (1.0 + 0.3 * I * frequency_hz[k]) + 0.05 * cos(3.0 * (double)(k * k));
    }
    data = (struct parametric_data){.name = "run.csv",
                                    .count = lines,
                                    .frequency_hz = frequency_hz,
                                    .input = input,
                                    .output = output,
                                    .output_variance = variance,
                                    .input_variance = input_variance,
                                    .output_covariance = covariance,
                                    .sample_rate_hz = 100.0};
    structure = (struct parametric_structure){.domain = parametric_continuous, .denominator_order = 1};
}

void tearDown(void) {}

static void check_refused(const char *part)
{
    struct error error = {0};
    struct parametric_model model;
    memset(&model, 1, sizeof model);
    TEST_ASSERT_EQUAL_INT(error_refused, parametric_fit(&data, &structure, NULL, &model, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "run.csv: "), error.message);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, part), error.message);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "expected"), error.message);
    TEST_ASSERT_EQUAL_size_t(0, model.unknowns);
}

static void test_parametric_refusals_start_from_data_that_are_taken(void)
{
    struct parametric_model model;
    struct error error = {0};
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, parametric_fit(&data, &structure, NULL, &model, &error), error.message);
}

static void test_parametric_refuses_values_that_are_not_finite_at_every_line(void)
{
    for (size_t k = 0; k < lines; k++) {
        setUp();
        output[k] = NAN;
        check_refused("|output| + |input| is nan");
        setUp();
        input[k] = I * INFINITY;
        check_refused("|output| + |input| is inf");
        setUp();
        variance[k] = NAN;
        check_refused("the output's variance is");
        setUp();
        variance[k] = 0.0;
        check_refused("the output's variance is 0");
        setUp();
        input_variance[k] = -1.0;
        check_refused("the input's variance is -1");
        setUp();
        covariance[k] = 0.5;
        check_refused("|covariance| of output and input is 0.5");
        setUp();
        frequency_hz[k] = k % 2 ? -1.0 : NAN;
        check_refused("the frequency is");
    }
}

static void test_parametric_refuses_lines_without_variances(void)
{
    data.output_variance = NULL;
    check_refused("no standard deviations to weigh 20 lines by");
    data.output_variance = variance;
    data.variance_dof = 2.0; // three periods
    check_refused("2 complex degrees of freedom");
    data.variance_dof = NAN;
    check_refused("complex degrees of freedom");
}

static void test_parametric_refuses_orders_beyond_the_data(void)
{
    data.count = 4;
    structure.numerator_order = 4;
    structure.denominator_order = 4;
    check_refused("4 lines for a model of order 4 over 4 with 9 parameters");
    structure.denominator_order = 13;
    check_refused("orders 4 over 13");
    structure = (struct parametric_structure){.numerator_lowest = 1, .denominator_order = 2};
    check_refused("lowest powers 1 over 0");
}

/// A constant response has any first-order model with a pole on its zero: the data do not say where.
static void test_parametric_refuses_coefficients_that_the_data_do_not_determine(void)
{
    for (size_t k = 0; k < lines; k++) {
        output[k] = 2.0;
    }
    structure.numerator_order = 1;
    check_refused("20 lines determine ");
}

static void test_parametric_refuses_half_the_rate_and_no_rate(void)
{
    structure.domain = parametric_discrete;
    data.sample_rate_hz = 30.0;
    check_refused("line 15 (15 Hz): the frequency is 15");
    data.sample_rate_hz = 0.0;
    check_refused("sample rate 0 Hz");
}

static void test_parametric_refuses_a_transient_of_a_response(void)
{
    data.input = NULL;
    structure.transient = true;
    check_refused("no transient left");
}

static void test_parametric_refuses_a_delay_that_is_not_finite(void)
{
    structure.delay_s = NAN;
    check_refused("delay nan s");
    structure.delay_s = 0.0;
    structure.delay_limit_s = -1.0;
    check_refused("searched for over -1 s");
}

static void test_parametric_refuses_a_response_of_nothing(void)
{
    for (size_t k = 0; k < lines; k++) {
        output[k] = 0.0;
    }
    check_refused("");
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_parametric_refusals_start_from_data_that_are_taken);
    RUN_TEST(test_parametric_refuses_values_that_are_not_finite_at_every_line);
    RUN_TEST(test_parametric_refuses_lines_without_variances);
    RUN_TEST(test_parametric_refuses_orders_beyond_the_data);
    RUN_TEST(test_parametric_refuses_coefficients_that_the_data_do_not_determine);
    RUN_TEST(test_parametric_refuses_half_the_rate_and_no_rate);
    RUN_TEST(test_parametric_refuses_a_transient_of_a_response);
    RUN_TEST(test_parametric_refuses_a_delay_that_is_not_finite);
    RUN_TEST(test_parametric_refuses_a_response_of_nothing);
    return UNITY_END();
}
