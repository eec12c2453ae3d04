/* SPDX-License-Identifier: MIT */
/// Foreign headers: which columns get which names, and which stay as they are. The headers are those of scopes and
/// drives, made up for the test.
#include "lab/record/run.h"
#include "tests/support/scratch.h"

#include "unity.h"

#include <stdio.h>
#include <string.h>

static struct run run;
static struct error error;

void setUp(void)
{
    error = (struct error){0};
}

void tearDown(void)
{
    run_free(&run);
}

/// Reads four rows of 1, 2, ... below the header; what is named is `expected` (NULL: nothing).
static void named(const char *header, const char *keep, const char *expected)
{
    char text[1024];
    size_t columns = 1;
    for (const char *at = header; *at; at++) {
        columns += *at == ',';
    }
    size_t used = (size_t)snprintf(text, sizeof text, "# sample_rate_hz: 1000\n%s\n", header);
    for (int row = 1; row <= 4; row++) {
        for (size_t c = 0; c < columns; c++) {
            used += (size_t)snprintf(text + used, sizeof text - used, "%s%d", c ? "," : "", row);
        }
        used += (size_t)snprintf(text + used, sizeof text - used, "\n");
    }
    const struct run_options options = {.guess = true, .keep = {keep}};
    const int status = run_read(scratch_text("run.csv", text), &options, &run, &error);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, status, error.message);
    const char *key = run_key(&run, "columns_named");
    TEST_ASSERT_EQUAL_STRING(expected ? expected : "", key ? key : "");
    run_free(&run);
}

static void test_run_guess_reads_units_at_the_end(void)
{
    named("i_A,w_rad_s", NULL, "current_A=i_A,velocity_rad_per_s=w_rad_s");
    named("drive torque [Nm],speed (rpm)", NULL,
          "torque_Nm=drive torque [Nm],velocity_rad_per_s=speed (rpm)*0.104719755");
    named("u_V,x_mm", NULL, "voltage_V=u_V,position_m=x_mm*0.001");
    named("f_kN,v_mm_per_s", NULL, "force_N=f_kN*1000,velocity_m_per_s=v_mm_per_s*0.001");
}

static void test_run_guess_tells_set_points_and_loads(void)
{
    named("i_cmd_A,i_act_A,pos_deg,load_pos_deg", NULL,
          "current_A=i_act_A,current_ref_A=i_cmd_A,position_rad=pos_deg*0.0174532925,load_position_rad=load_pos_deg*"
          "0.0174532925");
    named("w_load_rad_s_reversed,w_motor_rad_s", NULL,
          "velocity_rad_per_s=w_motor_rad_s,load_velocity_rad_per_s=w_load_rad_s_reversed");
}

static void test_run_guess_takes_nothing_by_chance(void)
{
    named("iu_A,iv_A,iw_A,w_rad_s", NULL, "velocity_rad_per_s=w_rad_s"); // three phases: none is the torque's
    named("vdc_V,bus_current_A,temp_V", NULL, NULL);
    named("following_err_rad,max_torque_Nm", NULL, NULL);
    named("a_rad_s2,a2 [m/s^2],alpha,A", NULL, NULL); // accelerations, and a name that is a unit by itself
    named("x_axis_A_count", NULL, NULL);              // a letter inside a name is no unit
}

static void test_run_guess_leaves_known_and_wanted_names(void)
{
    named("torque_Nm,position_rad,other_Nm", NULL, NULL);
    named("torque_Nm,w_rad_s", NULL, "velocity_rad_per_s=w_rad_s");
    named("i_A,w_rad_s", "i_A", "velocity_rad_per_s=w_rad_s");
}

static void test_run_guess_keeps_to_one_kind_of_axis(void)
{
    named("f_N,angle_rad,i_A", NULL, "current_A=i_A,position_rad=angle_rad");
    named("m_Nm,x_m,v_m_s", NULL, "torque_Nm=m_Nm"); // a torque: rotary, and nothing else is
}

static void test_run_guess_scales_and_refuses_what_is_no_number(void)
{
    const struct run_options options = {.guess = true};
    TEST_ASSERT_EQUAL_INT(
        0, run_read(scratch_text("mm.csv", "# sample_rate_hz: 10\ni_A,x_mm\n1,2\n3,4\n"), &options, &run, &error));
    TEST_ASSERT_EQUAL_DOUBLE(0.004, run_column(&run, "position_m")[1]);
    TEST_ASSERT_TRUE(run.linear);
    run_free(&run);
    TEST_ASSERT_EQUAL_INT(
        1, run_read(scratch_text("x.csv", "# sample_rate_hz: 10\ni_A,x_mm\n1,2\nx,4\n"), &options, &run, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "x.csv:4: i_A: 'x' is not a number"), error.message);
}

static void test_run_guess_is_not_made_beside_a_map(void)
{
    const struct run_options options = {.guess = true, .map = "torque_Nm=i_A"};
    TEST_ASSERT_EQUAL_INT(
        0, run_read(scratch_text("map.csv", "# sample_rate_hz: 10\ni_A,w_rad_s\n1,2\n3,4\n"), &options, &run, &error));
    TEST_ASSERT_NULL(run_column(&run, "velocity_rad_per_s"));
    TEST_ASSERT_NULL(run_key(&run, "columns_named"));
}

int main(void)
{
    UNITY_BEGIN();
    scratch_open();
    RUN_TEST(test_run_guess_reads_units_at_the_end);
    RUN_TEST(test_run_guess_tells_set_points_and_loads);
    RUN_TEST(test_run_guess_takes_nothing_by_chance);
    RUN_TEST(test_run_guess_leaves_known_and_wanted_names);
    RUN_TEST(test_run_guess_keeps_to_one_kind_of_axis);
    RUN_TEST(test_run_guess_scales_and_refuses_what_is_no_number);
    RUN_TEST(test_run_guess_is_not_made_beside_a_map);
    scratch_close();
    return UNITY_END();
}
