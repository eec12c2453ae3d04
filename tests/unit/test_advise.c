/* SPDX-License-Identifier: MIT */
#include "lab/estimate/advise.h"

#include "unity.h"

#include <string.h>

static struct run run;
static double level[8];
static size_t numbers[] = {0, 1, 2, 3, 4, 5, 6, 7};
static struct periodic recording;
static struct estimate_advice advice;

void setUp(void)
{
    run = (struct run){0};
    for (size_t p = 0; p < sizeof level / sizeof level[0]; p++) {
        level[p] = p == 0 ? 0.3 : 0.01;
    }
    recording = (struct periodic){.run = &run,
                                  .input = "torque_Nm",
                                  .output = "velocity_rad_per_s",
                                  .period_samples = 500,
                                  .total = 8,
                                  .used = 8,
                                  .used_periods = numbers,
                                  .transient = {.settled = true},
                                  .output_level = level};
}

void tearDown(void) {}

static void expect(const char *method, const char *text)
{
    TEST_ASSERT_EQUAL_STRING(method, advice.method);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(advice.sentence, text), advice.sentence);
}

static void test_advise_mean_for_a_settled_recording(void)
{
    estimate_advise(&recording, &advice);
    expect("mean", "it repeats every 500 samples, it is settled from the first of 8 periods");
}

static void test_advise_mean_where_the_recording_gives_up_its_settling_periods(void)
{
    run.has_settle_periods = true;
    run.settle_periods = 2;
    recording.used = 6;
    recording.used_periods = numbers + 2;
    recording.transient.periods = 2;
    estimate_advise(&recording, &advice);
    expect("mean", "settled after the 2 of 8 periods");
}

/* A limit cycle or a disturbance makes periods differ from each other, early and late alike: nothing is settled. */
static void test_advise_does_not_call_restless_periods_settled(void)
{
    for (size_t p = 0; p < sizeof level / sizeof level[0]; p++) {
        level[p] = 0.4;
    }
    estimate_advise(&recording, &advice);
    expect("mean", "no transient stands out of what differs from period to period anyway (0.4 of the output)");
    TEST_ASSERT_NULL(strstr(advice.sentence, "it is settled"));
}

static void test_advise_lpm_for_a_transient(void)
{
    recording.transient.periods = 3;
    recording.used = 5;
    recording.used_periods = numbers + 3;
    estimate_advise(&recording, &advice);
    expect("lpm", "a transient (0.3 of the output in the first period) takes 3 of 8 periods to settle, and lpm takes");
    recording.transient.settled = false;
    estimate_advise(&recording, &advice);
    expect("lpm", "it has not settled in its first half");
}

static void test_advise_mean_where_the_transient_costs_little(void)
{
    recording.transient.periods = 1;
    recording.used = 7;
    recording.used_periods = numbers + 1;
    estimate_advise(&recording, &advice);
    expect("mean", "takes 1 of 8 periods to settle, which --settle auto leaves out");
}

static void test_advise_lpm_for_few_periods(void)
{
    recording.total = 3;
    recording.used = 3;
    estimate_advise(&recording, &advice);
    expect("lpm", "not from 3 periods");
}

static void test_advise_names_lost_samples_and_the_loop(void)
{
    static size_t gaps[] = {0, 2, 4, 5, 6, 7};
    recording.used = 6;
    recording.used_periods = gaps;
    recording.lost = 2;
    recording.reference = "velocity_ref_rad_per_s";
    estimate_advise(&recording, &advice);
    expect("mean", "lost samples cost 2 periods and leave 4 in a row");
    expect("mean", "the loop is closed (velocity_ref_rad_per_s)");
    /* What a controller asks for shows no closed loop. */
    recording.reference = "torque_ref_Nm";
    estimate_advise(&recording, &advice);
    TEST_ASSERT_NULL(strstr(advice.sentence, "closed"));
}

static void test_advise_without_period_depends_on_the_loop(void)
{
    struct arbitrary arbitrary = {.run = &run, .input = "torque_Nm", .output = "velocity_rad_per_s", .rows = 900};
    estimate_advise_arbitrary(&arbitrary, &advice);
    expect("lpm", "no set-point shows a closed loop");
    arbitrary.reference = "position_ref_rad";
    arbitrary.lost = 3;
    estimate_advise_arbitrary(&arbitrary, &advice);
    expect("indirect", "position_ref_rad shows that a loop is closed");
    expect("indirect", "3 lost rows leave 900 rows in one piece");
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_advise_mean_for_a_settled_recording);
    RUN_TEST(test_advise_mean_where_the_recording_gives_up_its_settling_periods);
    RUN_TEST(test_advise_does_not_call_restless_periods_settled);
    RUN_TEST(test_advise_lpm_for_a_transient);
    RUN_TEST(test_advise_mean_where_the_transient_costs_little);
    RUN_TEST(test_advise_lpm_for_few_periods);
    RUN_TEST(test_advise_names_lost_samples_and_the_loop);
    RUN_TEST(test_advise_without_period_depends_on_the_loop);
    return UNITY_END();
}
