/* SPDX-License-Identifier: MIT */
/// The command line's options: tools/servoscope/options.h. The parser belongs to no room, so its sources are part of
/// this test.
#include "tools/servoscope/options.c"
#include "tools/servoscope/suggest.c"

#include "unity.h"

#include <string.h>

static bool fast;
static double level;
static double gain;
static long long count;
static const char *out;
static struct option_values runs;
static struct option_values operand_values;
static bool level_given;
static struct error error;

static const struct option options[] = {
    {.name = "fast", .kind = option_flag, .target = &fast},
    {.name = "level", .kind = option_number, .target = &level, .lowest = -2, .highest = 2, .out_given = &level_given},
    {.name = "gain", .kind = option_positive, .target = &gain},
    {.name = "count", .kind = option_integer, .target = &count, .lowest = 1, .highest = 100},
    {.name = "out", .kind = option_text, .target = &out, .required = true},
    {.name = "run", .kind = option_list, .target = &runs},
};
static const struct option_operands operands = {
    .name = "RUN.csv", .at_least = 1, .at_most = 2, .values = &operand_values};

void setUp(void)
{
    fast = false;
    level_given = false;
    level = 0.25;
    gain = 1;
    count = 10;
    out = NULL;
    runs.count = 0;
    error = (struct error){0};
}

void tearDown(void) {}

/// Splits at blanks, as a shell does, and parses.
static int parse(const char *line, const struct option_operands *taken)
{
    static char text[200];
    char *argv[32];
    int argc = 0;
    strcpy(text, line);
    for (char *word = strtok(text, " "); word; word = strtok(NULL, " ")) {
        argv[argc++] = word;
    }
    argv[argc] = NULL;
    return options_parse(argc, argv, options, sizeof options / sizeof options[0], taken, &error);
}

static void test_options_are_read_in_both_forms_and_any_order(void)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(
        0, parse("cmd a.csv --level -0.5 --count=7 b.csv --fast --out=x=y --gain 2e-3", &operands), error.message);
    TEST_ASSERT_TRUE(fast);
    TEST_ASSERT_TRUE(level_given);
    TEST_ASSERT_EQUAL_DOUBLE(-0.5, level);
    TEST_ASSERT_EQUAL_DOUBLE(2e-3, gain);
    TEST_ASSERT_EQUAL_INT64(7, count);
    TEST_ASSERT_EQUAL_STRING("x=y", out);
    TEST_ASSERT_EQUAL_size_t(2, operand_values.count);
    TEST_ASSERT_EQUAL_STRING("b.csv", operand_values.items[1]);
}

static void test_options_that_are_not_given_keep_their_default(void)
{
    TEST_ASSERT_EQUAL_INT(0, parse("cmd --out x", NULL));
    TEST_ASSERT_FALSE(level_given);
    TEST_ASSERT_EQUAL_DOUBLE(0.25, level);
    TEST_ASSERT_EQUAL_INT64(10, count);
}

static void test_options_list_takes_words_up_to_the_next_option(void)
{
    TEST_ASSERT_EQUAL_INT(0, parse("cmd --run a b --out x --run=c --run d", NULL));
    TEST_ASSERT_EQUAL_size_t(4, runs.count);
    TEST_ASSERT_EQUAL_STRING("b", runs.items[1]);
    TEST_ASSERT_EQUAL_STRING("d", runs.items[3]);
}

static void test_options_end_at_two_minus(void)
{
    TEST_ASSERT_EQUAL_INT(0, parse("cmd --out x -- --odd-name", &operands));
    TEST_ASSERT_EQUAL_STRING("--odd-name", operand_values.items[0]);
}

static void test_options_refused_with_name_and_value(void)
{
    static const struct {
        const char *line;
        const char *part;
    } cases[] = {
        {"cmd a", "--out is missing"},
        {"cmd --out x", "RUN.csv is missing"},
        {"cmd a b c --out x", "unexpected 'c'"},
        {"cmd a --out x --speed 3", "unknown option '--speed'"},
        {"cmd a --out x -v", "unknown option '-v'"},
        {"cmd a --out x --out y", "--out is given twice"},
        {"cmd a --out", "--out: needs a value"},
        {"cmd a --out --fast", "--out: needs a value"},
        {"cmd a --out=", "--out: the value is empty"},
        {"cmd a --out x --fast=1", "--fast takes no value, got '1'"},
        {"cmd a --out x --level 1x", "--level: '1x' is not a number"},
        {"cmd a --out x --level nan", "--level: 'nan' is not a number"},
        {"cmd a --out x --level inf", "--level: 'inf' is not a number"},
        {"cmd a --out x --level 0x1", "--level: '0x1' is hexadecimal"},
        {"cmd a --out x --level 1,5", "--level: '1,5' has a decimal comma"},
        {"cmd a --out x --level 3", "--level: '3' is out of range, expected -2 to 2"},
        {"cmd a --out x --gain 0", "--gain: '0', expected a positive number"},
        {"cmd a --out x --count 1.5", "--count: '1.5' is not a whole number"},
        {"cmd a --out x --count 0", "--count: '0' is out of range, expected 1 to 100"},
        {"cmd a --out x --count 99999999999999999999", "is not a whole number"},
        {"cmd a --out x --run", "--run: needs a value"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        setUp();
        TEST_ASSERT_EQUAL_INT_MESSAGE(error_usage, parse(cases[i].line, &operands), cases[i].line);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, cases[i].part), error.message);
    }
}

static void test_options_refuse_operands_where_none_are_taken(void)
{
    TEST_ASSERT_EQUAL_INT(error_usage, parse("cmd --out x stray", NULL));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "unexpected 'stray'"), error.message);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_options_are_read_in_both_forms_and_any_order);
    RUN_TEST(test_options_that_are_not_given_keep_their_default);
    RUN_TEST(test_options_list_takes_words_up_to_the_next_option);
    RUN_TEST(test_options_end_at_two_minus);
    RUN_TEST(test_options_refused_with_name_and_value);
    RUN_TEST(test_options_refuse_operands_where_none_are_taken);
    return UNITY_END();
}
