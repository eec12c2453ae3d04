/* SPDX-License-Identifier: MIT */
#include "lab/estimate/line_search.h"
#include "lab/estimate/spectra.h"
#include "lab/numeric/statistics.h"

#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static const double two_pi = 6.283185307179586476925;

void setUp(void) {}

void tearDown(void) {}

enum { length = 200, most_periods = 10, stride = length / 2 + 1 };

/// What is drawn: unit lines on every third bin from 2 to 77, and what comes on top.
struct drawn {
    size_t periods;
    double noise;     ///< white, RMS
    double pole;      ///< of the noise, which it makes rise to low frequencies; 0: white
    double ramp;      ///< per sample
    double hum_bin;   ///< of a sine of the lines' size; 0: none
    double weakest;   ///< of the lines' sizes, which are spread evenly in decibels; 1: all alike
    double quadratic; ///< share of the square
};

static void draw(const struct drawn *drawn, uint64_t seed, double *out_signal, bool *out_excited)
{
    struct random random;
    double coloured = 0.0;
    random_seed(&random, seed);
    for (size_t n = 0; n < drawn->periods * length; n++) {
        out_signal[n] = 0.0;
    }
    for (size_t k = 0; k < stride; k++) {
        out_excited[k] = k >= 2 && k < 80 && (k - 2) % 3 == 0;
        const double phase = two_pi * random_uniform(&random);
        const double size = pow(drawn->weakest, random_uniform(&random));
        for (size_t n = 0; n < drawn->periods * length && out_excited[k]; n++) {
            out_signal[n] += size * cos(two_pi * (double)(k * n % length) / length + phase);
        }
    }
    const double hum_phase = two_pi * random_uniform(&random);
    for (size_t n = 0; n < drawn->periods * length; n++) {
        coloured = drawn->pole * coloured + drawn->noise * random_normal(&random);
        out_signal[n] += drawn->quadratic * out_signal[n] * out_signal[n] + coloured + drawn->ramp * (double)n;
        out_signal[n] += drawn->hum_bin > 0.0 ? cos(two_pi * drawn->hum_bin * (double)n / length + hum_phase) : 0.0;
    }
}

struct count {
    size_t missed, false_lines, doubtful_missed, doubtful;
};

static struct count search_drawn(const struct drawn *drawn, uint64_t seeds)
{
    static double signal[most_periods * length];
    static double complex spectra[most_periods * stride];
    static size_t numbers[most_periods];
    struct count count = {0};
    for (uint64_t seed = 1; seed <= seeds; seed++) {
        bool excited[stride];
        bool found[stride] = {false};
        bool doubted[stride] = {false};
        draw(drawn, seed, signal, excited);
        for (size_t p = 0; p < drawn->periods; p++) {
            numbers[p] = p;
        }
        TEST_ASSERT_TRUE(spectra_transform_all(signal, length, drawn->periods, spectra));
        const struct line_search search = {spectra, numbers, drawn->periods, length};
        struct line_search_result result;
        TEST_ASSERT_TRUE(line_search_run(&search, &result));
        for (size_t b = 0; b < result.count; b++) {
            found[result.bins[b]] = true;
            count.false_lines += !excited[result.bins[b]];
        }
        for (size_t b = 0; b < result.doubtful_count; b++) {
            doubted[result.doubtful[b]] = true;
            count.doubtful++;
        }
        for (size_t k = 0; k < stride; k++) {
            count.missed += excited[k] && !found[k];
            count.doubtful_missed += excited[k] && !found[k] && doubted[k];
        }
        line_search_result_free(&result);
    }
    return count;
}

static char *described(const struct drawn *drawn, const struct count *count)
{
    static char text[160];
    snprintf(text, sizeof text, "%zu periods, noise %g: missed %zu (%zu of them doubtful), false %zu, doubtful %zu",
             drawn->periods, drawn->noise, count->missed, count->doubtful_missed, count->false_lines, count->doubtful);
    return text;
}

static const size_t few_and_many[] = {2, 3, 5, 10};
enum { period_cases = sizeof few_and_many / sizeof few_and_many[0], draws = 40 };

/// The lines stand 26 dB above the noise of one period's bin. Two periods miss one in 2600 there (13000 lines drawn), a
/// low one where the bins above happen to show a slope; three and more miss none.
static const double missed_share_of_two_periods = 0.005;

static void test_line_search_finds_all_lines_from_two_periods_on(void)
{
    for (int i = 0; i < period_cases; i++) {
        const struct drawn drawn = {.periods = few_and_many[i], .noise = 0.5, .weakest = 1.0};
        const struct count count = search_drawn(&drawn, draws);
        const double tolerated = few_and_many[i] == 2 ? missed_share_of_two_periods * draws * 26 : 0.0;
        TEST_ASSERT_TRUE_MESSAGE((double)count.missed <= tolerated, described(&drawn, &count));
        TEST_ASSERT_EQUAL_size_t_MESSAGE(0, count.false_lines, described(&drawn, &count));
    }
}

/// Noise alone: 1e-6 a bin are 0.004 lines expected of 40 draws of 100 bins. Noise that falls with frequency gives two
/// periods a line in 6 of 100 recordings (1000 drawn), three in 1 of 100, more none.
static const double lines_of_coloured_noise = 0.2;
static void test_line_search_finds_none_in_noise(void)
{
    for (int i = 0; i < period_cases; i++) {
        for (int coloured = 0; coloured <= 1; coloured++) {
            static double signal[most_periods * length];
            static double complex spectra[most_periods * stride];
            static size_t numbers[most_periods];
            size_t found = 0;
            for (uint64_t seed = 1; seed <= draws; seed++) {
                struct random random;
                double x = 0.0;
                random_seed(&random, seed);
                for (size_t n = 0; n < few_and_many[i] * length; n++) {
                    x = (coloured ? 0.95 : 0.0) * x + random_normal(&random);
                    signal[n] = x;
                }
                for (size_t p = 0; p < few_and_many[i]; p++) {
                    numbers[p] = p;
                }
                TEST_ASSERT_TRUE(spectra_transform_all(signal, length, few_and_many[i], spectra));
                const struct line_search search = {spectra, numbers, few_and_many[i], length};
                struct line_search_result result;
                TEST_ASSERT_TRUE(line_search_run(&search, &result));
                found += result.count;
                line_search_result_free(&result);
            }
            const double tolerated = coloured && few_and_many[i] <= 3 ? lines_of_coloured_noise * draws : 0.0;
            TEST_ASSERT_TRUE_MESSAGE((double)found <= tolerated, coloured ? "coloured noise" : "white noise");
        }
    }
}

/// Lines that noise hides are not called free of power, unless they are hardly there.
static void test_line_search_doubts_what_noise_hides(void)
{
    for (int i = 0; i < period_cases; i++) {
        const struct drawn drawn = {.periods = few_and_many[i], .noise = 1.5, .weakest = 0.1};
        const struct count count = search_drawn(&drawn, draws);
        TEST_ASSERT_EQUAL_size_t_MESSAGE(0, count.false_lines, described(&drawn, &count));
        TEST_ASSERT_TRUE_MESSAGE(4 * count.doubtful_missed >= count.missed, described(&drawn, &count));
    }
}

/// A ramp leaks into all bins of all periods alike; slow noise into the low ones.
static void test_line_search_ignores_drift(void)
{
    for (int i = 0; i < period_cases; i++) {
        const struct drawn drawn = {
            .periods = few_and_many[i], .noise = 0.03, .pole = 0.9, .ramp = 0.5, .weakest = 1.0};
        const struct count count = search_drawn(&drawn, draws);
        const double tolerated = few_and_many[i] == 2 ? missed_share_of_two_periods * draws * 26 : 0.0;
        TEST_ASSERT_TRUE_MESSAGE((double)count.missed <= tolerated, described(&drawn, &count));
        TEST_ASSERT_EQUAL_size_t_MESSAGE(0, count.false_lines, described(&drawn, &count));
    }
}

/// A sine between the bins has other phases in each period; two may be alike by chance, which says 1 draw in 25.
static void test_line_search_takes_no_disturbance_for_line(void)
{
    for (int i = 0; i < period_cases; i++) {
        const struct drawn drawn = {.periods = few_and_many[i], .noise = 0.01, .hum_bin = 90.37, .weakest = 1.0};
        const struct count count = search_drawn(&drawn, draws);
        TEST_ASSERT_EQUAL_size_t_MESSAGE(0, count.missed, described(&drawn, &count));
        TEST_ASSERT_EQUAL_size_t_MESSAGE(0, count.false_lines, described(&drawn, &count));
    }
}

/// In a loop the lines between the excited ones repeat as well, and are far above the noise: neither lines nor free.
static void test_line_search_tells_distortion_from_excitation(void)
{
    const struct drawn drawn = {.periods = 8, .noise = 0.001, .weakest = 1.0, .quadratic = 0.004};
    const struct count count = search_drawn(&drawn, draws);
    TEST_ASSERT_EQUAL_size_t_MESSAGE(0, count.missed, described(&drawn, &count));
    TEST_ASSERT_EQUAL_size_t_MESSAGE(0, count.false_lines, described(&drawn, &count));
    TEST_ASSERT_TRUE_MESSAGE(count.doubtful > 40 * draws, described(&drawn, &count));
}

/// What is left of a constant and of a ramp is rounding.
static void test_line_search_finds_none_in_constant_and_ramp(void)
{
    static double signal[3 * length];
    static double complex spectra[3 * stride];
    size_t numbers[] = {0, 1, 2};
    for (int ramp = 0; ramp <= 1; ramp++) {
        struct line_search_result result;
        for (size_t n = 0; n < 3 * length; n++) {
            signal[n] = 0.1 + 0.001 * ramp * (double)n;
        }
        TEST_ASSERT_TRUE(spectra_transform_all(signal, length, 3, spectra));
        TEST_ASSERT_TRUE(line_search_run(&(struct line_search){spectra, numbers, 3, length}, &result));
        TEST_ASSERT_EQUAL_size_t(0, result.count);
        line_search_result_free(&result);
    }
}

/// Periods with lost samples are not looked at, whatever stands there.
static void test_line_search_leaves_out_lost_periods(void)
{
    static double signal[6 * length];
    static double valid[6 * length];
    bool excited[stride];
    const struct drawn drawn = {.periods = 6, .noise = 0.1, .weakest = 1.0};
    struct run_column columns[] = {{"torque_Nm", signal}, {"valid", valid}};
    const struct run run = {.rows = 6 * length, .column_count = 2, .columns = columns};
    struct line_search search;
    draw(&drawn, 3, signal, excited);
    for (size_t n = 0; n < 6 * length; n++) {
        valid[n] = n == 2 * length + 7 ? 0.0 : 1.0;
    }
    signal[2 * length + 7] = 1e30;
    TEST_ASSERT_TRUE(line_search_transform(&run, "torque_Nm", length, 6, &search));
    TEST_ASSERT_EQUAL_size_t(4, search.periods);
    TEST_ASSERT_EQUAL_size_t(1, search.numbers[0]);
    TEST_ASSERT_EQUAL_size_t(3, search.numbers[1]);
    struct line_search_result result;
    TEST_ASSERT_TRUE(line_search_run(&search, &result));
    TEST_ASSERT_EQUAL_size_t(26, result.count);
    line_search_result_free(&result);
    line_search_free(&search);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_line_search_finds_all_lines_from_two_periods_on);
    RUN_TEST(test_line_search_finds_none_in_noise);
    RUN_TEST(test_line_search_doubts_what_noise_hides);
    RUN_TEST(test_line_search_ignores_drift);
    RUN_TEST(test_line_search_takes_no_disturbance_for_line);
    RUN_TEST(test_line_search_tells_distortion_from_excitation);
    RUN_TEST(test_line_search_finds_none_in_constant_and_ramp);
    RUN_TEST(test_line_search_leaves_out_lost_periods);
    return UNITY_END();
}
