/* SPDX-License-Identifier: MIT */
#include "lab/estimate/frf_lpm_arbitrary.h"

#include "lab/estimate/circle.h"
#include "lab/estimate/complex_fit.h"
#include "lab/estimate/method.h"
#include "lab/numeric/statistics.h"

#include "unity.h"

#include <complex.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;

enum { rows = 1500, runs = 150 };

static struct run run;

void setUp(void)
{
    static char path[] = "made";
    run = (struct run){.path = path, .sample_rate_hz = 1000.0, .rows = rows};
}

void tearDown(void)
{
    run.path = NULL;
    run_free(&run);
}

static void add_columns(bool with_reference)
{
    TEST_ASSERT_NOT_NULL(run_add_column(&run, "torque_Nm"));
    TEST_ASSERT_NOT_NULL(run_add_column(&run, "velocity_rad_per_s"));
    TEST_ASSERT_TRUE(!with_reference || run_add_column(&run, "velocity_ref_rad_per_s"));
}

/// u = r - gain y, y = G u + v, G = .3 q / (1 - .8 q), r white, from rest.
static void simulate(double gain, double noise, struct random *random)
{
    double state = 0.0;
    for (size_t n = 0; n < rows; n++) {
        double reference = random_normal(random);
        double output = state + noise * random_normal(random);
        double input = reference - gain * output;
        run.columns[0].data[n] = input;
        run.columns[1].data[n] = output;
        if (run.column_count > 2) {
            run.columns[2].data[n] = reference;
        }
        state = 0.8 * state + 0.3 * input;
    }
}

static double complex truth(double frequency_hz)
{
    double complex q = cexp(-I * two_pi * frequency_hz / 1000.0);
    return 0.3 * q / (1.0 - 0.8 * q);
}

static void estimate(const struct estimate_options *options, struct frf *out_frf)
{
    struct arbitrary recording;
    struct error error = {0};
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, arbitrary_cut(&run, &(struct arbitrary_options){0}, &recording, &error),
                                  error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, frf_lpm_estimate_arbitrary(&recording, options, out_frf, &error), error.message);
}

/// The ends of the record are a transient too: without its polynomial the error would be tens of per cent.
static void test_lpm_arbitrary_is_nearly_exact_without_noise(void)
{
    struct random random;
    struct frf frf;
    random_seed(&random, 1);
    add_columns(false);
    simulate(0.0, 0.0, &random);
    estimate(NULL, &frf);
    TEST_ASSERT_GREATER_THAN_size_t(90, frf.count);
    double worst = 0.0;
    for (size_t k = 0; k < frf.count; k++) {
        double complex exact = truth(frf.frequency_hz[k]);
        worst = fmax(worst, cabs(frf.real[k] + frf.imag[k] * I - exact) / cabs(exact));
    }
    printf("noise-free: worst relative error %.3g on %zu lines\n", worst, frf.count);
    /* What a parabola over 15 lines (10 Hz) leaves of a response with a bandwidth of 35 Hz. */
    TEST_ASSERT_TRUE(worst < 1e-3);
    TEST_ASSERT_NOT_NULL(strstr(estimate_key(&frf, "warning"), "biased if a loop is closed"));
    frf_free(&frf);
}

static void check_honesty(const char *name, double gain, uint64_t seed)
{
    struct random random;
    double predicted = 0.0;
    double empirical = 0.0;
    double covered = 0.0;
    double count = 0.0;
    random_seed(&random, seed);
    for (int r = 0; r < runs; r++) {
        struct frf frf;
        simulate(gain, 0.2, &random);
        estimate(NULL, &frf);
        double factor = circle_confidence_factor(0.95, frf.degrees_of_freedom / 2.0);
        for (size_t k = 0; k < frf.count; k++) {
            double complex exact = truth(frf.frequency_hz[k]);
            double error = cabs(frf.real[k] + frf.imag[k] * I - exact);
            predicted += pow(frf.std[k] / cabs(exact), 2.0);
            empirical += pow(error / cabs(exact), 2.0);
            covered += error <= factor * frf.std[k];
            count += 1.0;
        }
        frf_free(&frf);
    }
    printf("%s, seed %u: predicted/empirical variance %.3f, coverage %.2f %% of %.0f\n", name, (unsigned)seed,
           predicted / empirical, 100.0 * covered / count, count);
    /* The regressor's few strong lines decide: heavy tails, so that 15000 values scatter by 2 %. */
    TEST_ASSERT_DOUBLE_WITHIN(0.08, 1.0, predicted / empirical);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 0.95, covered / count);
}

static void test_lpm_arbitrary_std_is_right_with_output_noise(void)
{
    add_columns(false);
    check_honesty("output error", 0.0, 2);
}

static void test_lpm_arbitrary_std_is_right_through_the_reference_in_closed_loop(void)
{
    add_columns(true);
    check_honesty("closed loop", 0.6, 3);
}

static void test_lpm_arbitrary_says_which_reference_it_used(void)
{
    struct random random;
    struct frf frf;
    random_seed(&random, 4);
    add_columns(true);
    simulate(0.6, 0.2, &random);
    estimate(&(struct estimate_options){.order = 4, .half_width = 12, .segment_samples = 50}, &frf);
    TEST_ASSERT_EQUAL_STRING("velocity_ref_rad_per_s", estimate_key(&frf, "reference"));
    TEST_ASSERT_EQUAL_STRING("", estimate_key(&frf, "warning"));
    TEST_ASSERT_EQUAL_STRING("4", estimate_key(&frf, "lpm_order"));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 20.0, frf.frequency_hz[0]);
    TEST_ASSERT_EQUAL_DOUBLE(2.0 * (25 - 10), frf.degrees_of_freedom);
    frf_free(&frf);
}

/// An impulse has a smooth spectrum: no line can tell the response from the transient.
static void test_lpm_arbitrary_refuses_an_input_without_rank(void)
{
    struct random random;
    struct arbitrary recording;
    struct frf frf;
    struct error error = {0};
    random_seed(&random, 5);
    add_columns(false);
    simulate(0.0, 0.1, &random);
    for (size_t n = 0; n < rows; n++) {
        run.columns[0].data[n] = n == 0;
    }
    TEST_ASSERT_EQUAL_INT(0, arbitrary_cut(&run, &(struct arbitrary_options){0}, &recording, &error));
    TEST_ASSERT_EQUAL_INT(error_refused, frf_lpm_estimate_arbitrary(&recording, NULL, &frf, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "no line of torque_Nm has enough power of its own"),
                                 error.message);
}

static void test_complex_fit_gives_the_last_unknown_and_the_residual(void)
{
    enum { n = 6 };
    const double complex wanted = 2.0 - 3.0 * I;
    double complex K[2 * n];
    double complex values[n];
    double lengths[2];
    for (int i = 0; i < n; i++) {
        K[i] = 1.0 + 0.1 * i * I;
        K[n + i] = cexp(I * i * i);
        values[i] = (0.5 + I) * K[i] + wanted * K[n + i];
    }
    TEST_ASSERT_TRUE(complex_fit_orthonormalise(n, 2, K, lengths));
    double complex last = complex_fit_last(n, 2, K, lengths[1], values);
    TEST_ASSERT_TRUE(cabs(last - wanted) < 1e-14);
    for (int i = 0; i < n; i++) {
        TEST_ASSERT_TRUE(cabs(values[i]) < 1e-14);
    }
    for (int i = 0; i < n; i++) {
        K[i] = 1.0;
        K[n + i] = -2.5 * I;
    }
    TEST_ASSERT_FALSE(complex_fit_orthonormalise(n, 2, K, lengths));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_lpm_arbitrary_is_nearly_exact_without_noise);
    RUN_TEST(test_lpm_arbitrary_std_is_right_with_output_noise);
    RUN_TEST(test_lpm_arbitrary_std_is_right_through_the_reference_in_closed_loop);
    RUN_TEST(test_lpm_arbitrary_says_which_reference_it_used);
    RUN_TEST(test_lpm_arbitrary_refuses_an_input_without_rank);
    RUN_TEST(test_complex_fit_gives_the_last_unknown_and_the_residual);
    return UNITY_END();
}
