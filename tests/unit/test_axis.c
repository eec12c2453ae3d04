/* SPDX-License-Identifier: MIT */
/// Axes of figures: ticks and their labels, ranges from any data, the map from value to place.
#include "lab/page/axis.h"

#include "unity.h"

#include <math.h>

/* Tick values are products of a whole number and a step. */
static const double tick_relative = 1e-9;

void setUp(void) {}

void tearDown(void) {}

static const char *label_at(const struct axis_ticks *ticks, double value)
{
    for (size_t n = 0; n < ticks->count; n++) {
        if (fabs(ticks->tick[n].value - value) <= tick_relative * fmax(1e-300, fabs(value))) {
            return ticks->tick[n].label;
        }
    }
    return NULL;
}

static void test_axis_ticks_step_by_one_two_five(void)
{
    struct axis_ticks ticks;
    struct axis axis = {axis_linear, -1.06, 1.06};
    axis_find_ticks(&axis, 5, &ticks);
    TEST_ASSERT_EQUAL_STRING("\xE2\x88\x92"
                             "1.0",
                             label_at(&ticks, -1.0));
    TEST_ASSERT_EQUAL_STRING("0.0", label_at(&ticks, 0.0));
    TEST_ASSERT_EQUAL_STRING("0.5", label_at(&ticks, 0.5));
    TEST_ASSERT_EQUAL(0, ticks.exponent);
}

/* Over many ranges: ascending, inside, evenly spaced by 1, 2 or 5 times a power of ten, three to sixteen labels. */
static void test_axis_ticks_are_regular_over_many_ranges(void)
{
    for (int decade = -40; decade <= 40; decade++) {
        for (double width = 1.0; width < 10.0; width += 0.37) {
            struct axis axis = {axis_linear, 0.31 * pow(10.0, decade), (0.31 + width) * pow(10.0, decade)};
            struct axis_ticks ticks;
            axis_find_ticks(&axis, 6, &ticks);
            double step = 0.0;
            double last = NAN;
            size_t labels = 0;
            for (size_t n = 0; n < ticks.count; n++) {
                const struct axis_tick *tick = &ticks.tick[n];
                TEST_ASSERT_TRUE(tick->value >= axis.low * (1 - 1e-6) && tick->value <= axis.high * (1 + 1e-6));
                TEST_ASSERT_TRUE(n == 0 || tick->value > ticks.tick[n - 1].value);
                if (tick->rank == axis_minor) {
                    continue;
                }
                TEST_ASSERT_TRUE(tick->label[0] != '\0');
                if (labels == 1) {
                    step = tick->value - last;
                } else if (labels > 1) {
                    TEST_ASSERT_TRUE(fabs(tick->value - last - step) <= 1e-6 * step);
                }
                last = tick->value;
                labels++;
            }
            TEST_ASSERT_TRUE(labels >= 3 && labels <= 16);
            double mantissa = step / pow(10.0, floor(log10(step) + 1e-6));
            TEST_ASSERT_TRUE(fabs(mantissa - 1) < 1e-6 || fabs(mantissa - 2) < 1e-6 || fabs(mantissa - 5) < 1e-6);
        }
    }
}

static void test_axis_ticks_share_an_exponent_for_tiny_values(void)
{
    struct axis_ticks ticks;
    struct axis axis = {axis_linear, 0.0, 4.1e-6};
    axis_find_ticks(&axis, 4, &ticks);
    TEST_ASSERT_EQUAL(-6, ticks.exponent);
    TEST_ASSERT_EQUAL_STRING("2", label_at(&ticks, 2e-6));
}

static void test_axis_ticks_of_a_log_axis_are_decades(void)
{
    struct axis_ticks ticks;
    struct axis axis = {axis_log, 0.05, 2000.0};
    axis_find_ticks(&axis, 8, &ticks);
    TEST_ASSERT_EQUAL_STRING("0.1", label_at(&ticks, 0.1));
    TEST_ASSERT_EQUAL_STRING("1000", label_at(&ticks, 1000.0));
    TEST_ASSERT_EQUAL_STRING("", label_at(&ticks, 7.0));
    axis = (struct axis){axis_log, 1e-9, 1e-2};
    axis_find_ticks(&axis, 10, &ticks);
    TEST_ASSERT_EQUAL_STRING("10\xE2\x81\xBB\xE2\x81\xB8", label_at(&ticks, 1e-8));
    axis = (struct axis){axis_log, 0.5, 100.0};
    axis_find_ticks(&axis, 8, &ticks);
    TEST_ASSERT_EQUAL_STRING("0.5", label_at(&ticks, 0.5));
    TEST_ASSERT_EQUAL_STRING("20", label_at(&ticks, 20.0));
}

static void test_axis_ticks_of_degrees_are_parts_of_a_turn(void)
{
    struct axis_ticks ticks;
    struct axis axis = {axis_degrees, -190.0, 10.0};
    axis_find_ticks(&axis, 5, &ticks);
    TEST_ASSERT_EQUAL_STRING("0", label_at(&ticks, 0.0));
    TEST_ASSERT_EQUAL_STRING("\xE2\x88\x92"
                             "90",
                             label_at(&ticks, -90.0));
    TEST_ASSERT_NULL(label_at(&ticks, -100.0));
}

static void test_axis_fit_widens_a_point_and_survives_anything(void)
{
    static const double values[] = {0.0,   1.0, -1.0,     1e-300,    1e99, -1e99,
                                    1e300, NAN, INFINITY, -INFINITY, 3.0,  3.0 + 4e-16};
    enum { value_count = sizeof values / sizeof values[0] };
    for (int scale = axis_linear; scale <= axis_degrees; scale++) {
        for (size_t a = 0; a < value_count; a++) {
            for (size_t b = 0; b < value_count; b++) {
                struct axis axis;
                struct axis_ticks ticks;
                axis_fit((enum axis_scale)scale, values[a], values[b], 0.05, &axis);
                TEST_ASSERT_TRUE(axis.low < axis.high && isfinite(axis.high - axis.low));
                TEST_ASSERT_TRUE(scale != axis_log || axis.low > 0.0);
                axis_find_ticks(&axis, 5, &ticks);
                TEST_ASSERT_TRUE(ticks.count <= axis_ticks_max);
            }
        }
    }
}

static void test_axis_ticks_are_three_even_where_few_were_asked(void)
{
    struct axis_ticks ticks;
    struct axis axis = {axis_linear, -0.42, 0.42};
    axis_find_ticks(&axis, 2, &ticks);
    TEST_ASSERT_EQUAL_STRING("0.0", label_at(&ticks, 0.0));
    TEST_ASSERT_EQUAL_STRING("0.2", label_at(&ticks, 0.2));
}

static void test_axis_map_runs_from_the_low_end_to_the_high(void)
{
    const double rounding = 1e-12; /* a few operations on numbers near 1 */
    struct axis linear = {axis_linear, -1.0, 3.0};
    struct axis decades = {axis_log, 0.1, 1000.0};
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 0.25, axis_map(&linear, 0.0));
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 1.5, axis_map(&linear, 5.0));
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 0.5, axis_map(&decades, 10.0));
    TEST_ASSERT_TRUE(isnan(axis_map(&decades, 0.0)));
    TEST_ASSERT_TRUE(isnan(axis_map(&decades, -1.0)));
    TEST_ASSERT_TRUE(isnan(axis_map(&linear, INFINITY)));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_axis_ticks_step_by_one_two_five);
    RUN_TEST(test_axis_ticks_are_regular_over_many_ranges);
    RUN_TEST(test_axis_ticks_share_an_exponent_for_tiny_values);
    RUN_TEST(test_axis_ticks_of_a_log_axis_are_decades);
    RUN_TEST(test_axis_ticks_of_degrees_are_parts_of_a_turn);
    RUN_TEST(test_axis_fit_widens_a_point_and_survives_anything);
    RUN_TEST(test_axis_ticks_are_three_even_where_few_were_asked);
    RUN_TEST(test_axis_map_runs_from_the_low_end_to_the_high);
    return UNITY_END();
}
