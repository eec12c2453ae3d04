/* SPDX-License-Identifier: MIT */
#include "drivers/can/cia402_profile.h"

#include "drivers/can/cia402.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

void setUp(void) {}

void tearDown(void) {}

static const struct cia402_profile *named(const char *name)
{
    const struct cia402_profile *profile = cia402_profile_find(name);
    TEST_ASSERT_NOT_NULL_MESSAGE(profile, name);
    TEST_ASSERT_EQUAL_STRING(name, profile->name);
    return profile;
}

static void test_cia402_profile_each_is_complete_and_found_by_its_name(void)
{
    size_t count = 0;
    for (; cia402_profiles[count]; count++) {
        const struct cia402_profile *p = cia402_profiles[count];
        TEST_ASSERT_EQUAL_PTR(p, named(p->name));
        TEST_ASSERT_TRUE_MESSAGE(p->make && p->make[0] && p->source && p->source[0], p->name);
        TEST_ASSERT_TRUE_MESSAGE(p->exponent_min >= -6 && p->exponent_min <= p->exponent_max && p->exponent_max <= 0,
                                 p->name);
        TEST_ASSERT_TRUE_MESSAGE(p->units_min >= 1 && p->units_min <= p->units_max, p->name);
        TEST_ASSERT_TRUE_MESSAGE(p->torque_units_per_rated > 0, p->name);
    }
    TEST_ASSERT_TRUE(count >= 6);
    TEST_ASSERT_NULL(cia402_profile_find("unheard of"));
    TEST_ASSERT_NULL(cia402_profile_find(""));
}

static void test_cia402_profile_is_chosen_by_identity(void)
{
    TEST_ASSERT_EQUAL_PTR(named("delta_asda_a2"), cia402_profile_identify(0x1DD, 7));
    TEST_ASSERT_EQUAL_PTR(named("nanotec_pd4"), cia402_profile_identify(0x26C, 0));
    TEST_ASSERT_EQUAL_PTR(named("servoscope"), cia402_profile_identify(0, 0x402));
    TEST_ASSERT_EQUAL_PTR(&cia402_profile_generic, cia402_profile_identify(0, 0));
    TEST_ASSERT_EQUAL_PTR(&cia402_profile_generic, cia402_profile_identify(0x12345678, 0x402));
}

/// What each make takes, from its manual: rate and 60C2, units 0 where it is to be refused.
static const struct {
    const char *name;
    double rate_hz;
    uint8_t units;
    int8_t exponent;
} rows[] = {
    {"generic", 1000.0, 1, -3},       {"generic", 8000.0, 125, -6},
    {"generic", 1024.0, 0, 0},        {"generic", 3000.0, 0, 0},
    {"delta_asda_a2", 1000.0, 1, -3}, {"delta_asda_a2", 100.0, 10, -3},
    {"delta_asda_a2", 50.0, 20, -3},  {"delta_asda_a2", 2000.0, 0, 0},
    {"delta_asda_a2", 1250.0, 0, 0},  {"delta_asda_a2", 40.0, 0, 0},
    {"nanotec_pd4", 1000.0, 1, -3},   {"nanotec_pd4", 500.0, 2, -3},
    {"nanotec_pd4", 2000.0, 0, 0},    {"astraada_as64", 1000.0, 1, -3},
    {"astraada_as64", 2000.0, 0, 0},  {"astraada_as64", 800.0, 125, -5},
    {"infranor", 2000.0, 5, -4},      {"infranor", 1000.0, 1, -3},
    {"infranor", 800.0, 0, 0},        {"infranor", 40.0, 0, 0},
    {"infranor", 4000.0, 0, 0},       {"generic", 0.0, 0, 0},
    {"generic", -5.0, 0, 0},          {"generic", 30000.0, 0, 0},
};

static void test_cia402_profile_period_fits_or_is_refused(void)
{
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        uint8_t units = 0;
        int8_t exponent = 0;
        char text[240] = "", what[80];
        bool fits = cia402_profile_period(named(rows[i].name), rows[i].rate_hz, &units, &exponent, text, sizeof text);
        snprintf(what, sizeof what, "%s at %g Hz", rows[i].name, rows[i].rate_hz);
        TEST_ASSERT_EQUAL_MESSAGE(rows[i].units != 0, fits, what);
        TEST_ASSERT_EQUAL_UINT8_MESSAGE(rows[i].units, units, what);
        TEST_ASSERT_EQUAL_INT8_MESSAGE(rows[i].exponent, exponent, what);
        TEST_ASSERT_EQUAL_MESSAGE(!fits, text[0] != '\0', what);
    }
    uint8_t units;
    int8_t exponent;
    char text[240];
    TEST_ASSERT_FALSE(cia402_profile_period(named("generic"), NAN, &units, &exponent, text, sizeof text));
}

static void test_cia402_profile_refusal_shows_the_arithmetic(void)
{
    uint8_t units;
    int8_t exponent;
    char text[240];
    cia402_profile_period(named("delta_asda_a2"), 2000.0, &units, &exponent, text, sizeof text);
    TEST_ASSERT_EQUAL_STRING("sample rate 2000 Hz: 1 / 2000 Hz = 500 us; object 60C2 of Delta ASDA-A2 takes 1..20 x "
                             "10^-3 s, at least 1000 us, at most 20000 us",
                             text);
    cia402_profile_period(named("infranor"), 800.0, &units, &exponent, text, sizeof text);
    TEST_ASSERT_EQUAL_STRING("sample rate 800 Hz: 1 / 800 Hz = 1250 us; object 60C2 of Infranor XtrapulsGem takes "
                             "1..255 x 10^-6..10^0 s, multiples of 500 us, at least 500 us, at most 20000 us",
                             text);
}

/// Units of a make whose drives do not say them: 0.1 rpm, and PUU.
static void test_cia402_profile_units_stand_in_for_missing_objects(void)
{
    struct cia402_scaling_objects objects = named("delta_asda_a2")->units;
    struct cia402_scaling scaling;
    objects.rated_torque = 1270;
    objects.torque_units = named("delta_asda_a2")->torque_units_per_rated;
    TEST_ASSERT_NULL(cia402_scaling_read(&objects, &scaling));
    const double exact = 1e-17;
    TEST_ASSERT_DOUBLE_WITHIN(exact, 6.283185307179586 / 1280000.0, scaling.position);
    TEST_ASSERT_DOUBLE_WITHIN(exact, 6.283185307179586 / 600.0, scaling.velocity);
    TEST_ASSERT_DOUBLE_WITHIN(exact, 1.27e-3, scaling.torque);
    objects.torque_units = 100; // a make that counts per cent
    TEST_ASSERT_NULL(cia402_scaling_read(&objects, &scaling));
    TEST_ASSERT_DOUBLE_WITHIN(exact, 1.27e-2, scaling.torque);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_cia402_profile_each_is_complete_and_found_by_its_name);
    RUN_TEST(test_cia402_profile_is_chosen_by_identity);
    RUN_TEST(test_cia402_profile_period_fits_or_is_refused);
    RUN_TEST(test_cia402_profile_refusal_shows_the_arithmetic);
    RUN_TEST(test_cia402_profile_units_stand_in_for_missing_objects);
    return UNITY_END();
}
