/* SPDX-License-Identifier: MIT */
#include "lab/estimate/distortion.h"

#include "lab/estimate/frf_mean.h"
#include "lab/numeric/cmplx.h"
#include "lab/numeric/statistics.h"

#include "unity.h"

#include <complex.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;

enum { length = 400, highest = 99, most_periods = 8 };

/// Required of the levels on static polynomials.
static const double level_tolerance_db = 2.0;
/// Stated: 5 % of the lines of a linear drive have a level, 1 % of its recordings a chance below 0.01. Lines share
/// neighbours: of 400 recordings of 38 lines about 6 are independent each, 2400 trials, so that 5 % scatters by 0.45 %.
static const double alarm_share = 0.05, alarm_tolerance = 0.02;
enum { recordings = 400 };
/// 8 of 800 kinds are expected below 1 %; more than 20 happen once in 10 000.
enum { chance_alarms_most = 20 };

static struct run run;
static struct periodic recording;
static struct frf frf;
static struct distortion distortion;
static struct error error;
static uint32_t bins[length / 2];
static size_t bin_count;

void setUp(void)
{
    run = (struct run){0};
    recording = (struct periodic){0};
    frf = (struct frf){0};
    bin_count = 0;
}

void tearDown(void)
{
    frf_free(&frf);
    periodic_free(&recording);
    run.path = NULL;
    run_free(&run);
}

/// One period of a multisine with random phases on `bins`, each of amplitude 1.
static void make_period(struct random *random, double *out_period)
{
    memset(out_period, 0, length * sizeof *out_period);
    for (size_t b = 0; b < bin_count; b++) {
        const double phase = two_pi * random_uniform(random);
        for (size_t n = 0; n < length; n++) {
            out_period[n] += cos(two_pi * (double)(bins[b] * n % length) / length + phase);
        }
    }
}

/// Odd bins up to `highest`; `random_odd` leaves one of each four out.
static void choose_odd(bool random_odd, struct random *random)
{
    bin_count = 0;
    size_t left_out = 0;
    for (uint32_t index = 0; 2 * index + 1 <= highest; index++) {
        if (index % 4 == 0) {
            left_out = random_bits(random) % 4;
        }
        if (!random_odd || index % 4 != left_out) {
            bins[bin_count++] = 2 * index + 1;
        }
    }
}

static void make_run(size_t periods)
{
    static char path[] = "made";
    run = (struct run){.path = path, .sample_rate_hz = length, .rows = periods * length};
    TEST_ASSERT_NOT_NULL(run_add_column(&run, "torque_Nm"));
    TEST_ASSERT_NOT_NULL(run_add_column(&run, "velocity_rad_per_s"));
}

static void drop_run(void)
{
    frf_free(&frf);
    periodic_free(&recording);
    run.path = NULL;
    run_free(&run);
}

static void estimate(const struct distortion_options *options)
{
    const struct periodic_options cut = {.period_samples = length,
                                         .bins = bins,
                                         .bin_count = bin_count,
                                         .settle = periodic_settle_given,
                                         .settle_periods = 0};
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, periodic_cut(&run, &cut, &recording, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, frf_mean_estimate(&recording, NULL, &frf, &error), error.message);
    TEST_ASSERT_TRUE(distortion_estimate(&recording, options, &frf, &distortion));
}

static double decibel(double power)
{
    return 10.0 * log10(power);
}

/// What the lines' levels are in the mean, as a power, over those that have one.
static double mean_level(const double *column)
{
    double sum = 0.0;
    size_t known = 0;
    for (size_t line = 0; line < frf.count; line++) {
        sum += frf_known(column[line]) ? column[line] * column[line] : 0.0;
        known += frf_known(column[line]);
    }
    TEST_ASSERT_GREATER_THAN_size_t(frf.count / 2, known);
    return sum / (double)known;
}

/// y = u + a2 u^2 + a3 u^3 with noise of standard deviation `noise`.
static void play_polynomial(const double *period, size_t periods, double a2, double a3, double noise,
                            struct random *random)
{
    make_run(periods);
    for (size_t n = 0; n < run.rows; n++) {
        const double u = period[n % length];
        run.columns[0].data[n] = u;
        run.columns[1].data[n] = u + a2 * u * u + a3 * u * u * u + noise * random_normal(random);
    }
}

/// Power of a2 u^2 at even bins over that of u on a line, both in the mean: amplitudes are all 1, so that |U| = N/2,
/// and bin b of u^2 has amplitude 1 for each unordered pair of lines with that sum or difference.
static double even_truth(double a2)
{
    double sum = 0.0;
    size_t bins_even = 0;
    for (uint32_t b = 2; b < highest; b += 2) {
        for (size_t i = 0; i < bin_count; i++) {
            for (size_t j = i; j < bin_count; j++) {
                const double amplitude = i == j ? 0.5 : 1.0; // u^2 = sum of cos^2 / 2 ... + cos cos
                sum += bins[i] + bins[j] == b ? amplitude * amplitude : 0.0;
                sum += i != j && bins[j] - bins[i] == b ? 1.0 : 0.0;
            }
        }
        bins_even++;
    }
    return a2 * a2 * sum / (double)bins_even;
}

static void test_distortion_agrees_with_known_levels_on_static_polynomials(void)
{
    enum { realisations = 40 };
    const uint64_t seed = 31;
    const double a2 = 0.002;
    const double a3 = 0.0005;
    struct random random;
    double period[length];
    static double complex responses[realisations][highest];
    double odd = 0.0;
    double even = 0.0;
    random_seed(&random, seed);
    choose_odd(true, &random);
    for (int r = 0; r < realisations; r++) {
        make_period(&random, period);
        play_polynomial(period, 4, a2, a3, 0.01, &random);
        estimate(NULL);
        odd += mean_level(frf.odd_distortion) / realisations;
        even += mean_level(frf.even_distortion) / realisations;
        for (size_t line = 0; line < frf.count; line++) {
            responses[r][line] = CMPLX(frf.real[line], frf.imag[line]);
        }
        TEST_ASSERT_TRUE(distortion_chance(&distortion.kind[distortion_odd]) < 1e-6);
        TEST_ASSERT_TRUE(distortion_chance(&distortion.kind[distortion_even]) < 1e-6);
        drop_run();
    }
    double stochastic = 0.0;
    for (size_t line = 0; line < bin_count; line++) {
        double complex mean = 0.0;
        for (int r = 0; r < realisations; r++) {
            mean += responses[r][line] / realisations;
        }
        for (int r = 0; r < realisations; r++) {
            const double distance = cabs(responses[r][line] - mean);
            stochastic += distance * distance / (double)bin_count / (realisations - 1);
        }
    }
    printf("seed %u: odd %.2f dB, scatter between realisations %.2f dB; even %.2f dB, known %.2f dB\n", (unsigned)seed,
           decibel(odd), decibel(stochastic), decibel(even), decibel(even_truth(a2)));
    TEST_ASSERT_DOUBLE_WITHIN(level_tolerance_db, decibel(stochastic), decibel(odd));
    TEST_ASSERT_DOUBLE_WITHIN(level_tolerance_db, decibel(even_truth(a2)), decibel(even));
}

static void test_distortion_keeps_odd_and_even_apart(void)
{
    struct random random;
    double period[length];
    random_seed(&random, 32);
    choose_odd(true, &random);
    make_period(&random, period);
    play_polynomial(period, 4, 0.01, 0.0, 0.0, &random);
    estimate(NULL);
    /* What is left of a square at odd bins is rounding. */
    TEST_ASSERT_EQUAL_DOUBLE(0.0, mean_level(frf.odd_distortion));
    TEST_ASSERT_DOUBLE_WITHIN(level_tolerance_db, decibel(even_truth(0.01)), decibel(mean_level(frf.even_distortion)));
    drop_run();
    play_polynomial(period, 4, 0.0, 0.001, 0.0, &random);
    estimate(NULL);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, mean_level(frf.even_distortion));
    TEST_ASSERT_TRUE(sqrt(mean_level(frf.odd_distortion)) > 1e-3);
}

/// A first-order drive under a controller, noise in the loop and on both sensors.
static void play_loop(const double *period, size_t periods, struct random *random)
{
    make_run(periods);
    double speed = 0.0;
    const size_t before = length;
    for (size_t n = 0; n < before + run.rows; n++) {
        const double torque = period[n % length] - 0.3 * speed + 0.1 * random_normal(random);
        if (n >= before) {
            run.columns[0].data[n - before] = torque + 0.05 * random_normal(random);
            run.columns[1].data[n - before] = speed + 0.05 * random_normal(random);
        }
        speed = 0.95 * speed + 0.4 * torque;
    }
}

static void test_distortion_of_linear_drive_alarms_as_often_as_stated(void)
{
    struct random random;
    double period[length];
    const uint64_t seed = 33;
    double lines = 0.0;
    double alarms = 0.0;
    size_t chances = 0;
    random_seed(&random, seed);
    for (int r = 0; r < recordings; r++) {
        choose_odd(true, &random);
        make_period(&random, period);
        play_loop(period, 6, &random);
        estimate(NULL);
        for (size_t line = 0; line < frf.count; line++) {
            lines += frf_known(frf.odd_distortion[line]) + frf_known(frf.even_distortion[line]);
            alarms += (frf.odd_distortion[line] > 0.0) + (frf.even_distortion[line] > 0.0);
        }
        chances += (distortion_chance(&distortion.kind[distortion_odd]) < 0.01) +
                   (distortion_chance(&distortion.kind[distortion_even]) < 0.01);
        drop_run();
    }
    printf("seed %u: %.2f %% of lines have a level, %zu of %d kinds a chance below 1 %%\n", (unsigned)seed,
           100.0 * alarms / lines, chances, 2 * recordings);
    TEST_ASSERT_DOUBLE_WITHIN(alarm_tolerance, alarm_share, alarms / lines);
    TEST_ASSERT_LESS_OR_EQUAL_size_t(chance_alarms_most, chances);
}

/// What a wandering speed leaks is the same in every period but for its scatter; without its trend taken out 15 % to
/// 85 % of the lines would have a level.
static void test_distortion_of_wandering_speed_alarms_no_more_than_stated(void)
{
    struct random random;
    double period[length];
    double lines = 0.0;
    double alarms = 0.0;
    random_seed(&random, 39);
    for (int r = 0; r < recordings; r++) {
        double walk = 0.0;
        double slow = 0.0;
        choose_odd(true, &random);
        make_period(&random, period);
        play_polynomial(period, 7, 0.0, 0.0, 0.01, &random);
        for (size_t n = 0; n < run.rows; n++) {
            walk += 0.03 * random_normal(&random);
            slow += 0.01 * walk;
            run.columns[1].data[n] += r % 2 ? walk : slow;
        }
        estimate(NULL);
        for (size_t line = 0; line < frf.count; line++) {
            lines += frf_known(frf.odd_distortion[line]) + frf_known(frf.even_distortion[line]);
            alarms += (frf.odd_distortion[line] > 0.0) + (frf.even_distortion[line] > 0.0);
        }
        drop_run();
    }
    printf("seed 39: %.2f %% of lines have a level\n", 100.0 * alarms / lines);
    TEST_ASSERT_TRUE(alarms / lines < alarm_share + alarm_tolerance);
}

/// A strong input on the free bins, as a loop leaves it there, is no distortion of a linear drive.
static void test_distortion_takes_off_what_the_input_carries(void)
{
    struct random random;
    double period[length];
    random_seed(&random, 34);
    choose_odd(true, &random);
    make_period(&random, period);
    for (uint32_t b = 1; b < highest; b++) {
        for (size_t n = 0; n < length; n++) {
            period[n] += 0.3 * cos(two_pi * (double)(b * n % length) / length + b * b);
        }
    }
    make_run(4);
    double speed = 0.0;
    for (size_t n = 0; n < 10 * length; n++) { // settled after six periods
        if (n >= 6 * length) {
            run.columns[0].data[n - 6 * length] = period[n % length];
            run.columns[1].data[n - 6 * length] = speed;
        }
        speed = 0.5 * speed + 0.5 * period[n % length];
    }
    estimate(NULL);
    /* A straight line between lines misses this response by its curvature, below 1e-3 of 0.3. */
    TEST_ASSERT_TRUE(sqrt(mean_level(frf.odd_distortion)) < 1e-3);
    TEST_ASSERT_TRUE(sqrt(mean_level(frf.even_distortion)) < 1e-3);
}

static void test_distortion_of_full_grid_stays_unknown(void)
{
    struct random random;
    double period[length];
    random_seed(&random, 35);
    for (uint32_t b = 1; b <= highest; b++) {
        bins[bin_count++] = b;
    }
    make_period(&random, period);
    play_polynomial(period, 4, 0.01, 0.001, 0.0, &random);
    estimate(NULL);
    for (size_t line = 0; line < frf.count; line++) {
        TEST_ASSERT_FALSE(frf_known(frf.odd_distortion[line]) || frf_known(frf.even_distortion[line]));
    }
    for (int kind = 0; kind < distortion_kinds; kind++) {
        TEST_ASSERT_EQUAL_size_t(0, distortion.kind[kind].bins);
        TEST_ASSERT_EQUAL_DOUBLE(1.0, distortion_chance(&distortion.kind[kind]));
    }
}

static void test_distortion_of_mixed_grid_is_a_summary_only(void)
{
    struct random random;
    double period[length];
    random_seed(&random, 36);
    for (uint32_t b = 1; b <= highest; b += b % 3 == 0 ? 1 : 2) {
        bins[bin_count++] = b;
    }
    make_period(&random, period);
    play_polynomial(period, 4, 0.01, 0.0, 0.0, &random);
    estimate(NULL);
    TEST_ASSERT_FALSE(frf_known(frf.odd_distortion[10]) || frf_known(frf.even_distortion[10]));
    TEST_ASSERT_GREATER_THAN_size_t(10, distortion.kind[distortion_mixed].bins);
    TEST_ASSERT_TRUE(distortion.kind[distortion_mixed].median > 0.01);
    TEST_ASSERT_EQUAL_size_t(0, distortion.kind[distortion_odd].bins);
}

/// A line needs two free bins within an octave; the lowest ones of an odd grid have fewer.
static void test_distortion_needs_neighbours(void)
{
    struct random random;
    double period[length];
    random_seed(&random, 37);
    choose_odd(false, &random);
    make_period(&random, period);
    play_polynomial(period, 4, 0.01, 0.0, 0.0, &random);
    estimate(NULL);
    TEST_ASSERT_FALSE(frf_known(frf.even_distortion[0])); // bin 1: only bin 2
    TEST_ASSERT_TRUE(frf_known(frf.even_distortion[1]));  // bin 3: bins 2, 4, 6
    TEST_ASSERT_FALSE(frf_known(frf.odd_distortion[20]));
    TEST_ASSERT_EQUAL_size_t(0, distortion.kind[distortion_odd].bins);
}

/// What a second input excites is neither free nor distortion.
static void test_distortion_leaves_other_inputs_lines_alone(void)
{
    struct random random;
    double period[length];
    double other[length];
    random_seed(&random, 38);
    choose_odd(false, &random);
    uint32_t others[length / 2];
    size_t kept = 0;
    size_t other_count = 0;
    for (size_t b = 0; b < bin_count; b++) {
        if (b % 4 == 1) {
            others[other_count++] = bins[b];
        } else if (b % 4 != 2) {
            bins[kept++] = bins[b];
        }
    }
    bin_count = kept;
    make_period(&random, period);
    memset(other, 0, sizeof other);
    for (size_t b = 0; b < other_count; b++) {
        for (size_t n = 0; n < length; n++) {
            other[n] += cos(two_pi * (double)(others[b] * n % length) / length + b * b);
        }
    }
    play_polynomial(period, 4, 0.0, 0.0, 0.0, &random);
    for (size_t n = 0; n < run.rows; n++) {
        run.columns[1].data[n] += other[n % length];
    }
    estimate(&(struct distortion_options){.other_bins = others, .other_count = other_count});
    TEST_ASSERT_EQUAL_DOUBLE(0.0, mean_level(frf.odd_distortion));
    TEST_ASSERT_EQUAL_size_t(12, distortion.kind[distortion_odd].bins);
    drop_run();
    play_polynomial(period, 4, 0.0, 0.0, 0.0, &random);
    for (size_t n = 0; n < run.rows; n++) {
        run.columns[1].data[n] += other[n % length];
    }
    estimate(NULL);
    TEST_ASSERT_TRUE(mean_level(frf.odd_distortion) > 0.1);
}

static void test_distortion_merge_adds_evidence(void)
{
    struct distortion one = {.kind[distortion_odd] = {.bins = 10, .fisher = 20.0, .limit = 0.1, .median = 0.0}};
    const struct distortion two = {.kind[distortion_odd] = {.bins = 10, .fisher = 60.0, .limit = 0.2, .median = 0.3},
                                   .kind[distortion_even] = {.bins = 5, .fisher = 9.0, .limit = 0.2, .median = 0.0}};
    const double before = distortion_chance(&one.kind[distortion_odd]);
    distortion_merge(&one, &two);
    TEST_ASSERT_EQUAL_size_t(20, one.kind[distortion_odd].bins);
    TEST_ASSERT_EQUAL_size_t(5, one.kind[distortion_even].bins);
    TEST_ASSERT_EQUAL_DOUBLE(0.3, one.kind[distortion_odd].median);
    TEST_ASSERT_TRUE(distortion_chance(&one.kind[distortion_odd]) < before);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_distortion_agrees_with_known_levels_on_static_polynomials);
    RUN_TEST(test_distortion_keeps_odd_and_even_apart);
    RUN_TEST(test_distortion_of_linear_drive_alarms_as_often_as_stated);
    RUN_TEST(test_distortion_of_wandering_speed_alarms_no_more_than_stated);
    RUN_TEST(test_distortion_takes_off_what_the_input_carries);
    RUN_TEST(test_distortion_of_full_grid_stays_unknown);
    RUN_TEST(test_distortion_of_mixed_grid_is_a_summary_only);
    RUN_TEST(test_distortion_needs_neighbours);
    RUN_TEST(test_distortion_leaves_other_inputs_lines_alone);
    RUN_TEST(test_distortion_merge_adds_evidence);
    return UNITY_END();
}
