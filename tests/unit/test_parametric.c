/* SPDX-License-Identifier: MIT */
#include "lab/estimate/parametric.h"

#include "lab/estimate/parametric_problem.h"
#include "lab/numeric/statistics.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { lines = 60 };

static const double two_pi = 6.283185307179586476925;

/// Rounding of the data times what the model's conditioning makes of it.
static const double exact = 1e-9;

/// Resonance of the plant below.
static const double resonance_hz = 30.0;
static const double damping = 0.08;

static double frequency_hz[lines];
static double output_variance[lines];
static double input_variance[lines];
static double complex input[lines];
static double complex output[lines];
static double complex covariance[lines];

void setUp(void)
{
    memset(output_variance, 0, sizeof output_variance);
    memset(input_variance, 0, sizeof input_variance);
    memset(covariance, 0, sizeof covariance);
    for (size_t k = 0; k < lines; k++) {
        frequency_hz[k] = 2.0 + 2.0 * (double)k;
        input[k] = cexp(I * 0.7 * (double)(k * k));
    }
}

void tearDown(void) {}

/// 5 / (1 + 2 zeta s / w + (s / w)^2)
static double complex plant(double f)
{
    double complex s = I * f / resonance_hz;
    return 5.0 / (1.0 + 2.0 * damping * s + s * s);
}

static struct parametric_data spectra(void)
{
    return (struct parametric_data){.name = "made",
                                    .count = lines,
                                    .frequency_hz = frequency_hz,
                                    .input = input,
                                    .output = output,
                                    .output_variance = output_variance,
                                    .input_variance = input_variance,
                                    .output_covariance = covariance};
}

static const struct parametric_structure second_order = {.domain = parametric_continuous, .denominator_order = 2};

static void fit(const struct parametric_data *data, const struct parametric_structure *structure,
                struct parametric_model *out_model)
{
    struct error error = {0};
    int status = parametric_fit(data, structure, NULL, out_model, &error);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, status, error.message);
}

static double complex circular(struct random *random)
{
    double real = random_normal(random);
    double imag = random_normal(random);
    return sqrt(0.5) * (real + I * imag);
}

static void test_parametric_recovers_an_exact_response(void)
{
    struct parametric_model model;
    struct parametric_data data = {
        .name = "made", .count = lines, .frequency_hz = frequency_hz, .output = output, .unit_weights = true};
    for (size_t k = 0; k < lines; k++) {
        output[k] = plant(frequency_hz[k]);
    }
    fit(&data, &second_order, &model);
    TEST_ASSERT_EQUAL_size_t(1, model.pole_count);
    TEST_ASSERT_DOUBLE_WITHIN(exact, resonance_hz, model.poles[0].frequency_hz);
    TEST_ASSERT_DOUBLE_WITHIN(exact, damping, model.poles[0].damping);
    TEST_ASSERT_TRUE(model.poles[0].pair);
    TEST_ASSERT_TRUE(model.stable);
    TEST_ASSERT_TRUE(model.dc_gain_known);
    TEST_ASSERT_DOUBLE_WITHIN(exact, 5.0, model.dc_gain);
    TEST_ASSERT_DOUBLE_WITHIN(exact, 0.0, cabs(parametric_response(&model, 77.7, NULL) - plant(77.7)));
}

static void test_parametric_knows_integration_and_delay(void)
{
    struct parametric_structure structure = {.domain = parametric_continuous,
                                             .numerator_order = 1,
                                             .denominator_order = 3,
                                             .denominator_lowest = 1,
                                             .delay_s = 0.0031};
    struct parametric_model model;
    struct parametric_data data = {
        .name = "made", .count = lines, .frequency_hz = frequency_hz, .output = output, .unit_weights = true};
    for (size_t k = 0; k < lines; k++) {
        double complex s = I * two_pi * frequency_hz[k];
        output[k] = plant(frequency_hz[k]) * (s + 40.0) / s * cexp(-0.0031 * s);
    }
    fit(&data, &structure, &model);
    TEST_ASSERT_EQUAL_size_t(2, model.pole_count);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, model.poles[0].frequency_hz);
    TEST_ASSERT_DOUBLE_WITHIN(exact, resonance_hz, model.poles[1].frequency_hz);
    TEST_ASSERT_DOUBLE_WITHIN(exact, 40.0 / two_pi, model.zeros[0].frequency_hz);
    TEST_ASSERT_FALSE(model.dc_gain_known);
    structure.delay_s = 0.0;
    structure.delay_free = true;
    fit(&data, &structure, &model);
    TEST_ASSERT_DOUBLE_WITHIN(exact, 0.0031, model.delay_s);
    TEST_ASSERT_DOUBLE_WITHIN(1e2 * exact, resonance_hz, model.poles[1].frequency_hz);
}

/// The analytic Jacobian against differences, with everything in it: input noise, covariance, transient, delay.
static void test_parametric_jacobian_matches_differences(void)
{
    const struct parametric_structure structure = {.domain = parametric_continuous,
                                                   .numerator_order = 1,
                                                   .denominator_order = 2,
                                                   .transient = true,
                                                   .delay_free = true};
    const double step = 1e-6;
    const double difference_error = 1e-7; // step^2 and rounding / step
    struct parametric_data data = spectra();
    struct parametric_problem problem;
    struct tall_qr rows;
    double theta[] = {1.0, 0.1, 0.9, 2.0, 0.3, 0.4, -0.2, 0.1, 0.002};
    double R[10 * 10];
    for (size_t k = 0; k < lines; k++) {
        output[k] = plant(frequency_hz[k]) * input[k] * 1.1;
        output_variance[k] = 0.04;
        input_variance[k] = 0.02;
        covariance[k] = 0.01 + 0.015 * I;
    }
    TEST_ASSERT_EQUAL_INT(0, parametric_problem_init(&data, &structure, 0.0, &problem, NULL));
    TEST_ASSERT_EQUAL_size_t(9, problem.layout.unknowns);
    TEST_ASSERT_TRUE(tall_qr_init(&rows, 10));
    double cost = parametric_problem_evaluate(&problem, theta, &rows);
    TEST_ASSERT_TRUE(tall_qr_finish(&rows, R));
    for (size_t i = 0; i < 9; i++) {
        double gradient = 0.0; // of the cost: 2 J' r
        for (size_t r = 0; r < 10; r++) {
            gradient += 2.0 * R[i * 10 + r] * R[9 * 10 + r];
        }
        double value = theta[i];
        double h = step * fmax(fabs(value), 1e-3);
        theta[i] = value + h;
        double above = parametric_problem_evaluate(&problem, theta, NULL);
        theta[i] = value - h;
        double below = parametric_problem_evaluate(&problem, theta, NULL);
        theta[i] = value;
        double scale = cost / fmax(fabs(value), 1e-3);
        TEST_ASSERT_DOUBLE_WITHIN(difference_error * fmax(scale, fabs(gradient)), gradient,
                                  (above - below) / (2.0 * h));
    }
    tall_qr_free(&rows);
    parametric_problem_free(&problem);
}

struct tally {
    double frequency, damping, gain, response, cost, bias;
};

/// Squares of errors over their stated standard deviations.
static void add_errors(const struct parametric_model *model, struct tally *io_tally)
{
    const struct parametric_root *pole = &model->poles[0];
    double std;
    double complex error = parametric_response(model, 25.0, &std) - plant(25.0);
    double frequency = (pole->frequency_hz - resonance_hz) / pole->frequency_std_hz;
    io_tally->frequency += frequency * frequency;
    io_tally->damping += pow((pole->damping - damping) / pole->damping_std, 2.0);
    io_tally->gain += pow((model->dc_gain - 5.0) / model->dc_gain_std, 2.0);
    io_tally->response += creal(error * conj(error)) / (std * std);
    io_tally->cost += model->cost / model->cost_expected;
    io_tally->bias += frequency;
}

enum { runs = 1000 };
/// A mean of 1000 squares of normal numbers scatters by sqrt(2 / 1000) = .045; the estimate's own scatter adds a
/// little.
static const double square_tolerance = 0.2;
/// Mean costs: 1000 runs of 60 lines.
static const double cost_tolerance = 0.02;

static void check_tally(const struct tally *tally)
{
    TEST_ASSERT_DOUBLE_WITHIN(square_tolerance, 1.0, tally->frequency / runs);
    TEST_ASSERT_DOUBLE_WITHIN(square_tolerance, 1.0, tally->damping / runs);
    TEST_ASSERT_DOUBLE_WITHIN(square_tolerance, 1.0, tally->gain / runs);
    TEST_ASSERT_DOUBLE_WITHIN(square_tolerance, 1.0, tally->response / runs);
    TEST_ASSERT_DOUBLE_WITHIN(cost_tolerance, 1.0, tally->cost / runs);
    TEST_ASSERT_DOUBLE_WITHIN(4.5 / sqrt(runs), 0.0, tally->bias / runs);
}

/// Noise as in a loop: part of the output's comes back into the input.
static void test_parametric_standard_deviations_hold_with_correlated_input_noise(void)
{
    const double complex fed_back = -0.6 + 0.5 * I;
    struct parametric_data data = spectra();
    struct tally tally = {0};
    struct random random;
    random_seed(&random, 1);
    for (size_t k = 0; k < lines; k++) {
        output_variance[k] = 0.01;
        input_variance[k] = 0.01 * creal(fed_back * conj(fed_back)) + 0.002;
        covariance[k] = 0.01 * conj(fed_back);
    }
    for (size_t run = 0; run < runs; run++) {
        struct parametric_model model;
        for (size_t k = 0; k < lines; k++) {
            double complex clean = cexp(I * 0.7 * (double)(k * k));
            double complex noise = 0.1 * circular(&random);
            output[k] = plant(frequency_hz[k]) * clean + noise;
            input[k] = clean + fed_back * noise + sqrt(0.002) * circular(&random);
        }
        fit(&data, &second_order, &model);
        add_errors(&model, &tally);
    }
    check_tally(&tally);
}

/// Variances from 8 periods, 7 complex degrees of freedom: the cost rises by 7/6, the covariance by 7/5 over what the
/// sample variances promise.
static void test_parametric_allows_for_variances_that_are_estimates(void)
{
    enum { periods = 8 };
    struct parametric_data data = spectra();
    struct tally tally = {0};
    struct random random;
    random_seed(&random, 2);
    data.variance_dof = periods - 1;
    for (size_t run = 0; run < runs; run++) {
        struct parametric_model model;
        for (size_t k = 0; k < lines; k++) {
            double complex sample[periods];
            double complex mean = 0.0;
            double square = 0.0;
            for (size_t m = 0; m < periods; m++) {
                sample[m] = plant(frequency_hz[k]) * input[k] + 0.3 * circular(&random);
                mean += sample[m] / periods;
            }
            for (size_t m = 0; m < periods; m++) {
                square += creal((sample[m] - mean) * conj(sample[m] - mean));
            }
            output[k] = mean;
            output_variance[k] = square / (periods * (periods - 1));
        }
        fit(&data, &second_order, &model);
        add_errors(&model, &tally);
    }
    check_tally(&tally);
}

/// Two resonances fitted with one, then with two.
static void test_parametric_residual_tells_a_missing_mode(void)
{
    struct parametric_data data = spectra();
    struct parametric_model model;
    struct parametric_structure structure = second_order;
    struct random random;
    random_seed(&random, 3);
    for (size_t k = 0; k < lines; k++) {
        double complex s = I * frequency_hz[k] / 80.0;
        output_variance[k] = 1e-4;
        output[k] = (plant(frequency_hz[k]) + 1.0 / (1.0 + 0.1 * s + s * s)) * input[k] + 1e-2 * circular(&random);
    }
    fit(&data, &structure, &model);
    TEST_ASSERT_TRUE(model.cost > model.cost_expected + 20.0 * model.cost_std);
    TEST_ASSERT_TRUE(model.whiteness_chance < 1e-6);
    structure =
        (struct parametric_structure){.domain = parametric_continuous, .numerator_order = 2, .denominator_order = 4};
    fit(&data, &structure, &model);
    TEST_ASSERT_TRUE(fabs(model.cost - model.cost_expected) < 4.0 * model.cost_std);
    TEST_ASSERT_TRUE(model.whiteness_chance > 1e-3);
    TEST_ASSERT_EQUAL_size_t(2, model.pole_count);
    TEST_ASSERT_DOUBLE_WITHIN(4.5 * model.poles[1].frequency_std_hz, 80.0, model.poles[1].frequency_hz);
}

/// Cost and residual belong together, and a start at the minimum stays there.
static void test_parametric_start_from_a_model_gives_the_same(void)
{
    struct parametric_data data = spectra();
    struct parametric_model model;
    struct parametric_model again;
    struct random random;
    double complex residual[lines];
    double sum = 0.0;
    random_seed(&random, 4);
    for (size_t k = 0; k < lines; k++) {
        output_variance[k] = 0.01;
        output[k] = plant(frequency_hz[k]) * input[k] + 0.1 * circular(&random);
    }
    fit(&data, &second_order, &model);
    TEST_ASSERT_EQUAL_INT(0, parametric_fit(&data, &second_order, &model, &again, NULL));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6 * model.poles[0].frequency_std_hz, model.poles[0].frequency_hz,
                              again.poles[0].frequency_hz);
    parametric_residual(&model, &data, residual);
    for (size_t k = 0; k < lines; k++) {
        sum += creal(residual[k] * conj(residual[k]));
    }
    TEST_ASSERT_DOUBLE_WITHIN(exact * sum, model.cost, sum);
    TEST_ASSERT_DOUBLE_WITHIN(exact * sum, model.cost, parametric_cost(&model, &data, true));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_parametric_recovers_an_exact_response);
    RUN_TEST(test_parametric_knows_integration_and_delay);
    RUN_TEST(test_parametric_jacobian_matches_differences);
    RUN_TEST(test_parametric_standard_deviations_hold_with_correlated_input_noise);
    RUN_TEST(test_parametric_allows_for_variances_that_are_estimates);
    RUN_TEST(test_parametric_residual_tells_a_missing_mode);
    RUN_TEST(test_parametric_start_from_a_model_gives_the_same);
    return UNITY_END();
}
