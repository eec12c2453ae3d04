/* SPDX-License-Identifier: MIT */
/// The transient that is expected of a drive at rest, against the simulated drive itself: lab/design/start_phase.h,
/// transient.h, loop.h.
#include "lab/design/start_bank.h"
#include "lab/design/start_phase.h"

#include "sim/belt_drive.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { period = 400, line_count = 60, settling_periods = 120 };

/// The simulated drive integrates by Runge and Kutta; and what is left of the start after 120 periods.
static const double integration = 1e-4;
/// It also plays the mean of the lagged torque over each quarter of a sample: 4e-4 at a lag of 0.7 samples.
static const double quarter_samples = 1e-3;
static const double rounding = 1e-9;
static const double two_pi = 6.283185307179586;

static uint32_t bins[line_count];
static double amplitude[line_count];
static double phase[line_count];
static struct design_transient_table table;
static struct sim_model model;
static struct error error;

/// 2.5 .. 150 Hz at 1 kHz on a two-mass drive with everything that is linear: lag, dead time, filtered speed, friction.
void setUp(void)
{
    for (uint32_t k = 0; k < line_count; k++) {
        double omega = two_pi * 2.5 * (k + 1);
        bins[k] = k + 1;
        amplitude[k] = 10 / (omega * sqrt(10000 + omega * omega));
        phase[k] = 2.3 * k * k;
    }
    table = (struct design_transient_table){.rate_hz = 1000,
                                            .period_samples = period,
                                            .line_count = line_count,
                                            .bins = bins,
                                            .amplitude_rad = amplitude,
                                            .phase_rad = phase,
                                            .inertia_kgm2 = 0.004};
    sim_model_default(&model);
    model.structure = sim_structure_two_mass;
    model.motor_inertia_kgm2 = 0.0025;
    model.load_inertia_kgm2 = 0.0025;
    model.belt_stiffness_Nm_per_rad = 80;
    model.belt_damping_Nms_per_rad = 0.02;
    model.viscous_friction_Nms_per_rad = 0.005;
    model.torque_lag_s = 0.7e-3;
    model.dead_time_s = 1.4e-3;
    model.sensors = (struct sim_sensors){.velocity_filter_s = 0.5e-3};
    error = (struct error){0};
}

void tearDown(void) {}

static struct sim_command command_at(size_t n, enum design_loop_mode mode)
{
    struct sim_command command = {.control = mode == design_loop_cascade ? sim_control_cascade : sim_control_torque};
    for (size_t k = 0; k < line_count; k++) {
        double omega = two_pi * bins[k] * table.rate_hz / period;
        double angle = two_pi * (double)(bins[k] * n % period) / period + phase[k];
        command.position += amplitude[k] * cos(angle);
        command.velocity -= amplitude[k] * omega * sin(angle);
        command.torque -= table.inertia_kgm2 * amplitude[k] * omega * omega * cos(angle);
    }
    return command;
}

/// First period from rest minus settled period, in the motor's true velocity.
static double measured_share(enum design_loop_mode mode, size_t t0)
{
    static struct sim_command commands[period];
    static double first[period];
    struct sim_belt_drive drive;
    struct sim_sample sample;
    double transient = 0;
    double steady = 0;
    for (size_t n = 0; n < period; n++) {
        commands[n] = command_at(n, mode);
    }
    sim_belt_drive_init(&drive, &model, mode == design_loop_cascade ? commands[t0].position : 0);
    for (size_t i = 0; i < (size_t)settling_periods * period; i++) {
        double velocity = drive.plant.velocity;
        if (i < period) {
            first[i] = velocity;
        } else if (i >= (size_t)(settling_periods - 1) * period) {
            transient += (first[i % period] - velocity) * (first[i % period] - velocity);
            steady += velocity * velocity;
        }
        sim_belt_drive_step(&drive, &commands[(t0 + i) % period], &sample);
    }
    return transient / steady;
}

static double expected_share(enum design_loop_mode mode, size_t t0)
{
    double share = NAN;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, design_start_expect(&table, &model, mode, t0, &share, &error), error.message);
    return share;
}

static void compare_with_the_simulated_drive(enum design_loop_mode mode, double tolerance)
{
    for (size_t t0 = 3; t0 < period; t0 += 97) {
        double measured = measured_share(mode, t0);
        TEST_ASSERT_DOUBLE_WITHIN(tolerance * measured, measured, expected_share(mode, t0));
    }
}

static void test_start_expects_what_the_simulated_drive_does_in_cascade(void)
{
    compare_with_the_simulated_drive(design_loop_cascade, quarter_samples);
}

static void test_start_expects_what_the_simulated_drive_does_in_torque_mode(void)
{
    model.viscous_friction_Nms_per_rad = 0.02; // settled within the simulated time
    compare_with_the_simulated_drive(design_loop_torque, quarter_samples);
}

static void test_start_expects_what_a_rigid_drive_without_delays_does(void)
{
    model.structure = sim_structure_rigid;
    model.torque_lag_s = 0;
    model.dead_time_s = 0;
    model.sensors.velocity_filter_s = 0;
    compare_with_the_simulated_drive(design_loop_cascade, integration);
    model.viscous_friction_Nms_per_rad = 0.02;
    compare_with_the_simulated_drive(design_loop_torque, integration);
}

static void test_start_expects_what_a_drive_with_whole_samples_of_dead_time_does(void)
{
    model.dead_time_s = 3e-3;
    model.torque_lag_s = 0;
    model.controller.velocity_integral_time_s = 0;
    model.controller.velocity_gain_Nms_per_rad = 0.3;
    compare_with_the_simulated_drive(design_loop_cascade, integration);
}

static void test_start_choice_is_the_least_of_all_samples(void)
{
    for (int mode = design_loop_cascade; mode <= (int)design_loop_torque; mode++) {
        size_t chosen = period;
        double share = NAN;
        TEST_ASSERT_EQUAL_INT(
            0, design_start_choose(&table, &model, (enum design_loop_mode)mode, &chosen, &share, &error));
        TEST_ASSERT_LESS_THAN_size_t(period, chosen);
        TEST_ASSERT_DOUBLE_WITHIN(rounding, expected_share((enum design_loop_mode)mode, chosen), share);
        for (size_t t0 = 0; t0 < period; t0++) {
            TEST_ASSERT_TRUE(expected_share((enum design_loop_mode)mode, t0) >= share - rounding);
        }
    }
}

static void test_start_map_is_what_is_expected_at_each_sample(void)
{
    static double shares[period];
    TEST_ASSERT_EQUAL_INT(0, design_start_map(&table, &model, design_loop_cascade, shares, &error));
    for (size_t t0 = 0; t0 < period; t0++) {
        TEST_ASSERT_DOUBLE_WITHIN(rounding, expected_share(design_loop_cascade, t0), shares[t0]);
    }
}

static void test_start_choice_of_the_bank_is_the_least_mean_over_its_drives(void)
{
    size_t chosen = period;
    double share = NAN;
    TEST_ASSERT_EQUAL_INT(0, design_start_choose(&table, NULL, design_loop_cascade, &chosen, &share, &error));
    for (size_t t0 = chosen % 7; t0 < period; t0 += 7) {
        double mean = 0;
        for (size_t i = 0; i < design_start_bank_size; i++) {
            design_start_bank_drive(&table, i, &model);
            mean += expected_share(design_loop_cascade, t0) / design_start_bank_size;
        }
        double expected = NAN;
        TEST_ASSERT_EQUAL_INT(0, design_start_expect(&table, NULL, design_loop_cascade, t0, &expected, &error));
        TEST_ASSERT_DOUBLE_WITHIN(rounding, mean, expected);
        TEST_ASSERT_TRUE(mean >= share - rounding);
    }
}

static void test_start_bank_is_valid_and_has_the_inertia_of_the_table(void)
{
    char text[200];
    for (size_t i = 0; i < design_start_bank_size; i++) {
        design_start_bank_drive(&table, i, &model);
        TEST_ASSERT_NULL(sim_model_check(&model, text, sizeof text));
        TEST_ASSERT_DOUBLE_WITHIN(rounding, table.inertia_kgm2, model.motor_inertia_kgm2 + model.load_inertia_kgm2);
        double antiresonance_hz = sqrt(model.belt_stiffness_Nm_per_rad / model.load_inertia_kgm2) / two_pi;
        TEST_ASSERT_TRUE(antiresonance_hz > 10 && antiresonance_hz < 151);
    }
}

/// From 20 Hz to 16 kHz, with lines up to near half the rate: there is always a bank.
static void test_start_of_the_bank_exists_at_any_rate(void)
{
    static const double rates_hz[] = {20, 100, 1000, 16000};
    for (size_t k = 0; k < line_count; k++) {
        bins[k] = (uint32_t)(3 * k + 20);
        amplitude[k] = 1e-3 / bins[k] / bins[k];
    }
    for (size_t i = 0; i < sizeof rates_hz / sizeof rates_hz[0]; i++) {
        for (int mode = design_loop_cascade; mode <= (int)design_loop_torque; mode++) {
            size_t chosen = period;
            double share = NAN;
            table.rate_hz = rates_hz[i];
            TEST_ASSERT_EQUAL_INT_MESSAGE(
                0, design_start_choose(&table, NULL, (enum design_loop_mode)mode, &chosen, &share, &error),
                error.message);
            TEST_ASSERT_TRUE(share >= 0 && isfinite(share));
        }
    }
}

static void assert_refused(enum design_loop_mode mode, const char *part)
{
    size_t chosen = 0;
    double share = 0;
    TEST_ASSERT_EQUAL_INT(error_refused, design_start_choose(&table, &model, mode, &chosen, &share, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, part), error.message);
    TEST_ASSERT_EQUAL_INT(error_refused, design_start_expect(&table, &model, mode, 0, &share, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, part), error.message);
}

static void test_start_refuses_an_unstable_cascade_but_not_its_torque_mode(void)
{
    model.controller.velocity_gain_Nms_per_rad = 20;
    assert_refused(design_loop_cascade, "unstable");
    TEST_ASSERT_TRUE(expected_share(design_loop_torque, 0) > 0);
}

static void test_start_refuses_more_dead_time_than_it_can_hold(void)
{
    model.dead_time_s = (design_loop_dead_samples_max + 0.5) * 1e-3;
    assert_refused(design_loop_torque, "dead_time_s");
}

static void test_start_refuses_an_undamped_resonance_on_a_line(void)
{
    const double omega = two_pi * 25;
    model.belt_damping_Nms_per_rad = 0;
    model.viscous_friction_Nms_per_rad = 0;
    model.belt_stiffness_Nm_per_rad = omega * omega * 0.00125;
    assert_refused(design_loop_torque, "resonance");
    model.belt_stiffness_Nm_per_rad *= 1.01;
    TEST_ASSERT_TRUE(expected_share(design_loop_torque, 0) > 0);
}

/// Two crossings, at samples 2 and 6, with the velocity's slope smaller at the second.
static void test_start_of_the_paper_is_the_crossing_with_the_least_acceleration(void)
{
    const double velocity[] = {3, 2, 0.1, -3, -2, -1, 0.2, 1};
    const double acceleration[] = {0, -2, -5, 0, 1, 2, 1.5, 1};
    TEST_ASSERT_EQUAL_size_t(6, design_start_phase_paper(8, velocity, acceleration));
}

static void test_start_of_the_paper_may_cross_the_end_of_the_period(void)
{
    const double velocity[] = {-0.1, -3, -2, 4, 5, 1};
    const double acceleration[] = {-1, 0, 3, 2, 0, -3};
    TEST_ASSERT_EQUAL_size_t(0, design_start_phase_paper(6, velocity, acceleration));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_start_expects_what_the_simulated_drive_does_in_cascade);
    RUN_TEST(test_start_expects_what_the_simulated_drive_does_in_torque_mode);
    RUN_TEST(test_start_expects_what_a_rigid_drive_without_delays_does);
    RUN_TEST(test_start_expects_what_a_drive_with_whole_samples_of_dead_time_does);
    RUN_TEST(test_start_choice_is_the_least_of_all_samples);
    RUN_TEST(test_start_map_is_what_is_expected_at_each_sample);
    RUN_TEST(test_start_choice_of_the_bank_is_the_least_mean_over_its_drives);
    RUN_TEST(test_start_bank_is_valid_and_has_the_inertia_of_the_table);
    RUN_TEST(test_start_of_the_bank_exists_at_any_rate);
    RUN_TEST(test_start_refuses_an_unstable_cascade_but_not_its_torque_mode);
    RUN_TEST(test_start_refuses_more_dead_time_than_it_can_hold);
    RUN_TEST(test_start_refuses_an_undamped_resonance_on_a_line);
    RUN_TEST(test_start_of_the_paper_is_the_crossing_with_the_least_acceleration);
    RUN_TEST(test_start_of_the_paper_may_cross_the_end_of_the_period);
    return UNITY_END();
}
