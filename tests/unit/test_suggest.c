/* SPDX-License-Identifier: MIT */
/// The names of a command line belong to no room, so the source is part of this test.
#include "tools/servoscope/suggest.c"

#include "unity.h"

#include <string.h>

void setUp(void) {}

void tearDown(void) {}

static const char *meant(const char *word)
{
    static const char *const names[] = {"limit-position", "limit-velocity", "limit-torque", "out", "rate",
                                        "report",         "method",         "seed",         "for"};
    struct suggestion self;
    suggest_begin(&self, word, strlen(word));
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        suggest_consider(&self, names[i]);
    }
    const char *found = suggest_found(&self);
    return found ? found : "";
}

static void test_suggest_finds_the_name_with_a_letter_wrong_missing_too_many_or_swapped(void)
{
    TEST_ASSERT_EQUAL_STRING("method", meant("methid"));
    TEST_ASSERT_EQUAL_STRING("method", meant("metod"));
    TEST_ASSERT_EQUAL_STRING("method", meant("metthod"));
    TEST_ASSERT_EQUAL_STRING("method", meant("mehtod"));
    TEST_ASSERT_EQUAL_STRING("report", meant("reprot"));
    TEST_ASSERT_EQUAL_STRING("limit-position", meant("limt-positon"));
    TEST_ASSERT_EQUAL_STRING("out", meant("otu"));
}

static void test_suggest_takes_the_beginning_of_one_name_and_of_several_none(void)
{
    TEST_ASSERT_EQUAL_STRING("limit-velocity", meant("limit-v"));
    TEST_ASSERT_EQUAL_STRING("report", meant("rep"));
    TEST_ASSERT_EQUAL_STRING("", meant("limit-"));
}

static void test_suggest_finds_nothing_for_what_is_far_short_or_long(void)
{
    TEST_ASSERT_EQUAL_STRING("", meant("gravity"));
    TEST_ASSERT_EQUAL_STRING("", meant("x"));
    TEST_ASSERT_EQUAL_STRING("", meant(""));
    TEST_ASSERT_EQUAL_STRING("", meant("a-word-that-is-longer-than-any-name-of-an-option-may-be"));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_suggest_finds_the_name_with_a_letter_wrong_missing_too_many_or_swapped);
    RUN_TEST(test_suggest_takes_the_beginning_of_one_name_and_of_several_none);
    RUN_TEST(test_suggest_finds_nothing_for_what_is_far_short_or_long);
    return UNITY_END();
}
