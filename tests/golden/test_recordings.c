/* SPDX-License-Identifier: MIT */
/// Real recordings that nobody on this project made, read as a user would. SERVOSCOPE_DATA names their folder.
#include "lab/record/run.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

static struct run run;

void setUp(void) {}

void tearDown(void)
{
    run_free(&run);
}

static void read_recording(const char *name, const char *map, double rate_hz)
{
    static char path[1024];
    struct error error = {0};
    struct stat file;
    const char *folder = getenv("SERVOSCOPE_DATA");
    if (!folder || !*folder)
        TEST_IGNORE_MESSAGE("skipped: no data");
    snprintf(path, sizeof path, "%s/%s", folder, name);
    if (stat(path, &file) != 0)
        TEST_IGNORE_MESSAGE("skipped: no data");
    struct run_options options = {.map = map, .rate_hz = rate_hz};
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, run_read(path, &options, &run, &error), error.message);
}

static void test_recordings_emps_is_a_linear_axis_of_1_khz(void)
{
    read_recording("emps/DATA_EMPS.csv", "force_N=force_gtau_x_vir_N,position_m=qm_motor_position_m,time_s=t_s", 0);
    TEST_ASSERT_EQUAL_UINT(24841, run.rows);
    TEST_ASSERT_EQUAL_DOUBLE(1000, run.sample_rate_hz);
    TEST_ASSERT_TRUE(run.linear);
    TEST_ASSERT_EQUAL_DOUBLE(89.23443221, run_column(&run, "force_N")[0]);
    TEST_ASSERT_EQUAL_DOUBLE(0.00361505, run_column(&run, "position_m")[24840]);
}

static void test_recordings_emps_pulses_has_the_same_length(void)
{
    read_recording("emps/DATA_EMPS_PULSES.csv", "force_N=force_gtau_x_vir_N,position_m=qm_motor_position_m", 0);
    TEST_ASSERT_EQUAL_UINT(24841, run.rows);
    TEST_ASSERT_EQUAL_DOUBLE(1000, run.sample_rate_hz);
    TEST_ASSERT_EQUAL_DOUBLE(5, run_column(&run, "pulses_N_raw")[24840]);
}

static void test_recordings_twomass_is_rotary_at_2500_hz(void)
{
    read_recording("twomass/MultisineTypeA.csv",
                   "time_s=t_s,current_A=iq_meas_A,position_rad=theta_motor_rad,velocity_rad_per_s=omega_motor_rad_s,"
                   "load_position_rad=theta_load_rad_sign_reversed*-1",
                   0);
    TEST_ASSERT_EQUAL_UINT(50000, run.rows);
    TEST_ASSERT_EQUAL_DOUBLE(2500, run.sample_rate_hz);
    TEST_ASSERT_FALSE(run.linear);
    TEST_ASSERT_EQUAL_DOUBLE(-0.6393764, run_column(&run, "load_position_rad")[49998]);
}

static void test_recordings_linear_guide_keeps_the_clock_of_its_time_stamps(void)
{
    // The recording computer's clock ran a little off 1 kHz; the time stamps have 8 digits.
    const double clock_share = 2e-4;
    read_recording(
        "linear_guide/exp1.csv",
        "time_s=t_s,voltage_V=input_V,position_m=enc1_motor_mass_mm*0.001,load_position_m=enc2_load_mass_mm*0.001", 0);
    TEST_ASSERT_EQUAL_UINT(100610, run.rows);
    TEST_ASSERT_DOUBLE_WITHIN(1000 * clock_share, 1000, run.sample_rate_hz);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 100.59805, (double)(run.rows - 1) / run.sample_rate_hz);
    TEST_ASSERT_EQUAL_DOUBLE(8.20625 * 0.001, run_column(&run, "position_m")[0]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_recordings_emps_is_a_linear_axis_of_1_khz);
    RUN_TEST(test_recordings_emps_pulses_has_the_same_length);
    RUN_TEST(test_recordings_twomass_is_rotary_at_2500_hz);
    RUN_TEST(test_recordings_linear_guide_keeps_the_clock_of_its_time_stamps);
    return UNITY_END();
}
