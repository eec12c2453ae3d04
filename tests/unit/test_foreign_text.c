/* SPDX-License-Identifier: MIT */
/// Cells of other programs' tables: numbers with their marks, times of day, units in names.
#include "lab/record/foreign_layout.h"
#include "lab/record/foreign_text.h"
#include "lab/record/run_guess.h"
#include "unity.h"

#include <math.h>
#include <string.h>

void setUp(void) {}

void tearDown(void) {}

static void test_foreign_number_reads_marks_between_thousands_only_where_they_can_be_such(void)
{
    static const struct {
        const char *cell;
        char decimal;
        enum foreign_value kind;
        double value;
    } cases[] = {
        {"1.5", '.', foreign_value_number, 1.5},
        {"1,5", ',', foreign_value_number, 1.5},
        {"1,5", '.', foreign_value_text, 0},
        {"1.5", ',', foreign_value_text, 0},
        {"1.234", ',', foreign_value_grouped, 1234},
        {"1,234", '.', foreign_value_grouped, 1234},
        {"-12.345", ',', foreign_value_grouped, -12345},
        {"0.234", ',', foreign_value_text, 0}, // no thousands begin with a zero
        {"1.2345", ',', foreign_value_text, 0},
        {"1234.567", ',', foreign_value_text, 0},
        {"1.234,5", ',', foreign_value_proven, 1234.5},
        {"1,234.5", '.', foreign_value_proven, 1234.5},
        {"1.234.567", ',', foreign_value_proven, 1234567},
        {"1 234,5", ',', foreign_value_proven, 1234.5},
        {"1\xE2\x80\xAF"
         "234,5",
         ',', foreign_value_proven, 1234.5},
        {"1'234.5", '.', foreign_value_proven, 1234.5},
        {"1,2,5", ',', foreign_value_text, 0},
        {"1.5,2", ',', foreign_value_text, 0},
        {"\xE2\x88\x92"
         "3,5e-3",
         ',', foreign_value_number, -3.5e-3},
        {"1.0D+02", '.', foreign_value_number, 100},
        {"", '.', foreign_value_missing, 0},
        {"NaN", '.', foreign_value_missing, 0},
        {"#N/A", ',', foreign_value_missing, 0},
        {"-", ',', foreign_value_missing, 0},
        {"RUN", ',', foreign_value_text, 0},
        {"0x10", '.', foreign_value_text, 0},
        {"1e999", '.', foreign_value_text, 0},
        {"3 4", '.', foreign_value_text, 0},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        double value;
        TEST_ASSERT_EQUAL_INT_MESSAGE(cases[i].kind, foreign_number(cases[i].cell, cases[i].decimal, &value),
                                      cases[i].cell);
        if (foreign_is_number(cases[i].kind)) {
            TEST_ASSERT_TRUE_MESSAGE(value == cases[i].value, cases[i].cell);
        } else {
            TEST_ASSERT_TRUE_MESSAGE(isnan(value), cases[i].cell);
        }
    }
}

static double seconds(const char *from, const char *to)
{
    struct foreign_stamp a, b;
    TEST_ASSERT_TRUE_MESSAGE(foreign_stamp_read(from, &a), from);
    TEST_ASSERT_TRUE_MESSAGE(foreign_stamp_read(to, &b), to);
    return foreign_stamp_seconds(&a, &b);
}

static void test_foreign_stamp_counts_over_days_months_leap_years_and_zones(void)
{
    TEST_ASSERT_TRUE(seconds("2026-02-28T23:59:59.999Z", "2026-03-01T00:00:00.001Z") == 0.002);
    TEST_ASSERT_TRUE(seconds("28.02.2024 00:00:00", "01.03.2024 00:00:00") == 2 * 86400.0);
    TEST_ASSERT_TRUE(seconds("2026/12/31 23:59:59,5", "2027/01/01 00:00:00,25") == 0.75);
    TEST_ASSERT_TRUE(seconds("2026-01-01T00:00:00+01:00", "2026-01-01T00:00:00Z") == 3600.0);
    TEST_ASSERT_TRUE(seconds("2026-01-01T00:00:00+0530", "2026-01-01T00:00:00Z") == 19800.0);
    TEST_ASSERT_TRUE(seconds("23:59:59.75", "00:00:00.25") == 0.5);
    TEST_ASSERT_TRUE(seconds("11:59:59 AM", "12:00:01 PM") == 2.0);
    TEST_ASSERT_TRUE(seconds("12:00:00 AM", "1:00:00 am") == 3600.0);
    TEST_ASSERT_TRUE(seconds("14:21:04:123", "14:21:04:124") == 0.001);
    TEST_ASSERT_TRUE(seconds("26:00:00.5", "26:00:01.5") == 1.0); // since a beginning
    TEST_ASSERT_TRUE(seconds("11/12/2026 10:00:00", "11/12/2026 10:00:01") == 1.0);
    TEST_ASSERT_TRUE(seconds("10:00:00.123456789", "10:00:00.123456790") == 1e-9);
}

static void test_foreign_stamp_takes_nothing_else_for_a_time(void)
{
    static const char *const none[] = {"",         "12",          "12:30",       "1.5",      "2026-02-28",
                                       "12:3:04",  "12:60:00",    "12:30:00 x",  "a:b:c",    "-1:00:00",
                                       "12:30:61", "1.2.3 12:00", "12:30:00 +x", "12:30:00+"};
    struct foreign_stamp stamp;
    for (size_t i = 0; i < sizeof none / sizeof none[0]; i++)
        TEST_ASSERT_FALSE_MESSAGE(foreign_stamp_read(none[i], &stamp), none[i]);
}

static void test_foreign_units_in_brackets_are_the_unit_as_a_whole(void)
{
    static const struct {
        const char *name;
        double scale; ///< 0: none that is known
    } cases[] = {
        {"pos [mm]", 1e-3},
        {"pos (mm)", 1e-3},
        {"speed [rpm]", 0.10471975511965977},
        {"F [N/m]", 0},
        {"I [A rms]", 0},
        {"a [m/s^2]", 0},
        {"a [rad/s2]", 0},
        {"gain [V/rad]", 0},
        {"M [kg m]", 0},
        {"kt (Nm/A)", 0},
        {"speed_rpm (filtered)", 0.10471975511965977},
        {"turns [rev]", 6.283185307179586},
        {"v [mm/min]", 1e-3 / 60.0},
        {"M [Ncm]", 1e-2},
        {"x_mm", 1e-3},
        {"[mm]", 1e-3},
        {"pos [inch]", 0},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        double scale = 0.0;
        run_guess_scale(cases[i].name, &scale);
        TEST_ASSERT_TRUE_MESSAGE(scale == cases[i].scale, cases[i].name);
    }
    TEST_ASSERT_TRUE(foreign_is_unit("(Nm)") && foreign_is_unit("[furlong]") && foreign_is_unit("rad/s"));
    TEST_ASSERT_FALSE(foreign_is_unit("Moment [Nm]") || foreign_is_unit("speed_rpm") || foreign_is_unit("Time"));
}

static void test_foreign_times_have_their_unit_at_the_end_of_the_name(void)
{
    static const struct {
        const char *name;
        double scale;
    } cases[] = {{"t [ms]", 1e-3}, {"time_us", 1e-6}, {"Zeit (s)", 1}, {"t [ns]", 1e-9},
                 {"t [min]", 60},  {"t [ticks]", 0},  {"time", 0},     {"temperature", 0}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        double scale = 0.0;
        run_guess_time_scale(cases[i].name, &scale);
        TEST_ASSERT_TRUE_MESSAGE(scale == cases[i].scale, cases[i].name);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_foreign_number_reads_marks_between_thousands_only_where_they_can_be_such);
    RUN_TEST(test_foreign_stamp_counts_over_days_months_leap_years_and_zones);
    RUN_TEST(test_foreign_stamp_takes_nothing_else_for_a_time);
    RUN_TEST(test_foreign_units_in_brackets_are_the_unit_as_a_whole);
    RUN_TEST(test_foreign_times_have_their_unit_at_the_end_of_the_name);
    return UNITY_END();
}
