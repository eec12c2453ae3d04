/* SPDX-License-Identifier: MIT */
/// What a cause earns on unseen data is judged beside what it earns where it was fitted.
#include "lab/diagnose/cause_gain.h"

#include "unity.h"

static struct diagnosis_cause cause;

void setUp(void)
{
    cause = (struct diagnosis_cause){.evidence = 10000.0};
}

void tearDown(void) {}

static void test_cause_gain_that_shows_is_neither_hidden_nor_harm(void)
{
    cause.gain.unseen_nats = 4000.0;
    TEST_ASSERT_FALSE(cause_gain_is_hidden(&cause));
    TEST_ASSERT_FALSE(cause_gain_is_harm(&cause));
}

static void test_cause_gain_of_next_to_nothing_is_hidden_and_no_harm(void)
{
    cause.gain.unseen_nats = 60.0;
    TEST_ASSERT_TRUE(cause_gain_is_hidden(&cause));
    cause.gain.unseen_nats = -60.0;
    TEST_ASSERT_TRUE(cause_gain_is_hidden(&cause));
    TEST_ASSERT_FALSE(cause_gain_is_harm(&cause));
}

static void test_cause_gain_of_a_faint_cause_has_a_floor(void)
{
    cause.evidence = 30.0;
    cause.gain.unseen_nats = -8.0; // chance
    TEST_ASSERT_FALSE(cause_gain_is_harm(&cause));
    cause.gain.unseen_nats = -20.0;
    TEST_ASSERT_TRUE(cause_gain_is_harm(&cause));
}

static void test_cause_gain_that_costs_is_harm(void)
{
    cause.gain.unseen_nats = -1200.0;
    TEST_ASSERT_TRUE(cause_gain_is_harm(&cause));
    TEST_ASSERT_FALSE(cause_gain_is_hidden(&cause));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_cause_gain_that_shows_is_neither_hidden_nor_harm);
    RUN_TEST(test_cause_gain_of_next_to_nothing_is_hidden_and_no_harm);
    RUN_TEST(test_cause_gain_of_a_faint_cause_has_a_floor);
    RUN_TEST(test_cause_gain_that_costs_is_harm);
    return UNITY_END();
}
