/* SPDX-License-Identifier: MIT */
/* Mean, variance, covariance and the response's standard deviation: against sums by definition, and against many noisy
 * experiments of which the truth is known. */
#include "frf/statistics.h"

#include "unity.h"

#include <complex.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

enum { runs = 20000, periods_per_run = 10, bins = 3 };

/* F(2, 18) at 95 %: for M = 10 periods |dG|^2 / std^2 exceeds it once in twenty. */
static const double f_quantile = 3.555;

/* Required; 20000 runs scatter by 0.15 % of coverage and 0.8 % of variance (one sigma), the seed is fixed. */
static const double ratio_tolerance = 0.03;
static const double coverage_tolerance = 0.005;

/* Two ways of summing tens of doubles of size 1 to 1e3. */
static const double rounding = 1e-9;

static struct frf_statistics statistics;
static struct frf_pair pairs[bins];
static uint64_t random_state;

static double random_uniform(void)
{
    random_state = random_state * 6364136223846793005u + 1442695040888963407u;
    return ((double)(random_state >> 11) + 0.5) / 9007199254740992.0;
}

/* Circular complex Gaussian with E |z|^2 = 1. */
static double complex random_gaussian(void)
{
    double radius = sqrt(-log(random_uniform()));
    return radius * cexp(I * 6.28318530717958647692 * random_uniform());
}

static struct frf_complex from(double complex value)
{
    struct frf_complex result = {(core_real)creal(value), (core_real)cimag(value)};
    return result;
}

void setUp(void)
{
    random_state = 20;
    TEST_ASSERT_EQUAL_INT(core_ok, frf_statistics_init(&statistics, pairs, bins));
}

void tearDown(void) {}

static void add_same(double complex input, double complex output)
{
    struct frf_complex inputs[bins], outputs[bins];
    for (unsigned b = 0; b < bins; b++) {
        inputs[b] = from(input);
        outputs[b] = from(output);
    }
    TEST_ASSERT_TRUE(frf_statistics_add(&statistics, inputs, outputs));
}

/* By definition, two passes, with the formula as it is printed (errata applied) rather than as it is evaluated. */
static double std_by_definition(const double complex *u, const double complex *y, unsigned count, double complex *out_g)
{
    double complex mean_u = 0, mean_y = 0, s_yu = 0;
    double s_uu = 0, s_yy = 0;
    for (unsigned m = 0; m < count; m++) {
        mean_u += u[m] / count;
        mean_y += y[m] / count;
    }
    for (unsigned m = 0; m < count; m++) {
        s_uu += pow(cabs(u[m] - mean_u), 2) / (count - 1);
        s_yy += pow(cabs(y[m] - mean_y), 2) / (count - 1);
        s_yu += (y[m] - mean_y) * conj(u[m] - mean_u) / (count - 1);
    }
    double complex g = mean_y / mean_u;
    double bracket =
        s_yy / pow(cabs(mean_y), 2) + s_uu / pow(cabs(mean_u), 2) - 2 * creal(s_yu / (mean_y * conj(mean_u)));
    *out_g = g;
    return cabs(g) * sqrt(bracket / count);
}

static void test_statistics_equal_their_definition(void)
{
    double complex u[50], y[50], g;
    for (unsigned m = 0; m < 50; m++) {
        double complex common = random_gaussian();
        u[m] = 100 * cexp(0.7 * I) + 3 * random_gaussian() + 2 * common;
        y[m] = 40 * cexp(-1.9 * I) + random_gaussian() + common * cexp(1.2 * I);
        add_same(u[m], y[m]);
        if (m == 0)
            continue;
        struct frf_estimate estimate;
        frf_statistics_estimate(&statistics, 1, 0, &estimate);
        double std = std_by_definition(u, y, m + 1, &g);
        TEST_ASSERT_EQUAL_INT(frf_valid, estimate.validity);
        TEST_ASSERT_DOUBLE_WITHIN(rounding, creal(g), estimate.real);
        TEST_ASSERT_DOUBLE_WITHIN(rounding, cimag(g), estimate.imaginary);
        TEST_ASSERT_DOUBLE_WITHIN(rounding, std, estimate.std);
    }
    TEST_ASSERT_EQUAL_UINT32(50, statistics.periods);
    TEST_ASSERT_EQUAL_UINT32(SERVOSCOPE_REAL_BITS, statistics.real_bits);
}

/* A mean 1e8 times the scatter leaves single sums of squares without a digit; Welford keeps half of them. */
static void test_statistics_keep_the_scatter_beside_a_large_mean(void)
{
    double complex u[20], y[20], g;
    for (unsigned m = 0; m < 20; m++) {
        u[m] = 1e8 + random_gaussian();
        y[m] = 1e8 + random_gaussian();
        add_same(u[m], y[m]);
    }
    struct frf_estimate estimate;
    frf_statistics_estimate(&statistics, 0, 0, &estimate);
    double std = std_by_definition(u, y, 20, &g);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6 * std, std, estimate.std);
}

struct noise_case {
    const char *name;
    double correlation, correlation_phase; /* of the output's noise with the input's */
    double phase_y, phase_u;
};

/* One experiment after the other with input and output noise of 3 % each; sums up predicted and true errors. */
static void run_case(const struct noise_case *noise, double *out_ratio, double *out_coverage, double *out_std_ratio)
{
    const double sigma = 0.03;
    double predicted = 0, actual = 0, std_sum = 0;
    unsigned covered = 0;
    double complex u0 = cexp(I * noise->phase_u), y0 = 2 * cexp(I * noise->phase_y);
    for (unsigned run = 0; run < runs; run++) {
        TEST_ASSERT_EQUAL_INT(core_ok, frf_statistics_init(&statistics, pairs, bins));
        for (unsigned m = 0; m < periods_per_run; m++) {
            double complex nu = random_gaussian();
            double complex ny = noise->correlation * cexp(I * noise->correlation_phase) * nu +
                                sqrt(1 - noise->correlation * noise->correlation) * random_gaussian();
            add_same(u0 + sigma * nu, y0 + 2 * sigma * ny);
        }
        struct frf_estimate estimate;
        frf_statistics_estimate(&statistics, 2, 0, &estimate);
        double error = cabs(estimate.real + I * estimate.imaginary - y0 / u0);
        predicted += (double)estimate.std * (double)estimate.std;
        std_sum += (double)estimate.std;
        actual += error * error;
        covered += error * error <= f_quantile * (double)estimate.std * (double)estimate.std;
    }
    *out_ratio = sqrt(predicted / actual);
    *out_std_ratio = std_sum / runs / sqrt(actual / runs);
    *out_coverage = (double)covered / runs;
}

static void test_statistics_std_is_what_experiments_scatter(void)
{
    static const struct noise_case cases[] = {
        {"no correlation", 0, 0, 0.4, -0.3},
        {"0.9 at 1.2 rad", 0.9, 1.2, 0, 0},
        {"0.9, phases 1.0, 2.5", 0.9, 0, 1.0, 2.5},
        {"-0.8, phases 1.5, 1.5", -0.8, 0, 1.5, 1.5},
    };
    for (unsigned c = 0; c < sizeof cases / sizeof cases[0]; c++) {
        double ratio, coverage, std_ratio;
        run_case(&cases[c], &ratio, &coverage, &std_ratio);
        printf("std, %d runs, M = %d, %-22s rms predicted / true %.4f, mean(std) / true %.4f, coverage %.2f %%\n", runs,
               periods_per_run, cases[c].name, ratio, std_ratio, 100 * coverage);
        TEST_ASSERT_DOUBLE_WITHIN(ratio_tolerance, 1, ratio);
        TEST_ASSERT_DOUBLE_WITHIN(coverage_tolerance, 0.95, coverage);
    }
}

static void expect_no_scatter(const struct frf_estimate *estimate)
{
    TEST_ASSERT_TRUE(estimate->std == 0 && estimate->input_variance == 0 && estimate->output_variance == 0);
    TEST_ASSERT_TRUE(estimate->covariance.real == 0 && estimate->covariance.imaginary == 0);
}

static void test_estimate_says_why_it_is_invalid(void)
{
    struct frf_estimate estimate;
    frf_statistics_estimate(&statistics, 0, 0, &estimate);
    TEST_ASSERT_EQUAL_INT(frf_invalid_input, estimate.validity);
    TEST_ASSERT_TRUE(estimate.real == 0 && estimate.imaginary == 0);
    expect_no_scatter(&estimate);
    add_same(2 + I, 4 + 2 * I);
    frf_statistics_estimate(&statistics, 0, 0, &estimate);
    TEST_ASSERT_EQUAL_INT(frf_invalid_periods, estimate.validity);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 2, estimate.real);
    expect_no_scatter(&estimate);
    add_same(2 + I, 4 + 2 * I);
    frf_statistics_estimate(&statistics, 0, 0, &estimate);
    TEST_ASSERT_EQUAL_INT(frf_valid, estimate.validity);
    TEST_ASSERT_TRUE(estimate.std == 0);
    frf_statistics_estimate(&statistics, 0, (core_real)2.236, &estimate);
    TEST_ASSERT_EQUAL_INT(frf_valid, estimate.validity);
    frf_statistics_estimate(&statistics, 0, (core_real)2.237, &estimate);
    TEST_ASSERT_EQUAL_INT(frf_invalid_input, estimate.validity);
    TEST_ASSERT_TRUE(estimate.real == 0 && estimate.imaginary == 0 && estimate.std == 0);
    frf_statistics_estimate(&statistics, 0, (core_real)NAN, &estimate);
    TEST_ASSERT_EQUAL_INT(frf_invalid_input, estimate.validity);
    frf_statistics_estimate(&statistics, 0, -1, &estimate);
    TEST_ASSERT_EQUAL_INT(frf_invalid_input, estimate.validity);
}

static void test_estimate_of_a_silent_output_is_zero_with_its_std(void)
{
    add_same(1, 0.1);
    add_same(1, -0.1);
    struct frf_estimate estimate;
    frf_statistics_estimate(&statistics, 0, 0, &estimate);
    TEST_ASSERT_EQUAL_INT(frf_valid, estimate.validity);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 0, estimate.real);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 0.1, estimate.std);
}

static void test_estimate_never_returns_nan_or_infinity(void)
{
    add_same(1e-160, 1e160);
    add_same(1e-160, -1e160);
    struct frf_estimate estimate;
    frf_statistics_estimate(&statistics, 0, 0, &estimate);
    TEST_ASSERT_NOT_EQUAL(frf_valid, estimate.validity);
    TEST_ASSERT_TRUE(isfinite(estimate.real) && isfinite(estimate.imaginary) && isfinite(estimate.std));
    setUp();
    add_same(1e200, 1e200);
    add_same(1e200, 1e200);
    frf_statistics_estimate(&statistics, 0, 0, &estimate);
    TEST_ASSERT_EQUAL_INT(frf_invalid_not_finite, estimate.validity);
    TEST_ASSERT_TRUE(estimate.real == 0 && estimate.imaginary == 0);
    expect_no_scatter(&estimate);
}

static void test_statistics_leave_out_periods_that_are_not_finite(void)
{
    struct frf_complex good[bins] = {{1, 0}, {1, 0}, {1, 0}}, bad[bins] = {{1, 0}, {1, 0}, {1, (core_real)NAN}};
    struct frf_pair before[bins];
    TEST_ASSERT_TRUE(frf_statistics_add(&statistics, good, good));
    memcpy(before, pairs, sizeof before);
    TEST_ASSERT_FALSE(frf_statistics_add(&statistics, good, bad));
    TEST_ASSERT_FALSE(frf_statistics_add(&statistics, bad, good));
    bad[2].imaginary = (core_real)INFINITY;
    TEST_ASSERT_FALSE(frf_statistics_add(&statistics, bad, good));
    TEST_ASSERT_EQUAL_UINT32(3, statistics.excluded.not_finite);
    TEST_ASSERT_EQUAL_UINT32(1, statistics.periods);
    for (unsigned b = 0; b < bins; b++) {
        TEST_ASSERT_TRUE(pairs[b].input_mean.real == before[b].input_mean.real);
        TEST_ASSERT_TRUE(pairs[b].input_squares == before[b].input_squares);
    }
}

static void test_statistics_scale_with_units(void)
{
    struct frf_estimate small, large;
    for (unsigned pass = 0; pass < 2; pass++) {
        setUp();
        double unit = pass ? 1e6 : 1e-6;
        for (unsigned m = 0; m < 8; m++) {
            double complex u = 5 + random_gaussian(), y = 3 * I + random_gaussian();
            add_same(unit * u, y / unit);
        }
        frf_statistics_estimate(&statistics, 0, 0, pass ? &large : &small);
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-9 * small.real, small.real, 1e24 * large.real);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9 * small.std, small.std, 1e24 * large.std);
}

/* Through the integer DFT: a plant of known response y[n] = 0.5 x[n - 3], its response at each bin known by hand. */
enum { plant_period = 200, delay = 3 };

static int16_t frames[2 * plant_period];
static int16_t sine_storage[FRF_TWIDDLE_WORDS(200u)];
static union frf_word dft_storage[FRF_STORAGE_WORDS(3u, 2u)];
static const uint32_t dft_bins[bins] = {3, 20, 77};
static struct frf_dft dft;

static void start_dft(void)
{
    static struct frf_twiddles_q15 twiddles;
    struct frf_dft_config config = {dft_bins, bins, 2, dft_storage, FRF_STORAGE_WORDS(3u, 2u), 0, 0};
    TEST_ASSERT_EQUAL_INT(core_ok,
                          frf_twiddles_build_q15(sine_storage, FRF_TWIDDLE_WORDS(200u), plant_period, &twiddles));
    TEST_ASSERT_EQUAL_INT(core_ok, frf_dft_init_q15(&dft, &config, &twiddles));
    for (unsigned n = 0; n < plant_period; n++) {
        double x = 0, y = 0;
        for (unsigned b = 0; b < bins; b++) {
            x += 5000 * cos(6.28318530717958647692 * dft_bins[b] * n / plant_period + b);
            y += 2500 * cos(6.28318530717958647692 * dft_bins[b] * ((double)n - delay) / plant_period + b);
        }
        frames[2 * n] = (int16_t)lround(x);
        frames[2 * n + 1] = (int16_t)lround(y);
    }
}

static void test_statistics_find_a_known_plant_through_the_dft(void)
{
    start_dft();
    for (unsigned m = 0; m < 4; m++) {
        frf_dft_add_i16(&dft, frames, plant_period);
        TEST_ASSERT_TRUE(frf_statistics_add_period(&statistics, &dft, 0, 1));
        TEST_ASSERT_FALSE(frf_statistics_add_period(&statistics, &dft, 0, 1));
    }
    TEST_ASSERT_EQUAL_UINT32(4, statistics.periods);
    for (unsigned b = 0; b < bins; b++) {
        struct frf_estimate estimate;
        frf_statistics_estimate(&statistics, b, 1, &estimate);
        double complex expected = 0.5 * cexp(-I * 6.28318530717958647692 * dft_bins[b] * delay / plant_period);
        TEST_ASSERT_EQUAL_INT(frf_valid, estimate.validity);
        TEST_ASSERT_DOUBLE_WITHIN(2e-4, creal(expected), estimate.real); /* half a count of 2500 per sample */
        TEST_ASSERT_DOUBLE_WITHIN(2e-4, cimag(expected), estimate.imaginary);
        TEST_ASSERT_TRUE(estimate.std <= 1e-9); /* the same samples every period */
    }
}

static void test_statistics_exclude_invalid_periods_and_count_reasons(void)
{
    static const uint32_t marks[] = {0, frf_reason_gap, 0, frf_reason_late | frf_reason_application, 0};
    start_dft();
    for (unsigned m = 0; m < 5; m++) {
        frf_dft_mark(&dft, marks[m]);
        frf_dft_add_i16(&dft, frames, plant_period);
        TEST_ASSERT_EQUAL_INT(marks[m] == 0, frf_statistics_add_period(&statistics, &dft, 0, 1));
    }
    TEST_ASSERT_EQUAL_UINT32(3, statistics.periods);
    TEST_ASSERT_EQUAL_UINT32(2, statistics.excluded.invalid);
    TEST_ASSERT_EQUAL_UINT32(1, statistics.excluded.by_reason[0]);
    TEST_ASSERT_EQUAL_UINT32(0, statistics.excluded.by_reason[1]);
    TEST_ASSERT_EQUAL_UINT32(1, statistics.excluded.by_reason[2]);
    TEST_ASSERT_EQUAL_UINT32(1, statistics.excluded.by_reason[3]);
    frf_dft_add_i16(&dft, frames, plant_period);
    frf_dft_add_i16(&dft, frames, plant_period);
    TEST_ASSERT_TRUE(frf_statistics_add_period(&statistics, &dft, 0, 1));
    TEST_ASSERT_EQUAL_UINT32(1, statistics.excluded.missed);
}

static void test_statistics_refuse_a_dft_that_does_not_fit(void)
{
    start_dft();
    frf_dft_add_i16(&dft, frames, plant_period);
    TEST_ASSERT_FALSE(frf_statistics_add_period(&statistics, &dft, 2, 1));
    TEST_ASSERT_FALSE(frf_statistics_add_period(&statistics, &dft, 0, 2));
    TEST_ASSERT_EQUAL_INT(core_ok, frf_statistics_init(&statistics, pairs, bins - 1));
    TEST_ASSERT_FALSE(frf_statistics_add_period(&statistics, &dft, 0, 1));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_statistics_init(NULL, pairs, bins));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_statistics_init(&statistics, NULL, bins));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_statistics_init(&statistics, pairs, 0));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_statistics_equal_their_definition);
    RUN_TEST(test_statistics_keep_the_scatter_beside_a_large_mean);
    RUN_TEST(test_statistics_std_is_what_experiments_scatter);
    RUN_TEST(test_estimate_says_why_it_is_invalid);
    RUN_TEST(test_estimate_of_a_silent_output_is_zero_with_its_std);
    RUN_TEST(test_estimate_never_returns_nan_or_infinity);
    RUN_TEST(test_statistics_leave_out_periods_that_are_not_finite);
    RUN_TEST(test_statistics_scale_with_units);
    RUN_TEST(test_statistics_find_a_known_plant_through_the_dft);
    RUN_TEST(test_statistics_exclude_invalid_periods_and_count_reasons);
    RUN_TEST(test_statistics_refuse_a_dft_that_does_not_fit);
    return UNITY_END();
}
