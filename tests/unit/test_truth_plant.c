/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "tests/truth/truth_case.h"
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

static double line_size(const double *samples, int k)
{
    double re = 0.0, im = 0.0;
    for (int n = 0; n < TRUTH_PERIOD_SAMPLES; n++) {
        double angle = 2.0 * pi * (double)((k * n) % TRUTH_PERIOD_SAMPLES) / TRUTH_PERIOD_SAMPLES;
        re += samples[n] * cos(angle);
        im += samples[n] * sin(angle);
    }
    return 2.0 * hypot(re, im) / TRUTH_PERIOD_SAMPLES;
}

static void test_truth_excitation_has_its_lines_and_no_others(void)
{
    static struct truth_excitation excitation;
    struct truth_excitation_wish wish = {.inertia_kgm2 = 0.005,
                                         .torque_rms_Nm = 0.5,
                                         .speed_max_rad_per_s = 2.0,
                                         .corner_hz = 5.0,
                                         .stroke_rad = 2.0,
                                         .centre_rad = 0.3};
    struct truth_random random;
    truth_random_init(&random, 9u, 1u);
    truth_excitation_make(&excitation, &wish, &random);
    for (int k = 1; k < TRUTH_PERIOD_SAMPLES / 2; k += 3) {
        double v = line_size(excitation.velocity_rad_per_s, k), w = pi * k;
        if (k > TRUTH_LINES) {
            TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.0, v);
        } else {
            TEST_ASSERT_TRUE(v > 1e-3);
        }
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, v / w, line_size(excitation.position_rad, k));
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, v * w, line_size(excitation.acceleration_rad_per_s2, k));
    }
    TEST_ASSERT_TRUE(truth_excitation_range_rad(&excitation) > 3.5);
    TEST_ASSERT_TRUE(fabs(excitation.velocity_rad_per_s[0]) < 0.3);
}

static int same_run(const struct truth_case *made, uint64_t first, uint64_t second)
{
    struct truth_run a, b;
    int failed = truth_run_make(&a, &made->truth, &made->controller, &made->sensors, &made->fit, 2, first);
    failed |= truth_run_make(&b, &made->truth, &made->controller, &made->sensors, &made->fit, 2, second);
    TEST_ASSERT_EQUAL_INT(0, failed);
    size_t bytes = (size_t)a.samples * sizeof(double);
    int same = memcmp(a.torque_ref_Nm, b.torque_ref_Nm, bytes) == 0 && memcmp(a.torque_Nm, b.torque_Nm, bytes) == 0 &&
               memcmp(a.position_rad, b.position_rad, bytes) == 0 &&
               memcmp(a.velocity_rad_per_s, b.velocity_rad_per_s, bytes) == 0;
    truth_run_free(&a);
    truth_run_free(&b);
    return same;
}

static void test_truth_case_is_the_same_for_the_same_seed(void)
{
    static struct truth_case a, b, other;
    truth_case_make(&a, 5u, truth_kind_cogging, 1.0, truth_protocol_any);
    truth_case_make(&b, 5u, truth_kind_cogging, 1.0, truth_protocol_any);
    truth_case_make(&other, 6u, truth_kind_cogging, 1.0, truth_protocol_any);
    TEST_ASSERT_EQUAL_MEMORY(&a.fit, &b.fit, sizeof a.fit);
    TEST_ASSERT_EQUAL_MEMORY(&a.truth, &b.truth, sizeof a.truth);
    TEST_ASSERT_TRUE(memcmp(&a.truth, &other.truth, sizeof a.truth) != 0);
    TEST_ASSERT_TRUE(same_run(&a, 3u, 3u));
    TEST_ASSERT_FALSE(same_run(&a, 3u, 4u));
}

// Largest relative difference of the nominal model from the drive without the effect.
static double nominal_error(const struct truth_case *made)
{
    const struct truth_plant_spec *a = &made->nominal, *b = &made->without;
    double error = fabs(a->motor_inertia_kgm2 / b->motor_inertia_kgm2 - 1.0);
    error = fmax(error, fabs(a->load_inertia_kgm2 / b->load_inertia_kgm2 - 1.0));
    error = fmax(error, fabs(a->torque_lag_s / b->torque_lag_s - 1.0));
    error = fmax(error, fabs(a->dead_time_s - b->dead_time_s) / 1e-3);
    error = fmax(error, fabs(a->coulomb_friction_Nm - b->coulomb_friction_Nm) / 0.12);
    return error;
}

static void test_truth_case_hides_one_visible_effect_of_each_kind(void)
{
    static struct truth_case made;
    for (int kind = 0; kind < truth_kind_count; kind++) {
        for (uint64_t seed = 100; seed < 104; seed++) {
            truth_case_make(&made, seed, (enum truth_kind)kind, 1.0, truth_protocol_any);
            TEST_ASSERT_TRUE_MESSAGE(nominal_error(&made) <= 0.03, truth_kind_name((enum truth_kind)kind));
            int differs = memcmp(&made.truth, &made.without, sizeof made.truth) != 0;
            TEST_ASSERT_EQUAL_INT_MESSAGE(kind != truth_kind_clean, differs, truth_kind_name((enum truth_kind)kind));
            int shown = kind == truth_kind_clean || made.expected_evidence_nats >= 1000.0;
            TEST_ASSERT_TRUE_MESSAGE(shown, truth_kind_name((enum truth_kind)kind));
            TEST_ASSERT_TRUE(kind == truth_kind_clean || made.parameters > 0);
        }
    }
}

static void test_truth_case_cogging_has_two_periods_under_the_motion(void)
{
    static struct truth_case made;
    for (uint64_t seed = 1; seed <= 10; seed++) {
        truth_case_make(&made, seed, truth_kind_cogging, 1.0, truth_protocol_any);
        double n = made.truth.cogging_periods_per_rev;
        TEST_ASSERT_TRUE(n >= 6.0 && n <= 60.0 && n == floor(n));
        TEST_ASSERT_TRUE(n * truth_excitation_range_rad(&made.validation) / (2.0 * pi) >= 2.0);
    }
}

static void test_truth_run_stays_near_its_reference_in_the_closed_loop(void)
{
    static struct truth_case made;
    for (int kind = 0; kind < truth_kind_count; kind++) {
        truth_case_make(&made, 7u, (enum truth_kind)kind, 1.0, truth_protocol_any);
        struct truth_run run;
        TEST_ASSERT_EQUAL_INT(0, truth_run_make(&run, &made.truth, &made.controller, &made.sensors, &made.fit, 2, 1u));
        double error = 0.0, travel = 0.0, torque = 0.0, peak = 0.0;
        for (int n = 0; n < TRUTH_PERIOD_SAMPLES; n++) {
            int late = TRUTH_PERIOD_SAMPLES + n;
            error += pow(run.true_position_rad[late] - made.fit.position_rad[n], 2.0);
            travel += pow(made.fit.position_rad[n] - made.truth.coulomb_origin_rad, 2.0);
            torque += pow(run.torque_ref_Nm[late], 2.0);
            peak = fmax(peak, fabs(run.torque_ref_Nm[late]));
        }
        truth_run_free(&run);
        // A two-mass drive fed forward as one body swings on its own mode, up to a fifth of a small travel.
        TEST_ASSERT_TRUE_MESSAGE(error < 0.09 * travel, truth_kind_name((enum truth_kind)kind));
        // A multisine's crest is 3 to 4; a loop on the edge of stability adds a limit cycle to it.
        TEST_ASSERT_TRUE_MESSAGE(peak * peak < 25.0 * torque / TRUTH_PERIOD_SAMPLES,
                                 truth_kind_name((enum truth_kind)kind));
    }
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
    RUN_TEST(test_truth_excitation_has_its_lines_and_no_others);
    RUN_TEST(test_truth_case_is_the_same_for_the_same_seed);
    RUN_TEST(test_truth_case_hides_one_visible_effect_of_each_kind);
    RUN_TEST(test_truth_case_cogging_has_two_periods_under_the_motion);
    RUN_TEST(test_truth_run_stays_near_its_reference_in_the_closed_loop);
    return UNITY_END();
}
