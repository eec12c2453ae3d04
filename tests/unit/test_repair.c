/* SPDX-License-Identifier: MIT */
/// Rows that repeat the one before are found and filled so that what was lost is nearly back.
#include "lab/diagnose/repair.h"

#include "unity.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { period = 400, rows = 5 * period };

static const double two_pi = 6.283185307179586;

static struct run run;
static double *torque, *position, *velocity;
static double whole[rows];
static bool lost[rows];
static struct repair_finding finding;

static double course(size_t n)
{
    double phase = two_pi * (double)n / period;
    return sin(3 * phase) + 0.3 * cos(11 * phase) + 0.2 * (double)n / rows; // and a drift
}

void setUp(void)
{
    memset(&run, 0, sizeof run);
    run.sample_rate_hz = 1000.0;
    run.rows = rows;
    torque = run_add_column(&run, "torque_Nm");
    position = run_add_column(&run, "position_rad");
    velocity = run_add_column(&run, "velocity_rad_per_s");
    for (size_t n = 0; n < rows; n++) {
        whole[n] = position[n] = course(n);
        torque[n] = 0.5 * course(n + 7);
        velocity[n] = course(n + 90);
    }
}

void tearDown(void)
{
    run_free(&run);
}

/// Row n repeats the row before in every column.
static void lose(size_t n)
{
    double *columns[] = {torque, position, velocity};
    for (size_t i = 0; i < 3; i++)
        columns[i][n] = columns[i][n - 1];
}

static void test_repair_marks_nothing_in_a_whole_run(void)
{
    TEST_ASSERT_EQUAL_UINT(0, repair_find(&run, lost, &finding));
    TEST_ASSERT_EQUAL_INT(-1, finding.effect);
}

static void test_repair_finds_the_rows_that_repeat_and_says_their_share(void)
{
    size_t count = 0;
    for (size_t n = 30; n + 2 < rows; n += 50, count++)
        lose(n);
    TEST_ASSERT_EQUAL_UINT(count, repair_find(&run, lost, &finding));
    TEST_ASSERT_TRUE(finding.effect >= 0);
    TEST_ASSERT_EQUAL_STRING("lost_samples", sim_effects[finding.effect]->id);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, (double)count / rows, finding.values[0]); // of the rows that could be lost
    TEST_ASSERT_TRUE(finding.evidence > 12.0);
    for (size_t n = 0; n < rows; n++)
        TEST_ASSERT_EQUAL_INT(n >= 30 && (n - 30) % 50 == 0 && n + 2 < rows, lost[n]);
}

static void test_repair_marks_what_the_file_says_is_not_valid(void)
{
    double *valid = run_add_column(&run, "valid");
    for (size_t n = 0; n < rows; n++)
        valid[n] = n != 17;
    TEST_ASSERT_EQUAL_UINT(1, repair_find(&run, lost, &finding));
    TEST_ASSERT_TRUE(lost[17]);
    TEST_ASSERT_EQUAL_INT(-1, finding.effect);
}

/// The other periods know the course, the rows about the gap how far it has drifted: what is left is how much the drift
/// bends within a gap, which here is nothing.
static void test_repair_fills_a_gap_from_the_other_periods(void)
{
    for (size_t n = 700; n < 740; n++) {
        position[n] = 1e3;
        lost[n] = true;
    }
    TEST_ASSERT_TRUE(repair_fill(rows, lost, period, position));
    for (size_t n = 0; n < rows; n++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, whole[n], position[n]);
    memset(lost, 0, sizeof lost);
}

/// A cubic over four samples of a wave of 36 samples: an eighth of (2 pi 2 / 36)^3 at most.
static void test_repair_fills_a_short_gap_without_periods(void)
{
    for (size_t n = 100; n < 103; n++) {
        position[n] = NAN;
        lost[n] = true;
    }
    TEST_ASSERT_TRUE(repair_fill(rows, lost, 0, position));
    for (size_t n = 98; n < 106; n++)
        TEST_ASSERT_DOUBLE_WITHIN(5e-3, whole[n], position[n]);
    memset(lost, 0, sizeof lost);
}

static void test_repair_takes_the_nearest_row_at_the_ends(void)
{
    lost[0] = lost[1] = lost[rows - 1] = true;
    TEST_ASSERT_TRUE(repair_fill(rows, lost, 0, position));
    TEST_ASSERT_EQUAL_DOUBLE(whole[2], position[0]);
    TEST_ASSERT_EQUAL_DOUBLE(whole[rows - 2], position[rows - 1]);
    memset(lost, 0, sizeof lost);
}

static void test_repair_marks_a_row_that_jumps_away_and_back(void)
{
    position[700] += 3.0;
    velocity[1100] -= 40.0;
    TEST_ASSERT_EQUAL_UINT(2, repair_find(&run, lost, &finding));
    TEST_ASSERT_TRUE(lost[700] && lost[1100]);
    TEST_ASSERT_EQUAL_UINT(2, finding.spikes);
    TEST_ASSERT_EQUAL_UINT(700, finding.first_spike);
    TEST_ASSERT_EQUAL_INT(-1, finding.effect);
}

static void test_repair_puts_an_angle_together(void)
{
    static const double turns[] = {6.283185307179586, 360.0, 1.0};
    for (size_t i = 0; i < 3; i++) {
        for (size_t n = 0; n < rows; n++) // three turns there, and back again
            position[n] = turns[i] * (0.3 + 3.0 * sin(two_pi * (double)n / rows));
        memcpy(whole, position, sizeof whole);
        for (size_t n = 0; n < rows; n++)
            position[n] -= turns[i] * floor(position[n] / turns[i]);
        TEST_ASSERT_EQUAL_UINT(12, repair_unwrap(rows, position));
        for (size_t n = 0; n < rows; n++)
            TEST_ASSERT_DOUBLE_WITHIN(1e-9 * turns[i], whole[n] - whole[0], position[n] - position[0]);
        TEST_ASSERT_EQUAL_UINT(0, repair_unwrap(rows, position)); // it is whole now
    }
}

static void test_repair_lets_an_angle_dither_about_its_zero(void)
{
    for (size_t n = 0; n < rows; n++) {
        position[n] = 0.001 * sin(0.9 * (double)n) + 0.1 * sin(two_pi * (double)n / rows);
        position[n] += position[n] < 0.0 ? two_pi : 0.0;
    }
    TEST_ASSERT_EQUAL_UINT(0, repair_find(&run, lost, &finding));
    TEST_ASSERT_GREATER_THAN_UINT(0, repair_unwrap(rows, position));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_repair_marks_nothing_in_a_whole_run);
    RUN_TEST(test_repair_finds_the_rows_that_repeat_and_says_their_share);
    RUN_TEST(test_repair_marks_what_the_file_says_is_not_valid);
    RUN_TEST(test_repair_fills_a_gap_from_the_other_periods);
    RUN_TEST(test_repair_fills_a_short_gap_without_periods);
    RUN_TEST(test_repair_takes_the_nearest_row_at_the_ends);
    RUN_TEST(test_repair_marks_a_row_that_jumps_away_and_back);
    RUN_TEST(test_repair_puts_an_angle_together);
    RUN_TEST(test_repair_lets_an_angle_dither_about_its_zero);
    return UNITY_END();
}
