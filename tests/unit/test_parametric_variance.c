/* SPDX-License-Identifier: MIT */
#include "lab/estimate/parametric_variance.h"

#include "lab/numeric/statistics.h"
#include "unity.h"

#include <math.h>
#include <string.h>

enum { lines = 120 };

static double frequency_hz[lines];
static double output_variance[lines], input_variance[lines], noise_share[lines];
static double complex output[lines], covariance[lines];
static struct parametric_data data;
static const struct parametric_weights weights = {.output_variance = output_variance,
                                                  .input_variance = input_variance,
                                                  .output_covariance = covariance,
                                                  .noise_share = noise_share};

void setUp(void)
{
    for (size_t k = 0; k < lines; k++) {
        frequency_hz[k] = 1.0 + (double)k;
        output[k] = 1.0;
        output_variance[k] = 1.0;
        input_variance[k] = 0.0;
        covariance[k] = 0.0;
        noise_share[k] = 1.0;
    }
    data = (struct parametric_data){.name = "made",
                                    .count = lines,
                                    .frequency_hz = frequency_hz,
                                    .output = output,
                                    .output_variance = output_variance,
                                    .input_variance = input_variance,
                                    .output_covariance = covariance};
}

void tearDown(void) {}

/// Sample variance of v + 1 complex values of variance `truth`.
static double draw(struct random *random, double truth, int dof)
{
    double sum = 0.0;
    for (int i = 0; i < 2 * dof; i++) {
        double normal = random_normal(random);
        sum += 0.5 * normal * normal / dof;
    }
    return truth * sum;
}

static void fill(uint64_t seed, int dof, double contrast)
{
    struct random random;
    random_seed(&random, seed);
    data.variance_dof = dof;
    for (size_t k = 0; k < lines; k++) {
        double truth = 3.0 * exp(0.01 * (double)k) * (k % 2 ? contrast : 1.0);
        output_variance[k] = draw(&random, truth, dof);
    }
}

/// Of 120 lines in 200 draws: five standard deviations of the mean over 21 lines of one degree of freedom, and the
/// slope over half of them.
static const double largest_error = 1.2;

/// 21 lines of one degree of freedom: a standard deviation of 22 % instead of 100 %, and the slope of the noise stays.
static void test_parametric_weights_are_pooled_where_lines_scatter_alike(void)
{
    size_t refused = 0;
    const size_t draws = 200;
    for (uint64_t seed = 1; seed <= draws; seed++) {
        setUp();
        fill(seed, 1, 1.0);
        size_t window = parametric_weights_pool(&weights, &data);
        refused += window < 21;
        TEST_ASSERT_EQUAL_DOUBLE((double)window, data.variance_dof);
        for (size_t k = 0; k < lines && window == 21; k++) {
            TEST_ASSERT_DOUBLE_WITHIN(largest_error, 0.0, log(output_variance[k] / (3.0 * exp(0.01 * (double)k))));
        }
    }
    // Four standard deviations of a sum that is not quite normal: a few in ten thousand.
    TEST_ASSERT_TRUE(refused <= 1);
}

static void test_parametric_weights_stay_where_lines_differ(void)
{
    fill(1, 3, 20.0);
    double before[lines];
    memcpy(before, output_variance, sizeof before);
    TEST_ASSERT_EQUAL_size_t(1, parametric_weights_pool(&weights, &data));
    TEST_ASSERT_EQUAL_DOUBLE(3.0, data.variance_dof);
    TEST_ASSERT_EQUAL_MEMORY(before, output_variance, sizeof before);
}

/// Enough periods, exact variances and equal weights are left alone.
static void test_parametric_weights_stay_where_pooling_gains_nothing(void)
{
    fill(1, 20, 1.0);
    TEST_ASSERT_EQUAL_size_t(1, parametric_weights_pool(&weights, &data));
    data.variance_dof = 0.0;
    TEST_ASSERT_EQUAL_size_t(1, parametric_weights_pool(&weights, &data));
    data.variance_dof = 3.0;
    data.unit_weights = true;
    TEST_ASSERT_EQUAL_size_t(1, parametric_weights_pool(&weights, &data));
}

/// The input's variances are pooled with the output's, unless they are rounding, whatever that looks like.
static void test_parametric_weights_look_at_the_input_where_it_matters(void)
{
    fill(1, 3, 1.0);
    for (size_t k = 0; k < lines; k++) {
        input_variance[k] = k % 2 ? 1e-30 : 1e-33;
    }
    TEST_ASSERT_TRUE(parametric_weights_pool(&weights, &data) > 1);
    fill(1, 3, 1.0);
    for (size_t k = 0; k < lines; k++) {
        input_variance[k] = k % 2 ? 1.0 : 0.01;
    }
    TEST_ASSERT_EQUAL_size_t(1, parametric_weights_pool(&weights, &data));
}

/// In a closed loop both signals have the loop's peaks, but not what is left of one when the other is taken off.
static void test_parametric_weights_take_output_and_input_together_in_a_loop(void)
{
    static double complex input[lines];
    fill(1, 2, 1.0);
    data.input = input;
    for (size_t k = 0; k < lines; k++) {
        double shared = k % 2 ? 100.0 : 1.0; // input noise that reaches the output through G = 1 / 100
        input[k] = 1e5;
        output[k] = 1000.0;
        input_variance[k] = shared * 1e4;
        covariance[k] = shared * 1e2;
        output_variance[k] += shared;
    }
    TEST_ASSERT_EQUAL_size_t(11, parametric_weights_pool(&weights, &data));
    for (size_t k = 0; k < lines; k++) {
        TEST_ASSERT_DOUBLE_WITHIN(largest_error, 0.0, log(output_variance[k] / (3.0 * exp(0.01 * (double)k))));
        TEST_ASSERT_EQUAL_DOUBLE(0.0, input_variance[k]);
    }
}

/// Of two realisations, whose noise differs from line to line, but not what they differ by beyond it.
static void test_parametric_weights_of_few_runs_are_pooled_in_units_of_their_noise(void)
{
    fill(1, 1, 1.0);
    for (size_t k = 0; k < lines; k++) {
        double noise = k % 2 ? 50.0 : 1.0;
        noise_share[k] = 1.0 / output_variance[k];
        output_variance[k] *= noise;
    }
    TEST_ASSERT_EQUAL_size_t(21, parametric_weights_pool(&weights, &data));
    for (size_t k = 0; k < lines; k++) {
        double noise = k % 2 ? 50.0 : 1.0;
        TEST_ASSERT_DOUBLE_WITHIN(largest_error, 0.0, log(output_variance[k] / (3.0 * noise * exp(0.01 * (double)k))));
        TEST_ASSERT_DOUBLE_WITHIN(1e-9 * noise, fmin(noise, output_variance[k]), noise_share[k] * output_variance[k]);
    }
}

/// What a model misses by more than the noise becomes variance, and the noise keeps its share of it.
static void test_parametric_distortion_is_what_the_residual_has_beyond_noise(void)
{
    const double noise = 0.01, distortion = 0.09;
    struct parametric_model model = {.structure = {.domain = parametric_continuous},
                                     .scale_rad_per_s = 1.0,
                                     .numerator = {1.0},
                                     .denominator = {1.0},
                                     .unknowns = 2,
                                     .parameters = 1};
    struct random random;
    double mean = 0.0;
    random_seed(&random, 1);
    data.input_variance = NULL;
    data.output_covariance = NULL;
    for (size_t k = 0; k < lines; k++) {
        double real = random_normal(&random);
        output[k] = 1.0 + sqrt(0.5 * (noise + distortion)) * (real + I * random_normal(&random));
        output_variance[k] = noise;
    }
    TEST_ASSERT_TRUE(parametric_weights_add_distortion(&weights, &model, &data));
    for (size_t k = 0; k < lines; k++) {
        mean += output_variance[k] / lines;
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, noise, noise_share[k] * output_variance[k]);
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.4 * (noise + distortion), noise + distortion, mean); // four times 1 / sqrt(lines)
    TEST_ASSERT_EQUAL_DOUBLE(11.0, data.variance_dof);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_parametric_weights_are_pooled_where_lines_scatter_alike);
    RUN_TEST(test_parametric_weights_stay_where_lines_differ);
    RUN_TEST(test_parametric_weights_stay_where_pooling_gains_nothing);
    RUN_TEST(test_parametric_weights_look_at_the_input_where_it_matters);
    RUN_TEST(test_parametric_weights_take_output_and_input_together_in_a_loop);
    RUN_TEST(test_parametric_weights_of_few_runs_are_pooled_in_units_of_their_noise);
    RUN_TEST(test_parametric_distortion_is_what_the_residual_has_beyond_noise);
    return UNITY_END();
}
