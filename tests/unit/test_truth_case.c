/* SPDX-License-Identifier: MIT */
#include "tests/truth/truth_case.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "tests/truth/truth_evidence.h"
#include "unity.h"

static const double pi = 3.14159265358979323846;

static struct truth_case made, other;

void setUp(void) {}

void tearDown(void) {}

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

static struct truth_wish wish_for(enum truth_kind kind, enum truth_size size, uint64_t seed)
{
    return (struct truth_wish){.seed = seed, .size = size, .causes = kind != truth_kind_clean, .kind = {kind}};
}

static void make(enum truth_kind kind, enum truth_size size, uint64_t seed)
{
    struct truth_wish wish = wish_for(kind, size, seed);
    truth_case_make(&made, &wish);
}

// Column by column, over one period that stands for a run.
static void record(struct truth_run *out, const struct truth_sensors *sensors, uint64_t seed)
{
    TEST_ASSERT_EQUAL_INT(0, truth_run_make(out, &made.truth.plant, &made.controller, sensors, &made.fit, 2, seed));
}

static int same_run(const struct truth_case *self, uint64_t first, uint64_t second)
{
    struct truth_run a, b;
    int failed = truth_run_make(&a, &self->truth.plant, &self->controller, &self->truth.sensors, &self->fit, 2, first);
    failed |= truth_run_make(&b, &self->truth.plant, &self->controller, &self->truth.sensors, &self->fit, 2, second);
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
    struct truth_wish wish = wish_for(truth_kind_load_bias, truth_size_moderate, 5u);
    make(truth_kind_load_bias, truth_size_moderate, 5u);
    truth_case_make(&other, &wish);
    TEST_ASSERT_EQUAL_MEMORY(&made.fit, &other.fit, sizeof made.fit);
    TEST_ASSERT_EQUAL_MEMORY(&made.truth, &other.truth, sizeof made.truth);
    wish.seed = 6u;
    truth_case_make(&other, &wish);
    TEST_ASSERT_TRUE(memcmp(&made.truth, &other.truth, sizeof made.truth) != 0);
    TEST_ASSERT_TRUE(same_run(&made, 3u, 3u));
    TEST_ASSERT_FALSE(same_run(&made, 3u, 4u));
}

static void test_truth_case_says_its_kinds_and_reads_them(void)
{
    struct truth_wish wish = {0};
    char name[160];
    TEST_ASSERT_EQUAL_INT(0, truth_wish_read(&wish, "cogging+dead_time+backlash"));
    truth_wish_name(&wish, name, sizeof name);
    TEST_ASSERT_EQUAL_STRING("cogging+dead_time+backlash", name);
    TEST_ASSERT_EQUAL_INT(0, truth_wish_read(&wish, "clean"));
    TEST_ASSERT_EQUAL_INT(0, wish.causes);
    TEST_ASSERT_EQUAL_INT(-1, truth_wish_read(&wish, "coging"));
    TEST_ASSERT_EQUAL_INT(-1, truth_wish_read(&wish, "torque_lag+dead_time"));
    TEST_ASSERT_EQUAL_INT(-1, truth_wish_read(&wish, "cogging+cogging"));
}

// Largest relative difference of the nominal model from the drive without the effect.
static double nominal_error(const struct truth_case *self)
{
    const struct truth_plant_spec *a = &self->nominal, *b = &self->without;
    double error = fabs(a->motor_inertia_kgm2 / b->motor_inertia_kgm2 - 1.0);
    error = fmax(error, fabs(a->load_inertia_kgm2 / b->load_inertia_kgm2 - 1.0));
    error = fmax(error, fabs(a->torque_lag_s / b->torque_lag_s - 1.0));
    error = fmax(error, fabs(a->dead_time_s - b->dead_time_s) / 1e-3);
    error = fmax(error, fabs(a->coulomb_friction_Nm - b->coulomb_friction_Nm) / 0.12);
    return error;
}

static void check_case(enum truth_kind kind, enum truth_size size)
{
    char what[80];
    make(kind, size, 100u);
    snprintf(what, sizeof what, "truth_case --kind %s --size %s --seed 100", truth_kind_name(kind),
             truth_size_name(size));
    TEST_ASSERT_TRUE_MESSAGE(nominal_error(&made) <= 0.03, what);
    TEST_ASSERT_TRUE_MESSAGE(made.reached, what);
    if (kind == truth_kind_clean) {
        TEST_ASSERT_EQUAL_MEMORY(&made.truth.plant, &made.without, sizeof made.without);
        return;
    }
    struct truth_parameter parameters[TRUTH_PARAMETERS_MAX];
    struct truth_drive without = truth_case_drive(&made, 0u);
    double low, high;
    truth_kind_bounds(kind, &low, &high);
    TEST_ASSERT_TRUE_MESSAGE(memcmp(&made.truth, &without, sizeof without) != 0, what);
    TEST_ASSERT_TRUE_MESSAGE(truth_kind_parameters(kind, &made.truth, parameters) > 0, what);
    TEST_ASSERT_TRUE_MESSAGE(made.hidden[0].amount >= 0.999 * low && made.hidden[0].amount <= 1.001 * high, what);
    double ratio = made.evidence_nats[0] / truth_size_nats(size);
    TEST_ASSERT_TRUE_MESSAGE(ratio < 1.6 && ratio > 1.0 / 1.6, what);
}

// A few kinds of each sort; the campaign makes them all, and says which sizes it could not reach.
static void test_truth_case_hides_its_kind_at_the_size_asked_for(void)
{
    check_case(truth_kind_clean, truth_size_clear);
    check_case(truth_kind_viscous_friction, truth_size_clear);
    check_case(truth_kind_encoder_eccentricity, truth_size_moderate);
    check_case(truth_kind_lost_samples, truth_size_faint);
}

static void test_truth_case_combination_shows_each_of_its_causes(void)
{
    struct truth_wish wish = {.seed = 3u, .size = truth_size_moderate};
    TEST_ASSERT_EQUAL_INT(0, truth_wish_read(&wish, "cogging+load_bias"));
    truth_case_make(&made, &wish);
    TEST_ASSERT_TRUE(made.reached && made.unlike > 0.3);
    for (int i = 0; i < 2; i++) {
        TEST_ASSERT_TRUE(made.evidence_nats[i] >= 500.0);
    }
}

static void test_truth_case_cogging_has_two_periods_under_the_motion(void)
{
    make(truth_kind_cogging, truth_size_clear, 1u);
    double n = made.truth.plant.cogging_periods_per_rev;
    TEST_ASSERT_TRUE(n >= 6.0 && n <= 60.0 && n == floor(n));
    TEST_ASSERT_TRUE(n * truth_excitation_range_rad(&made.validation) / (2.0 * pi) >= 2.0);
}

static void test_truth_case_stroke_is_more_than_a_turn_in_both_runs(void)
{
    for (uint64_t seed = 1; seed <= 2; seed++) {
        struct truth_wish wish = {.seed = seed, .protocol = truth_protocol_stroke};
        truth_case_make(&made, &wish);
        TEST_ASSERT_TRUE(truth_excitation_range_rad(&made.fit) > 2.0 * pi);
        TEST_ASSERT_TRUE(truth_excitation_range_rad(&made.validation) > 2.0 * pi);
    }
}

static void test_truth_case_given_the_numbers_of_a_diagnosis_is_that_drive(void)
{
    const double two_pi = 6.283185307179586;
    make(truth_kind_clean, truth_size_clear, 3u);
    struct truth_drive drive = truth_case_drive(&made, 0u);
    TEST_ASSERT_EQUAL_INT(0, truth_kind_set(truth_kind_second_mode, "mode_damping_ratio", 0.03, &drive));
    TEST_ASSERT_EQUAL_INT(0, truth_kind_set(truth_kind_second_mode, "mode_inertia_kgm2", 2e-4, &drive));
    TEST_ASSERT_EQUAL_INT(0, truth_kind_set(truth_kind_second_mode, "mode_frequency_hz", 40.0, &drive));
    double w = two_pi * 40.0;
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 2e-4 * w * w, drive.plant.third_stiffness_Nm_per_rad);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 2.0 * 0.03 * 2e-4 * w, drive.plant.third_damping_Nms_per_rad);
    TEST_ASSERT_EQUAL_INT(0, truth_kind_set(truth_kind_periodic_disturbance, "amplitude_Nm", 0.02, &drive));
    TEST_ASSERT_EQUAL_INT(0, truth_kind_set(truth_kind_periodic_disturbance, "phase_rad", 0.5, &drive));
    // a sin(phase) pushes, a cos(phase) of the diagnosis opposes
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.02 * cos(0.5),
                              drive.plant.disturbance_amplitude_Nm * sin(drive.plant.disturbance_phase_rad));
    TEST_ASSERT_EQUAL_INT(0, truth_kind_set(truth_kind_encoder_eccentricity, "speed_error_ratio", 0.02, &drive));
    TEST_ASSERT_EQUAL_INT(0, drive.sensors.speed_from_encoder);
    TEST_ASSERT_EQUAL_INT(-1, truth_kind_set(truth_kind_second_mode, "amplitude_rad", 1.0, &drive));
}

static void test_truth_case_given_its_own_parameters_is_not_short_of_the_truth(void)
{
    static const enum truth_kind kinds[] = {truth_kind_stribeck_friction, truth_kind_friction_drift};
    for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; i++) {
        struct truth_parameter parameters[TRUTH_PARAMETERS_MAX];
        make(kinds[i], truth_size_moderate, 12u);
        struct truth_drive drive = truth_case_drive(&made, 0u);
        TEST_ASSERT_TRUE(truth_case_left_nats(&made, &drive) > 200.0);
        int count = truth_kind_parameters(kinds[i], &made.truth, parameters);
        for (int k = 0; k < count; k++) {
            TEST_ASSERT_EQUAL_INT(0, truth_kind_set(kinds[i], parameters[k].name, parameters[k].value, &drive));
        }
        TEST_ASSERT_TRUE_MESSAGE(truth_case_left_nats(&made, &drive) < 1.0, truth_kind_name(kinds[i]));
    }
    struct truth_drive drive = truth_case_drive(&made, 0u);
    drive.sensors.lost_share = 0.01;
    TEST_ASSERT_TRUE(isinf(truth_case_left_nats(&made, &drive)));
    drive = truth_case_drive(&made, 0u);
    TEST_ASSERT_EQUAL_INT(-1, truth_kind_set(truth_kind_backlash, "bias_Nm", 1.0, &drive));
}

// ---- Evidence

static struct truth_evidence evidence;

static struct truth_evidence_setting plain_setting(void)
{
    make(truth_kind_clean, truth_size_clear, 21u);
    return (struct truth_evidence_setting){.controller = &made.controller, .excitation = &made.fit, .periods = 11};
}

static void test_truth_evidence_is_nothing_between_equal_drives(void)
{
    struct truth_evidence_setting setting = plain_setting();
    TEST_ASSERT_EQUAL_INT(0, truth_evidence_find(&made.truth, &made.truth, &setting, &evidence));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.0, evidence.nats);
}

static void test_truth_evidence_leaves_out_what_a_refit_takes_up(void)
{
    struct truth_evidence_setting setting = plain_setting();
    struct truth_drive less = made.truth;
    less.plant.viscous_friction_Nms_per_rad *= 0.7;
    less.plant.motor_inertia_kgm2 *= 1.02;
    TEST_ASSERT_EQUAL_INT(0, truth_evidence_find(&made.truth, &less, &setting, &evidence));
    double refitted = evidence.nats;
    setting.not_free = 1u << truth_refit_viscous | 1u << truth_refit_motor_inertia | 1u << truth_refit_load_inertia;
    TEST_ASSERT_EQUAL_INT(0, truth_evidence_find(&made.truth, &less, &setting, &evidence));
    // What is left is of second order in the change of inertia.
    TEST_ASSERT_TRUE(evidence.nats > 100.0);
    TEST_ASSERT_DOUBLE_WITHIN(0.01 * evidence.nats, 0.0, refitted);
}

static void test_truth_evidence_lets_what_stands_in_move_within_its_reach(void)
{
    struct truth_evidence_setting setting = plain_setting();
    struct truth_drive late = made.truth;
    made.truth.plant.torque_lag_s = late.plant.torque_lag_s = 5e-4;
    made.truth.plant.dead_time_s = 4e-4;
    late.plant.dead_time_s = 4.2e-4;
    setting.not_free = 1u << truth_refit_lag | 1u << truth_refit_dead_time;
    TEST_ASSERT_EQUAL_INT(0, truth_evidence_find(&made.truth, &late, &setting, &evidence));
    double unmoved = evidence.nats;
    setting.stand_in = truth_refit_dead_time;
    setting.reach = 0.01; // 0.0042 of the 0.02 ms that it is off: 0.79 of the residual are left, in nats the square
    TEST_ASSERT_EQUAL_INT(0, truth_evidence_find(&made.truth, &late, &setting, &evidence));
    TEST_ASSERT_TRUE(unmoved > 100.0);
    TEST_ASSERT_DOUBLE_WITHIN(0.05 * unmoved, 0.624 * unmoved, evidence.nats);
    setting.reach = 0.1; // farther than it needs
    TEST_ASSERT_EQUAL_INT(0, truth_evidence_find(&made.truth, &late, &setting, &evidence));
    TEST_ASSERT_DOUBLE_WITHIN(0.01 * unmoved, 0.0, evidence.nats);
}

/// What is asked for is evidence over the model that is given, whose own numbers are off as well.
static void test_truth_case_measures_a_size_from_the_given_model(void)
{
    for (uint64_t seed = 31u; seed < 34u; seed++) {
        make(truth_kind_viscous_friction, truth_size_faint, seed);
        double given = made.nominal.viscous_friction_Nms_per_rad, real = made.truth.plant.viscous_friction_Nms_per_rad;
        struct truth_drive best = made.truth;
        TEST_ASSERT_TRUE(fabs(real / given - 1.0) > TRUTH_REFIT_SHARE);
        best.plant.viscous_friction_Nms_per_rad = given * (1.0 + copysign(TRUTH_REFIT_SHARE, real - given));
        struct truth_evidence_setting setting = {.controller = &made.controller,
                                                 .excitation = &made.fit,
                                                 .periods = made.periods,
                                                 .seed = truth_case_noise_seed(&made),
                                                 .not_free = 1u << truth_refit_viscous};
        TEST_ASSERT_EQUAL_INT(0, truth_evidence_find(&made.truth, &best, &setting, &evidence));
        TEST_ASSERT_DOUBLE_WITHIN(0.05 * evidence.nats, evidence.nats, made.evidence_nats[0]);
    }
}

/// A resonance that is off by its own width is no straight line: one projection leaves what a refit takes up.
static void test_truth_evidence_refit_takes_up_a_resonance_that_is_off(void)
{
    struct truth_evidence_setting setting = plain_setting();
    struct truth_drive drive = made.truth, near;
    drive.plant.two_mass = 1;
    drive.plant.motor_inertia_kgm2 = 0.003;
    drive.plant.load_inertia_kgm2 = 0.002;
    drive.plant.belt_stiffness_Nm_per_rad = 60.0;
    drive.plant.belt_damping_Nms_per_rad = 0.015;
    near = drive;
    near.plant.belt_stiffness_Nm_per_rad *= 1.06;
    TEST_ASSERT_EQUAL_INT(0, truth_evidence_find(&drive, &near, &setting, &evidence));
    double projected = evidence.nats;
    TEST_ASSERT_EQUAL_INT(0, truth_evidence_refit(&drive, &near.plant, &near, &setting, &evidence));
    TEST_ASSERT_TRUE(projected > 10.0);
    TEST_ASSERT_DOUBLE_WITHIN(0.01 * projected, 0.0, evidence.nats);
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 60.0, near.plant.belt_stiffness_Nm_per_rad);
}

/// Nor does it leave what the given model may be off by: an inertia that is off by more stays so.
static void test_truth_evidence_refit_stays_within_what_is_believed(void)
{
    struct truth_evidence_setting setting = plain_setting();
    struct truth_drive drive = made.truth, near = made.truth;
    const struct truth_plant_spec believed = made.truth.plant;
    drive.plant.motor_inertia_kgm2 *= 1.5;
    drive.plant.two_mass = near.plant.two_mass = 0;
    TEST_ASSERT_EQUAL_INT(0, truth_evidence_refit(&drive, &believed, &near, &setting, &evidence));
    double moved = near.plant.motor_inertia_kgm2 / believed.motor_inertia_kgm2;
    TEST_ASSERT_TRUE(moved >= 0.98 - 1e-9 && moved <= 1.02 + 1e-9);
}

static void test_truth_evidence_of_a_bias_is_that_of_a_mean(void)
{
    struct truth_evidence_setting setting = plain_setting();
    struct truth_drive pushed = made.truth, quiet = made.truth;
    // Without friction nothing but the bias is off, and the process noise alone hides it.
    quiet.plant.coulomb_friction_Nm = pushed.plant.coulomb_friction_Nm = 0.0;
    quiet.plant.two_mass = pushed.plant.two_mass = 0;
    quiet.plant.process_noise_Nm = pushed.plant.process_noise_Nm = 0.02;
    quiet.sensors.velocity_rad_per_s = pushed.sensors.velocity_rad_per_s = 1e-7;
    pushed.plant.bias_Nm = 0.001;
    TEST_ASSERT_EQUAL_INT(0, truth_evidence_find(&pushed, &quiet, &setting, &evidence));
    double samples = 10.0 * TRUTH_PERIOD_SAMPLES, right = 0.5 * samples * pow(0.001 / 0.02, 2.0);
    // A twentieth of a hundredth is lost with the last sample, and a little to the refit.
    TEST_ASSERT_DOUBLE_WITHIN(0.02 * right, right, evidence.nats);
}

static void test_truth_evidence_of_an_encoder_is_that_of_two_columns_that_differ(void)
{
    struct truth_evidence_setting setting = plain_setting();
    struct truth_drive bent = made.truth;
    bent.sensors.eccentricity_rad = 1e-3;
    TEST_ASSERT_EQUAL_INT(0, truth_evidence_find(&bent, &made.truth, &setting, &evidence));
    double apart = evidence.nats;
    bent.sensors.speed_from_encoder = 1;
    TEST_ASSERT_EQUAL_INT(0, truth_evidence_find(&bent, &made.truth, &setting, &evidence));
    TEST_ASSERT_TRUE(apart > 10.0 && evidence.nats > 0.0 && evidence.nats != apart);
}

// ---- Sensors

static void test_truth_run_eccentric_encoder_shows_a_wave_per_turn(void)
{
    struct truth_run run;
    make(truth_kind_clean, truth_size_clear, 22u);
    struct truth_sensors sensors = {.eccentricity_rad = 4e-3, .eccentricity_phase_rad = 0.7, .speed_from_encoder = 1};
    record(&run, &sensors, 1u);
    for (int n = 0; n < run.samples; n += 97) {
        double angle = run.true_position_rad[n] + 0.7, speed = run.true_velocity_rad_per_s[n];
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, run.true_position_rad[n] + 4e-3 * cos(angle), run.position_rad[n]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, speed * (1.0 - 4e-3 * sin(angle)), run.velocity_rad_per_s[n]);
    }
    truth_run_free(&run);
}

static void test_truth_run_filter_lags_by_its_time_constant(void)
{
    struct truth_run run;
    make(truth_kind_clean, truth_size_clear, 22u);
    struct truth_sensors sensors = {.filter_s = 2e-3};
    record(&run, &sensors, 1u);
    double off = 0.0, size = 0.0;
    // y' = (x - y) / T: the filtered angle's difference from the true one is its filtered speed times T.
    for (int n = 100; n < run.samples; n++) {
        off += pow(run.true_position_rad[n] - run.position_rad[n] - 2e-3 * run.velocity_rad_per_s[n], 2.0);
        size += pow(2e-3 * run.velocity_rad_per_s[n], 2.0);
    }
    truth_run_free(&run);
    // Speed is taken to be straight between samples, which the angle is not: (w h)^2 / 12 at up to 100 Hz.
    TEST_ASSERT_TRUE(off < pow(0.03, 2.0) * size);
}

static void test_truth_run_lost_rows_repeat_all_but_the_reference(void)
{
    struct truth_run run;
    make(truth_kind_clean, truth_size_clear, 22u);
    struct truth_sensors sensors = {
        .lost_share = 0.05, .position_rad = 1e-5, .velocity_rad_per_s = 1e-3, .torque_Nm = 1e-3};
    record(&run, &sensors, 1u);
    int repeated = 0, references = 0;
    for (int n = 1; n < run.samples; n++) {
        int same = run.torque_Nm[n] == run.torque_Nm[n - 1];
        TEST_ASSERT_EQUAL_INT(same, run.position_rad[n] == run.position_rad[n - 1] &&
                                        run.velocity_rad_per_s[n] == run.velocity_rad_per_s[n - 1]);
        repeated += same;
        references += run.torque_ref_Nm[n] == run.torque_ref_Nm[n - 1];
    }
    TEST_ASSERT_EQUAL_INT(run.lost, repeated);
    TEST_ASSERT_EQUAL_INT(0, references);
    // 80 losses expected in 4000 rows: four standard deviations of their number.
    TEST_ASSERT_DOUBLE_WITHIN(0.45 * 0.05, 0.05, (double)repeated / run.samples);
    truth_run_free(&run);
}

static void test_truth_run_stays_near_its_reference_in_the_closed_loop(void)
{
    static const enum truth_kind kinds[] = {truth_kind_clean, truth_kind_belt_elasticity};
    for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; i++) {
        enum truth_kind kind = kinds[i];
        make(kind, truth_size_clear, 7u);
        struct truth_run run;
        record(&run, &made.truth.sensors, 1u);
        double error = 0.0, travel = 0.0, torque = 0.0, peak = 0.0;
        for (int n = 0; n < TRUTH_PERIOD_SAMPLES; n++) {
            int late = TRUTH_PERIOD_SAMPLES + n;
            error += pow(run.true_position_rad[late] - made.fit.position_rad[n], 2.0);
            travel += pow(made.fit.position_rad[n] - made.base.plant.coulomb_origin_rad, 2.0);
            torque += pow(run.torque_ref_Nm[late], 2.0);
            peak = fmax(peak, fabs(run.torque_ref_Nm[late]));
        }
        truth_run_free(&run);
        // A two-mass drive fed forward as one body swings on its own mode, up to a fifth of a small travel.
        TEST_ASSERT_TRUE_MESSAGE(error < 0.09 * travel, truth_kind_name(kind));
        // A multisine's crest is 3 to 4; a loop on the edge of stability adds a limit cycle to it.
        TEST_ASSERT_TRUE_MESSAGE(peak * peak < 25.0 * torque / TRUTH_PERIOD_SAMPLES, truth_kind_name(kind));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_truth_excitation_has_its_lines_and_no_others);
    RUN_TEST(test_truth_case_is_the_same_for_the_same_seed);
    RUN_TEST(test_truth_case_says_its_kinds_and_reads_them);
    RUN_TEST(test_truth_case_hides_its_kind_at_the_size_asked_for);
    RUN_TEST(test_truth_case_combination_shows_each_of_its_causes);
    RUN_TEST(test_truth_case_cogging_has_two_periods_under_the_motion);
    RUN_TEST(test_truth_case_stroke_is_more_than_a_turn_in_both_runs);
    RUN_TEST(test_truth_case_given_the_numbers_of_a_diagnosis_is_that_drive);
    RUN_TEST(test_truth_case_given_its_own_parameters_is_not_short_of_the_truth);
    RUN_TEST(test_truth_evidence_is_nothing_between_equal_drives);
    RUN_TEST(test_truth_evidence_leaves_out_what_a_refit_takes_up);
    RUN_TEST(test_truth_evidence_lets_what_stands_in_move_within_its_reach);
    RUN_TEST(test_truth_case_measures_a_size_from_the_given_model);
    RUN_TEST(test_truth_evidence_refit_takes_up_a_resonance_that_is_off);
    RUN_TEST(test_truth_evidence_refit_stays_within_what_is_believed);
    RUN_TEST(test_truth_evidence_of_a_bias_is_that_of_a_mean);
    RUN_TEST(test_truth_evidence_of_an_encoder_is_that_of_two_columns_that_differ);
    RUN_TEST(test_truth_run_eccentric_encoder_shows_a_wave_per_turn);
    RUN_TEST(test_truth_run_filter_lags_by_its_time_constant);
    RUN_TEST(test_truth_run_lost_rows_repeat_all_but_the_reference);
    RUN_TEST(test_truth_run_stays_near_its_reference_in_the_closed_loop);
    return UNITY_END();
}
