/* SPDX-License-Identifier: MIT */
/// What each effect does to the drive, against closed forms or an integration of its equation that shares no code with
/// the plant. Friction and ripple have theirs in test_plant.c.
#include "sim/belt_drive.h"
#include "sim/plant.h"

#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const double two_pi = 6.283185307179586;
/// A quarter of a sample at 1 kHz.
static const double substep_s = 250e-6;

static struct sim_model model;
static struct sim_stepper stepper;
static struct sim_plant plant;

void setUp(void)
{
    sim_model_default(&model);
    model.sensors = (struct sim_sensors){0};
    model.motor_inertia_kgm2 = 0.004;
    sim_plant_init(&plant, 0.0);
}

void tearDown(void) {}

static double *switch_on(const char *id, double first, double second, double third)
{
    int effect = sim_effect_find(id);
    TEST_ASSERT_TRUE_MESSAGE(effect >= 0, id);
    const double values[] = {first, second, third};
    model.effect_on[effect] = true;
    for (size_t i = 0; i < 3; i++)
        model.effect_parameters[effect][i] = values[i];
    return model.effect_parameters[effect];
}

static void two_masses(double stiffness)
{
    model.structure = sim_structure_two_mass;
    model.load_inertia_kgm2 = 0.007;
    model.belt_stiffness_Nm_per_rad = stiffness;
}

/// Friction that holds the motor whatever the load does.
static void hold_motor(void)
{
    model.coulomb_friction_Nm = 1e3;
}

static void prepare(double dt_s)
{
    sim_stepper_init(&stepper, &model, dt_s);
}

static void move(double torque, size_t steps)
{
    for (size_t i = 0; i < steps; i++)
        sim_plant_move(&plant, &stepper, torque);
}

// ---- Presliding

/// While the motor moves one way friction is s Fc (1 - exp(-x / distance)) from rest on: what the motion loses is its
/// integral over the way.
static void test_presliding_takes_the_energy_of_its_curve(void)
{
    const double Fc = 0.05, distance = 2e-3, J = 0.004, v0 = 3.0;
    model.coulomb_friction_Nm = Fc;
    switch_on("presliding", distance, 0.0, 0.0);
    prepare(substep_s);
    plant.velocity = v0;
    double start = 0.5 * J * v0 * v0;
    for (size_t n = 0; n < 300; n++) {
        move(0.0, 1);
        double x = plant.position, v = plant.velocity;
        double lost = Fc * (x + distance * expm1(-x / distance));
        TEST_ASSERT_DOUBLE_WITHIN(1e-6 * start, start - lost, 0.5 * J * v * v);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, -Fc * expm1(-x / distance), plant.bristle);
    }
    TEST_ASSERT_TRUE(plant.position > 50.0 * distance);
}

/// From rest on, what is missing of the level is (1 - (1 - n) x / distance)^(1 / (1 - n)) with Dahl's exponent n, and
/// with n below 1 nothing from an end on.
static void test_presliding_follows_its_exponent(void)
{
    const double Fc = 0.05, distance = 2e-3;
    model.coulomb_friction_Nm = Fc;
    for (int i = 0; i < 2; i++) {
        sim_plant_init(&plant, 0.0);
        switch_on("presliding", distance, i == 0 ? 0.5 : 2.0, 0.0);
        prepare(substep_s);
        plant.velocity = 3.0;
        for (size_t n = 0; n < 30; n++) {
            move(0.0, 1);
            double way = plant.position / distance, left = fmax(1.0 - 0.5 * way, 0.0);
            double missing = i == 0 ? left * left : 1.0 / (1.0 + way);
            TEST_ASSERT_DOUBLE_WITHIN(1e-9, Fc * (1.0 - missing), plant.bristle);
        }
    }
}

/// Far below its level friction is a spring of Fc / distance.
static void test_presliding_is_a_spring_for_small_motion(void)
{
    const double Fc = 0.05, distance = 1e-2, J = 0.004, w = sqrt(Fc / (distance * J)), v0 = 1e-4;
    model.coulomb_friction_Nm = Fc;
    switch_on("presliding", distance, 0.0, 0.0);
    prepare(substep_s);
    plant.velocity = v0;
    // The amplitude is 3e-4 of the distance: so much the loop's curvature takes each way.
    for (size_t n = 1; n < 2000; n++) {
        move(0.0, 1);
        TEST_ASSERT_DOUBLE_WITHIN(0.02 * v0 / w, v0 / w * sin(w * substep_s * (double)n), plant.position);
    }
}

/// dv/dt = (T - F - damping dF/dt) / J, dF/dt = (v Fd(v) - |v| F) / distance by small midpoint steps.
static void reference_presliding(double torque, double level, double excess, double excess_speed, double distance,
                                 double damping_s, double time_s, double io[3])
{
    const double h = 2e-7;
    size_t steps = (size_t)(time_s / h + 0.5);
    for (size_t i = 0; i < steps; i++) {
        double at[3] = {io[0], io[1], io[2]};
        for (int stage = 0; stage < 2; stage++) {
            double reach = stage == 0 ? 0.5 * h : h, ratio = at[1] / excess_speed;
            double dry = level + excess * exp(-ratio * ratio);
            double rate = (at[1] * dry - fabs(at[1]) * at[2]) / distance, v = at[1];
            double pull = (torque - at[2] - damping_s * rate) / 0.004;
            at[0] = io[0] + reach * v;
            at[1] = io[1] + reach * pull;
            at[2] = io[2] + reach * rate;
        }
        memcpy(io, at, sizeof at);
    }
}

static void test_presliding_follows_its_equation_through_reversals(void)
{
    static const double distances[] = {1e-4, 1e-3, 2e-2, 1e-3}, dampings_s[] = {0.0, 0.0, 0.0, 5e-4};
    for (size_t d = 0; d < 4; d++) {
        double state[3] = {0.0, 0.0, 0.0}, largest = 0.0;
        setUp();
        model.coulomb_friction_Nm = 0.05;
        switch_on("presliding", distances[d], 0.0, dampings_s[d]);
        switch_on("stribeck_friction", 0.02, 0.5, 0.0);
        prepare(substep_s);
        for (size_t n = 0; n < 800; n++) {
            double torque = 0.15 * sin(0.02 * (double)n) + 0.05 * sin(0.13 * (double)n);
            move(torque, 1);
            reference_presliding(torque, 0.05, 0.02, 0.5, distances[d], dampings_s[d], substep_s, state);
            largest = fmax(largest, fabs(state[0]));
            // Encoders resolve some 1e-5 rad of travels of tenths.
            TEST_ASSERT_DOUBLE_WITHIN(5e-5 * fmax(largest, 1e-2), state[0], plant.position);
            TEST_ASSERT_DOUBLE_WITHIN(2e-3, state[1], plant.velocity);
        }
        TEST_ASSERT_TRUE(largest > 0.01);
    }
}

/// Under a torque below its level it holds: the motor comes to rest where the spring holds the torque.
/// RMS over a motion with many reversals of what a look one sample ahead is off by, from where ever finer steps lead,
/// as torque on the body and a share of the torque's RMS. A look keeps the bristle where the last one left it.
static double share_missed_ahead(double peak_speed)
{
    enum { looks = 300, fine = 32 };
    const double sample_s = sim_substeps * substep_s, omega = two_pi * 7.0;
    const double inertia = model.motor_inertia_kgm2 + model.load_inertia_kgm2, size = peak_speed * inertia * omega;
    struct sim_stepper quick;
    double bristle = 0.0, missed = 0.0, all = 0.0;
    sim_stepper_init_quick(&quick, &model, substep_s);
    prepare(substep_s / fine);
    for (size_t n = 0; n < looks; n++) {
        double angle = omega * sample_s * (double)n;
        double friction = copysign(0.9 * model.coulomb_friction_Nm, plant.velocity);
        double torque = size * (cos(angle) + 0.3 * cos(4.3 * angle)) + friction;
        struct sim_plant ahead = plant;
        ahead.bristle = bristle;
        for (size_t i = 0; i < sim_substeps; i++)
            sim_plant_move(&ahead, &quick, torque);
        bristle = ahead.bristle;
        move(torque, (size_t)sim_substeps * fine);
        double error = inertia * (ahead.velocity - plant.velocity) / sample_s;
        missed += error * error;
        all += torque * torque;
    }
    return sqrt(missed / all);
}

static void test_presliding_looks_ahead_as_fine_steps_do(void)
{
    static const double distances[] = {1e-5, 1e-4, 1e-3, 1e-2}, exponents[] = {0.33, 1.0, 2.0}, speeds[] = {0.02, 5.0};
    const double least_sensible = 2e-4; // of the torque: a good torque sensor has ten times as much noise
    for (size_t d = 0; d < 4; d++)
        for (size_t e = 0; e < 3; e++)
            for (size_t s = 0; s < 2; s++) {
                char message[80];
                setUp();
                model.motor_inertia_kgm2 = model.load_inertia_kgm2 = 1e-4;
                model.coulomb_friction_Nm = 0.05;
                switch_on("presliding", distances[d], exponents[e], 0.0);
                snprintf(message, sizeof message, "%g rad, exponent %g, to %g rad/s", distances[d], exponents[e],
                         speeds[s]);
                TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(least_sensible, 0.0, share_missed_ahead(speeds[s]), message);
            }
}

/// Friction that falls with speed while it builds up.
static void test_presliding_looks_ahead_beside_stribeck_friction(void)
{
    model.motor_inertia_kgm2 = model.load_inertia_kgm2 = 1e-4;
    model.coulomb_friction_Nm = 0.05;
    switch_on("presliding", 1e-4, 1.0, 0.0);
    switch_on("stribeck_friction", 0.02, 1.0, 0.0);
    TEST_ASSERT_DOUBLE_WITHIN(2e-4, 0.0, share_missed_ahead(5.0));
}

static void test_presliding_holds_below_its_level(void)
{
    model.coulomb_friction_Nm = 0.05;
    model.viscous_friction_Nms_per_rad = 2.0; // creeps there without a swing
    switch_on("presliding", 1e-3, 0.0, 0.0);
    prepare(substep_s);
    move(0.03, 20000);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.03, plant.bristle);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.0, plant.velocity);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, -1e-3 * log1p(-0.03 / 0.05), plant.position);
}

// ---- Third mass

/// With the motor held the mass swings at its own frequency and decays by its damping ratio.
static void test_second_mode_swings_at_its_frequency_on_a_held_body(void)
{
    const double f = 23.0, zeta = 0.04, w = two_pi * f, wd = w * sqrt(1.0 - zeta * zeta);
    hold_motor();
    switch_on("second_mode", f, 0.0007, zeta);
    prepare(substep_s);
    plant.attached_velocity = 2.0;
    for (size_t n = 1; n < 3000; n++) {
        move(0.0, 1);
        double t = substep_s * (double)n;
        TEST_ASSERT_TRUE(plant.velocity == 0.0);
        TEST_ASSERT_DOUBLE_WITHIN(1e-10 / w, 2.0 / wd * exp(-zeta * w * t) * sin(wd * t), plant.attached_position);
    }
}

/// On a free body both swing at sqrt(k2 (1/J + 1/J3)), and a step of torque does what it does to two masses.
static void test_second_mode_on_a_free_body_is_a_pair_of_masses(void)
{
    const double f = 30.0, J = 0.004, J3 = 0.001, k = J3 * two_pi * f * two_pi * f, T = 0.2;
    const double w = sqrt(k * (1.0 / J + 1.0 / J3));
    switch_on("second_mode", f, J3, 0.0);
    prepare(substep_s);
    for (size_t n = 1; n < 2000; n++) {
        move(T, 1);
        double t = substep_s * (double)n;
        double expected = T * t / (J + J3) + T * J3 / (J * (J + J3) * w) * sin(w * t);
        TEST_ASSERT_DOUBLE_WITHIN(1e-10 * T / (J * w), expected, plant.velocity);
    }
}

static double energy_of_three(double f, double J3)
{
    double e = plant.position - plant.load_position, d = plant.load_position - plant.attached_position;
    double w = two_pi * f;
    return 0.5 * (0.004 * plant.velocity * plant.velocity + 0.007 * plant.load_velocity * plant.load_velocity +
                  J3 * plant.attached_velocity * plant.attached_velocity + 60.0 * e * e + J3 * w * w * d * d);
}

static void test_second_mode_on_a_load_keeps_momentum_and_energy(void)
{
    const double f = 41.0, J3 = 0.002;
    two_masses(60.0);
    switch_on("second_mode", f, J3, 0.0);
    prepare(substep_s);
    plant.velocity = 2.0;
    double start = energy_of_three(f, J3), momentum = 0.004 * 2.0;
    move(0.0, 4000);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9 * start, start, energy_of_three(f, J3));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9 * momentum, momentum,
                              0.004 * plant.velocity + 0.007 * plant.load_velocity + J3 * plant.attached_velocity);
    TEST_ASSERT_TRUE(fabs(plant.attached_velocity - plant.load_velocity) > 1e-3);
}

// ---- Belt

static void test_position_dependent_stiffness_is_the_stiffness_at_the_motor(void)
{
    static const double positions[] = {-3.0, 0.0, 2.5};
    hold_motor();
    two_masses(60.0);
    switch_on("position_dependent_stiffness", 0.1, 0.0, 0.0);
    prepare(substep_s);
    for (size_t i = 0; i < 3; i++) {
        sim_plant_init(&plant, positions[i]);
        plant.load_velocity = 1.0;
        double w = sqrt(60.0 * (1.0 + 0.1 * positions[i]) / 0.007);
        for (size_t n = 1; n < 1500; n++) {
            move(0.0, 1);
            TEST_ASSERT_DOUBLE_WITHIN(2e-5 / w, sin(w * substep_s * (double)n) / w, plant.load_position - positions[i]);
        }
    }
}

/// Complete elliptic integral of the first kind by the arithmetic-geometric mean.
static double elliptic(double m)
{
    double a = 1.0, b = sqrt(1.0 - m);
    for (int i = 0; i < 40; i++) {
        double mean = 0.5 * (a + b);
        b = sqrt(a * b);
        a = mean;
    }
    return two_pi / 4.0 / a;
}

/// A load on a held motor is Duffing's oscillator: period 4 K(m) / (w sqrt(1 + c A^2)), m = c A^2 / (2 (1 + c A^2)).
static void test_hardening_stiffness_swings_with_the_period_of_its_amplitude(void)
{
    const double c = 2e3, A = 0.02, k = 60.0, J = 0.007, stretch = c * A * A;
    hold_motor();
    two_masses(k);
    switch_on("hardening_stiffness", c, 0.0, 0.0);
    prepare(substep_s);
    plant.load_position = A;
    double period = 4.0 * elliptic(stretch / (2.0 * (1.0 + stretch))) / sqrt(k / J * (1.0 + stretch));
    double at_s = 0.0, before = A;
    size_t crossings = 0;
    for (size_t n = 1; crossings < 20; n++) {
        move(0.0, 1);
        if (before * plant.load_position < 0.0) {
            crossings++;
            at_s = substep_s * ((double)n - 1.0 + before / (before - plant.load_position));
        }
        before = plant.load_position;
        double energy = 0.5 * J * plant.load_velocity * plant.load_velocity +
                        0.5 * k * before * before * (1.0 + 0.5 * c * before * before);
        TEST_ASSERT_DOUBLE_WITHIN(2e-4 * energy, 0.5 * k * A * A * (1.0 + 0.5 * stretch), energy);
    }
    // The crossings' places are interpolated to a hundredth of a substep.
    TEST_ASSERT_DOUBLE_WITHIN(0.01 * substep_s + 2e-5 * at_s, (0.25 + 0.5 * 19.0) * period, at_s);
}

/// Between the stops of the gap the load runs free, at them it bounces off a spring: half a period of it each time.
static void test_backlash_bounces_with_the_period_of_flight_and_spring(void)
{
    const double gap = 0.004, k = 60.0, J = 0.007, v = 0.3, w = sqrt(k / J);
    hold_motor();
    two_masses(k);
    switch_on("backlash", gap, 0.0, 0.0);
    prepare(substep_s);
    plant.load_velocity = v;
    double period = 2.0 * gap / v + two_pi / w, at_s = 0.0, before = 0.0;
    size_t crossings = 0;
    for (size_t n = 1; crossings < 12; n++) {
        move(0.0, 1);
        if (fabs(plant.load_position) < 0.9 * 0.5 * gap)
            TEST_ASSERT_DOUBLE_WITHIN(1e-4 * v, v, fabs(plant.load_velocity));
        if (before * plant.load_position < 0.0) {
            crossings++;
            at_s = substep_s * ((double)n - 1.0 + before / (before - plant.load_position));
        }
        before = plant.load_position;
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-4 * at_s, 6.0 * period, at_s);
}

static void test_backlash_gives_no_torque_and_no_damping_inside(void)
{
    two_masses(60.0);
    model.belt_damping_Nms_per_rad = 0.05;
    switch_on("backlash", 0.01, 0.0, 0.0);
    prepare(substep_s);
    plant.velocity = 0.5; // 4.9 mrad in 39 substeps
    move(0.0, 39);
    TEST_ASSERT_EQUAL_DOUBLE(0.5, plant.velocity);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, plant.load_velocity);
    move(0.0, 10);
    TEST_ASSERT_TRUE(plant.velocity < 0.5 && plant.load_velocity > 0.0);
}

// ---- In time

static void test_periodic_disturbance_is_a_cosine_in_time(void)
{
    const double a = 0.03, phase = 0.6, f = 7.3, w = two_pi * f;
    switch_on("periodic_disturbance", a, phase, f);
    prepare(substep_s);
    for (size_t n = 1; n < 2000; n++) {
        move(0.0, 1);
        double t = substep_s * (double)n;
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, -a / (0.004 * w) * (sin(w * t + phase) - sin(phase)), plant.velocity);
    }
}

/// J dv/dt = -B v (1 + d (1 - exp(-t/T))): ln(v/v0) = -B/J ((1 + d) t - d T (1 - exp(-t/T))).
static void test_friction_drift_scales_friction_as_time_goes_on(void)
{
    const double B = 0.004, d = 0.5, T = 0.3, J = 0.004;
    model.viscous_friction_Nms_per_rad = B;
    switch_on("friction_drift", d, T, 0.0);
    prepare(substep_s);
    plant.velocity = 4.0;
    for (size_t n = 1; n < 4000; n++) {
        move(0.0, 1);
        double t = substep_s * (double)n;
        double expected = 4.0 * exp(-B / J * ((1.0 + d) * t + d * T * expm1(-t / T)));
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, expected, plant.velocity);
    }
    struct sim_motion motion = {.velocity = -1.0, .time_s = 100.0 * T};
    struct sim_opposing o;
    model.coulomb_friction_Nm = 0.1;
    sim_plant_opposing(&model, &motion, &o);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1.0 + d, o.positive_factor);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1.0 + d, o.negative_factor);
}

// ---- Actuator

static void test_torque_saturation_clips_behind_lag_and_dead_time(void)
{
    struct sim_actuator actuator;
    model.torque_lag_s = 2e-3;
    model.dead_time_s = 1e-3;
    switch_on("torque_saturation", 0.4, 0.0, 0.0);
    prepare(substep_s);
    sim_actuator_init(&actuator);
    double largest = 0.0;
    for (size_t n = 0; n < 60; n++) {
        double ref = n < 30 ? 1.0 : -1.0;
        sim_actuator_hold(&actuator, ref);
        double t = (double)n - 1.0, now = sim_actuator_now(&actuator, &stepper);
        double unlimited = t <= 0.0    ? 0.0
                           : t <= 30.0 ? -expm1(-t / 2.0)
                                       : -1.0 + (2.0 - exp(-30.0 / 2.0)) * exp(-(t - 30.0) / 2.0);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, fmin(fmax(unlimited, -0.4), 0.4), now);
        for (size_t i = 0; i < sim_substeps; i++)
            largest = fmax(largest, fabs(sim_actuator_substep(&actuator, &stepper, i)));
    }
    TEST_ASSERT_EQUAL_DOUBLE(0.4, largest);
}

// ---- Sensors and record

static void test_encoder_eccentricity_is_in_angle_and_in_a_speed_derived_from_it(void)
{
    const double a = 0.002, phase = 0.4;
    struct sim_motion motion = {.position = 1.3, .velocity = 5.0};
    struct sim_sensed sensed;
    double *parameters = switch_on("encoder_eccentricity", a, phase, 1.0);
    prepare(substep_s);
    sim_stepper_sense(&stepper, &motion, &sensed);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, 1.3 + a * cos(1.3 + phase), sensed.position);
    TEST_ASSERT_DOUBLE_WITHIN(1e-14, 5.0 * (1.0 - a * sin(1.3 + phase)), sensed.velocity);
    struct sim_motion back = {0};
    sim_stepper_unsense(&stepper, &sensed, &back);
    TEST_ASSERT_DOUBLE_WITHIN(1e-13, motion.position, back.position);
    TEST_ASSERT_DOUBLE_WITHIN(1e-13, motion.velocity, back.velocity);
    parameters[2] = 0.0;
    prepare(substep_s);
    sim_stepper_sense(&stepper, &motion, &sensed);
    TEST_ASSERT_EQUAL_DOUBLE(5.0, sensed.velocity);
    model.linear = true; // the same shaft, seen through a pulley
    model.pulley_radius_m = 0.02;
    parameters[0] = a * 0.02;
    parameters[2] = 1.0;
    prepare(substep_s);
    motion = (struct sim_motion){.position = 1.3 * 0.02, .velocity = 5.0 * 0.02, .linear = true};
    sim_stepper_sense(&stepper, &motion, &sensed);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, 0.02 * (1.3 + a * cos(1.3 + phase)), sensed.position);
    TEST_ASSERT_DOUBLE_WITHIN(1e-14, 0.02 * 5.0 * (1.0 - a * sin(1.3 + phase)), sensed.velocity);
}

enum { rows = 6000 };

static double column[4][rows];
static bool mask[rows];

static void record(double amplitude)
{
    static struct sim_belt_drive drive;
    sim_belt_drive_init(&drive, &model, 0.0);
    for (size_t n = 0; n < rows; n++) {
        double w = two_pi * 3.0, t = (double)n / model.sample_rate_hz;
        struct sim_command command = {
            .control = sim_control_cascade, .position = amplitude * sin(w * t), .velocity = amplitude * w * cos(w * t)};
        struct sim_sample sample;
        sim_belt_drive_step(&drive, &command, &sample);
        column[0][n] = sample.torque;
        column[1][n] = sample.position;
        column[2][n] = sample.velocity;
        column[3][n] = sample.torque_ref;
    }
}

static bool notice(double *out_share, double *out_deviation, double *out_evidence)
{
    struct sim_columns columns = {
        .rows = rows, .sample_rate_hz = 1000.0, .torque = column[0], .position = column[1], .velocity = column[2]};
    int effect = sim_effect_find("lost_samples");
    return sim_effects[effect]->notice(&columns, out_share, out_deviation, out_evidence, mask);
}

static void test_lost_samples_repeat_rows_but_for_the_reference_and_are_noticed(void)
{
    static double whole[4][rows];
    double share, deviation, evidence;
    model.coulomb_friction_Nm = 0.05;
    model.sensors.position_noise_rad = 5e-6;
    model.sensors.torque_noise_Nm = 3e-3;
    model.sensors.velocity_noise_rad_per_s = 2e-3;
    record(1.0);
    memcpy(whole, column, sizeof whole);
    TEST_ASSERT_FALSE(notice(&share, &deviation, &evidence));
    switch_on("lost_samples", 0.02, 0.0, 0.0);
    record(1.0);
    TEST_ASSERT_TRUE(notice(&share, &deviation, &evidence));
    size_t lost = 0;
    for (size_t n = 1; n < rows; n++) {
        bool changed = column[1][n] != whole[1][n];
        char message[40];
        snprintf(message, sizeof message, "row %zu", n);
        TEST_ASSERT_EQUAL_INT_MESSAGE(changed, mask[n], message);
        TEST_ASSERT_EQUAL_DOUBLE(whole[3][n], column[3][n]);
        for (size_t c = 0; c < 3; c++)
            TEST_ASSERT_EQUAL_DOUBLE(changed ? column[c][n - 1] : whole[c][n], column[c][n]);
        lost += changed;
    }
    // A few rows around reversals do not count: there the axis hardly moves.
    TEST_ASSERT_DOUBLE_WITHIN(1e-2 * share, (double)lost / rows, share);
    TEST_ASSERT_DOUBLE_WITHIN(4.0 * deviation, 0.02, share);
    TEST_ASSERT_TRUE(evidence > 100.0);
}

/// Position counts repeat all the time; that noisy torque and speed do so in the same row, nobody waits for.
static void test_lost_samples_are_noticed_from_two_rows_on_beside_coarse_counts(void)
{
    const double doubt = 12.0 + 0.5 * log((double)rows); // repair.c
    double share, deviation, evidence;
    model.coulomb_friction_Nm = 0.05;
    model.sensors.counts_per_rev = 8192.0;
    model.sensors.torque_noise_Nm = 3e-3;
    model.sensors.velocity_noise_rad_per_s = 2e-3;
    record(0.3);
    TEST_ASSERT_FALSE(notice(&share, &deviation, &evidence));
    for (size_t n = 1020; n < 1022; n++)
        for (size_t c = 0; c < 3; c++)
            column[c][n] = column[c][n - 1];
    TEST_ASSERT_TRUE(notice(&share, &deviation, &evidence));
    TEST_ASSERT_TRUE(evidence > doubt);
    TEST_ASSERT_TRUE(mask[1020] && mask[1021] && !mask[1019] && !mask[1022]);
    // Two columns alone, of which one repeats often, do not say as much.
    struct sim_columns two = {.rows = rows, .sample_rate_hz = 1000.0, .torque = column[0], .position = column[1]};
    sim_effects[sim_effect_find("lost_samples")]->notice(&two, &share, &deviation, &evidence, mask);
    TEST_ASSERT_TRUE(evidence < doubt);
}

static void test_lost_samples_are_not_noticed_in_coarse_columns_or_at_rest(void)
{
    double share, deviation, evidence;
    model.coulomb_friction_Nm = 0.05;
    model.sensors.counts_per_rev = 2000.0; // many rows with one count
    record(0.05);
    for (size_t n = 1; n < rows; n++) {
        column[2][n] = (column[1][n] - column[1][n - 1]) * model.sample_rate_hz;
        column[0][n] = 0.02 * floor(column[0][n] / 0.02 + 0.5); // a coarse current
    }
    TEST_ASSERT_FALSE(notice(&share, &deviation, &evidence));
    record(0.0);
    TEST_ASSERT_FALSE(notice(&share, &deviation, &evidence));
}

// ---- Steps

/// Where the plant is after half a second of usual substeps, and of sixteen times finer ones, under one held torque.
static void assert_substep_is_short_enough(double tolerance_rad)
{
    static const size_t parts[] = {1, 16};
    double reached[2];
    for (size_t p = 0; p < 2; p++) {
        prepare(substep_s / (double)parts[p]);
        sim_plant_init(&plant, 0.0);
        plant.velocity = plant.load_velocity = 2.0;
        for (size_t n = 0; n < 2000; n++)
            move(0.3 * sin(0.05 * (double)n) + 0.1 * sin(0.31 * (double)n), parts[p]);
        reached[p] = plant.position;
    }
    TEST_ASSERT_DOUBLE_WITHIN(tolerance_rad, reached[1], reached[0]);
}

/// Of travels of tenths of a radian; encoders resolve some 1e-5.
static void test_usual_substep_is_short_enough_for_every_effect(void)
{
    static const struct {
        const char *id;
        double first, second, third, tolerance_rad;
    } cases[] = {{"presliding", 1e-3, 0.0, 0.0, 1e-6},
                 {"presliding", 1e-5, 0.0, 0.0, 1e-5},
                 {"second_mode", 60.0, 0.002, 0.01, 1e-7},
                 {"position_dependent_stiffness", 0.2, 0.0, 0.0, 1e-7},
                 {"hardening_stiffness", 1e5, 0.0, 0.0, 1e-6},
                 {"backlash", 2e-3, 0.0, 0.0, 1e-5},
                 {"backlash", 5e-5, 0.0, 0.0, 1e-5}, // passed through within a substep
                 {"periodic_disturbance", 0.05, 0.3, 11.0, 1e-7},
                 {"friction_drift", 0.5, 0.2, 0.0, 1e-7}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        setUp();
        two_masses(60.0);
        model.belt_damping_Nms_per_rad = 0.02;
        model.coulomb_friction_Nm = 0.05;
        switch_on(cases[i].id, cases[i].first, cases[i].second, cases[i].third);
        TEST_MESSAGE(cases[i].id);
        assert_substep_is_short_enough(cases[i].tolerance_rad);
    }
}

/// The exact step and the Runge-Kutta one agree, for one to three masses.
static void test_exact_steps_agree_with_integrated_ones(void)
{
    for (int masses = 1; masses <= 3; masses++) {
        setUp();
        model.viscous_friction_Nms_per_rad = 0.003;
        model.coulomb_friction_Nm = 0.03;
        switch_on("asymmetric_friction", 0.2, 0.0, 0.0);
        switch_on("load_bias", 0.01, 0.0, 0.0);
        if (masses > 1)
            two_masses(60.0);
        if (masses > 2)
            switch_on("second_mode", 35.0, 0.001, 0.02);
        prepare(substep_s);
        TEST_ASSERT_TRUE(stepper.exact);
        struct sim_plant integrated = plant;
        for (size_t n = 0; n < 1000; n++) {
            double torque = 0.2 * sin(0.03 * (double)n);
            move(torque, 1);
            for (int i = 0; i < 8; i++)
                sim_plant_step(&integrated, &model, torque, substep_s / 8);
            TEST_ASSERT_DOUBLE_WITHIN(1e-7, integrated.position, plant.position);
            TEST_ASSERT_DOUBLE_WITHIN(1e-5, integrated.velocity, plant.velocity);
            TEST_ASSERT_DOUBLE_WITHIN(1e-5, integrated.load_velocity, plant.load_velocity);
            TEST_ASSERT_DOUBLE_WITHIN(1e-5, integrated.attached_velocity, plant.attached_velocity);
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_presliding_takes_the_energy_of_its_curve);
    RUN_TEST(test_presliding_follows_its_exponent);
    RUN_TEST(test_presliding_is_a_spring_for_small_motion);
    RUN_TEST(test_presliding_follows_its_equation_through_reversals);
    RUN_TEST(test_presliding_looks_ahead_as_fine_steps_do);
    RUN_TEST(test_presliding_looks_ahead_beside_stribeck_friction);
    RUN_TEST(test_presliding_holds_below_its_level);
    RUN_TEST(test_second_mode_swings_at_its_frequency_on_a_held_body);
    RUN_TEST(test_second_mode_on_a_free_body_is_a_pair_of_masses);
    RUN_TEST(test_second_mode_on_a_load_keeps_momentum_and_energy);
    RUN_TEST(test_position_dependent_stiffness_is_the_stiffness_at_the_motor);
    RUN_TEST(test_hardening_stiffness_swings_with_the_period_of_its_amplitude);
    RUN_TEST(test_backlash_bounces_with_the_period_of_flight_and_spring);
    RUN_TEST(test_backlash_gives_no_torque_and_no_damping_inside);
    RUN_TEST(test_periodic_disturbance_is_a_cosine_in_time);
    RUN_TEST(test_friction_drift_scales_friction_as_time_goes_on);
    RUN_TEST(test_torque_saturation_clips_behind_lag_and_dead_time);
    RUN_TEST(test_encoder_eccentricity_is_in_angle_and_in_a_speed_derived_from_it);
    RUN_TEST(test_lost_samples_repeat_rows_but_for_the_reference_and_are_noticed);
    RUN_TEST(test_lost_samples_are_noticed_from_two_rows_on_beside_coarse_counts);
    RUN_TEST(test_lost_samples_are_not_noticed_in_coarse_columns_or_at_rest);
    RUN_TEST(test_usual_substep_is_short_enough_for_every_effect);
    RUN_TEST(test_exact_steps_agree_with_integrated_ones);
    return UNITY_END();
}
