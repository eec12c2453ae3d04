/* SPDX-License-Identifier: MIT */
#include "lab/estimate/frf_hann.h"
#include "lab/estimate/frf_mean.h"

#include "lab/estimate/circle.h"
#include "lab/numeric/statistics.h"

#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;

enum { length = 100, lines = 24, periods = 8, rows = length * periods, runs = 500 };

void setUp(void) {}

void tearDown(void) {}

static void prepare(struct run *run)
{
    static char path[] = "made";
    *run = (struct run){.path = path,
                        .sample_rate_hz = 1000.0,
                        .rows = rows,
                        .period_samples = length,
                        .periods = periods,
                        .settle_periods = 0,
                        .has_settle_periods = true,
                        .bin_count = lines};
    run->bins = malloc(lines * sizeof *run->bins);
    for (uint32_t b = 0; b < lines; b++) {
        run->bins[b] = 1 + 2 * b;
    }
    TEST_ASSERT_NOT_NULL(run_add_column(run, "torque_Nm"));
    TEST_ASSERT_NOT_NULL(run_add_column(run, "velocity_rad_per_s"));
}

/// y = G u, G = 0.2 / (1 - a/q), from rest: the start transient falls as a^n. White noise on the output.
static void simulate(struct run *run, double pole, double noise, struct random *random)
{
    double state = 0.0;
    double *torque = run->columns[0].data;
    double *velocity = run->columns[1].data;
    for (size_t n = 0; n < rows; n++) {
        torque[n] = 0.0;
        for (size_t b = 0; b < lines; b++) {
            double k = (double)run->bins[b];
            torque[n] += cos(two_pi * k * (double)(n % length) / length + 0.13 * k * k);
        }
        state = pole * state + 0.2 * torque[n];
        velocity[n] = state + noise * random_normal(random);
    }
}

static double complex truth(double pole, uint32_t bin)
{
    return 0.2 / (1.0 - pole * cexp(-I * two_pi * (double)bin / length));
}

static void release(struct run *run)
{
    run->path = NULL;
    run_free(run);
}

typedef int estimator(const struct periodic *, const struct estimate_options *, struct frf *, struct error *);

static double error_of(const struct run *run, estimator *estimate, double pole)
{
    struct periodic recording;
    struct frf frf;
    struct error error;
    double sum = 0.0;
    TEST_ASSERT_EQUAL_INT(0, periodic_cut(run, &(struct periodic_options){0}, &recording, &error));
    TEST_ASSERT_EQUAL_INT(0, estimate(&recording, NULL, &frf, &error));
    for (size_t b = 0; b < lines; b++) {
        double complex deviation = frf.real[b] + frf.imag[b] * I - truth(pole, run->bins[b]);
        sum += creal(deviation * conj(deviation)) / lines;
    }
    frf_free(&frf);
    periodic_free(&recording);
    return sqrt(sum);
}

static void test_frf_hann_is_exact_in_steady_state(void)
{
    struct run run;
    struct random random;
    random_seed(&random, 1);
    prepare(&run);
    simulate(&run, 0.0, 0.0, &random);
    /* Rounding only: sums of 800 terms of size 1. */
    TEST_ASSERT_TRUE(error_of(&run, frf_hann_estimate, 0.0) < 1e-13);
    release(&run);
}

static void test_frf_hann_suppresses_a_slow_transient(void)
{
    struct run run;
    struct random random;
    random_seed(&random, 1);
    prepare(&run);
    /* Dies by 1/e in 200 samples: two periods. */
    simulate(&run, 0.995, 0.0, &random);
    double hann = error_of(&run, frf_hann_estimate, 0.995);
    double mean = error_of(&run, frf_mean_estimate, 0.995);
    printf("slow transient: rms error mean %.3g, hann %.3g\n", mean, hann);
    TEST_ASSERT_TRUE(hann < 0.2 * mean);
    release(&run);
}

static void test_frf_hann_std_and_noise_penalty_are_right(void)
{
    struct run run;
    struct random random;
    random_seed(&random, 2);
    prepare(&run);
    double predicted = 0.0;
    double hann = 0.0;
    double mean = 0.0;
    double covered = 0.0;
    for (int r = 0; r < runs; r++) {
        struct periodic recording;
        struct frf frf;
        struct error error;
        simulate(&run, 0.0, 0.1, &random);
        mean += pow(error_of(&run, frf_mean_estimate, 0.0), 2.0) / runs;
        TEST_ASSERT_EQUAL_INT(0, periodic_cut(&run, &(struct periodic_options){0}, &recording, &error));
        TEST_ASSERT_EQUAL_INT(0, frf_hann_estimate(&recording, NULL, &frf, &error));
        double factor = circle_confidence_factor(0.95, frf.degrees_of_freedom / 2.0);
        for (size_t b = 0; b < lines; b++) {
            double deviation = cabs(frf.real[b] + frf.imag[b] * I - truth(0.0, run.bins[b]));
            predicted += frf.std[b] * frf.std[b] / (runs * lines);
            hann += deviation * deviation / (runs * lines);
            covered += (deviation <= factor * frf.std[b]) / (double)(runs * lines);
        }
        frf_free(&frf);
        periodic_free(&recording);
    }
    double penalty_db = 10.0 * log10(hann / mean);
    printf("hann: predicted/empirical variance %.3f, coverage %.2f %%, noise penalty %.3f dB\n", predicted / hann,
           100.0 * covered, penalty_db);
    /* 12000 values scatter by 1 %. */
    TEST_ASSERT_DOUBLE_WITHIN(0.04, 1.0, predicted / hann);
    /* Theory 10 log10(1.5) = 1.761 dB. */
    TEST_ASSERT_DOUBLE_WITHIN(0.2, 1.761, penalty_db);
    /* The degrees of freedom of correlated neighbours are Satterthwaite's approximation: a point and a half. */
    TEST_ASSERT_DOUBLE_WITHIN(0.015, 0.95, covered);
    release(&run);
}

static void test_frf_hann_refuses_fewer_than_four_periods_in_a_row(void)
{
    struct run run;
    struct random random;
    struct periodic recording;
    struct frf frf;
    struct error error;
    random_seed(&random, 3);
    prepare(&run);
    simulate(&run, 0.0, 0.1, &random);
    double *valid = run_add_column(&run, "valid");
    for (size_t n = 0; n < rows; n++) {
        valid[n] = n != 3 * length + 5 && n != 6 * length + 5;
    }
    TEST_ASSERT_EQUAL_INT(0, periodic_cut(&run, &(struct periodic_options){0}, &recording, &error));
    TEST_ASSERT_EQUAL_INT(error_refused, frf_hann_estimate(&recording, NULL, &frf, &error));
    TEST_ASSERT_NOT_NULL(strstr(error.message, "longest stretch without a gap has 3 periods"));
    periodic_free(&recording);
    release(&run);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_frf_hann_is_exact_in_steady_state);
    RUN_TEST(test_frf_hann_suppresses_a_slow_transient);
    RUN_TEST(test_frf_hann_std_and_noise_penalty_are_right);
    RUN_TEST(test_frf_hann_refuses_fewer_than_four_periods_in_a_row);
    return UNITY_END();
}
