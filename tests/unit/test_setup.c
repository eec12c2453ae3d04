/* SPDX-License-Identifier: MIT */
#include "lab/estimate/setup.h"

#include "lab/estimate/method.h"

#include "unity.h"

#include <complex.h>
#include <math.h>
#include <string.h>

/// Products of a few doubles.
static const double rounding = 1e-12;

static struct frf frf;
static struct error error;

void setUp(void)
{
    TEST_ASSERT_EQUAL_INT(0, frf_alloc(&frf, 3, &error));
    for (size_t k = 0; k < 3; k++) {
        frf.frequency_hz[k] = 10.0 * (double)(k + 1);
        estimate_set_line(&frf, k, 2.0, 0.1);
    }
    TEST_ASSERT_TRUE(frf_set_text(&frf.input, "torque_Nm"));
}

void tearDown(void)
{
    frf_free(&frf);
}

static void test_setup_delay_is_turned_back_in_phase(void)
{
    for (size_t k = 0; k < 3; k++) {
        const double complex late = 2.0 * cexp(-I * 6.283185307179586 * frf.frequency_hz[k] * 0.013);
        frf.real[k] = creal(late);
        frf.imag[k] = cimag(late);
    }
    setup_remove_delay(&frf, 0.013);
    for (size_t k = 0; k < 3; k++) {
        TEST_ASSERT_DOUBLE_WITHIN(rounding, 2.0, frf.real[k]);
        TEST_ASSERT_DOUBLE_WITHIN(rounding, 0.0, frf.imag[k]);
        TEST_ASSERT_EQUAL_DOUBLE(0.1, frf.std[k]);
    }
}

static void test_setup_knows_which_columns_hold_the_actuator(void)
{
    TEST_ASSERT_EQUAL_STRING("included", setup_actuator("torque_ref_Nm"));
    TEST_ASSERT_EQUAL_STRING("included", setup_actuator("current_ref_A"));
    TEST_ASSERT_EQUAL_STRING("included", setup_actuator("force_ref_2_N"));
    TEST_ASSERT_EQUAL_STRING("included", setup_actuator("voltage_V"));
    TEST_ASSERT_EQUAL_STRING("not included", setup_actuator("torque_Nm"));
    TEST_ASSERT_EQUAL_STRING("not included", setup_actuator("torque_2_Nm"));
    TEST_ASSERT_EQUAL_STRING("not included", setup_actuator("current_A"));
    TEST_ASSERT_EQUAL_STRING("unknown", setup_actuator("position_rad"));
}

static void test_setup_keys_say_hold_actuator_and_delay(void)
{
    TEST_ASSERT_TRUE(setup_set_keys(&frf, setup_zoh, 0.0));
    TEST_ASSERT_EQUAL_STRING("zoh", estimate_key(&frf, "hold"));
    TEST_ASSERT_EQUAL_STRING("not included", estimate_key(&frf, "actuator"));
    TEST_ASSERT_EQUAL_STRING("", estimate_key(&frf, "delay_removed_s"));
    TEST_ASSERT_TRUE(setup_set_keys(&frf, setup_band_limited, 0.0015));
    TEST_ASSERT_EQUAL_STRING("band-limited", estimate_key(&frf, "hold"));
    TEST_ASSERT_EQUAL_STRING("0.0015", estimate_key(&frf, "delay_removed_s"));
}

static void test_setup_refuses_other_holds(void)
{
    enum setup_hold hold = setup_zoh;
    TEST_ASSERT_EQUAL_INT(0, setup_hold_parse("band-limited", &hold, &error));
    TEST_ASSERT_EQUAL_INT(setup_band_limited, hold);
    TEST_ASSERT_EQUAL_INT(error_usage, setup_hold_parse("foh", &hold, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "--hold: 'foh', expected zoh"), error.message);
    TEST_ASSERT_EQUAL_INT(setup_band_limited, hold);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_setup_delay_is_turned_back_in_phase);
    RUN_TEST(test_setup_knows_which_columns_hold_the_actuator);
    RUN_TEST(test_setup_keys_say_hold_actuator_and_delay);
    RUN_TEST(test_setup_refuses_other_holds);
    return UNITY_END();
}
