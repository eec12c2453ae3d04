/* SPDX-License-Identifier: MIT */
/// An error that sits in one place, one direction or one stretch of time is reported there and nowhere else.
#include "lab/diagnose/report_where.h"

#include "unity.h"

#include <math.h>
#include <string.h>

enum { rows = 1200 };

static const double two_pi = 6.283185307179586;
static const double rounding = 1e-9;

static double time_s[rows], position[rows], velocity[rows], nominal[rows], extended[rows];
static struct diagnosis_curves curves;
static struct report_share shares[report_shares_max];
static size_t count;

/// Two strokes there and back.
void setUp(void)
{
    for (size_t n = 0; n < rows; n++) {
        double phase = two_pi * 2.0 * ((double)n + 0.5) / rows;
        time_s[n] = (double)n / 1000.0;
        position[n] = -cos(phase);
        velocity[n] = sin(phase);
        nominal[n] = extended[n] = 1.0;
    }
    curves = (struct diagnosis_curves){.samples = rows,
                                       .rate_hz = 1000.0,
                                       .time_s = time_s,
                                       .position = position,
                                       .velocity = velocity,
                                       .residual_nominal = nominal,
                                       .residual_extended = extended};
}

void tearDown(void) {}

static const struct report_share *share(const char *what)
{
    count = report_shares_find(&curves, false, shares);
    for (size_t i = 0; i < count; i++)
        if (strstr(shares[i].what, what))
            return &shares[i];
    TEST_FAIL_MESSAGE(what);
    return NULL;
}

static void test_report_where_an_even_error_lies_everywhere_as_often_as_the_samples(void)
{
    TEST_ASSERT_EQUAL_UINT(report_shares_max, report_shares_find(&curves, false, shares));
    for (size_t i = 0; i < report_shares_max; i++) {
        TEST_ASSERT_DOUBLE_WITHIN(rounding, shares[i].samples, shares[i].nominal);
        TEST_ASSERT_DOUBLE_WITHIN(rounding, shares[i].samples, shares[i].extended);
    }
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 0.5, share("forward")->samples);
}

static void test_report_where_an_error_of_one_direction_lies_there(void)
{
    for (size_t n = 0; n < rows; n++)
        nominal[n] = velocity[n] < 0.0 ? 2.0 : NAN; // what is not known counts nowhere
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 1.0, share("backward")->nominal);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 0.0, share("forward")->nominal);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 0.5, share("forward")->extended);
}

static void test_report_where_an_error_of_one_place_lies_there(void)
{
    struct report_places places;
    for (size_t n = 0; n < rows; n++)
        nominal[n] = position[n] > 0.9 ? 3.0 : 0.0;
    TEST_ASSERT_TRUE(report_places_find(&curves, &places));
    for (size_t i = 0; i < report_places; i++)
        TEST_ASSERT_DOUBLE_WITHIN(rounding, places.position[i] > 0.9 ? 3.0 : 0.0, places.nominal[i]);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 1.0, share("at 0.3333 to 1 rad")->nominal);
}

static void test_report_where_nothing_moves_has_no_places(void)
{
    struct report_places places;
    memset(position, 0, sizeof position);
    TEST_ASSERT_FALSE(report_places_find(&curves, &places));
    curves.samples = 0;
    TEST_ASSERT_EQUAL_UINT(0, report_shares_find(&curves, false, shares));
}

static void test_report_where_a_turn_at_constant_speed_has_no_shares_by_speed_or_direction(void)
{
    for (size_t n = 0; n < rows; n++) {
        position[n] = two_pi * (double)n / rows;
        velocity[n] = two_pi;
    }
    TEST_ASSERT_EQUAL_UINT(6, report_shares_find(&curves, false, shares));
    for (size_t i = 0; i < 6; i++)
        TEST_ASSERT_NULL_MESSAGE(strstr(shares[i].what, "rad/s"), shares[i].what);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_report_where_an_even_error_lies_everywhere_as_often_as_the_samples);
    RUN_TEST(test_report_where_an_error_of_one_direction_lies_there);
    RUN_TEST(test_report_where_an_error_of_one_place_lies_there);
    RUN_TEST(test_report_where_nothing_moves_has_no_places);
    RUN_TEST(test_report_where_a_turn_at_constant_speed_has_no_shares_by_speed_or_direction);
    return UNITY_END();
}
