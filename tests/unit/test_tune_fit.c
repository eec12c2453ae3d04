/* SPDX-License-Identifier: MIT */
/// The least squares behind tuning: gains at their bound, lines at any spacing, noise of a known size.
#include "lab/numeric/statistics.h"
#include "lab/tune/fit.h"
#include "tests/support/known_drive.h"
#include "unity.h"

#include <math.h>
#include <string.h>

static struct frf frf;
static struct tune_plant plant;
static struct tune_problem problem;
static struct tune_controller controller;

void setUp(void) {}

void tearDown(void)
{
    tune_problem_free(&problem);
    tune_plant_free(&plant);
    frf_free(&frf);
}

static void take(double first_hz, double step_hz, size_t count)
{
    struct error error;
    const struct known_drive drive = known_two_mass(2000.0, 1, 0.003, 0.002, 60.0, 0.01, 0.005);
    frf = known_frf(&drive, first_hz, step_hz, count);
    TEST_ASSERT_EQUAL_INT(0, tune_plant_take("f.csv", &frf, 0.0, 0.0, &plant, &error));
}

static void prepare(const char *name, double bandwidth_hz, double delay_samples)
{
    struct error error;
    const struct tune_reference reference = {bandwidth_hz, 0.9, delay_samples, 2000.0};
    controller = (struct tune_controller){
        .structure = tune_structure_find(name, &error), .rate_hz = 2000.0, .corner_hz = 10.0 * bandwidth_hz};
    tune_problem_free(&problem);
    TEST_ASSERT_TRUE(tune_problem_init(&problem, &plant, &controller, &reference, tune_weighting_log));
}

/// The sum of squares that the linear fit minimises, straight from its definition.
static double linear_cost(const double *gain)
{
    double sum = 0.0;
    for (size_t k = 0; k < problem.lines; k++) {
        double complex loop = 0.0;
        for (size_t i = 0; i < problem.gains; i++)
            loop += gain[i] * problem.term[i * problem.lines + k] * plant.response[k];
        const double complex M = problem.reference[k];
        const double error = problem.weight[k] * cabs((1.0 - M) * (M - (1.0 - M) * loop));
        sum += error * error;
    }
    return sum;
}

/// At a minimum over gains >= 0 no step that is allowed goes down: of a convex function, at no place at all.
static void test_tune_fit_is_the_minimum_over_gains_that_are_not_negative(void)
{
    static const char *const names[] = {"p", "pi", "pid", "lead"};
    static const double delays[] = {0.0, 1.0, 3.0};
    int at_bound = 0, free_gains = 0;
    take(1.0, 1.0, 950);
    for (size_t s = 0; s < 4; s++)
        for (size_t d = 0; d < 3; d++) {
            double gain[tune_gains_max] = {0.0};
            prepare(names[s], 60.0, delays[d]);
            TEST_ASSERT_TRUE(tune_fit_linear(&problem, plant.response, gain));
            const double best = linear_cost(gain);
            for (size_t i = 0; i < problem.gains; i++) {
                TEST_ASSERT_TRUE(gain[i] >= 0.0);
                at_bound += gain[i] == 0.0;
                free_gains += gain[i] > 0.0;
                for (int side = -1; side <= 1; side += 2) {
                    double other[tune_gains_max];
                    memcpy(other, gain, sizeof other);
                    other[i] = gain[i] > 0.0 ? gain[i] * (1.0 + 1e-3 * side) : 1e-4 * (side > 0);
                    TEST_ASSERT_TRUE_MESSAGE(linear_cost(other) >= best * (1.0 - 1e-12), names[s]);
                }
            }
        }
    TEST_ASSERT_TRUE(at_bound > 0 && free_gains > 0);
}

/// Twice as many lines in one part of the band must not pull the gains there: a line counts for its stretch of the
/// axis.
static void test_tune_fit_does_not_depend_on_how_lines_are_spaced(void)
{
    double even[2], uneven[2];
    take(1.0, 0.5, 1900);
    prepare("pi", 30.0, 1.0);
    TEST_ASSERT_TRUE(tune_fit_linear(&problem, plant.response, even));
    for (size_t k = 0; k < frf.count; k++)
        frf.valid[k] = frf.frequency_hz[k] < 100.0 || k % 2 == 0; // every second line above 100 Hz
    tune_plant_free(&plant);
    struct error error;
    TEST_ASSERT_EQUAL_INT(0, tune_plant_take("f.csv", &frf, 0.0, 0.0, &plant, &error));
    prepare("pi", 30.0, 1.0);
    TEST_ASSERT_TRUE(tune_fit_linear(&problem, plant.response, uneven));
    const double tolerance = 0.01; // of the sum in place of the integral; a plain mean over lines is off by 30 %
    for (size_t i = 0; i < 2; i++)
        TEST_ASSERT_DOUBLE_WITHIN(tolerance * even[i], even[i], uneven[i]);
}

/// The cost is the weighted mean square of what the loop misses the reference by.
static void test_tune_fit_cost_of_no_controller_is_the_reference_itself(void)
{
    const double none[2] = {0.0, 0.0};
    double sum = 0.0, weights = 0.0;
    take(1.0, 1.0, 900);
    prepare("pi", 30.0, 1.0);
    for (size_t k = 0; k < problem.lines; k++) {
        sum += problem.weight[k] * problem.weight[k] * creal(problem.reference[k] * conj(problem.reference[k]));
        weights += problem.weight[k] * problem.weight[k];
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1.0, weights);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, sum, tune_fit_cost(&problem, plant.response, none));
}

/// Gains of noisy responses scatter around those of the true one if the noise's size is known, else they are too
/// small.
static void test_tune_fit_takes_out_what_noise_adds(void)
{
    enum { draws = 60 };
    struct random random;
    double exact[1], mean[2] = {0.0}, square[2] = {0.0};
    take(1.0, 1.0, 950);
    prepare("p", 60.0, 1.0);
    TEST_ASSERT_TRUE(tune_fit_linear(&problem, plant.response, exact));
    double complex *truth = malloc(plant.count * sizeof *truth);
    memcpy(truth, plant.response, plant.count * sizeof *truth);
    random_seed(&random, 9);
    for (int draw = 0; draw < draws; draw++) {
        const double std = 0.05;
        for (size_t k = 0; k < plant.count; k++) {
            const double real = std * sqrt(0.5) * random_normal(&random),
                         imag = std * sqrt(0.5) * random_normal(&random);
            plant.response[k] = truth[k] + real + imag * I;
        }
        for (int known = 0; known < 2; known++) {
            double gain[1];
            for (size_t k = 0; k < plant.count; k++)
                problem.variance[k] = known ? std * std : 0.0;
            TEST_ASSERT_TRUE(tune_fit_linear(&problem, plant.response, gain));
            mean[known] += gain[0] / exact[0] / draws;
            square[known] += gain[0] * gain[0] / exact[0] / exact[0] / draws;
        }
    }
    free(truth);
    const double error_of_mean = sqrt((square[1] - mean[1] * mean[1]) / draws);
    TEST_ASSERT_DOUBLE_WITHIN(4.0 * error_of_mean, 1.0, mean[1]);
    TEST_ASSERT_TRUE(mean[0] < 1.0 - 8.0 * error_of_mean);
}

static void test_tune_fit_refuses_terms_that_cannot_be_told_apart(void)
{
    double gain[2] = {0.0};
    take(1.0, 1.0, 100);
    prepare("pi", 30.0, 1.0);
    for (size_t k = 0; k < problem.lines; k++)
        problem.term[problem.lines + k] = 3.0 * problem.term[k];
    TEST_ASSERT_FALSE(tune_fit_linear(&problem, plant.response, gain));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_tune_fit_is_the_minimum_over_gains_that_are_not_negative);
    RUN_TEST(test_tune_fit_does_not_depend_on_how_lines_are_spaced);
    RUN_TEST(test_tune_fit_cost_of_no_controller_is_the_reference_itself);
    RUN_TEST(test_tune_fit_takes_out_what_noise_adds);
    RUN_TEST(test_tune_fit_refuses_terms_that_cannot_be_told_apart);
    return UNITY_END();
}
