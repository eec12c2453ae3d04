/* SPDX-License-Identifier: MIT */
/// Which lines a specification means: lab/design/lines.h.
#include "lab/design/lines.h"

#include "unity.h"

#include <stdio.h>
#include <string.h>

static const struct design_line_grid half_hertz = {.rate_hz = 1000, .period_samples = 2000};
static struct design_lines lines;
static struct error error;

void setUp(void)
{
    lines = (struct design_lines){0};
    error = (struct error){0};
}

void tearDown(void)
{
    design_lines_free(&lines);
}

static int parse(const char *specification)
{
    design_lines_free(&lines);
    return design_lines_parse(specification, &half_hertz, 7, &lines, &error);
}

static void assert_refused(int status, const char *specification, const char *part)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(status, parse(specification), specification);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, part), error.message);
    TEST_ASSERT_NULL(lines.bins);
    TEST_ASSERT_EQUAL_size_t(0, lines.count);
}

static void test_lines_linear_covers_both_ends(void)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, parse("linear:0.5:100:0.5"), error.message);
    TEST_ASSERT_EQUAL_size_t(200, lines.count);
    for (uint32_t k = 0; k < 200; k++) {
        TEST_ASSERT_EQUAL_UINT32(k + 1, lines.bins[k]);
    }
}

static void test_lines_of_a_sequence_are_those_of_linear(void)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, parse("octaves:0.5:100:0.5"), error.message);
    TEST_ASSERT_EQUAL_size_t(200, lines.count);
    TEST_ASSERT_EQUAL_UINT32(1, lines.step_bins);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, parse("dwell:1:100:1.5"), error.message);
    TEST_ASSERT_EQUAL_size_t(67, lines.count);
    TEST_ASSERT_EQUAL_UINT32(3, lines.step_bins);
}

static void test_lines_linear_stops_below_fmax_when_the_step_misses_it(void)
{
    const uint32_t expected[] = {2, 5, 8};
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, parse("linear:1:5.4:1.5"), error.message);
    TEST_ASSERT_EQUAL_size_t(3, lines.count);
    TEST_ASSERT_EQUAL_UINT32_ARRAY(expected, lines.bins, 3);
}

static void test_lines_linear_reaches_the_highest_bin(void)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, parse("linear:499:499.5:0.5"), error.message);
    TEST_ASSERT_EQUAL_UINT32(999, lines.bins[1]);
}

static void test_lines_odd_takes_odd_multiples_only(void)
{
    const uint32_t expected[] = {3, 5, 7, 9};
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, parse("odd:1:5:0.5"), error.message);
    TEST_ASSERT_EQUAL_size_t(4, lines.count);
    TEST_ASSERT_EQUAL_UINT32_ARRAY(expected, lines.bins, 4);
}

static void test_lines_random_odd_leaves_one_of_each_four_out(void)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, parse("random-odd:0.5:99.5:0.5"), error.message);
    TEST_ASSERT_EQUAL_size_t(75, lines.count); // 100 odd bins 1 .. 199, 25 groups
    size_t in_group[25] = {0};
    for (size_t k = 0; k < lines.count; k++) {
        TEST_ASSERT_EQUAL_UINT32(1, lines.bins[k] % 2);
        in_group[(lines.bins[k] - 1) / 8]++;
    }
    for (size_t group = 0; group < 25; group++) {
        TEST_ASSERT_EQUAL_size_t(3, in_group[group]);
    }
}

static void test_lines_random_odd_follows_the_seed(void)
{
    struct design_lines again;
    struct design_lines other;
    TEST_ASSERT_EQUAL_INT(0, parse("random-odd:0.5:99.5:0.5"));
    TEST_ASSERT_EQUAL_INT(0, design_lines_parse("random-odd:0.5:99.5:0.5", &half_hertz, 7, &again, &error));
    TEST_ASSERT_EQUAL_INT(0, design_lines_parse("random-odd:0.5:99.5:0.5", &half_hertz, 8, &other, &error));
    TEST_ASSERT_EQUAL_UINT32_ARRAY(lines.bins, again.bins, 75);
    TEST_ASSERT_NOT_EQUAL(0, memcmp(lines.bins, other.bins, 75 * sizeof *lines.bins));
    design_lines_free(&again);
    design_lines_free(&other);
}

static void test_lines_quasilog_grows_by_the_ratio(void)
{
    const struct design_line_grid one_hertz = {.rate_hz = 32768, .period_samples = 32768};
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, design_lines_parse("quasilog:1:10000:1.05", &one_hertz, 0, &lines, &error),
                                  error.message);
    for (size_t k = 1; k < lines.count; k++) {
        uint32_t before = lines.bins[k - 1];
        uint32_t grown = (uint32_t)(1.05 * before + 0.5);
        TEST_ASSERT_EQUAL_UINT32(grown > before + 1 ? grown : before + 1, lines.bins[k]);
    }
    TEST_ASSERT_TRUE(lines.bins[lines.count - 1] <= 10000 && lines.bins[lines.count - 1] * 1.05 > 10000 - 0.5);
}

static void write_list(const char *text)
{
    FILE *stream = fopen("lines.txt", "w");
    TEST_ASSERT_NOT_NULL(stream);
    fputs(text, stream);
    fclose(stream);
}

static void test_lines_list_sorts_and_skips_comments(void)
{
    const uint32_t expected[] = {1, 4, 20};
    write_list("# mine\n10\n\n0.5 # first\r\n  2\n");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, parse("list:lines.txt"), error.message);
    TEST_ASSERT_EQUAL_size_t(3, lines.count);
    TEST_ASSERT_EQUAL_UINT32_ARRAY(expected, lines.bins, 3);
}

static void test_lines_list_names_file_and_line_of_what_it_refuses(void)
{
    write_list("1\n2\nnan\n");
    assert_refused(error_refused, "list:lines.txt", "lines.txt:3: 'nan'");
    write_list("1\n\n0.7\n");
    assert_refused(error_refused, "list:lines.txt", "lines.txt:3: frequency 0.7 Hz is not on");
    write_list("1\n2\n1\n");
    assert_refused(error_refused, "list:lines.txt", "lines.txt:3: 1 Hz is there twice");
    write_list("1\n700\n");
    assert_refused(error_refused, "list:lines.txt", "lines.txt:2: frequency 700 Hz is too high");
    write_list("# nothing\n");
    assert_refused(error_usage, "list:lines.txt", "no line is left");
    assert_refused(error_refused, "list:does-not-exist.txt", "does-not-exist.txt: cannot be opened");
}

static void test_lines_refused_with_value_and_expectation(void)
{
    static const struct {
        const char *specification;
        const char *part;
    } cases[] = {
        {"", "expected linear:"},
        {"linear", "expected three numbers"},
        {"linear:1:2", "expected three numbers"},
        {"linear:1:2:1:1", "expected three numbers"},
        {"linear:1:2:x", "'x' is not a number"},
        {"linear:1:2:nan", "'nan' is not a number"},
        {"linear:1:2:", "is empty"},
        {"linear:0:2:1", "'0' is not positive"},
        {"linear:1:2:-1", "'-1' is not positive"},
        {"linear:5:2:1", "FMAX 2 Hz is below FMIN 5 Hz"},
        {"linear:0.7:2:0.5", "FMIN 0.7 Hz is not on the period's grid of 0.5 Hz; the nearest is 0.5 Hz"},
        {"linear:0.5:2:0.3", "STEP 0.3 Hz is not on"},
        {"linear:0.5:500:0.5", "FMAX 500 Hz is too high, half the rate is 500 Hz and the highest line 499.5 Hz"},
        {"linear:0.5:1e300:0.5", "is too high"},
        {"odd:2:2.4:1", "no line is left"},
        {"quasilog:1:10:1", "RATIO 1, expected a number above 1"},
        {"list:", "expected linear:"},
        {"octaves:1:10", "expected three numbers, octaves:FMIN:FMAX:STEP"},
        {"cubic:1:10:1", "expected linear:"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        assert_refused(error_usage, cases[i].specification, cases[i].part);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_lines_linear_covers_both_ends);
    RUN_TEST(test_lines_of_a_sequence_are_those_of_linear);
    RUN_TEST(test_lines_linear_stops_below_fmax_when_the_step_misses_it);
    RUN_TEST(test_lines_linear_reaches_the_highest_bin);
    RUN_TEST(test_lines_odd_takes_odd_multiples_only);
    RUN_TEST(test_lines_random_odd_leaves_one_of_each_four_out);
    RUN_TEST(test_lines_random_odd_follows_the_seed);
    RUN_TEST(test_lines_quasilog_grows_by_the_ratio);
    RUN_TEST(test_lines_list_sorts_and_skips_comments);
    RUN_TEST(test_lines_list_names_file_and_line_of_what_it_refuses);
    RUN_TEST(test_lines_refused_with_value_and_expectation);
    return UNITY_END();
}
