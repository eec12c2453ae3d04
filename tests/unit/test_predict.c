/* SPDX-License-Identifier: MIT */
/// A model's prediction of a run that the same model made, without noise, leaves nothing but rounding.
#include "lab/diagnose/predict.h"

#include "lab/numeric/statistics.h"
#include "sim/belt_drive.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { period = 800, settle = 60, rows = period * (settle + 1) };

static const double two_pi = 6.283185307179586;
/// Nm, of torques of about 0.5 Nm: rounding of speeds of about 20 rad/s times inertia and sample rate.
static const double rounding = 1e-9;
/// Nm: what the prediction of effects that are not linear may be off by, which it takes as they are half way through a
/// substep. A good torque sensor has ten times as much noise.
static const double midway = 2e-4;
static double allowed_Nm;

static struct sim_model model;
static double torque_ref[rows], torque[rows], position[rows], velocity[rows];
static double mechanics[rows], actuator[rows];
static struct stretch all, last_period;

void setUp(void)
{
    allowed_Nm = rounding;
    sim_model_default(&model);
    model.sensors = (struct sim_sensors){0};
    model.motor_inertia_kgm2 = 0.004;
    model.load_inertia_kgm2 = 0.001;
    model.viscous_friction_Nms_per_rad = 0.002;
    model.coulomb_friction_Nm = 0.04;
    model.torque_lag_s = 6e-4;
    model.dead_time_s = 3.3e-4;
}

void tearDown(void) {}

static void two_masses(void)
{
    model.structure = sim_structure_two_mass;
    model.load_inertia_kgm2 = 0.003;
    model.belt_stiffness_Nm_per_rad = 80.0;
    model.belt_damping_Nms_per_rad = 0.25; // the load forgets where it started within one period
}

static void switch_on(const char *id, double first, double second, double third)
{
    int effect = sim_effect_find(id);
    TEST_ASSERT_TRUE_MESSAGE(effect >= 0, id);
    const double values[] = {first, second, third};
    model.effect_on[effect] = true;
    for (size_t i = 0; i < 3; i++)
        model.effect_parameters[effect][i] = values[i];
}

static void switch_all_on(void)
{
    switch_on("cogging", 0.03, 0.7, 9.0);
    switch_on("load_bias", 0.02, 0.0, 0.0);
    switch_on("stribeck_friction", 0.02, 1.5, 0.0);
    switch_on("asymmetric_friction", 0.1, 0.0, 0.0);
}

/// A periodic reference of some lines, followed by the cascade; all rows recorded, the last period after the transient.
static void run_drive(void)
{
    static const double lines[] = {1, 2, 5, 11, 23};
    static struct sim_belt_drive drive;
    double inertia = model.motor_inertia_kgm2 + model.load_inertia_kgm2;
    sim_belt_drive_init(&drive, &model, 0.0);
    for (size_t n = 0; n < rows; n++) {
        struct sim_command command = {.control = sim_control_cascade};
        for (size_t l = 0; l < sizeof lines / sizeof lines[0]; l++) {
            double w = two_pi * lines[l] * model.sample_rate_hz / period, angle = w * (double)n / model.sample_rate_hz;
            double size = 8.0 / (w * sqrt(lines[l]));
            command.position += size * sin(angle + (double)l);
            command.velocity += size * w * cos(angle + (double)l);
            command.torque -= 0.5 * inertia * size * w * w * sin(angle + (double)l);
        }
        struct sim_sample sample;
        sim_belt_drive_step(&drive, &command, &sample);
        torque_ref[n] = sample.torque_ref;
        torque[n] = sample.torque;
        position[n] = sample.position;
        velocity[n] = sample.velocity;
    }
    all = (struct stretch){.samples = rows,
                           .torque_ref = torque_ref,
                           .torque = torque,
                           .position = position,
                           .velocity = velocity,
                           .substeps = sim_substeps};
    last_period = (struct stretch){.samples = period,
                                   .torque_ref = torque_ref + rows - period,
                                   .torque = torque + rows - period,
                                   .position = position + rows - period,
                                   .velocity = velocity + rows - period,
                                   .substeps = sim_substeps};
}

static void assert_all_zero(size_t samples, double tolerance)
{
    char message[64];
    for (size_t n = 0; n < samples; n++) {
        snprintf(message, sizeof message, "residual of sample %zu", n);
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(tolerance, 0.0, mechanics[n], message);
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(tolerance, 0.0, actuator[n], message);
    }
}

static void assert_predicts_itself(void)
{
    run_drive();
    TEST_ASSERT_NULL(sim_model_check(&model, (char[200]){0}, 200));
    predict(&model, &all, false, 0.005, mechanics, actuator);
    assert_all_zero(rows, allowed_Nm);
    // The run has to repeat first, for its last period to be one: as good as the transient has decayed.
    for (size_t n = rows - period; n < rows; n++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-10, position[n - period], position[n]);
    predict(&model, &last_period, true, 0.005, mechanics, actuator);
    assert_all_zero(period, fmax(allowed_Nm, 100.0 * rounding));
}

static void test_predict_leaves_nothing_of_a_rigid_drive(void)
{
    assert_predicts_itself();
}

static void test_predict_leaves_nothing_of_a_rigid_drive_with_every_friction_and_ripple(void)
{
    allowed_Nm = midway;
    switch_all_on();
    assert_predicts_itself();
}

static void test_predict_leaves_nothing_of_two_masses(void)
{
    two_masses();
    assert_predicts_itself();
}

static void test_predict_leaves_nothing_of_two_masses_with_every_friction_and_ripple(void)
{
    allowed_Nm = midway;
    two_masses();
    switch_all_on();
    assert_predicts_itself();
}

static void test_predict_leaves_nothing_without_lag_and_with_whole_dead_time(void)
{
    model.torque_lag_s = 0.0;
    model.dead_time_s = 2e-3;
    assert_predicts_itself();
    model.dead_time_s = 0.0;
    assert_predicts_itself();
}

static void test_predict_leaves_nothing_of_a_linear_axis(void)
{
    allowed_Nm = midway;
    model.linear = true;
    model.dead_time_s = 1.6e-3;
    switch_on("cogging", 0.03, 0.7, 0.4);
    assert_predicts_itself();
}

static void test_predict_leaves_nothing_of_a_third_mass(void)
{
    switch_on("second_mode", 14.0, 0.0006, 0.2);
    assert_predicts_itself();
    two_masses();
    assert_predicts_itself();
}

static void test_predict_leaves_nothing_of_friction_that_builds_up(void)
{
    allowed_Nm = 0.1 * midway;
    switch_on("presliding", 3e-3, 1.0, 0.0);
    assert_predicts_itself();
    allowed_Nm = midway;
    two_masses();
    switch_all_on();
    assert_predicts_itself();
}

static void test_predict_leaves_nothing_of_a_belt_that_is_not_linear(void)
{
    two_masses();
    switch_on("hardening_stiffness", 3e4, 0.0, 0.0);
    assert_predicts_itself();
    switch_on("position_dependent_stiffness", 0.1, 0.0, 0.0);
    assert_predicts_itself();
    switch_on("backlash", 5e-4, 0.0, 0.0);
    assert_predicts_itself();
}

static void test_predict_leaves_nothing_of_an_eccentric_encoder_and_of_saturation(void)
{
    switch_on("encoder_eccentricity", 2e-3, 0.4, 1.0);
    switch_on("torque_saturation", 1.6, 0.0, 0.0);
    assert_predicts_itself();
    switch_on("encoder_eccentricity", 2e-3, 0.4, 0.0);
    assert_predicts_itself();
}

/// The clock runs in a run as it was recorded.
static void test_predict_leaves_nothing_of_what_depends_on_time(void)
{
    allowed_Nm = midway;
    switch_on("periodic_disturbance", 0.02, 0.4, 3.3);
    switch_on("friction_drift", 0.4, 7.0, 0.0);
    run_drive();
    predict(&model, &all, false, 0.005, mechanics, actuator);
    assert_all_zero(rows, allowed_Nm);
    struct stretch later = all;
    size_t first = 7 * period;
    later.samples -= first;
    later.torque_ref += first;
    later.torque += first;
    later.position += first;
    later.velocity += first;
    later.start_s = (double)first / model.sample_rate_hz;
    predict(&model, &later, false, 0.005, mechanics, actuator);
    for (size_t n = period; n < later.samples; n++) // the actuator's start is unknown
        TEST_ASSERT_DOUBLE_WITHIN(allowed_Nm, 0.0, mechanics[n]);
}

/// Rows that were lost say nothing: the motor runs on, and what is beside them stays right.
static void test_predict_runs_on_over_lost_rows(void)
{
    static bool lost[rows];
    two_masses();
    run_drive();
    for (size_t n = 1; n < rows; n++) {
        lost[n] = n % 37 == 0 || n % 37 == 1;
        if (lost[n]) {
            torque[n] = torque[n - 1];
            position[n] = position[n - 1];
            velocity[n] = velocity[n - 1];
        }
    }
    all.lost = lost;
    predict(&model, &all, false, 0.005, mechanics, actuator);
    assert_all_zero(rows, rounding);
    all.lost = NULL;
    predict(&model, &all, false, 0.005, mechanics, actuator);
    TEST_ASSERT_TRUE(fabs(mechanics[36]) > 1e-3 && fabs(mechanics[38]) > 1e-3);
}

/// Where the speed has a sensor of its own, it contradicts the eccentric angle by a sin(th + phase) v.
static void test_predict_kinematics_is_what_an_eccentric_encoder_contradicts(void)
{
    static double kinematics[rows], out[rows];
    for (int derived = 0; derived <= 1; derived++) {
        switch_on("encoder_eccentricity", 2e-3, 0.4, derived);
        run_drive();
        memset(kinematics, 0, sizeof kinematics);
        all.kinematics = kinematics;
        predict_kinematics(&model, &all, out);
        for (size_t n = 0; n < rows; n += 7) {
            double th = position[n] - 2e-3 * cos(position[n] + 0.4); // to a's square
            double expected = derived ? 0.0 : 2e-3 * sin(th + 0.4) * velocity[n];
            TEST_ASSERT_DOUBLE_WITHIN(2e-5 * 10.0, -expected, out[n]);
        }
    }
}

/// What the model lacks comes out as torque, at the time and in the size in which it acted.
static void test_predict_gives_missing_torque_in_nm(void)
{
    switch_on("load_bias", 0.02, 0.0, 0.0);
    switch_on("cogging", 0.03, 0.7, 2.0);
    run_drive();
    struct sim_model plain = model;
    memset(plain.effect_on, 0, sizeof plain.effect_on);
    predict(&plain, &last_period, true, 0.005, mechanics, actuator);
    size_t compared = 0;
    for (size_t n = 0; n + 1 < period; n++) {
        const double *v = last_period.velocity, *x = last_period.position;
        if (fabs(v[n]) < 1.0 || v[n] * v[n + 1] < 0.0)
            continue; // where friction may hold the motor the missing torque shows only in part
        double expected = -0.02 - 0.03 * cos(2.0 * 0.5 * (x[n] + x[n + 1]) + 0.7);
        TEST_ASSERT_DOUBLE_WITHIN(2e-3 * 0.05, expected, mechanics[n]);
        compared++;
    }
    TEST_ASSERT_TRUE(compared > period / 2);
    for (size_t n = 0; n < period; n++)
        TEST_ASSERT_DOUBLE_WITHIN(100.0 * rounding, 0.0, actuator[n]);
}

static void test_predict_gives_missing_dead_time_to_the_actuator_channel(void)
{
    run_drive();
    struct sim_model late = model;
    late.dead_time_s += 5e-4;
    predict(&late, &last_period, true, 0.005, mechanics, actuator);
    double sum = 0.0;
    for (size_t n = 0; n < period; n++)
        sum += actuator[n] * actuator[n] / period;
    TEST_ASSERT_TRUE(sqrt(sum) > 1e-3);
}

/// Without a reference the measured torque drives the model, straight between its samples.
static void test_predict_from_measured_torque_alone_is_right_where_torque_is_slow(void)
{
    enum { fine = 64 };
    struct sim_plant plant;
    sim_plant_init(&plant, 0.0);
    const double w = two_pi * 2.0;
    for (size_t n = 0; n < period; n++) {
        double t = (double)n / model.sample_rate_hz;
        torque[n] = 0.3 * sin(w * t);
        position[n] = plant.position;
        velocity[n] = plant.velocity;
        for (size_t i = 0; i < fine; i++)
            sim_plant_step(&plant, &model, 0.3 * sin(w * (t + ((double)i + 0.5) / (fine * model.sample_rate_hz))),
                           1.0 / (fine * model.sample_rate_hz));
    }
    struct stretch stretch = {
        .samples = period, .torque = torque, .position = position, .velocity = velocity, .substeps = sim_substeps};
    predict(&model, &stretch, false, 0.005, mechanics, NULL);
    // A straight line is off from the sinusoid by (w dt)^2 / 8 of its size at most; where the motor reverses and breaks
    // away, by what torque changes meanwhile, w dt of its size.
    size_t off = 0;
    for (size_t n = 0; n < period; n++)
        off += !(fabs(mechanics[n]) < 3e-5 * 0.3);
    TEST_ASSERT_TRUE(off <= 8);
    for (size_t n = 0; n < period; n++)
        TEST_ASSERT_DOUBLE_WITHIN(w / model.sample_rate_hz * 0.3, 0.0, mechanics[n]);
    predict(&model, &stretch, false, 0.005, mechanics, actuator);
    for (size_t n = 0; n < period; n++)
        TEST_ASSERT_EQUAL_DOUBLE(0.0, actuator[n]);
}

static void test_predict_scales_by_the_given_inertia(void)
{
    run_drive();
    struct sim_model other = model;
    other.coulomb_friction_Nm = 0.0;
    static double twice[period];
    predict(&other, &last_period, true, 0.005, mechanics, NULL);
    predict(&other, &last_period, true, 0.010, twice, NULL);
    for (size_t n = 0; n < period; n++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-15, 2.0 * mechanics[n], twice[n]);
}

static double rms_of_mechanics(void)
{
    double sum = 0.0;
    for (size_t n = 0; n < period; n++)
        sum += mechanics[n] * mechanics[n] / period;
    return sqrt(sum);
}

static void test_predict_lets_a_belt_feel_less_of_a_position_s_noise_beside_a_good_speed(void)
{
    const double noise_rad = 1e-4, gain = 0.1;
    struct random random;
    two_masses();
    run_drive();
    random_seed(&random, 3);
    for (size_t n = 0; n < rows; n++)
        position[n] += noise_rad * random_normal(&random);
    predict(&model, &last_period, true, 0.005, mechanics, NULL);
    double all_of_it = rms_of_mechanics();
    last_period.position_gain = gain;
    predict(&model, &last_period, true, 0.005, mechanics, NULL);
    // What is left of white noise behind x += gain (measured - x).
    double expected = sqrt(gain / (2.0 - gain));
    TEST_ASSERT_DOUBLE_WITHIN(0.1 * expected, expected, rms_of_mechanics() / all_of_it);
}

static void test_predict_with_a_position_gain_leaves_nothing_of_two_masses(void)
{
    two_masses();
    run_drive();
    last_period.position_gain = 0.05;
    predict(&model, &last_period, true, 0.005, mechanics, actuator);
    assert_all_zero(period, fmax(allowed_Nm, 100.0 * rounding));
}

/// Belts that swing faster than the samples come and are hardly damped shake the load wherever the motor is set anew.
/// What that would grow to is no prediction: such a model is off by a thousand times the torque, and never by more.
static void test_predict_of_a_belt_that_runs_away_says_nothing(void)
{
    const double far = 1e3, growth = 1.1;
    double most = 0.0, largest = 0.0;
    size_t away = 0;
    two_masses();
    run_drive();
    for (size_t n = 0; n < period; n++)
        most = fmax(most, fabs(last_period.torque[n]));
    model.belt_damping_Nms_per_rad = 1e-3;
    for (; model.belt_stiffness_Nm_per_rad < 1e6; model.belt_stiffness_Nm_per_rad *= growth) {
        largest = 0.0;
        predict(&model, &last_period, true, 0.005, mechanics, actuator);
        for (size_t n = 0; n < period; n++)
            largest = fmax(largest, isfinite(mechanics[n]) ? fabs(mechanics[n]) : INFINITY);
        TEST_ASSERT_TRUE(largest <= far * most);
        away += largest == far * most;
    }
    TEST_ASSERT_TRUE(away > 0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_predict_leaves_nothing_of_a_rigid_drive);
    RUN_TEST(test_predict_leaves_nothing_of_a_rigid_drive_with_every_friction_and_ripple);
    RUN_TEST(test_predict_leaves_nothing_of_two_masses);
    RUN_TEST(test_predict_leaves_nothing_of_two_masses_with_every_friction_and_ripple);
    RUN_TEST(test_predict_leaves_nothing_without_lag_and_with_whole_dead_time);
    RUN_TEST(test_predict_leaves_nothing_of_a_linear_axis);
    RUN_TEST(test_predict_leaves_nothing_of_a_third_mass);
    RUN_TEST(test_predict_leaves_nothing_of_friction_that_builds_up);
    RUN_TEST(test_predict_leaves_nothing_of_a_belt_that_is_not_linear);
    RUN_TEST(test_predict_leaves_nothing_of_an_eccentric_encoder_and_of_saturation);
    RUN_TEST(test_predict_leaves_nothing_of_what_depends_on_time);
    RUN_TEST(test_predict_runs_on_over_lost_rows);
    RUN_TEST(test_predict_kinematics_is_what_an_eccentric_encoder_contradicts);
    RUN_TEST(test_predict_gives_missing_torque_in_nm);
    RUN_TEST(test_predict_gives_missing_dead_time_to_the_actuator_channel);
    RUN_TEST(test_predict_from_measured_torque_alone_is_right_where_torque_is_slow);
    RUN_TEST(test_predict_scales_by_the_given_inertia);
    RUN_TEST(test_predict_lets_a_belt_feel_less_of_a_position_s_noise_beside_a_good_speed);
    RUN_TEST(test_predict_with_a_position_gain_leaves_nothing_of_two_masses);
    RUN_TEST(test_predict_of_a_belt_that_runs_away_says_nothing);
    return UNITY_END();
}
