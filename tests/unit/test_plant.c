/* SPDX-License-Identifier: MIT */
#include "sim/plant.h"

#include "unity.h"

#include <math.h>
#include <stdio.h>

static const double two_pi = 6.283185307179586;
/// Relative: rounding over some ten thousand steps.
static const double rounding = 1e-10;

static struct sim_model model;
static struct sim_plant plant;

void setUp(void)
{
    sim_model_default(&model);
    model.motor_inertia_kgm2 = 0.004;
    sim_plant_init(&plant, 0.0);
}

void tearDown(void) {}

static void switch_on(const char *id, double first, double second, double third)
{
    int effect = sim_effect_find(id);
    TEST_ASSERT_TRUE_MESSAGE(effect >= 0, id);
    const double values[] = {first, second, third};
    model.effect_on[effect] = true;
    for (size_t i = 0; i < 3; i++)
        model.effect_parameters[effect][i] = values[i];
}

static void two_masses(double stiffness, double damping)
{
    model.structure = sim_structure_two_mass;
    model.load_inertia_kgm2 = 0.007;
    model.belt_stiffness_Nm_per_rad = stiffness;
    model.belt_damping_Nms_per_rad = damping;
}

/// Moves the plant under a constant torque.
static void move(double torque, double dt_s, size_t steps)
{
    for (size_t i = 0; i < steps; i++)
        sim_plant_step(&plant, &model, torque, dt_s);
}

// ---- Sticking

static void assert_sticks(double torque)
{
    struct sim_plant start = plant;
    for (size_t i = 0; i < 12000; i++) {
        sim_plant_step(&plant, &model, torque, 250e-6);
        TEST_ASSERT_TRUE_MESSAGE(plant.velocity == 0.0, "speed while sticking");
    }
    TEST_ASSERT_TRUE(plant.position == start.position);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, start.time_s + 3.0, plant.time_s);
    plant = start;
}

static void assert_breaks_away(double torque)
{
    struct sim_plant start = plant;
    move(torque, 250e-6, 4);
    TEST_ASSERT_TRUE_MESSAGE(torque > 0.0 ? plant.velocity > 0.0 : plant.velocity < 0.0, "speed after breaking away");
    plant = start;
}

static void test_plant_sticks_below_coulomb_friction_and_breaks_away_above(void)
{
    model.coulomb_friction_Nm = 0.1;
    for (int sign = -1; sign <= 1; sign += 2) {
        assert_sticks(sign * 0.0);
        assert_sticks(sign * 0.05);
        assert_sticks(sign * 0.0999999);
        assert_sticks(sign * 0.1);
        assert_breaks_away(sign * 0.1000001);
    }
}

static void test_plant_sticks_with_an_elastic_load_at_rest(void)
{
    two_masses(60.0, 0.01);
    model.coulomb_friction_Nm = 0.1;
    assert_sticks(0.0999);
    assert_breaks_away(0.1001);
}

static void test_plant_breakaway_torque_contains_stribeck_excess_and_asymmetry(void)
{
    model.coulomb_friction_Nm = 0.1;
    switch_on("stribeck_friction", 0.05, 2.0, 0.0);
    assert_sticks(0.1499);
    assert_breaks_away(0.1501);
    switch_on("asymmetric_friction", 0.2, 0.0, 0.0);
    assert_sticks(0.15 * 1.2 - 1e-4);
    assert_breaks_away(0.15 * 1.2 + 1e-4);
    assert_sticks(-0.15 * 0.8 + 1e-4);
    assert_breaks_away(-0.15 * 0.8 - 1e-4);
}

static void test_plant_holding_window_is_shifted_by_bias_and_cogging(void)
{
    model.coulomb_friction_Nm = 0.1;
    switch_on("load_bias", 0.03, 0.0, 0.0);
    switch_on("cogging", 0.02, 0.4, 7.0);
    sim_plant_init(&plant, 0.9);
    double centre = 0.03 + 0.02 * cos(7.0 * 0.9 + 0.4);
    assert_sticks(centre + 0.0999);
    assert_sticks(centre - 0.0999);
    move(centre + 0.1001, 250e-6, 4);
    TEST_ASSERT_TRUE(plant.velocity > 0.0);
    sim_plant_init(&plant, 0.9);
    move(centre - 0.1001, 250e-6, 4);
    TEST_ASSERT_TRUE(plant.velocity < 0.0);
}

static void test_plant_stops_from_speed_at_the_analytic_place_and_stays(void)
{
    model.coulomb_friction_Nm = 0.1;
    for (int sign = -1; sign <= 1; sign += 2) {
        sim_plant_init(&plant, 0.0);
        plant.velocity = sign * 3.1234;
        double stop_s = model.motor_inertia_kgm2 * 3.1234 / 0.1;
        double distance = 0.5 * 3.1234 * stop_s;
        size_t steps = (size_t)(stop_s / 250e-6);
        move(0.0, 250e-6, steps);
        TEST_ASSERT_TRUE(sign * plant.velocity > 0.0);
        move(0.0, 250e-6, 1);
        TEST_ASSERT_TRUE(plant.velocity == 0.0);
        TEST_ASSERT_DOUBLE_WITHIN(rounding * distance, sign * distance, plant.position);
        assert_sticks(sign * 0.0);
        assert_sticks(sign * 0.09);
    }
}

static void test_plant_stops_with_viscous_friction_at_the_analytic_place(void)
{
    model.coulomb_friction_Nm = 0.1;
    model.viscous_friction_Nms_per_rad = 0.02;
    plant.velocity = 8.0;
    // J dv/dt = -B v - Fc from v0 to rest: x = J v0 / B - (Fc J / B^2) ln(1 + B v0 / Fc).
    double J = 0.004, B = 0.02, Fc = 0.1, v0 = 8.0;
    double distance = J * v0 / B - Fc * J / (B * B) * log1p(B * v0 / Fc);
    move(0.0, 250e-6, 4000);
    TEST_ASSERT_TRUE(plant.velocity == 0.0);
    TEST_ASSERT_DOUBLE_WITHIN(rounding * distance, distance, plant.position);
}

// ---- Momentum and energy

static void test_plant_constant_torque_gives_constant_acceleration(void)
{
    model.load_inertia_kgm2 = 0.006; // a rigid drive moves both
    move(0.25, 250e-6, 4000);
    TEST_ASSERT_DOUBLE_WITHIN(rounding * 25.0, 25.0, plant.velocity);
    TEST_ASSERT_DOUBLE_WITHIN(rounding * 12.5, 12.5, plant.position);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 1.0, plant.time_s);
    TEST_ASSERT_TRUE(plant.load_position == plant.position && plant.load_velocity == plant.velocity);
}

static void test_plant_speed_decays_with_viscous_friction(void)
{
    model.viscous_friction_Nms_per_rad = 0.01;
    plant.velocity = -5.0;
    double rate = 0.01 / 0.004;
    for (size_t i = 1; i <= 10; i++) {
        move(0.0, 250e-6, 400);
        double expected = -5.0 * exp(-rate * 0.1 * (double)i);
        TEST_ASSERT_DOUBLE_WITHIN(rounding * 5.0, expected, plant.velocity);
        TEST_ASSERT_DOUBLE_WITHIN(rounding * 5.0, (-5.0 - expected) / rate, plant.position);
    }
}

static double total_energy(void)
{
    double twist = plant.position - plant.load_position;
    return 0.5 * (model.motor_inertia_kgm2 * plant.velocity * plant.velocity +
                  model.load_inertia_kgm2 * plant.load_velocity * plant.load_velocity +
                  model.belt_stiffness_Nm_per_rad * twist * twist);
}

static void test_plant_two_masses_keep_momentum_and_energy(void)
{
    // The second belt swings so fast that a substep is divided into inner steps.
    static const double stiffnesses[] = {500.0, 2e5};
    for (size_t i = 0; i < 2; i++) {
        two_masses(stiffnesses[i], 0.0);
        sim_plant_init(&plant, 0.0);
        plant.velocity = 2.0;
        plant.load_velocity = 1.0;
        double momentum = 0.004 * 2.0 + 0.007 * 1.0, energy = total_energy();
        double rate = sqrt(stiffnesses[i] * (1.0 / 0.004 + 1.0 / 0.007));
        move(0.0, 250e-6, 2000);
        TEST_ASSERT_DOUBLE_WITHIN(rounding * momentum, momentum, 0.004 * plant.velocity + 0.007 * plant.load_velocity);
        // The integration may damp the swing like a damping ratio of 1e-5: a hundredth of what belts have at the least.
        double swing = 0.5 * 0.004 * 0.007 / 0.011;
        double most_lost = -swing * expm1(-2.0 * 1e-5 * rate * 0.5);
        TEST_ASSERT_TRUE(total_energy() <= energy * (1.0 + 1e-9));
        TEST_ASSERT_TRUE(total_energy() >= energy - most_lost);
    }
}

// ---- Two masses

static void test_plant_step_response_of_two_masses_is_the_analytic_one(void)
{
    two_masses(60.0, 0.0);
    // v1 = T t / J + T J2 / (J1 J w) sin w t, with the resonance w = sqrt(k (1/J1 + 1/J2)), J = J1 + J2.
    double J1 = 0.004, J2 = 0.007, J = J1 + J2, T = 0.3, w = sqrt(60.0 * (1.0 / J1 + 1.0 / J2));
    for (size_t n = 1; n <= 2000; n++) {
        move(T, 250e-6, 1);
        double t = 250e-6 * (double)n;
        double expected = T * t / J + T * J2 / (J1 * J * w) * sin(w * t);
        TEST_ASSERT_DOUBLE_WITHIN(1e-5 * T / (J1 * w), expected, plant.velocity);
    }
}

/// With the motor held by friction the load swings at the antiresonance, w^2 = k / J2, and decays by d / 2 J2.
static void test_plant_load_swings_at_the_antiresonance_while_the_motor_sticks(void)
{
    two_masses(60.0, 0.02);
    model.coulomb_friction_Nm = 50.0;
    plant.load_velocity = 1.0;
    double J2 = 0.007, alpha = 0.02 / (2.0 * J2), w = sqrt(60.0 / J2 - alpha * alpha);
    for (size_t n = 1; n <= 2000; n++) {
        move(0.0, 250e-6, 1);
        double t = 250e-6 * (double)n;
        TEST_ASSERT_TRUE(plant.velocity == 0.0 && plant.position == 0.0);
        TEST_ASSERT_DOUBLE_WITHIN(1e-5 / w, exp(-alpha * t) * sin(w * t) / w, plant.load_position);
    }
}

/// Steady response of the motor's speed to a sinusoidal torque over the analytic one, at any frequency.
static void assert_frequency_response(double w, double share)
{
    const double dt_s = 20e-6; // fine enough for the held torque to be a sinusoid
    const double d = model.belt_damping_Nms_per_rad, k = model.belt_stiffness_Nm_per_rad;
    size_t period = (size_t)floor(two_pi / (w * dt_s) + 0.5);
    w = two_pi / (dt_s * (double)period);
    sim_plant_init(&plant, 0.0);
    double re = 0.0, im = 0.0;
    for (size_t n = 0; n < 80 * period; n++) {
        double angle = w * dt_s * ((double)n + 0.5);
        if (n >= 78 * period) {
            re += plant.velocity * cos(angle - 0.5 * w * dt_s) / (double)period;
            im -= plant.velocity * sin(angle - 0.5 * w * dt_s) / (double)period;
        }
        sim_plant_step(&plant, &model, cos(angle), dt_s);
    }
    // H = (J2 s^2 + d s + k) / (s (J1 J2 s^2 + (J1 + J2) (d s + k))), s = j w.
    double J1 = model.motor_inertia_kgm2, J2 = model.load_inertia_kgm2;
    double nr = k - J2 * w * w, ni = d * w;
    double dr = -(J1 + J2) * d * w * w, di = w * ((J1 + J2) * k - J1 * J2 * w * w);
    double size = dr * dr + di * di, hr = (nr * dr + ni * di) / size, hi = (ni * dr - nr * di) / size;
    TEST_ASSERT_DOUBLE_WITHIN(share * hypot(hr, hi), hr, re);
    TEST_ASSERT_DOUBLE_WITHIN(share * hypot(hr, hi), hi, im);
}

static void test_plant_frequency_response_has_the_analytic_antiresonance_and_resonance(void)
{
    two_masses(60.0, 0.03);
    // Without friction the mean speed is what the start left; it falls out of the sum over whole periods.
    const double share = 2e-3;
    double antiresonance = sqrt(60.0 / 0.007), resonance = sqrt(60.0 * (1.0 / 0.004 + 1.0 / 0.007));
    assert_frequency_response(0.4 * antiresonance, share);
    assert_frequency_response(antiresonance, share);
    assert_frequency_response(0.5 * (antiresonance + resonance), share);
    assert_frequency_response(resonance, share);
    assert_frequency_response(2.0 * resonance, share);
}

// ---- Effects: the torque that keeps a speed

static void assert_keeps_speed(double speed, double torque)
{
    sim_plant_init(&plant, 0.3);
    plant.velocity = speed;
    move(torque, 250e-6, 2000);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9 * fabs(speed), speed, plant.velocity);
}

static void test_plant_constant_speed_takes_the_friction_of_that_speed(void)
{
    model.coulomb_friction_Nm = 0.1;
    model.viscous_friction_Nms_per_rad = 0.003;
    assert_keeps_speed(4.0, 0.1 + 0.012);
    assert_keeps_speed(-4.0, -0.1 - 0.012);
    switch_on("load_bias", -0.07, 0.0, 0.0);
    assert_keeps_speed(4.0, 0.1 + 0.012 - 0.07);
    assert_keeps_speed(-4.0, -0.1 - 0.012 - 0.07);
}

static void test_plant_constant_speed_takes_the_stribeck_curve(void)
{
    model.coulomb_friction_Nm = 0.1;
    model.viscous_friction_Nms_per_rad = 0.05; // outweighs the falling curve: a speed that stays is a stable one
    switch_on("stribeck_friction", 0.04, 2.0, 0.0);
    for (double v = 0.5; v < 9.0; v += 1.3) {
        assert_keeps_speed(v, 0.1 + 0.05 * v + 0.04 * exp(-v * v / 4.0));
        assert_keeps_speed(-v, -0.1 - 0.05 * v - 0.04 * exp(-v * v / 4.0));
    }
}

static void test_plant_asymmetry_scales_all_friction_each_way_and_nothing_else(void)
{
    model.coulomb_friction_Nm = 0.1;
    model.viscous_friction_Nms_per_rad = 0.01;
    switch_on("stribeck_friction", 0.04, 2.0, 0.0);
    switch_on("load_bias", 0.02, 0.0, 0.0);
    switch_on("asymmetric_friction", 0.3, 0.0, 0.0);
    double friction = 0.1 + 0.01 * 5.0 + 0.04 * exp(-25.0 / 4.0);
    assert_keeps_speed(5.0, 1.3 * friction + 0.02);
    assert_keeps_speed(-5.0, -0.7 * friction + 0.02);
}

static double opposing_smooth(double position)
{
    struct sim_motion motion = {.position = position, .velocity = 1.0, .linear = model.linear};
    struct sim_opposing o;
    sim_plant_opposing(&model, &motion, &o);
    return o.smooth;
}

static void test_plant_cogging_is_a_cosine_of_the_angle_or_of_the_travel(void)
{
    switch_on("cogging", 0.05, 0.8, 12.0);
    for (double x = -4.0; x < 4.0; x += 0.37)
        TEST_ASSERT_DOUBLE_WITHIN(1e-14, 0.05 * cos(12.0 * x + 0.8), opposing_smooth(x));
    model.linear = true;
    switch_on("cogging", 0.05, 0.8, 0.024);
    for (double x = -0.4; x < 0.4; x += 0.037)
        TEST_ASSERT_DOUBLE_WITHIN(1e-13, 0.05 * cos(two_pi * x / 0.024 + 0.8), opposing_smooth(x));
}

/// Without friction the energy put into a cogging torque's potential comes back: v^2 J / 2 + (a / n) sin(n x + p)
/// stays.
static void test_plant_cogging_stores_and_returns_energy(void)
{
    switch_on("cogging", 0.05, 0.8, 12.0);
    plant.velocity = 10.0;
    double start = 0.5 * 0.004 * 100.0 + 0.05 / 12.0 * sin(0.8);
    double lowest = INFINITY, highest = 0.0;
    for (size_t n = 0; n < 4000; n++) {
        move(0.0, 250e-6, 1);
        double now = 0.5 * 0.004 * plant.velocity * plant.velocity + 0.05 / 12.0 * sin(12.0 * plant.position + 0.8);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9 * start, start, now);
        lowest = fmin(lowest, plant.velocity);
        highest = fmax(highest, plant.velocity);
    }
    // The potential swings by 2 a / n, the speed by that over J v.
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 2.0 * 0.05 / 12.0 / (0.004 * 10.0), highest - lowest);
}

// ---- Step width

/// Where the plant is after a time under a slow sinusoidal torque held over `hold_s`, moved in `parts` steps each hold.
static double position_after(double hold_s, size_t holds, size_t parts, double amplitude)
{
    sim_plant_init(&plant, 0.0);
    plant.velocity = 6.0;
    for (size_t n = 0; n < holds; n++)
        move(amplitude * sin(0.05 * (double)n), hold_s / (double)parts, parts);
    return plant.position;
}

static void test_plant_error_falls_with_the_fourth_power_of_the_step_without_reversals(void)
{
    model.viscous_friction_Nms_per_rad = 0.002;
    switch_on("cogging", 0.05, 0.8, 20.0);
    double finest = position_after(4e-3, 200, 64, 0.002);
    TEST_ASSERT_TRUE(plant.velocity > 1.0);
    double coarse = fabs(position_after(4e-3, 200, 1, 0.002) - finest),
           fine = fabs(position_after(4e-3, 200, 2, 0.002) - finest);
    TEST_ASSERT_TRUE(coarse > 1e-9);
    TEST_ASSERT_TRUE_MESSAGE(fine < coarse / 12.0, "halving the step has to divide the error by nearly sixteen");
}

static void assert_substep_is_short_enough(double amplitude, double tolerance_rad)
{
    // A second of 250 us substeps with some fifty reversals against steps sixteen times finer.
    double finest = position_after(250e-6, 4000, 16, amplitude), usual = position_after(250e-6, 4000, 1, amplitude);
    TEST_ASSERT_DOUBLE_WITHIN(tolerance_rad, finest, usual);
}

static void test_plant_substep_is_short_enough_for_reversals(void)
{
    // Of travels of half a radian; encoders resolve some 1e-5.
    model.coulomb_friction_Nm = 0.1;
    model.viscous_friction_Nms_per_rad = 0.005;
    switch_on("stribeck_friction", 0.03, 1.0, 0.0);
    assert_substep_is_short_enough(0.3, 1e-10);
    two_masses(60.0, 0.02);
    assert_substep_is_short_enough(0.3, 5e-8);
}

static void test_plant_substep_is_short_enough_for_sticking(void)
{
    model.coulomb_friction_Nm = 0.1;
    model.viscous_friction_Nms_per_rad = 0.005;
    assert_substep_is_short_enough(0.13, 1e-10);
    // With a belt the motor breaks away within a substep, and sets off at its end: an error of the first order.
    two_masses(60.0, 0.02);
    assert_substep_is_short_enough(0.13, 1e-5);
}

static void test_plant_inner_steps_keep_a_stiff_belt_stable(void)
{
    // A belt a hundred times stiffer than what a substep of 250 us could integrate in one step.
    two_masses(5e5, 0.0);
    move(0.3, 250e-6, 4000);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0.3 / 0.011, plant.velocity);
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, 0.0, plant.position - plant.load_position);
}

// ---- Torque that changes within a step

/// Reference number n, held for a sample.
static double reference(size_t n)
{
    return 0.4 * sin(0.9 * (double)n) + 0.1 * (double)(n * n % 7) - 0.3;
}

/// Where motor and load are after 200 samples behind a dead time and a lag, in 400 steps a sample.
static struct sim_plant driven_finely(double delay, double lag)
{
    enum { parts = 400 };
    struct sim_stepper stepper;
    double torque = 0.0, step = 1.0 / parts;
    sim_stepper_init(&stepper, &model, step / model.sample_rate_hz);
    sim_plant_init(&plant, 0.0);
    for (size_t i = 0; i < 200 * parts; i++) {
        double since = ((double)i + 0.5) * step - delay, held = since > 0.0 ? reference((size_t)since) : 0.0;
        double next = held + (torque - held) * exp(-step / lag);
        sim_plant_move(&plant, &stepper, held + (torque - next) * lag / step);
        torque = next;
    }
    return plant;
}

/// The same in usual substeps; `course`: not only by their mean torques.
static struct sim_plant driven_usually(bool course)
{
    struct sim_stepper stepper;
    struct sim_actuator actuator;
    sim_stepper_init(&stepper, &model, 1.0 / (sim_substeps * model.sample_rate_hz));
    sim_plant_init(&plant, 0.0);
    sim_actuator_init(&actuator);
    for (size_t n = 0; n < 200; n++) {
        sim_actuator_hold(&actuator, reference(n));
        for (size_t i = 0; i < sim_substeps; i++)
            if (course)
                sim_plant_drive(&plant, &stepper, &actuator, i, 0.0);
            else
                sim_plant_move(&plant, &stepper, sim_actuator_substep(&actuator, &stepper, i));
    }
    return plant;
}

static void test_plant_driven_in_usual_substeps_follows_the_torques_course(void)
{
    two_masses(60.0, 0.03);
    model.dead_time_s = 0.15 / model.sample_rate_hz; // begins within a substep
    model.torque_lag_s = 0.4 / model.sample_rate_hz;
    struct sim_plant exact = driven_finely(0.15, 0.4), means = driven_usually(false), course = driven_usually(true);
    // Of what the mean torques are off by: what is left is of a higher order of the step.
    const double part = 0.05, of_position = 0.3;
    TEST_ASSERT_TRUE(fabs(means.velocity - exact.velocity) > 1e-6);
    TEST_ASSERT_DOUBLE_WITHIN(part * fabs(means.velocity - exact.velocity), exact.velocity, course.velocity);
    TEST_ASSERT_DOUBLE_WITHIN(part * fabs(means.load_velocity - exact.load_velocity), exact.load_velocity,
                              course.load_velocity);
    TEST_ASSERT_DOUBLE_WITHIN(part * fabs(means.load_position - exact.load_position), exact.load_position,
                              course.load_position);
    TEST_ASSERT_DOUBLE_WITHIN(of_position * fabs(means.position - exact.position), exact.position, course.position);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_plant_sticks_below_coulomb_friction_and_breaks_away_above);
    RUN_TEST(test_plant_sticks_with_an_elastic_load_at_rest);
    RUN_TEST(test_plant_breakaway_torque_contains_stribeck_excess_and_asymmetry);
    RUN_TEST(test_plant_holding_window_is_shifted_by_bias_and_cogging);
    RUN_TEST(test_plant_stops_from_speed_at_the_analytic_place_and_stays);
    RUN_TEST(test_plant_stops_with_viscous_friction_at_the_analytic_place);
    RUN_TEST(test_plant_constant_torque_gives_constant_acceleration);
    RUN_TEST(test_plant_speed_decays_with_viscous_friction);
    RUN_TEST(test_plant_two_masses_keep_momentum_and_energy);
    RUN_TEST(test_plant_step_response_of_two_masses_is_the_analytic_one);
    RUN_TEST(test_plant_load_swings_at_the_antiresonance_while_the_motor_sticks);
    RUN_TEST(test_plant_frequency_response_has_the_analytic_antiresonance_and_resonance);
    RUN_TEST(test_plant_constant_speed_takes_the_friction_of_that_speed);
    RUN_TEST(test_plant_constant_speed_takes_the_stribeck_curve);
    RUN_TEST(test_plant_asymmetry_scales_all_friction_each_way_and_nothing_else);
    RUN_TEST(test_plant_cogging_is_a_cosine_of_the_angle_or_of_the_travel);
    RUN_TEST(test_plant_cogging_stores_and_returns_energy);
    RUN_TEST(test_plant_error_falls_with_the_fourth_power_of_the_step_without_reversals);
    RUN_TEST(test_plant_substep_is_short_enough_for_reversals);
    RUN_TEST(test_plant_substep_is_short_enough_for_sticking);
    RUN_TEST(test_plant_inner_steps_keep_a_stiff_belt_stable);
    RUN_TEST(test_plant_driven_in_usual_substeps_follows_the_torques_course);
    return UNITY_END();
}
