/* SPDX-License-Identifier: MIT */
/// Bands, periods, lines of several inputs and test times of sequences: lab/design/sequence.h, against the second
/// paper's figures; and its Schroeder multisines' peaks.
#include "lab/design/design.h"
#include "lab/design/sequence.h"

#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/// The paper's constant for one multisine of 250 and more lines, and how far its own four numbers of lines spread.
static const double peak_constant = 1.19;
static const double peak_spread = 0.02;
/// Two lines of equal size add up to at most sqrt(2) times sqrt(2); room for the rounding of a sum.
static const double rounding = 1e-9;

/// The two systems of the paper: line spacing of the first is 0.1 Hz, of the second 0.5 Hz.
static const struct design_line_grid spring_masses = {.rate_hz = 500, .period_samples = 5000};
static const struct design_line_grid telescope = {.rate_hz = 1000, .period_samples = 2000};

static struct design_sequence sequence;
static struct error error;

void setUp(void)
{
    sequence = (struct design_sequence){0};
    error = (struct error){0};
}

void tearDown(void)
{
    design_sequence_free(&sequence);
}

static void parse(const char *specification, const struct design_line_grid *grid, size_t inputs)
{
    design_sequence_free(&sequence);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, design_sequence_parse(specification, grid, inputs, 1, &sequence, &error),
                                  error.message);
}

static void assert_time(double expected_s, const char *specification, const struct design_line_grid *grid,
                        size_t inputs, uint64_t periods, double settle_s)
{
    parse(specification, grid, inputs);
    double time_s = design_sequence_test_time_s(&sequence, periods, settle_s);
    char text[160];
    snprintf(text, sizeof text, "%s, %zu inputs, factor %llu: %.17g s", specification, inputs,
             (unsigned long long)periods, time_s);
    TEST_ASSERT_TRUE_MESSAGE(time_s >= expected_s && time_s <= expected_s, text);
}

static void assert_lines(const uint32_t *expected, size_t count, size_t segment, size_t input)
{
    TEST_ASSERT_EQUAL_size_t(count, sequence.segments[segment].lines[input].count);
    TEST_ASSERT_EQUAL_UINT32_ARRAY(expected, sequence.segments[segment].lines[input].bins, count);
}

static void test_octaves_hold_the_papers_numbers_of_lines(void)
{
    static const uint32_t springs[] = {1, 2, 4, 8, 16, 32, 64, 123};
    static const uint32_t dot[] = {1, 2, 4, 8, 16, 32, 64, 53};
    parse("octaves:0.1:25:0.1", &spring_masses, 1);
    TEST_ASSERT_EQUAL_size_t(8, sequence.segment_count);
    for (size_t i = 0; i < 8; i++) {
        TEST_ASSERT_EQUAL_UINT32(springs[i], sequence.segments[i].periods);
        TEST_ASSERT_EQUAL_size_t(springs[i], sequence.segments[i].lines[0].count);
    }
    parse("octaves:0.5:90:0.5", &telescope, 1);
    TEST_ASSERT_EQUAL_size_t(8, sequence.segment_count);
    for (size_t i = 0; i < 8; i++) {
        TEST_ASSERT_EQUAL_UINT32(dot[i], sequence.segments[i].periods);
        TEST_ASSERT_EQUAL_size_t(dot[i], sequence.segments[i].lines[0].count);
    }
}

static void test_octaves_close_the_last_band_at_fmax(void)
{
    static const uint32_t first[] = {2, 3};
    static const uint32_t second[] = {4, 5, 6, 7};
    static const uint32_t last[] = {8};
    parse("octaves:1:4:0.5", &telescope, 1);
    TEST_ASSERT_EQUAL_size_t(3, sequence.segment_count);
    assert_lines(first, 2, 0, 0);
    assert_lines(second, 4, 1, 0);
    assert_lines(last, 1, 2, 0);
}

static void test_octaves_leave_out_bands_without_a_line(void)
{
    static const uint32_t second[] = {12};
    parse("octaves:1:12:5", &telescope, 1); // 1, 6, 11 Hz: nothing from 2 to below 4 Hz
    TEST_ASSERT_EQUAL_size_t(3, sequence.segment_count);
    assert_lines(second, 1, 1, 0);
}

/// No multiple of a line, and no sum or difference of two, of whichever inputs, is a line of the same band.
static void test_octaves_keep_second_order_products_out_of_their_band(void)
{
    enum { period = 30000, inputs = 3 };
    const struct design_line_grid grid = {.rate_hz = 1000, .period_samples = period};
    parse("octaves:0.1:25.3:0.1", &grid, inputs);
    for (size_t i = 0; i < sequence.segment_count; i++) {
        static bool excited[period];
        static uint32_t bins[period];
        size_t count = 0;
        memset(excited, 0, sizeof excited);
        for (size_t p = 0; p < inputs; p++) {
            const struct design_lines *lines = &sequence.segments[i].lines[p];
            for (size_t k = 0; k < lines->count; k++) {
                TEST_ASSERT_FALSE_MESSAGE(excited[lines->bins[k]], "two inputs share a line");
                excited[lines->bins[k]] = true;
                bins[count++] = lines->bins[k];
            }
        }
        for (size_t a = 0; a < count; a++) {
            for (size_t b = 0; b <= a; b++) {
                TEST_ASSERT_FALSE(excited[bins[a] + bins[b]]);
                TEST_ASSERT_FALSE(a != b && excited[abs((int)bins[a] - (int)bins[b])]);
            }
        }
    }
}

static void test_dwell_plays_one_line_after_the_other(void)
{
    parse("dwell:1:3:0.5", &telescope, 1);
    TEST_ASSERT_EQUAL_size_t(5, sequence.segment_count);
    for (size_t i = 0; i < 5; i++) {
        const uint32_t expected = (uint32_t)(2 + i);
        TEST_ASSERT_EQUAL_UINT32(1, sequence.segments[i].periods);
        assert_lines(&expected, 1, i, 0);
    }
}

static void test_any_other_specification_is_one_segment(void)
{
    parse("linear:0.5:100:0.5", &telescope, 1);
    TEST_ASSERT_EQUAL_size_t(1, sequence.segment_count);
    TEST_ASSERT_EQUAL_UINT32(1, sequence.segments[0].periods);
    TEST_ASSERT_EQUAL_STRING("multisine", design_sequence_kind_str(sequence.kind));
    TEST_ASSERT_FALSE(design_sequence_is("linear:0.5:100:0.5"));
    TEST_ASSERT_FALSE(design_sequence_is("octaves"));
    TEST_ASSERT_TRUE(design_sequence_is("octaves:1:2:3"));
    TEST_ASSERT_TRUE(design_sequence_is("dwell:nonsense"));
}

static void test_times_of_the_spring_masses_are_the_papers(void)
{
    assert_time(2510, "linear:0.1:25:0.1", &spring_masses, 1, 250, 10);
    assert_time(5000, "dwell:0.1:25:0.1", &spring_masses, 1, 1, 10);
    assert_time(2580, "octaves:0.1:25:0.1", &spring_masses, 1, 1, 10);
}

static void test_times_of_the_telescope_are_the_papers(void)
{
    assert_time(730, "linear:0.5:90:0.5", &telescope, 1, 360, 10);
    assert_time(2520, "dwell:0.5:90:0.5", &telescope, 1, 2, 10);
    assert_time(800, "octaves:0.5:90:0.5", &telescope, 1, 2, 10);
}

static void test_times_of_a_thousand_lines_are_the_papers(void)
{
    for (unsigned l = 1; l <= 7; l++) {
        assert_time(10000.0 * l + 5, "linear:0.1:100:0.1", &spring_masses, 1, 1000 * l, 5);
        assert_time(10000.0 * l + 5000, "dwell:0.1:100:0.1", &spring_masses, 1, l, 5);
        assert_time(10000.0 * l + 50, "octaves:0.1:100:0.1", &spring_masses, 1, l, 5);
    }
}

/// The paper's "no extra time" holds for whole l N_i / p only: bands of 1 and of 123 lines take half a period more.
static void test_two_inputs_take_twenty_seconds_more(void)
{
    const struct design_line_grid twice = {.rate_hz = 500, .period_samples = 10000};
    assert_time(2600, "octaves:0.1:25:0.1", &twice, 2, 1, 10);
    assert_time(2 * 2500 + 80, "octaves:0.1:25:0.1", &twice, 2, 2, 10);
    assert_time(1260 + 1260, "linear:0.1:25:0.1", &twice, 2, 251, 0); // ceil(251 / 2) periods of 20 s
}

static void test_inputs_interleave_at_fractions_of_the_step(void)
{
    static const uint32_t inputs[3][2] = {{6, 9}, {7, 10}, {8, 11}};
    const struct design_line_grid grid = {.rate_hz = 1000, .period_samples = 6000};
    parse("octaves:1:3:0.5", &grid, 3); // STEP is 3 bins; bands of 6, 9 and of 12, 15, 18
    for (size_t p = 0; p < 3; p++) {
        assert_lines(inputs[p], 2, 0, p);
    }
    parse("linear:1:3:1", &grid, 3); // STEP is 6 bins: shifts of 2
    TEST_ASSERT_EQUAL_UINT32(8, sequence.segments[0].lines[1].bins[0]);
    TEST_ASSERT_EQUAL_UINT32(10, sequence.segments[0].lines[2].bins[0]);
}

static void test_inputs_of_kinds_without_a_step_take_every_pth_bin(void)
{
    static const uint32_t inputs[2][3] = {{2, 4, 6}, {3, 5, 7}};
    const struct design_line_grid grid = {.rate_hz = 1000, .period_samples = 4000};
    parse("quasilog:0.5:1.5:1.05", &grid, 2);
    assert_lines(inputs[0], 3, 0, 0);
    assert_lines(inputs[1], 3, 0, 1);
}

/// All lines of all inputs are odd multiples of one frequency and none is there twice.
static void test_inputs_of_odd_lines_keep_even_products_away(void)
{
    enum { period = 1000 * 3 * 5 };
    const struct design_line_grid grid = {.rate_hz = 1000, .period_samples = period};
    for (size_t inputs = 2; inputs <= 5; inputs++) {
        static bool excited[period];
        const uint32_t denominator = inputs <= 3 ? 3 : 5;
        memset(excited, 0, sizeof excited);
        parse("odd:1:20:1", &grid, inputs); // STEP is 15 bins
        for (size_t p = 0; p < inputs; p++) {
            for (size_t k = 0; k < sequence.segments[0].lines[p].count; k++) {
                uint32_t bin = sequence.segments[0].lines[p].bins[k];
                TEST_ASSERT_EQUAL_UINT32(0, bin % (15 / denominator));
                TEST_ASSERT_EQUAL_UINT32(1, bin / (15 / denominator) % 2);
                TEST_ASSERT_FALSE(excited[bin]);
                excited[bin] = true;
            }
        }
    }
}

static void refuse(const char *specification, const struct design_line_grid *grid, size_t inputs, const char *part)
{
    TEST_ASSERT_EQUAL_INT(error_usage, design_sequence_parse(specification, grid, inputs, 1, &sequence, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, part), error.message);
    TEST_ASSERT_NULL(sequence.segments);
}

static void test_sequence_refused_with_what_would_do(void)
{
    const struct design_line_grid longest = {.rate_hz = 1000, .period_samples = 1 << 20};
    refuse("octaves:0.5:90:0.5", &telescope, 2, "expected a period of 4000 samples");
    refuse("octaves:1:90:1", &telescope, 3, "expected a period of 6000 samples");
    refuse("octaves:2:90:2", &telescope, 8, "expected a period of 4000 samples"); // STEP of 4 bins
    refuse("odd:0.5:90:0.5", &telescope, 2, "expected a period of 6000 samples");
    refuse("quasilog:0.5:90:1.1", &telescope, 3, "expected 6000");
    refuse("quasilog:0.5:90:1.1", &telescope, 2, "each has one of 2 lines");
    refuse("dwell:0.5:90:0.7", &telescope, 1, "STEP 0.7 Hz is not on");
    refuse("octaves:4:2:1", &telescope, 1, "FMAX 2 Hz is below FMIN 4 Hz");
    refuse("octaves:0.25:499.75:0.5", &(struct design_line_grid){1000, 4000}, 2, "the last line of input 2");
    refuse("linear:0.5:90:0.5", &telescope, 0, "--inputs: 0, expected 1 to 16");
    refuse("linear:0.5:90:0.5", &telescope, 17, "--inputs: 17");
    refuse("dwell:0.00095367431640625:480:0.00095367431640625", &longest, 1, "expected at most 4096");
    refuse("linear:0.00095367431640625:100:0.00095367431640625", &longest, 2, "too long for a table");
}

/// Peak of a flat torque by Schroeder's phases over its lines' amplitude and the root of their number.
static double peak_over_root(const struct design_line_grid *grid, const struct design_lines *lines)
{
    struct design_result result;
    struct design_request request = {.rate_num_hz = (uint32_t)grid->rate_hz,
                                     .rate_den = 1,
                                     .period_samples = grid->period_samples,
                                     .bin_count = lines->count,
                                     .bins = lines->bins,
                                     .limits = {.torque_Nm = 1},
                                     .inertia_kgm2 = 0.005,
                                     .method = "schroeder"};
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, design_run(&request, &result, &error), error.message);
    double amplitude = result.effective_torque_Nm * sqrt(2 / (double)lines->count);
    double peak = 0;
    for (size_t n = 0; n < result.period_samples; n++) {
        peak = fmax(peak, fabs(result.torque_Nm[n]));
    }
    design_result_free(&result);
    return peak / amplitude / sqrt((double)lines->count);
}

static void test_schroeder_peak_grows_with_the_root_of_the_lines(void)
{
    // 20 samples and more per cycle of the highest line, so that the samples find the peaks.
    const struct design_line_grid fine = {.rate_hz = 4000, .period_samples = 40000};
    static const char *const specifications[] = {"linear:0.1:25:0.1", "linear:0.1:50:0.1", "linear:0.1:100:0.1",
                                                 "linear:0.1:200:0.1"};
    for (size_t i = 0; i < 4; i++) {
        parse(specifications[i], &fine, 1);
        double constant = peak_over_root(&fine, &sequence.segments[0].lines[0]);
        printf("%s: peak / sqrt(N) %.4f\n", specifications[i], constant);
        TEST_ASSERT_DOUBLE_WITHIN(peak_spread, peak_constant, constant);
    }
}

static void test_schroeder_peak_of_bands_stays_below_the_root_of_two(void)
{
    parse("octaves:0.1:25:0.1", &spring_masses, 1);
    for (size_t i = 0; i < sequence.segment_count; i++) {
        double constant = peak_over_root(&spring_masses, &sequence.segments[i].lines[0]);
        printf("band %zu: peak / sqrt(N) %.4f\n", i + 1, constant);
        TEST_ASSERT_TRUE(constant >= 1 - rounding && constant <= sqrt(2) + rounding);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_octaves_hold_the_papers_numbers_of_lines);
    RUN_TEST(test_octaves_close_the_last_band_at_fmax);
    RUN_TEST(test_octaves_leave_out_bands_without_a_line);
    RUN_TEST(test_octaves_keep_second_order_products_out_of_their_band);
    RUN_TEST(test_dwell_plays_one_line_after_the_other);
    RUN_TEST(test_any_other_specification_is_one_segment);
    RUN_TEST(test_times_of_the_spring_masses_are_the_papers);
    RUN_TEST(test_times_of_the_telescope_are_the_papers);
    RUN_TEST(test_times_of_a_thousand_lines_are_the_papers);
    RUN_TEST(test_two_inputs_take_twenty_seconds_more);
    RUN_TEST(test_inputs_interleave_at_fractions_of_the_step);
    RUN_TEST(test_inputs_of_kinds_without_a_step_take_every_pth_bin);
    RUN_TEST(test_inputs_of_odd_lines_keep_even_products_away);
    RUN_TEST(test_sequence_refused_with_what_would_do);
    RUN_TEST(test_schroeder_peak_grows_with_the_root_of_the_lines);
    RUN_TEST(test_schroeder_peak_of_bands_stays_below_the_root_of_two);
    return UNITY_END();
}
