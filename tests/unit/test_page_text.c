/* SPDX-License-Identifier: MIT */
/// Texts of a page: escaped, wrapped, cut between characters: lab/page/text.h.
#include "lab/page/text.h"

#include "unity.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static char *text;
static size_t text_length;
static FILE *out;

void setUp(void)
{
    out = open_memstream(&text, &text_length);
}

void tearDown(void)
{
    fclose(out);
    free(text);
}

static const char *written(void)
{
    fflush(out);
    return text;
}

static void test_text_escapes_markup_characters(void)
{
    text_write(out, "a<b> & \"c\" 'd'");
    TEST_ASSERT_EQUAL_STRING("a&lt;b&gt; &amp; &quot;c&quot; &#39;d&#39;", written());
}

static void test_text_keeps_valid_utf8_and_replaces_the_rest(void)
{
    static const char *const cases[][2] = {
        {"\xC2\xB5m \xE2\x88\x92 \xF0\x9F\x98\x80", "\xC2\xB5m \xE2\x88\x92 \xF0\x9F\x98\x80"},
        {"a\xFFz", "a\xEF\xBF\xBDz"},                             /* no such byte */
        {"\xC0\xAF", "\xEF\xBF\xBD\xEF\xBF\xBD"},                 /* overlong slash */
        {"\xE2\x88", "\xEF\xBF\xBD\xEF\xBF\xBD"},                 /* cut short */
        {"\xED\xA0\x80", "\xEF\xBF\xBD\xEF\xBF\xBD\xEF\xBF\xBD"}, /* a surrogate */
        {"a\x01\x7Fz", "a\xEF\xBF\xBD\xEF\xBF\xBDz"},             /* control characters */
        {"a\tb\nc", "a b c"},
    };
    for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        rewind(out);
        text_write(out, cases[n][0]);
        fputc('\0', out);
        TEST_ASSERT_EQUAL_STRING(cases[n][1], written());
    }
}

static void test_text_shorten_keeps_both_ends(void)
{
    char buffer[16];
    text_shorten("short", sizeof buffer, buffer);
    TEST_ASSERT_EQUAL_STRING("short", buffer);
    text_shorten("a_long_name_of_a_run.csv", sizeof buffer, buffer);
    TEST_ASSERT_EQUAL_STRING("a_long_n\xE2\x80\xA6.csv", buffer);
    text_shorten("\xE2\x88\x92\xE2\x88\x92\xE2\x88\x92\xE2\x88\x92\xE2\x88\x92\xE2\x88\x92", sizeof buffer, buffer);
    TEST_ASSERT_EQUAL_STRING("\xE2\x88\x92\xE2\x88\x92\xE2\x80\xA6\xE2\x88\x92", buffer); // no character cut in two
}

static void test_text_copy_cuts_between_characters(void)
{
    char buffer[6];
    text_copy("abc\xE2\x88\x92", sizeof buffer, buffer);
    TEST_ASSERT_EQUAL_STRING("abc", buffer);
    text_copy("ab\xE2\x88\x92", sizeof buffer, buffer);
    TEST_ASSERT_EQUAL_STRING("ab\xE2\x88\x92", buffer);
    text_copy(NULL, sizeof buffer, buffer);
    TEST_ASSERT_EQUAL_STRING("", buffer);
}

static void test_text_wrap_breaks_at_spaces_and_loses_nothing(void)
{
    const char *words = "measured with the table of the first run";
    struct text_span line[8];
    int cut = 1;
    size_t lines = text_wrap(words, 10.0, 8, line, &cut);
    TEST_ASSERT_GREATER_THAN(1, lines);
    TEST_ASSERT_EQUAL(0, cut);
    size_t letters = 0;
    for (size_t n = 0; n < lines; n++) {
        TEST_ASSERT_TRUE(text_measure_em(line[n]) <= 10.0);
        TEST_ASSERT_TRUE(line[n].start[0] != ' ' && line[n].start[line[n].length - 1] != ' ');
        letters += line[n].length;
    }
    TEST_ASSERT_EQUAL(strlen(words) - (lines - 1), letters);
    TEST_ASSERT_EQUAL(1, text_wrap(words, 10.0, 1, line, &cut));
    TEST_ASSERT_EQUAL(1, cut);
    TEST_ASSERT_EQUAL(8, text_wrap("unbreakable_and_far_too_long_for_one_line", 2.0, 8, line, NULL));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_text_escapes_markup_characters);
    RUN_TEST(test_text_keeps_valid_utf8_and_replaces_the_rest);
    RUN_TEST(test_text_shorten_keeps_both_ends);
    RUN_TEST(test_text_copy_cuts_between_characters);
    RUN_TEST(test_text_wrap_breaks_at_spaces_and_loses_nothing);
    return UNITY_END();
}
