/* SPDX-License-Identifier: MIT */
/// The frequency-response section: what it counts, what it leaves out, and that nothing in it is not a number.
#include "lab/estimate/method.h"
#include "lab/estimate/report.h"
#include "lab/page/page.h"

#include "unity.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { lines = 8, many_lines = 10000, page_bytes_max = 500000 };

static struct frf frf;
static char *text;

void setUp(void)
{
    struct error error;
    TEST_ASSERT_EQUAL(0, frf_alloc(&frf, lines, &error));
    TEST_ASSERT_TRUE(frf_set_text(&frf.input, "torque_Nm") && frf_set_text(&frf.output, "velocity_rad_per_s") &&
                     frf_set_text(&frf.units, "rad_per_s/Nm") && frf_set_text(&frf.method, "mean"));
    frf.periods = 10;
    frf.degrees_of_freedom = 18;
    for (size_t k = 0; k < lines; k++) {
        frf.frequency_hz[k] = 1.0 + (double)k;
        frf.real[k] = 0.0;
        frf.imag[k] = -1.0 / frf.frequency_hz[k];
        frf.std[k] = frf.noise_std[k] = 0.01;
        frf.valid[k] = true;
    }
}

void tearDown(void)
{
    frf_free(&frf);
    free(text);
    text = NULL;
}

static void write_section(const struct frf_report_options *options)
{
    size_t size = 0;
    struct page page;
    FILE *stream = open_memstream(&text, &size);
    TEST_ASSERT_NOT_NULL(stream);
    page_start(&page, stream, "test", NULL);
    frf_report_section(&page, &frf, options);
    TEST_ASSERT_EQUAL(0, page_end(&page, NULL));
    fclose(stream);
    const char *body = strstr(text, "<main>");
    TEST_ASSERT_NOT_NULL(body);
    TEST_ASSERT_NULL(strstr(body, "nan"));
    TEST_ASSERT_NULL(strstr(body, "inf"));
}

static void says(const char *part)
{
    TEST_ASSERT_TRUE_MESSAGE(strstr(text, part) != NULL, part);
}

static void does_not_say(const char *part)
{
    TEST_ASSERT_TRUE_MESSAGE(strstr(text, part) == NULL, part);
}

/// How many series of a class the figures have, their samples in the legend not counted: "ln" lines, "pt" points, "sp"
/// spans, "bd" bands.
static size_t count_paths(const char *class_name)
{
    char begin[32];
    size_t found = 0;
    snprintf(begin, sizeof begin, "<path class=\"%s ", class_name);
    for (const char *at = strstr(text, "<svg class=\"pl\""); at && (at = strstr(at, begin)); at++) {
        const char *name = strstr(at, " data-n=");
        found += name && name < strchr(at, '>');
    }
    return found;
}

static void test_frf_report_counts_valid_lines(void)
{
    frf.valid[3] = false;
    write_section(NULL);
    says("7 of 8 lines valid");
    says("magnitude in dB, 0 dB is 1 (rad/s)/Nm");
    does_not_say("less model");
    does_not_say("known delay");
}

static void test_frf_report_counts_lines_beyond_two_std(void)
{
    // A model at every other line; at 1 Hz it is off by 1.9 std, at 3 Hz by 2.1 std, elsewhere exact.
    double frequency[] = {1.0, 3.0, 5.0, 7.0, 9.5};
    double real[] = {0.019, 0.021, 0.0, 0.0, 0.0};
    double imag[] = {-1.0, -1.0 / 3.0, -1.0 / 5.0, -1.0 / 7.0, 0.0};
    const struct frf_model_curve curve = {"nominal model", 5, frequency, real, imag, NULL, false};
    const struct frf_report_options options = {
        .known_delay_s = 0.0005, .delay_reason = "half a sample", .curve_count = 1, .curves = &curve};
    write_section(&options);
    says("off by more than 2 std at 1 of 4 lines; noise alone would do that at 3.7 % of them"); // F(2, 18) above 4
    says("known delay of 0.5 ms (half a sample) is taken out of the phase shown");
    says("residual over 2 std: measured less model");
}

static void test_frf_report_skips_invalid_lines_in_the_count(void)
{
    const struct frf_model_curve curve = {"shifted", lines, frf.frequency_hz, frf.imag, frf.imag, NULL, false};
    const struct frf_report_options options = {.curve_count = 1, .curves = &curve};
    frf.valid[0] = frf.valid[7] = false;
    write_section(&options);
    says("off by more than 2 std at 6 of 6 lines");
}

static void test_frf_report_shows_noise_apart_only_where_it_differs(void)
{
    write_section(NULL);
    does_not_say("std of the noise");
    free(text);
    frf.std[2] = 0.05;
    write_section(NULL);
    says("std of the noise");
    says("std, total");
}

static void test_frf_report_takes_unknown_and_zero_numbers(void)
{
    frf.std[0] = frf.noise_std[0] = FRF_UNKNOWN;
    frf.std[1] = frf.noise_std[1] = 0.0;
    frf.imag[2] = 0.0; // no magnitude: no place on a scale in dB
    write_section(NULL);
    says("8 of 8 lines valid");
}

static void test_frf_report_takes_no_valid_line(void)
{
    for (size_t k = 0; k < lines; k++) {
        frf.valid[k] = false;
    }
    write_section(NULL);
    says("0 of 8 lines valid");
    says("no data");
}

/* Magnitude, phase, std and residual: all of them points. */
static void test_frf_report_joins_no_measured_lines(void)
{
    write_section(NULL);
    TEST_ASSERT_EQUAL_UINT(0, count_paths("ln"));
    TEST_ASSERT_EQUAL_UINT(2, count_paths("sp"));
    says(">measured<");
    says("residual over 2 std: measured less smooth curve");
}

static void test_frf_report_calls_a_model_a_model(void)
{
    TEST_ASSERT_TRUE(frf_set_text(&frf.method, "parametric"));
    write_section(NULL);
    says(">model, not measured<");
    does_not_say(">measured<");
    does_not_say("from neighbours");
    TEST_ASSERT_EQUAL_UINT(2, count_paths("ln")); // magnitude and phase
}

/* A model with its own std beside the measured lines: one band, one line in each of two panels. */
static void test_frf_report_draws_a_model_with_its_region(void)
{
    double std[lines];
    for (size_t k = 0; k < lines; k++) {
        std[k] = 0.02;
    }
    const struct frf_model_curve curve = {"two masses", lines, frf.frequency_hz, frf.real, frf.imag, std, false};
    const struct frf_report_options options = {.curve_count = 1, .curves = &curve};
    write_section(&options);
    TEST_ASSERT_EQUAL_UINT(2, count_paths("ln"));
    TEST_ASSERT_EQUAL_UINT(1, count_paths("bd"));
    says(">measured<");
    says(">two masses<");
}

static void test_frf_report_joins_no_lines_of_a_model_simulated_at_them(void)
{
    const struct frf_model_curve curve = {"simulated", lines, frf.frequency_hz, frf.real, frf.imag, NULL, true};
    const struct frf_report_options options = {.curve_count = 1, .curves = &curve};
    write_section(&options);
    TEST_ASSERT_EQUAL_UINT(0, count_paths("ln"));
    says(">simulated<");
}

/* Without colour a triangle is a path of three sides, a square one of four, and a dot has no length. */
static void test_frf_report_overlays_runs_in_shapes_of_their_own(void)
{
    const struct frf runs[] = {frf, frf};
    static const char *const names[] = {"run1.csv", "run2.csv"};
    const struct frf_report_options options = {.run_count = 2, .runs = runs, .run_names = names};
    write_section(&options);
    says(">run1.csv<");
    says(">run2.csv<");
    says("mean of 2 runs");
    says("<path class=\"pt mf c2\"");
    says("<path class=\"pt mf c3\"");
    says("<path class=\"pt mc c1\"");
    says("difference over 2 std, from run1.csv");
    says("lies 0 dB higher than run1.csv (median of 8 lines in common)");
    says("more than 2 std of the difference apart at 0 of 8 lines");
}

/* Lines of its own: 6 % and 5 % more at 2 and 4 Hz are 0.03 and 0.0125 apart; with a std of 0.01 each, 2 std of the
   difference are 0.0283. */
static void test_frf_report_holds_a_saved_response_against_this_one(void)
{
    struct frf other;
    struct error error;
    TEST_ASSERT_EQUAL(0, frf_alloc(&other, 5, &error));
    for (size_t k = 0; k < 5; k++) {
        other.frequency_hz[k] = 2.0 * (double)(k + 1);
        other.imag[k] = -(k == 0 ? 1.06 : 1.05) / other.frequency_hz[k];
        other.std[k] = other.noise_std[k] = 0.01;
        other.valid[k] = k != 3;
    }
    TEST_ASSERT_TRUE(frf_set_text(&other.units, "rad_per_s/Nm"));
    static const char *const names[] = {"before.csv"};
    const struct frf_report_options options = {
        .name = "after.csv", .other_count = 1, .others = &other, .other_names = names};
    write_section(&options);
    frf_free(&other);
    says(">after.csv<");
    does_not_say(">measured<");
    says(">before.csv<");
    says("difference over 2 std, from after.csv");
    says("lies 0.42 dB higher than after.csv (median of 3 lines in common)"); // 10 Hz is not there, 8 Hz not valid
    says("apart at 1 of 3 lines");
    says("furthest at 2 Hz, 1.06 times 2 std");
}

static void test_frf_report_takes_the_known_delay_of_a_held_input(void)
{
    TEST_ASSERT_TRUE(estimate_set_key(&frf, "hold", "zoh") && estimate_set_key(&frf, "sample_rate_hz", "500"));
    TEST_ASSERT_EQUAL_DOUBLE(0.001, frf_report_known_delay_s(&frf));
    write_section(NULL);
    says("known delay of 1 ms (half a sample: the input is held between samples) is taken out of the phase shown");
}

static void test_frf_report_says_when_runs_are_too_many_to_draw(void)
{
    const struct frf runs[frf_report_overlays_max + 1] = {frf, frf, frf, frf, frf, frf, frf, frf};
    static const char *const names[frf_report_overlays_max + 1] = {"1", "2", "3", "4", "5", "6", "7", "8"};
    const struct frf_report_options options = {
        .run_count = frf_report_overlays_max + 1, .runs = runs, .run_names = names};
    write_section(&options);
    says("8 runs are too many to be drawn one by one");
}

static void test_frf_report_reaches_as_far_as_95_percent(void)
{
    write_section(NULL);
    says("\xC2\xB1"
         "2 std");
    free(text);
    TEST_ASSERT_TRUE(estimate_set_key(&frf, "confidence_95_factor", "4.3589"));
    write_section(NULL);
    says("95 %: \xC2\xB1"
         "4.36 std");
}

static void test_frf_report_knows_what_there_was_instead_of_periods(void)
{
    frf.periods = 0;
    TEST_ASSERT_TRUE(estimate_set_key(&frf, "rows", "60000"));
    write_section(NULL);
    does_not_say("0 periods");
    says("from 60000 rows without a period");
    free(text);
    TEST_ASSERT_TRUE(estimate_set_key(&frf, "segments", "28"));
    write_section(NULL);
    says("from 28 segments of 60000 rows without a period");
    free(text);
    frf.periods = 1;
    write_section(NULL);
    says("from 1 period,");
}

static void test_frf_report_writes_degrees_of_freedom_out(void)
{
    frf.degrees_of_freedom = 8640;
    write_section(NULL);
    says("with 8640 degrees of freedom");
    free(text);
    frf.degrees_of_freedom = 0; // not known
    write_section(NULL);
    does_not_say("degrees of freedom");
}

static void test_frf_report_states_a_delay_that_is_gone_already(void)
{
    TEST_ASSERT_TRUE(estimate_set_key(&frf, "delay_removed_s", "0.002"));
    write_section(NULL);
    says("A known delay of 2 ms has been taken out of the response, here and in its file.");
}

static void test_frf_report_shows_coherence_where_there_is_one(void)
{
    write_section(NULL);
    does_not_say("coherence");
    free(text);
    frf.coherence[4] = 0.9;
    write_section(NULL);
    says(">coherence<");
}

/* Nine lines can be compared with their neighbours; these lie on 1/f exactly. */
static void test_frf_report_counts_lines_off_the_smooth_curve(void)
{
    struct error error;
    frf_free(&frf);
    TEST_ASSERT_EQUAL(0, frf_alloc(&frf, 40, &error));
    TEST_ASSERT_TRUE(frf_set_text(&frf.input, "torque_Nm") && frf_set_text(&frf.output, "velocity_rad_per_s") &&
                     frf_set_text(&frf.units, "rad_per_s/Nm") && frf_set_text(&frf.method, "mean"));
    for (size_t k = 0; k < 40; k++) {
        frf.frequency_hz[k] = 1.0 + (double)k;
        frf.imag[k] = -1.0 / frf.frequency_hz[k] + (k == 20 ? 0.01 : 0.0);
        frf.std[k] = frf.noise_std[k] = 0.001;
        frf.valid[k] = true;
    }
    write_section(NULL);
    says("1 of 40 lines are more than 2 std of the difference away");
}

/* The largest page that is promised: every panel, two standard deviations, a model. */
static void test_frf_report_of_10000_lines_stays_light(void)
{
    struct error error;
    frf_free(&frf);
    TEST_ASSERT_EQUAL(0, frf_alloc(&frf, many_lines, &error));
    TEST_ASSERT_TRUE(frf_set_text(&frf.input, "torque_Nm") && frf_set_text(&frf.output, "velocity_rad_per_s") &&
                     frf_set_text(&frf.units, "rad_per_s/Nm") && frf_set_text(&frf.method, "h1"));
    uint32_t state = 1;
    for (size_t k = 0; k < many_lines; k++) {
        state = state * 1664525u + 1013904223u; // scattered, so that few points fall on each other
        const double noise = (double)(state >> 8) / (double)(1u << 24) + 0.01;
        frf.frequency_hz[k] = 1.0 + (double)k;
        frf.real[k] = 0.5 * noise / frf.frequency_hz[k];
        frf.imag[k] = -1.0 / frf.frequency_hz[k];
        frf.std[k] = noise / frf.frequency_hz[k];
        frf.noise_std[k] = 0.5 * noise * noise / frf.frequency_hz[k];
        frf.coherence[k] = 1.0 - 0.5 * noise;
        frf.valid[k] = true;
    }
    const struct frf_model_curve curve = {"model", many_lines, frf.frequency_hz, frf.noise_std, frf.imag,
                                          frf.std, false};
    const struct frf_report_options options = {.curve_count = 1, .curves = &curve};
    write_section(&options);
    TEST_ASSERT_LESS_THAN_UINT(page_bytes_max, strlen(text));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_frf_report_counts_valid_lines);
    RUN_TEST(test_frf_report_counts_lines_beyond_two_std);
    RUN_TEST(test_frf_report_skips_invalid_lines_in_the_count);
    RUN_TEST(test_frf_report_shows_noise_apart_only_where_it_differs);
    RUN_TEST(test_frf_report_takes_unknown_and_zero_numbers);
    RUN_TEST(test_frf_report_takes_no_valid_line);
    RUN_TEST(test_frf_report_joins_no_measured_lines);
    RUN_TEST(test_frf_report_calls_a_model_a_model);
    RUN_TEST(test_frf_report_draws_a_model_with_its_region);
    RUN_TEST(test_frf_report_joins_no_lines_of_a_model_simulated_at_them);
    RUN_TEST(test_frf_report_overlays_runs_in_shapes_of_their_own);
    RUN_TEST(test_frf_report_holds_a_saved_response_against_this_one);
    RUN_TEST(test_frf_report_takes_the_known_delay_of_a_held_input);
    RUN_TEST(test_frf_report_says_when_runs_are_too_many_to_draw);
    RUN_TEST(test_frf_report_reaches_as_far_as_95_percent);
    RUN_TEST(test_frf_report_knows_what_there_was_instead_of_periods);
    RUN_TEST(test_frf_report_writes_degrees_of_freedom_out);
    RUN_TEST(test_frf_report_states_a_delay_that_is_gone_already);
    RUN_TEST(test_frf_report_shows_coherence_where_there_is_one);
    RUN_TEST(test_frf_report_counts_lines_off_the_smooth_curve);
    RUN_TEST(test_frf_report_of_10000_lines_stays_light);
    return UNITY_END();
}
