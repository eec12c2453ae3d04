/* SPDX-License-Identifier: MIT */
#include "lab/estimate/frf_mean.h"

#include "lab/estimate/circle.h"
#include "lab/numeric/statistics.h"

#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;

/// Reference: 20000 runs, M = 10; the empirical variance alone scatters by 0.7 %, so that 3 % is more than four sigma.
enum { lines = 200, repeats = 100, periods = 10 };
static const double ratio_tolerance = 0.03;
/// 20000 trials at 95 % scatter by 0.15 %.
static const double coverage_tolerance = 0.005;

void setUp(void) {}

void tearDown(void) {}

/// A recording given by its spectra alone, as periodic_cut would hand it on.
struct made_recording {
    struct run run;
    struct periodic periodic;
    uint32_t bins[lines];
    double complex input[periods * lines];
    double complex output[periods * lines];
};

static struct made_recording *make_recording(void)
{
    struct made_recording *self = calloc(1, sizeof *self);
    static char path[] = "made";
    self->run = (struct run){.path = path, .sample_rate_hz = 1000.0, .period_samples = 1000};
    self->periodic = (struct periodic){.run = &self->run,
                                       .input = "torque_Nm",
                                       .output = "velocity_rad_per_s",
                                       .period_samples = 1000,
                                       .bin_count = lines,
                                       .bins = self->bins,
                                       .total = periods,
                                       .used = periods,
                                       .input_spectra = self->input,
                                       .output_spectra = self->output};
    for (uint32_t b = 0; b < lines; b++) {
        self->bins[b] = b + 1;
    }
    return self;
}

static double complex circular(struct random *random)
{
    double real = random_normal(random);
    double imaginary = random_normal(random);
    return (real + imaginary * I) * sqrt(0.5);
}

/// Noise of input and output with unit variance each and correlation E(n_y conj(n_u)) = rho.
static void fill(struct made_recording *self, double complex input, double complex output, double noise,
                 double complex rho, struct random *random)
{
    double rest = sqrt(1.0 - creal(rho * conj(rho)));
    for (size_t i = 0; i < periods * lines; i++) {
        double complex input_noise = circular(random);
        double complex output_noise = rho * input_noise + rest * circular(random);
        self->input[i] = input + noise * input_noise;
        self->output[i] = output + noise * output_noise;
    }
}

struct tally {
    double predicted;
    double empirical;
    double covered;
};

static struct tally monte_carlo(double complex input, double complex output, double complex rho, uint64_t seed)
{
    struct made_recording *recording = make_recording();
    struct random random;
    random_seed(&random, seed);
    struct tally tally = {0};
    double factor = circle_confidence_factor(0.95, periods - 1);
    for (int r = 0; r < repeats; r++) {
        struct frf frf;
        struct error error;
        /* 40 dB: the quotient's curvature stays below a tenth of a per cent of the variance. */
        fill(recording, input, output, 0.01, rho, &random);
        TEST_ASSERT_EQUAL_INT(0, frf_mean_estimate(&recording->periodic, NULL, &frf, &error));
        for (size_t line = 0; line < lines; line++) {
            double deviation = cabs(frf.real[line] + frf.imag[line] * I - output / input);
            TEST_ASSERT_TRUE(frf.valid[line]);
            tally.predicted += frf.std[line] * frf.std[line] / (lines * repeats);
            tally.empirical += deviation * deviation / (lines * repeats);
            tally.covered += (deviation <= factor * frf.std[line]) / (double)(lines * repeats);
        }
        frf_free(&frf);
    }
    free(recording);
    return tally;
}

static void check_case(double complex input, double complex output, double complex rho, uint64_t seed)
{
    struct tally tally = monte_carlo(input, output, rho, seed);
    double ratio = tally.predicted / tally.empirical;
    printf("seed %u: predicted/empirical variance %.3f, coverage of the 95 %% circle %.2f %%\n", (unsigned)seed, ratio,
           100.0 * tally.covered);
    TEST_ASSERT_DOUBLE_WITHIN(ratio_tolerance, 1.0, ratio);
    TEST_ASSERT_DOUBLE_WITHIN(coverage_tolerance, 0.95, tally.covered);
}

static void test_frf_mean_std_is_right_with_independent_noise(void)
{
    check_case(1.0, 1.0, 0.0, 11);
}

static void test_frf_mean_std_is_right_with_correlated_noise(void)
{
    check_case(1.0, 1.0, 0.9 * cexp(1.2 * I), 12);
}

/// The first paper's formula without the conjugate is off by 1.9 and by 0.15 here.
static void test_frf_mean_std_is_right_whatever_the_phases(void)
{
    check_case(cexp(2.5 * I), cexp(1.0 * I), 0.9, 13);
    check_case(cexp(1.5 * I), cexp(1.5 * I), -0.8, 14);
}

static void test_frf_mean_marks_line_without_power(void)
{
    struct made_recording *recording = make_recording();
    struct random random;
    random_seed(&random, 21);
    fill(recording, 1.0, 0.5, 0.01, 0.0, &random);
    for (size_t p = 0; p < periods; p++) {
        recording->input[p * lines + 7] = 0.01 * circular(&random);
    }
    struct frf frf;
    struct error error;
    TEST_ASSERT_EQUAL_INT(0, frf_mean_estimate(&recording->periodic, NULL, &frf, &error));
    for (size_t line = 0; line < lines; line++) {
        TEST_ASSERT_EQUAL_INT(line != 7, frf.valid[line]);
    }
    TEST_ASSERT_FALSE(frf_known(frf.std[7]));
    frf_free(&frf);
    free(recording);
}

static void test_frf_mean_refuses_input_without_any_power(void)
{
    struct made_recording *recording = make_recording();
    struct frf frf;
    struct error error;
    TEST_ASSERT_EQUAL_INT(error_refused, frf_mean_estimate(&recording->periodic, NULL, &frf, &error));
    TEST_ASSERT_NOT_NULL(strstr(error.message, "no power"));
    free(recording);
}

/// A closed loop in time: u = r - K y_measured, y = G u + disturbance, G = b/(1 - a/q), a multisine as the reference.
enum { loop_length = 200, loop_lines = 30, loop_settle = 2, loop_runs = 400 };

static void simulate_loop(struct run *run, const double *reference, struct random *random)
{
    double *torque = run->columns[0].data;
    double *velocity = run->columns[1].data;
    double state = 0.0;
    double disturbance = 0.0;
    for (size_t n = 0; n < run->rows; n++) {
        disturbance = 0.8 * disturbance + 0.02 * random_normal(random);
        double measured = state + disturbance + 0.01 * random_normal(random);
        double input = reference[n % loop_length] - 0.5 * measured;
        torque[n] = input + 0.01 * random_normal(random);
        velocity[n] = measured;
        state = 0.9 * state + 0.3 * input;
    }
}

static double complex loop_truth(uint32_t bin)
{
    double complex delay = cexp(-I * two_pi * (double)bin / loop_length);
    return 0.3 * delay / (1.0 - 0.9 * delay);
}

static void prepare_loop(struct run *run, double *reference)
{
    static char path[] = "loop";
    struct random random;
    random_seed(&random, 99);
    *run = (struct run){.path = path,
                        .sample_rate_hz = 1000.0,
                        .rows = loop_length * (loop_settle + periods),
                        .period_samples = loop_length,
                        .periods = periods,
                        .settle_periods = loop_settle,
                        .has_settle_periods = true,
                        .bin_count = loop_lines};
    run->bins = malloc(loop_lines * sizeof *run->bins);
    for (uint32_t b = 0; b < loop_lines; b++) {
        run->bins[b] = 1 + 3 * b;
        double phase = two_pi * random_uniform(&random);
        for (size_t n = 0; n < loop_length; n++) {
            reference[n] += cos(two_pi * run->bins[b] * (double)n / loop_length + phase);
        }
    }
    TEST_ASSERT_NOT_NULL(run_add_column(run, "torque_Nm"));
    TEST_ASSERT_NOT_NULL(run_add_column(run, "velocity_rad_per_s"));
}

static void free_made_run(struct run *run)
{
    run->path = NULL;
    run_free(run);
}

static void test_frf_mean_std_is_right_in_closed_loop(void)
{
    struct run run;
    double reference[loop_length] = {0};
    prepare_loop(&run, reference);
    struct random random;
    random_seed(&random, 5);
    double predicted[loop_lines] = {0};
    double empirical[loop_lines] = {0};
    double covered = 0.0;
    double factor = circle_confidence_factor(0.95, periods - 1);
    for (int r = 0; r < loop_runs; r++) {
        struct periodic recording;
        struct frf frf;
        struct error error;
        simulate_loop(&run, reference, &random);
        TEST_ASSERT_EQUAL_INT(0, periodic_cut(&run, &(struct periodic_options){0}, &recording, &error));
        TEST_ASSERT_EQUAL_size_t(loop_settle, recording.settle);
        TEST_ASSERT_EQUAL_INT(0, frf_mean_estimate(&recording, NULL, &frf, &error));
        for (size_t b = 0; b < loop_lines; b++) {
            double deviation = cabs(frf.real[b] + frf.imag[b] * I - loop_truth(run.bins[b]));
            predicted[b] += frf.std[b] * frf.std[b];
            empirical[b] += deviation * deviation;
            covered += (deviation <= factor * frf.std[b]) / (double)(loop_runs * loop_lines);
        }
        frf_free(&frf);
        periodic_free(&recording);
    }
    double mean_ratio = 0.0;
    for (size_t b = 0; b < loop_lines; b++) {
        double ratio = predicted[b] / empirical[b];
        mean_ratio += ratio / loop_lines;
        /* One line's empirical variance scatters by 5 % with 400 runs: four and a half sigma. */
        TEST_ASSERT_DOUBLE_WITHIN(0.23, 1.0, ratio);
    }
    printf("closed loop: predicted/empirical variance %.3f, coverage %.2f %%\n", mean_ratio, 100.0 * covered);
    /* 12000 values: 1 %, and the disturbance's own period-to-period correlation. */
    TEST_ASSERT_DOUBLE_WITHIN(0.04, 1.0, mean_ratio);
    TEST_ASSERT_DOUBLE_WITHIN(0.008, 0.95, covered);
    free_made_run(&run);
}

static void test_frf_mean_leaves_out_periods_with_lost_samples(void)
{
    struct run run;
    double reference[loop_length] = {0};
    prepare_loop(&run, reference);
    struct random random;
    random_seed(&random, 6);
    simulate_loop(&run, reference, &random);
    double *valid = run_add_column(&run, "valid");
    for (size_t n = 0; n < run.rows; n++) {
        valid[n] = 1.0;
    }
    /* Periods 5 and 8 lose a sample and read nonsense there; so does a settling one, which does not count anyway. */
    const size_t lost_rows[] = {20, 5 * loop_length + 17, 8 * loop_length + 199};
    for (size_t i = 0; i < 3; i++) {
        valid[lost_rows[i]] = 0.0;
        run.columns[1].data[lost_rows[i]] = 1e6;
    }
    struct periodic recording;
    struct frf frf;
    struct error error;
    TEST_ASSERT_EQUAL_INT(0, periodic_cut(&run, &(struct periodic_options){0}, &recording, &error));
    TEST_ASSERT_EQUAL_size_t(2, recording.lost);
    TEST_ASSERT_EQUAL_size_t(periods - 2, recording.used);
    TEST_ASSERT_EQUAL_size_t(5 * loop_length + 17 + 1, recording.first_lost_row);
    TEST_ASSERT_EQUAL_INT(0, frf_mean_estimate(&recording, NULL, &frf, &error));
    for (size_t b = 0; b < loop_lines; b++) {
        /* Ten standard deviations: one nonsense sample in a period that counts would be off by thousands. */
        TEST_ASSERT_TRUE(cabs(frf.real[b] + frf.imag[b] * I - loop_truth(run.bins[b])) < 10.0 * frf.std[b]);
    }
    frf_free(&frf);
    periodic_free(&recording);
    free_made_run(&run);
}

static void test_frf_mean_takes_drift_out_of_a_position(void)
{
    struct run run;
    double reference[loop_length] = {0};
    prepare_loop(&run, reference);
    free(run.columns[1].name);
    run.columns[1].name = strdup("position_rad");
    for (size_t n = 0; n < run.rows; n++) {
        run.columns[0].data[n] = reference[n % loop_length];
        run.columns[1].data[n] = 2.0 * reference[n % loop_length] + 0.37 * (double)n - 11.0;
    }
    struct periodic recording;
    struct frf frf;
    struct error error;
    TEST_ASSERT_EQUAL_INT(0, periodic_cut(&run, &(struct periodic_options){0}, &recording, &error));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.37, recording.trend_per_sample);
    TEST_ASSERT_EQUAL_INT(0, frf_mean_estimate(&recording, NULL, &frf, &error));
    for (size_t b = 0; b < loop_lines; b++) {
        /* Rounding of a ramp of 800 against a response of 200. */
        TEST_ASSERT_DOUBLE_WITHIN(1e-10, 2.0, frf.real[b]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-10, 0.0, frf.imag[b]);
    }
    frf_free(&frf);
    periodic_free(&recording);
    free_made_run(&run);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_frf_mean_std_is_right_with_independent_noise);
    RUN_TEST(test_frf_mean_std_is_right_with_correlated_noise);
    RUN_TEST(test_frf_mean_std_is_right_whatever_the_phases);
    RUN_TEST(test_frf_mean_marks_line_without_power);
    RUN_TEST(test_frf_mean_refuses_input_without_any_power);
    RUN_TEST(test_frf_mean_std_is_right_in_closed_loop);
    RUN_TEST(test_frf_mean_leaves_out_periods_with_lost_samples);
    RUN_TEST(test_frf_mean_takes_drift_out_of_a_position);
    return UNITY_END();
}
