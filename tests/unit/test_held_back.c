/* SPDX-License-Identifier: MIT */
/// The only run in two: nothing that is judged was fitted, but for a period that leads in.
#include "lab/diagnose/held_back.h"

#include "unity.h"

#include <string.h>

enum { rows = 1000 };

static double values[rows];
static struct run_column column = {(char *)"torque_Nm", values};
static struct run run;
static struct held_back parts;

void setUp(void)
{
    for (size_t i = 0; i < rows; i++)
        values[i] = (double)i;
    run = (struct run){.rows = rows, .column_count = 1, .columns = &column, .sample_rate_hz = 1000.0};
}

void tearDown(void)
{
    held_back_free(&parts);
}

static void test_held_back_without_periods_splits_at_two_thirds(void)
{
    TEST_ASSERT_TRUE(held_back_split(&run, &parts));
    TEST_ASSERT_EQUAL_UINT(666, parts.fitted.rows);
    TEST_ASSERT_EQUAL_UINT(334, parts.judged.rows);
    TEST_ASSERT_EQUAL_UINT(666, parts.first_row);
    TEST_ASSERT_EQUAL_DOUBLE(666.0, parts.judged.columns[0].data[0]);
}

static void test_held_back_keeps_whole_periods_and_one_to_lead_in(void)
{
    run.period_samples = 100;
    run.settle_periods = 1;
    TEST_ASSERT_TRUE(held_back_split(&run, &parts));
    TEST_ASSERT_EQUAL_UINT(700, parts.fitted.rows); // nine counted, a third of them held back
    TEST_ASSERT_EQUAL_UINT(700, parts.first_row);
    TEST_ASSERT_EQUAL_UINT(600, parts.from);
    TEST_ASSERT_EQUAL_UINT(400, parts.judged.rows);
    TEST_ASSERT_EQUAL_UINT(1, parts.judged.settle_periods);
    TEST_ASSERT_EQUAL_DOUBLE(600.0, parts.judged.columns[0].data[0]);
}

static void test_held_back_of_few_periods_splits_as_without(void)
{
    run.period_samples = 200;
    TEST_ASSERT_TRUE(held_back_split(&run, &parts));
    TEST_ASSERT_EQUAL_UINT(666, parts.from);
    TEST_ASSERT_EQUAL_UINT(666, parts.first_row);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_held_back_without_periods_splits_at_two_thirds);
    RUN_TEST(test_held_back_keeps_whole_periods_and_one_to_lead_in);
    RUN_TEST(test_held_back_of_few_periods_splits_as_without);
    return UNITY_END();
}
