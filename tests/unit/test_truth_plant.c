/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "tests/truth/truth_plant.h"
#include "unity.h"

static const double pi = 3.14159265358979323846;
static const double sample_s = 1e-3;

// The actuator and a rigid body under held torque are polynomials of low degree in time: only rounding is left.
static const double rounding = 1e-11;
// Runge-Kutta of order 4 at 40 us and a mode of 60 Hz: (2 pi 60 40e-6)^4 / 120 is 4e-10 of a cycle's phase.
static const double integration = 1e-7;

static struct truth_plant drive;

void setUp(void) {}

void tearDown(void) {}

static struct truth_plant_spec body(void)
{
    return (struct truth_plant_spec){
        .motor_inertia_kgm2 = 0.002, .load_inertia_kgm2 = 0.003, .sample_s = sample_s, .step_s = 40e-6};
}

static struct truth_plant_spec two_bodies(void)
{
    struct truth_plant_spec spec = body();
    spec.two_mass = 1;
    spec.belt_stiffness_Nm_per_rad = spec.load_inertia_kgm2 * pow(2.0 * pi * 40.0, 2.0);
    return spec;
}

static void start(const struct truth_plant_spec *spec)
{
    truth_plant_init(&drive, spec, 0.0, 1u);
}

static void play(double torque, int samples)
{
    for (int n = 0; n < samples; n++) {
        truth_plant_hold(&drive, torque);
        truth_plant_advance(&drive);
    }
}

static void test_truth_random_bits_match_the_published_sequence(void)
{
    // Output of the authors' pcg32 demo, seed 42, stream 54.
    static const uint32_t published[6] = {0xa15c02b7u, 0x7b47f409u, 0xba1d3330u, 0x83d2f293u, 0xbfa4784bu, 0xcbed606eu};
    struct truth_random random;
    truth_random_init(&random, 42u, 54u);
    for (int i = 0; i < 6; i++) {
        TEST_ASSERT_EQUAL_HEX32(published[i], truth_random_bits(&random));
    }
}

static void test_truth_plant_accelerates_evenly_under_constant_torque(void)
{
    struct truth_plant_spec spec = body();
    start(&spec);
    play(0.1, 500);
    TEST_ASSERT_DOUBLE_WITHIN(10.0 * rounding, 0.1 / 0.005 * 0.5, drive.velocity_rad_per_s);
    TEST_ASSERT_DOUBLE_WITHIN(10.0 * rounding, 0.5 * 0.1 / 0.005 * 0.25, drive.position_rad);
}

static void test_truth_plant_slows_exponentially_under_viscous_friction(void)
{
    struct truth_plant_spec spec = body();
    spec.viscous_friction_Nms_per_rad = 0.02;
    start(&spec);
    truth_plant_launch(&drive, 3.0);
    play(0.0, 500);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 3.0 * exp(-0.5 * 0.02 / 0.005), drive.velocity_rad_per_s);
}

static void test_truth_plant_stands_exactly_still_below_breakaway(void)
{
    struct truth_plant_spec spec = body();
    spec.coulomb_friction_Nm = 0.05;
    spec.torque_lag_s = 0.5e-3;
    truth_plant_init(&drive, &spec, 0.7, 1u);
    for (int n = 0; n < 1000; n++) {
        truth_plant_hold(&drive, 0.0499 * sin(0.3 * n));
        truth_plant_advance(&drive);
        TEST_ASSERT_TRUE(drive.velocity_rad_per_s == 0.0);
        TEST_ASSERT_TRUE(drive.position_rad == 0.7);
    }
}

static void test_truth_plant_breaks_away_at_the_torque_of_each_direction(void)
{
    struct truth_plant_spec spec = body();
    spec.coulomb_friction_Nm = 0.05;
    spec.stribeck_excess_Nm = 0.03;
    spec.stribeck_velocity_rad_per_s = 0.3;
    spec.asymmetry_ratio = 0.2;
    const double edge[2] = {0.08 * 1.2, -0.08 * 0.8};
    for (int i = 0; i < 2; i++) {
        start(&spec);
        play(0.999 * edge[i], 100);
        TEST_ASSERT_TRUE(drive.velocity_rad_per_s == 0.0);
        play(1.001 * edge[i], 100);
        TEST_ASSERT_TRUE(drive.velocity_rad_per_s * edge[i] > 0.0);
    }
}

static void test_truth_plant_breaks_away_at_the_right_moment_inside_a_step(void)
{
    struct truth_plant_spec spec = body();
    spec.coulomb_friction_Nm = 0.05;
    spec.torque_lag_s = 1e-3;
    start(&spec);
    play(0.2, 20);
    // From t0, where the lagged torque reaches Fc, J v = integral of 0.2 (1 - exp(-t/T)) - Fc.
    double T = 1e-3, t0 = -T * log(1.0 - 0.05 / 0.2), t = 20e-3;
    double impulse = 0.15 * (t - t0) + 0.2 * T * (exp(-t / T) - exp(-t0 / T));
    TEST_ASSERT_DOUBLE_WITHIN(integration, impulse / 0.005, drive.velocity_rad_per_s);
}

static void test_truth_plant_stops_where_friction_has_used_up_the_energy(void)
{
    struct truth_plant_spec spec = body();
    spec.coulomb_friction_Nm = 0.05;
    start(&spec);
    truth_plant_launch(&drive, -1.2345);
    play(0.0, 123);
    TEST_ASSERT_TRUE(drive.velocity_rad_per_s < 0.0);
    play(0.0, 1);
    TEST_ASSERT_TRUE(drive.velocity_rad_per_s == 0.0);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, -0.005 * 1.2345 * 1.2345 / (2.0 * 0.05), drive.position_rad);
    double rest = drive.position_rad;
    play(0.0, 1000);
    TEST_ASSERT_TRUE(drive.position_rad == rest);
}

static void test_truth_plant_balances_work_kinetic_energy_and_friction(void)
{
    struct truth_plant_spec spec = body();
    spec.coulomb_friction_Nm = 0.05;
    start(&spec);
    double work = 0.0;
    for (int n = 0; n < 1000; n++) {
        double torque = 0.1 + 0.08 * sin(0.05 * n), before = drive.position_rad;
        play(torque, 1);
        work += torque * (drive.position_rad - before);
    }
    double kinetic = 0.5 * 0.005 * drive.velocity_rad_per_s * drive.velocity_rad_per_s;
    TEST_ASSERT_DOUBLE_WITHIN(100.0 * rounding, work, kinetic + 0.05 * drive.position_rad);
}

static void test_truth_plant_reversals_do_not_depend_on_the_step(void)
{
    double position[2], velocity[2];
    for (int i = 0; i < 2; i++) {
        struct truth_plant_spec spec = two_bodies();
        spec.belt_damping_Nms_per_rad = 0.05;
        spec.coulomb_friction_Nm = 0.05;
        spec.stribeck_excess_Nm = 0.02;
        spec.stribeck_velocity_rad_per_s = 0.2;
        spec.torque_lag_s = 0.7e-3;
        spec.dead_time_s = 0.3e-3;
        spec.step_s = i ? 5e-6 : 40e-6;
        start(&spec);
        for (int n = 0; n < 2000; n++) {
            play(0.2 * sin(0.02 * n) + 0.1 * sin(0.31 * n), 1);
        }
        position[i] = drive.position_rad;
        velocity[i] = drive.velocity_rad_per_s;
    }
    TEST_ASSERT_DOUBLE_WITHIN(integration, position[1], position[0]);
    TEST_ASSERT_DOUBLE_WITHIN(10.0 * integration, velocity[1], velocity[0]);
}

static double twist(void)
{
    return drive.position_rad - drive.load_position_rad;
}

// Mean frequency between the first and the last upward zero crossing of the twist.
static double twist_frequency_hz(int samples)
{
    double first = -1.0, last = -1.0, before = twist();
    int cycles = -1;
    for (int n = 0; n < samples; n++) {
        play(0.0, 1);
        double now = twist();
        if (before < 0.0 && now >= 0.0) {
            last = ((double)n + before / (before - now)) * sample_s;
            first = first < 0.0 ? last : first;
            cycles++;
        }
        before = now;
    }
    return (double)cycles / (last - first);
}

// A crossing between samples is interpolated along a chord of a 40 to 65 Hz sinusoid: a few microseconds in two
// seconds.
static const double crossing = 1e-4;

static void test_truth_plant_resonates_where_both_masses_swing_freely(void)
{
    struct truth_plant_spec spec = two_bodies();
    start(&spec);
    play(0.5, 3);
    double right = 40.0 * sqrt(1.0 + spec.load_inertia_kgm2 / spec.motor_inertia_kgm2);
    TEST_ASSERT_DOUBLE_WITHIN(crossing * right, right, twist_frequency_hz(2000));
}

static void test_truth_plant_load_swings_at_the_antiresonance_while_the_motor_sticks(void)
{
    struct truth_plant_spec spec = two_bodies();
    start(&spec);
    play(0.5, 3);
    drive.spec.coulomb_friction_Nm = 1000.0;
    play(0.0, 1);
    double stuck = drive.position_rad;
    TEST_ASSERT_DOUBLE_WITHIN(crossing * 40.0, 40.0, twist_frequency_hz(2000));
    TEST_ASSERT_TRUE(drive.position_rad == stuck && drive.velocity_rad_per_s == 0.0);
}

static double energy(void)
{
    return 0.5 * drive.spec.motor_inertia_kgm2 * pow(drive.velocity_rad_per_s, 2.0) +
           0.5 * drive.spec.load_inertia_kgm2 * pow(drive.load_velocity_rad_per_s, 2.0) +
           0.5 * drive.spec.belt_stiffness_Nm_per_rad * pow(twist(), 2.0);
}

static void test_truth_plant_keeps_its_energy_without_friction_and_damping(void)
{
    struct truth_plant_spec spec = two_bodies();
    start(&spec);
    play(0.5, 3);
    double before = energy();
    play(0.0, 2000);
    TEST_ASSERT_DOUBLE_WITHIN(integration * before, before, energy());
}

static void test_truth_plant_belt_damping_gives_the_stated_decay(void)
{
    struct truth_plant_spec spec = two_bodies();
    double w = 2.0 * pi * 40.0, ratio = 0.04;
    spec.belt_damping_Nms_per_rad = 2.0 * ratio * spec.load_inertia_kgm2 * w;
    start(&spec);
    play(0.5, 3);
    drive.spec.coulomb_friction_Nm = 1000.0;
    play(0.0, 1);
    double before = energy(), cycles = 5.0, damped = w * sqrt(1.0 - ratio * ratio);
    int samples = (int)floor(cycles * 2.0 * pi / damped / sample_s + 0.5);
    play(0.0, samples);
    double right = exp(-2.0 * ratio * w * samples * sample_s);
    // The energy of a damped swing ripples by the damping ratio, and the samples do not fall on whole cycles.
    TEST_ASSERT_DOUBLE_WITHIN(0.03 * right, right, energy() / before);
}

static void test_truth_plant_holds_back_torque_by_a_fraction_of_a_sample(void)
{
    static const double dead_time_s[5] = {0.0, 0.13e-3, 1e-3, 1.3e-3, 2.96e-3};
    for (int i = 0; i < 5; i++) {
        struct truth_plant_spec spec = body();
        spec.dead_time_s = dead_time_s[i];
        start(&spec);
        play(0.1, 10);
        TEST_ASSERT_DOUBLE_WITHIN(rounding, 0.1 / 0.005 * (10e-3 - dead_time_s[i]), drive.velocity_rad_per_s);
    }
}

static void test_truth_plant_torque_equals_the_reference_without_lag_and_dead_time(void)
{
    struct truth_plant_spec spec = body();
    start(&spec);
    for (int n = 0; n < 10; n++) {
        truth_plant_hold(&drive, 0.01 * n);
        TEST_ASSERT_TRUE(drive.torque_Nm == 0.01 * n);
        truth_plant_advance(&drive);
    }
}

static void test_truth_plant_torque_lags_exponentially(void)
{
    struct truth_plant_spec spec = body();
    spec.torque_lag_s = 0.8e-3;
    spec.dead_time_s = 0.4e-3;
    start(&spec);
    play(0.3, 3);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 0.3 * (1.0 - exp(-2.6e-3 / 0.8e-3)), drive.torque_Nm);
}

static void test_truth_plant_cogging_and_bias_push_the_motor_forward(void)
{
    struct truth_plant_spec spec = body();
    spec.cogging_amplitude_Nm = 0.03;
    spec.cogging_periods_per_rev = 12.0;
    spec.cogging_phase_rad = 0.4;
    spec.bias_Nm = 0.01;
    double x = 0.2;
    TEST_ASSERT_DOUBLE_WITHIN(rounding, -0.01 - 0.03 * cos(12.0 * x + 0.4),
                              truth_plant_resistance_Nm(&spec, x, 1.0, 1));
    truth_plant_init(&drive, &spec, x, 1u);
    play(0.0, 1);
    double acceleration = (0.01 + 0.03 * cos(12.0 * x + 0.4)) / 0.005;
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, acceleration * sample_s, drive.velocity_rad_per_s);
}

static void test_truth_plant_process_noise_has_the_stated_size(void)
{
    struct truth_plant_spec spec = body();
    spec.process_noise_Nm = 0.01;
    start(&spec);
    double square = 0.0, before = 0.0;
    enum { SAMPLES = 20000 };
    for (int n = 0; n < SAMPLES; n++) {
        play(0.0, 1);
        square += pow((drive.velocity_rad_per_s - before) * 0.005 / sample_s, 2.0);
        before = drive.velocity_rad_per_s;
    }
    // The standard error of a standard deviation from 20000 values is 0.5 %; four of them.
    TEST_ASSERT_DOUBLE_WITHIN(0.02 * 0.01, 0.01, sqrt(square / SAMPLES));
}

// ---- Terms of single causes, each against its closed form

static void test_truth_plant_output_is_clipped_behind_the_lag(void)
{
    struct truth_plant_spec spec = body();
    spec.torque_lag_s = 1e-3;
    spec.torque_limit_Nm = 0.1;
    start(&spec);
    play(0.3, 20);
    // The lag passes 0.1 of 0.3 at T ln 1.5 and goes on behind the clip.
    double T = 1e-3, reached = T * log(1.5), before = 0.3 * (reached - T * (1.0 - exp(-reached / T)));
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 0.1, truth_plant_output_Nm(&drive));
    TEST_ASSERT_TRUE(drive.torque_Nm > 0.29);
    // One step of 40 us holds the kink: (40e-6)^2 / 8 of a torque's slope of 0.2 / T.
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, (before + 0.1 * (20e-3 - reached)) / 0.005, drive.velocity_rad_per_s);
}

static void test_truth_plant_command_is_clipped_before_the_lag(void)
{
    struct truth_plant_spec spec = body();
    spec.torque_lag_s = 1e-3;
    spec.command_limit_Nm = 0.1;
    start(&spec);
    play(-0.3, 2);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, -0.1 * (1.0 - exp(-2.0)), truth_plant_output_Nm(&drive));
}

static void test_truth_plant_torque_rate_limits_each_sample(void)
{
    struct truth_plant_spec spec = body();
    spec.torque_rate_Nm_per_s = 20.0;
    start(&spec);
    for (int n = 1; n <= 5; n++) {
        play(0.07, 1);
        TEST_ASSERT_DOUBLE_WITHIN(rounding, fmin(0.07, 0.02 * n), truth_plant_output_Nm(&drive));
    }
}

static void test_truth_plant_dead_band_takes_its_torque_away(void)
{
    struct truth_plant_spec spec = body();
    spec.torque_dead_band_Nm = 0.02;
    start(&spec);
    play(0.019, 10);
    TEST_ASSERT_TRUE(drive.velocity_rad_per_s == 0.0);
    play(-0.05, 10);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, -0.03, truth_plant_output_Nm(&drive));
    TEST_ASSERT_DOUBLE_WITHIN(rounding, -0.03 / 0.005 * 10e-3, drive.velocity_rad_per_s);
}

static void test_truth_plant_periodic_disturbance_swings_the_body(void)
{
    struct truth_plant_spec spec = body();
    spec.disturbance_amplitude_Nm = 0.02;
    spec.disturbance_hz = 17.3;
    spec.disturbance_phase_rad = 0.6;
    start(&spec);
    play(0.0, 300);
    double w = 2.0 * pi * 17.3, right = 0.02 / (0.005 * w) * (cos(0.6) - cos(w * 0.3 + 0.6));
    TEST_ASSERT_DOUBLE_WITHIN(integration, right, drive.velocity_rad_per_s);
}

static void test_truth_plant_friction_drifts_with_time(void)
{
    struct truth_plant_spec spec = body();
    spec.coulomb_friction_Nm = 0.05;
    spec.friction_drift_ratio = -0.4;
    spec.friction_drift_s = 0.7;
    start(&spec);
    truth_plant_launch(&drive, 8.0);
    play(0.0, 600);
    double t = 0.6, T = 0.7, impulse = 0.05 * (t - 0.4 * (t - T * (1.0 - exp(-t / T))));
    TEST_ASSERT_DOUBLE_WITHIN(integration, 8.0 - impulse / 0.005, drive.velocity_rad_per_s);
}

static void test_truth_plant_torque_constant_drifts_with_time(void)
{
    struct truth_plant_spec spec = body();
    spec.torque_drift_ratio = -0.2;
    spec.torque_drift_s = 0.5;
    start(&spec);
    play(0.1, 600);
    double t = 0.6, T = 0.5, impulse = 0.1 * (t - 0.2 * (t - T * (1.0 - exp(-t / T))));
    TEST_ASSERT_DOUBLE_WITHIN(integration, impulse / 0.005, drive.velocity_rad_per_s);
    TEST_ASSERT_TRUE(truth_plant_output_Nm(&drive) == 0.1);
}

static void test_truth_plant_bias_step_pushes_from_its_time_on(void)
{
    struct truth_plant_spec spec = body();
    spec.step_bias_Nm = 0.03;
    spec.step_bias_s = 0.25;
    start(&spec);
    play(0.0, 250);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.0, drive.velocity_rad_per_s); // the step may fall into the last integration step
    play(0.0, 200);
    TEST_ASSERT_DOUBLE_WITHIN(3e-4, 0.03 / 0.005 * 0.2, drive.velocity_rad_per_s);
}

static void test_truth_plant_burst_lasts_as_long_as_stated(void)
{
    struct truth_plant_spec spec = body();
    spec.burst_amplitude_Nm = 0.1;
    spec.burst_hz = 20.0;
    spec.burst_length_s = 0.15;
    spec.burst_every_s = 1.0;
    start(&spec);
    int moving = 0;
    double before = 0.0, most = 0.0;
    for (int n = 0; n < 4000; n++) {
        play(0.0, 1);
        double change = fabs(drive.velocity_rad_per_s - before) / sample_s * 0.005;
        moving += change > 1e-9;
        most = fmax(most, change);
        before = drive.velocity_rad_per_s;
    }
    TEST_ASSERT_INT_WITHIN(8, 4 * 150, moving); // each burst's two ends fall inside a sample
    TEST_ASSERT_TRUE(most > 0.08 && most <= 0.1);
}

static void test_truth_plant_friction_grows_with_torque(void)
{
    struct truth_plant_spec spec = body();
    spec.friction_per_torque = 0.1;
    start(&spec);
    play(-0.2, 100);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, -0.2 * 0.9 / 0.005 * 0.1, drive.velocity_rad_per_s);
}

static void test_truth_plant_ground_spring_swings_at_its_frequency(void)
{
    struct truth_plant_spec spec = body();
    spec.ground_stiffness_Nm_per_rad = 0.5;
    spec.coulomb_origin_rad = 0.3;
    start(&spec); // at rest 0.3 rad from the spring's middle
    play(0.0, 777);
    double w = sqrt(0.5 / 0.005), right = 0.3 - 0.3 * cos(w * 0.777);
    TEST_ASSERT_DOUBLE_WITHIN(integration, right, drive.position_rad);
}

static double bristle_energy(double x, double distance)
{
    return 0.05 * (x - distance * (1.0 - exp(-x / distance)));
}

static void test_truth_plant_dahl_friction_takes_its_energy_over_the_distance(void)
{
    struct truth_plant_spec spec = body();
    spec.coulomb_friction_Nm = 0.05;
    spec.presliding_distance_rad = 0.02;
    start(&spec);
    truth_plant_launch(&drive, 1.5);
    for (int n = 0; n < 60; n++) {
        play(0.0, 1);
        double x = drive.position_rad, left = 0.5 * 0.005 * (2.25 - pow(drive.velocity_rad_per_s, 2.0));
        TEST_ASSERT_TRUE(drive.velocity_rad_per_s > 0.0);
        TEST_ASSERT_DOUBLE_WITHIN(integration, bristle_energy(x, 0.02), left);
        TEST_ASSERT_DOUBLE_WITHIN(integration, 1.0 - exp(-x / 0.02), drive.bristle);
    }
}

static void test_truth_plant_lugre_damping_adds_the_deflections_rate(void)
{
    struct truth_plant_spec spec = body();
    spec.coulomb_friction_Nm = 0.05;
    spec.presliding_distance_rad = 0.02;
    spec.bristle = truth_bristle_lugre;
    spec.bristle_damping_s = 0.8e-3;
    start(&spec);
    truth_plant_launch(&drive, 1.5);
    double dz = 1.5 / 0.02, right = 0.05 * 0.8e-3 * dz;
    TEST_ASSERT_DOUBLE_WITHIN(rounding, right, truth_plant_resistance_Nm(&spec, 0.0, 1.5, 1));
    play(0.0, 40);
    // z follows the way alone whatever the force; dv/dx = -Fc (z + Tb v (1 - z) / x0) / (J v), by fine Euler steps.
    double v = 1.5, h = drive.position_rad / 400000.0;
    for (int i = 0; i < 400000; i++) {
        double z = 1.0 - exp(-(i + 0.5) * h / 0.02);
        v -= h * 0.05 * (z + 0.8e-3 * v * (1.0 - z) / 0.02) / (0.005 * v);
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, v, drive.velocity_rad_per_s);
}

static void test_truth_plant_elastoplastic_friction_springs_back_while_it_is_small(void)
{
    struct truth_plant_spec spec = body();
    spec.coulomb_friction_Nm = 0.05;
    spec.presliding_distance_rad = 0.02;
    spec.bristle = truth_bristle_elastoplastic;
    spec.bristle_elastic_share = 0.5;
    start(&spec);
    double w = sqrt(0.05 / 0.02 / 0.005), v = 0.4 * 0.02 * w; // to 0.4 of the distance
    truth_plant_launch(&drive, v);
    play(0.0, 1234);
    TEST_ASSERT_DOUBLE_WITHIN(integration, v / w * sin(w * 1.234), drive.position_rad);
    play(0.2, 100);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 1.0, drive.bristle);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3 * 0.05, 0.05, truth_plant_resistance_Nm(&spec, 0.0, 0.0, 1) + 0.05);
}

// Motor stuck, load given a speed by hand: what the belt alone does.
static void swing_load(const struct truth_plant_spec *spec, double position, double speed)
{
    truth_plant_init(&drive, spec, position, 1u);
    drive.spec.coulomb_friction_Nm = 1000.0;
    drive.load_velocity_rad_per_s = speed;
}

static void test_truth_plant_stiffness_changes_along_the_travel(void)
{
    struct truth_plant_spec spec = two_bodies();
    spec.stiffness_slope_per_rad = 0.08;
    swing_load(&spec, 2.5, 1.0);
    TEST_ASSERT_DOUBLE_WITHIN(crossing * 45.0, 40.0 * sqrt(1.2), twist_frequency_hz(2000));
}

static void test_truth_plant_hardening_belt_turns_where_its_energy_is(void)
{
    struct truth_plant_spec spec = two_bodies();
    double k = spec.belt_stiffness_Nm_per_rad, c = 2000.0, speed = 8.0, most = 0.0;
    spec.stiffness_cubic_per_rad2 = c;
    swing_load(&spec, 0.0, speed);
    for (int n = 0; n < 1000; n++) {
        play(0.0, 1);
        double e = twist(), potential = 0.5 * k * e * e + 0.25 * k * c * pow(e, 4.0);
        double kinetic = 0.5 * 0.003 * pow(drive.load_velocity_rad_per_s, 2.0);
        TEST_ASSERT_DOUBLE_WITHIN(10.0 * integration, 0.5 * 0.003 * speed * speed, potential + kinetic);
        most = fmax(most, fabs(e));
    }
    // k e^2 / 2 (1 + c e^2 / 2) = J v^2 / 2; samples miss the turning point by up to half of one.
    double square = (sqrt(1.0 + 2.0 * c * 0.003 * speed * speed / k) - 1.0) / c;
    TEST_ASSERT_DOUBLE_WITHIN(0.01 * sqrt(square), sqrt(square), most);
}

static void test_truth_plant_backlash_lets_the_load_fly_through_the_gap(void)
{
    struct truth_plant_spec spec = two_bodies();
    spec.gap_rad = 0.02;
    spec.belt_damping_Nms_per_rad = 0.1;
    spec.step_s = 10e-6;
    swing_load(&spec, 0.0, 1.0);
    play(0.0, 9);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 0.009, drive.load_position_rad);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 1.0, drive.load_velocity_rad_per_s);
    drive.spec.belt_damping_Nms_per_rad = 0.0;
    double k = spec.belt_stiffness_Nm_per_rad;
    for (int n = 0; n < 500; n++) {
        play(0.0, 1);
        double beyond = fmax(0.0, fabs(twist()) - 0.01);
        double all = 0.5 * k * beyond * beyond + 0.5 * 0.003 * pow(drive.load_velocity_rad_per_s, 2.0);
        // Each contact begins inside a step of 10 us: (10e-6 w)^2 of the energy, some 50 times.
        TEST_ASSERT_DOUBLE_WITHIN(2e-3 * 0.0015, 0.0015, all);
    }
}

static void test_truth_plant_third_mass_swings_on_its_own_spring(void)
{
    struct truth_plant_spec spec = two_bodies();
    spec.third_inertia_kgm2 = 0.0005;
    spec.third_stiffness_Nm_per_rad = 0.0005 * pow(2.0 * pi * 55.0, 2.0);
    truth_plant_init(&drive, &spec, 0.0, 1u);
    drive.spec.coulomb_friction_Nm = 1000.0;
    drive.spec.load_inertia_kgm2 = 1e9;
    drive.third_velocity_rad_per_s = 1.0;
    play(0.0, 1234);
    double w = 2.0 * pi * 55.0;
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, sin(w * 1.234) / w, drive.third_position_rad);
    drive.spec.third_damping_Nms_per_rad = 2.0 * 0.05 * 0.0005 * w;
    play(0.0, 2000);
    TEST_ASSERT_TRUE(fabs(drive.third_position_rad) < 1e-9);
}

static void test_truth_plant_third_mass_keeps_the_momentum(void)
{
    struct truth_plant_spec spec = two_bodies();
    spec.third_inertia_kgm2 = 0.0005;
    spec.third_stiffness_Nm_per_rad = 30.0;
    spec.third_damping_Nms_per_rad = 0.01;
    start(&spec);
    play(0.5, 3);
    play(0.0, 500);
    double momentum = 0.002 * drive.velocity_rad_per_s + 0.003 * drive.load_velocity_rad_per_s +
                      0.0005 * drive.third_velocity_rad_per_s;
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 0.5 * 3e-3, momentum);
}

static void test_truth_plant_load_friction_slows_the_load(void)
{
    struct truth_plant_spec spec = two_bodies();
    spec.load_coulomb_Nm = 0.05;
    spec.step_s = 10e-6;
    start(&spec);
    truth_plant_launch(&drive, 5.0);
    play(0.0, 100);
    // The bristle is stretched within 1e-3 rad; the energy it misses there is 0.05 1e-4.
    double motion = 0.002 * drive.velocity_rad_per_s + 0.003 * drive.load_velocity_rad_per_s;
    TEST_ASSERT_DOUBLE_WITHIN(0.05 * 1e-4, 0.005 * 5.0 - 0.05 * 0.1, motion);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1.0, drive.load_bristle);
}

static void test_truth_plant_placed_motor_leaves_the_load_alone(void)
{
    struct truth_plant_spec spec = two_bodies();
    start(&spec);
    play(0.5, 3);
    double load = drive.load_position_rad, speed = drive.load_velocity_rad_per_s;
    truth_plant_place(&drive, 0.4, -1.0);
    TEST_ASSERT_TRUE(drive.position_rad == 0.4 && drive.velocity_rad_per_s == -1.0);
    TEST_ASSERT_TRUE(drive.load_position_rad == load && drive.load_velocity_rad_per_s == speed);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_truth_random_bits_match_the_published_sequence);
    RUN_TEST(test_truth_plant_accelerates_evenly_under_constant_torque);
    RUN_TEST(test_truth_plant_slows_exponentially_under_viscous_friction);
    RUN_TEST(test_truth_plant_stands_exactly_still_below_breakaway);
    RUN_TEST(test_truth_plant_breaks_away_at_the_torque_of_each_direction);
    RUN_TEST(test_truth_plant_breaks_away_at_the_right_moment_inside_a_step);
    RUN_TEST(test_truth_plant_stops_where_friction_has_used_up_the_energy);
    RUN_TEST(test_truth_plant_balances_work_kinetic_energy_and_friction);
    RUN_TEST(test_truth_plant_reversals_do_not_depend_on_the_step);
    RUN_TEST(test_truth_plant_resonates_where_both_masses_swing_freely);
    RUN_TEST(test_truth_plant_load_swings_at_the_antiresonance_while_the_motor_sticks);
    RUN_TEST(test_truth_plant_keeps_its_energy_without_friction_and_damping);
    RUN_TEST(test_truth_plant_belt_damping_gives_the_stated_decay);
    RUN_TEST(test_truth_plant_holds_back_torque_by_a_fraction_of_a_sample);
    RUN_TEST(test_truth_plant_torque_equals_the_reference_without_lag_and_dead_time);
    RUN_TEST(test_truth_plant_torque_lags_exponentially);
    RUN_TEST(test_truth_plant_cogging_and_bias_push_the_motor_forward);
    RUN_TEST(test_truth_plant_process_noise_has_the_stated_size);
    RUN_TEST(test_truth_plant_output_is_clipped_behind_the_lag);
    RUN_TEST(test_truth_plant_command_is_clipped_before_the_lag);
    RUN_TEST(test_truth_plant_torque_rate_limits_each_sample);
    RUN_TEST(test_truth_plant_dead_band_takes_its_torque_away);
    RUN_TEST(test_truth_plant_periodic_disturbance_swings_the_body);
    RUN_TEST(test_truth_plant_friction_drifts_with_time);
    RUN_TEST(test_truth_plant_torque_constant_drifts_with_time);
    RUN_TEST(test_truth_plant_bias_step_pushes_from_its_time_on);
    RUN_TEST(test_truth_plant_burst_lasts_as_long_as_stated);
    RUN_TEST(test_truth_plant_friction_grows_with_torque);
    RUN_TEST(test_truth_plant_ground_spring_swings_at_its_frequency);
    RUN_TEST(test_truth_plant_dahl_friction_takes_its_energy_over_the_distance);
    RUN_TEST(test_truth_plant_lugre_damping_adds_the_deflections_rate);
    RUN_TEST(test_truth_plant_elastoplastic_friction_springs_back_while_it_is_small);
    RUN_TEST(test_truth_plant_stiffness_changes_along_the_travel);
    RUN_TEST(test_truth_plant_hardening_belt_turns_where_its_energy_is);
    RUN_TEST(test_truth_plant_backlash_lets_the_load_fly_through_the_gap);
    RUN_TEST(test_truth_plant_third_mass_swings_on_its_own_spring);
    RUN_TEST(test_truth_plant_third_mass_keeps_the_momentum);
    RUN_TEST(test_truth_plant_load_friction_slows_the_load);
    RUN_TEST(test_truth_plant_placed_motor_leaves_the_load_alone);
    return UNITY_END();
}
