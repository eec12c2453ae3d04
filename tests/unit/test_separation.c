/* SPDX-License-Identifier: MIT */
/// Excitations that separate two causes: what they may be, which one is chosen, and what is equal by physics.
#include "lab/experiment/separation.h"

#include "sim/belt_drive.h"
#include "unity.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { period = 250, line_count = 8 };

static const double rate_hz = 500.0, two_pi = 6.283185307179586;

static uint32_t bins[line_count];
static struct design_request design;
static struct sim_model model;
static struct separation_request request;
static struct separation separation;
static struct error error;

/// A rigid drive with friction; noise so small that 250 samples a period are enough, so that the test is fast.
void setUp(void)
{
    for (uint32_t i = 0; i < line_count; i++)
        bins[i] = 1 + 2 * i;
    design = (struct design_request){.rate_num_hz = 500,
                                     .rate_den = 1,
                                     .period_samples = period,
                                     .bin_count = line_count,
                                     .bins = bins,
                                     .limits = {.velocity_rad_per_s = 15.0, .torque_Nm = 2.0},
                                     .inertia_kgm2 = 0.005,
                                     .method = "newman"};
    sim_model_default(&model);
    model.structure = sim_structure_rigid;
    model.motor_inertia_kgm2 = 0.0004;
    model.load_inertia_kgm2 = 0.0046;
    model.viscous_friction_Nms_per_rad = 0.0008;
    model.coulomb_friction_Nm = 0.05;
    model.sample_rate_hz = rate_hz;
    model.sensors.counts_per_rev = 0.0;
    request = (struct separation_request){.model = &model, .enough_nats = 20.0};
    request.basis = (struct variant_basis){.request = &design, .periods = 8, .settle_time_s = NAN, .turn = two_pi};
    memset(&separation, 0, sizeof separation);
    memset(&error, 0, sizeof error);
}

void tearDown(void)
{
    separation_free(&separation);
}

/// The cascade on the table, repeated from its start without fades: settling periods, counted periods.
static int play(void *user, const struct sim_model *drive, const struct variant *excitation, size_t table,
                struct run *out_run, struct error *out_error)
{
    static const char *const names[] = {"torque_ref_Nm", "torque_Nm", "position_rad", "velocity_rad_per_s"};
    const struct design_result *r = &excitation->tables[table].result;
    const size_t samples = r->period_samples;
    double *columns[4];
    (void)user;
    *out_run = (struct run){.sample_rate_hz = rate_hz,
                            .rows = samples * (excitation->periods + excitation->settle_periods),
                            .period_samples = samples,
                            .periods = excitation->periods,
                            .settle_periods = excitation->settle_periods,
                            .has_settle_periods = true};
    out_run->bins = malloc(r->bin_count * sizeof *out_run->bins);
    for (size_t c = 0; c < 4; c++)
        columns[c] = run_add_column(out_run, names[c]);
    if (!out_run->bins || !columns[0] || !columns[1] || !columns[2] || !columns[3])
        return error_set(out_error, error_refused, "memory is short");
    memcpy(out_run->bins, r->bins, r->bin_count * sizeof *r->bins);
    out_run->bin_count = r->bin_count;
    struct sim_belt_drive simulated;
    sim_belt_drive_init(&simulated, drive, r->position_rad[r->start_index]);
    for (size_t n = 0; n < out_run->rows; n++) {
        size_t i = (r->start_index + n) % samples;
        struct sim_sample sample;
        struct sim_command command = {.control = sim_control_cascade,
                                      .torque = r->torque_Nm[i],
                                      .velocity = r->velocity_rad_per_s[i],
                                      .position =
                                          r->position_rad[i] + r->travel_per_period_rad * (double)n / (double)samples};
        sim_belt_drive_step(&simulated, &command, &sample);
        columns[0][n] = sample.torque_ref;
        columns[1][n] = sample.torque;
        columns[2][n] = sample.position;
        columns[3][n] = sample.velocity;
    }
    return 0;
}

static int effect_of(const char *id)
{
    int effect = sim_effect_find(id);
    TEST_ASSERT_TRUE_MESSAGE(effect >= 0, id);
    return effect;
}

static int separate(const char *one, const char *other)
{
    request.effects[0] = effect_of(one);
    request.effects[1] = effect_of(other);
    request.door.measure = play;
    return separation_run(&request, &separation, &error);
}

static void switch_on(const char *id, double value)
{
    int effect = effect_of(id);
    model.effect_on[effect] = true;
    model.effect_parameters[effect][0] = value;
}

static void test_separation_parse_reads_two_causes_and_lists_the_ids_otherwise(void)
{
    int effects[2];
    TEST_ASSERT_EQUAL(0, separation_parse("load_bias,asymmetric_friction", effects, &error));
    TEST_ASSERT_EQUAL(effect_of("load_bias"), effects[0]);
    TEST_ASSERT_EQUAL(effect_of("asymmetric_friction"), effects[1]);
    TEST_ASSERT_EQUAL(error_usage, separation_parse("load_bias,gravity", effects, &error));
    TEST_ASSERT_NOT_NULL(strstr(error.message, "'gravity'"));
    for (int e = 0; sim_effects[e]; e++)
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, sim_effects[e]->id), sim_effects[e]->id);
    static const char *const wrong[] = {"",           "load_bias",           "load_bias,",
                                        ",load_bias", "load_bias,load_bias", "load_bias,inertia,cogging"};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++)
        TEST_ASSERT_EQUAL_MESSAGE(error_usage, separation_parse(wrong[i], effects, &error), wrong[i]);
}

static void check_within_limits(const struct variant *variant)
{
    const double rounding = 1.0 + 1e-9;
    const struct design_limits *limits = &design.limits;
    for (size_t t = 0; t < variant->table_count; t++) {
        const struct design_result *r = &variant->tables[t].result;
        double travel = fabs(r->travel_per_period_rad) * (double)(variant->periods + variant->settle_periods);
        TEST_ASSERT_TRUE(r->peak_continuous.torque_Nm <= rounding * limits->torque_Nm);
        TEST_ASSERT_TRUE(r->peak_continuous.velocity_rad_per_s <= rounding * limits->velocity_rad_per_s);
        TEST_ASSERT_TRUE(r->peak_continuous.position_rad + travel <= rounding * limits->position_rad);
    }
}

static void test_variant_stays_within_the_limits_and_says_what_it_cannot_do(void)
{
    struct variant given, variant;
    size_t possible = 0;
    design.limits.position_rad = 3.0;
    TEST_ASSERT_EQUAL(0, variant_design(&request.basis, variant_as_given, NULL, &given, &error));
    check_within_limits(&given);
    const double period_s = period / rate_hz, rounding = 1e-9;
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 9.0 * period_s, given.test_time_s);
    for (int kind = variant_half_level; kind < variant_longer; kind++) {
        TEST_ASSERT_EQUAL(0, variant_design(&request.basis, (enum variant_kind)kind, &given, &variant, &error));
        check_within_limits(&variant);
        possible += variant.table_count > 0;
        TEST_ASSERT_TRUE((variant.table_count > 0) != (variant.why_not[0] != '\0'));
        variant_free(&variant);
    }
    TEST_ASSERT_EQUAL(6, possible);
    design.period_samples = 50; // lines to 150 Hz: twice that is beyond half the rate
    TEST_ASSERT_EQUAL(0, variant_design(&request.basis, variant_wide_lines, &given, &variant, &error));
    TEST_ASSERT_EQUAL(0, variant.table_count);
    TEST_ASSERT_NOT_NULL(strstr(variant.why_not, "300 Hz"));
    variant_free(&given);
}

static void test_variant_levels_strokes_and_speeds_are_what_they_say(void)
{
    struct variant given, variant;
    const double tolerance = 1e-9;
    TEST_ASSERT_EQUAL(0, variant_design(&request.basis, variant_as_given, NULL, &given, &error));
    TEST_ASSERT_EQUAL(0, variant_design(&request.basis, variant_half_level, &given, &variant, &error));
    TEST_ASSERT_EQUAL(2, variant.table_count);
    for (size_t n = 0; n < period; n++)
        TEST_ASSERT_DOUBLE_WITHIN(tolerance, 0.5 * variant.tables[0].result.torque_Nm[n],
                                  variant.tables[1].result.torque_Nm[n]);
    variant_free(&variant);
    TEST_ASSERT_EQUAL(0, variant_design(&request.basis, variant_slow_stroke, &given, &variant, &error));
    double low = 0.0, high = 0.0;
    for (size_t n = 0; n < variant.tables[0].result.period_samples; n++) {
        low = fmin(low, variant.tables[0].result.position_rad[n]);
        high = fmax(high, variant.tables[0].result.position_rad[n]);
    }
    TEST_ASSERT_TRUE(high - low > two_pi); // a free axis: more than a turn
    variant_free(&variant);
    TEST_ASSERT_EQUAL(0, variant_design(&request.basis, variant_both_directions, &given, &variant, &error));
    TEST_ASSERT_EQUAL(2, variant.table_count);
    double travel = variant.tables[0].result.travel_per_period_rad;
    TEST_ASSERT_TRUE(travel > 0.0);
    TEST_ASSERT_DOUBLE_WITHIN(tolerance, -travel, variant.tables[1].result.travel_per_period_rad);
    TEST_ASSERT_TRUE(variant.tables[0].result.peak_continuous.velocity_rad_per_s <= design.limits.velocity_rad_per_s);
    variant_free(&variant);
    variant_free(&given);
}

static void test_separation_finds_an_excitation_for_a_bias_and_an_asymmetry_that_tie_as_given(void)
{
    switch_on("load_bias", 0.0008);
    TEST_ASSERT_EQUAL_MESSAGE(0, separate("load_bias", "asymmetric_friction"), error.message);
    const struct separation_candidate *given = &separation.candidates[variant_as_given];
    TEST_ASSERT_EQUAL(separation_of_model, separation.causes[0].source);
    TEST_ASSERT_EQUAL(separation_of_rival, separation.causes[1].source);
    TEST_ASSERT_DOUBLE_WITHIN(0.0, 0.0008, separation.causes[0].values[0]);
    // Friction of 0.05 Nm, a and 1 + a times it in either direction: a = 0.016 imitates the bias, less what viscous
    // friction adds.
    TEST_ASSERT_DOUBLE_WITHIN(0.004, 0.014, separation.causes[1].values[0]);
    TEST_ASSERT_TRUE(given->measured);
    TEST_ASSERT_TRUE(given->evidence[0] > 100.0); // seen clearly, but as what?
    TEST_ASSERT_TRUE(given->nats < separation_tie_nats);
    TEST_ASSERT_TRUE(separation.chosen >= 0 && separation.enough);
    TEST_ASSERT_TRUE(separation.candidates[separation.chosen].nats >= request.enough_nats);
    TEST_ASSERT_EQUAL(separation_checks, separation.checked);
    for (size_t i = 0; i < separation.checked; i++)
        TEST_ASSERT_TRUE(separation.checked_nats[i] > separation_tie_nats);
}

static void test_separation_of_pure_coulomb_asymmetry_and_a_bias_is_refused_by_physics(void)
{
    model.viscous_friction_Nms_per_rad = 0.0;
    switch_on("load_bias", 0.0008);
    TEST_ASSERT_EQUAL_MESSAGE(0, separate("load_bias", "asymmetric_friction"), error.message);
    TEST_ASSERT_EQUAL(-1, separation.chosen);
    TEST_ASSERT_EQUAL(0, separation.checked);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(separation.reason, "the same in every motion"), separation.reason);
    for (size_t i = 0; i < variant_longer; i++)
        TEST_ASSERT_TRUE(!separation.candidates[i].measured || separation.candidates[i].nats < 1.0);
}

static void test_separation_refuses_a_cause_that_has_nothing_to_act_on(void)
{
    TEST_ASSERT_EQUAL(error_refused, separate("backlash", "load_bias"));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "belt"), error.message);
    TEST_ASSERT_EQUAL(error_refused, separate("load_bias", "lost_samples"));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "lost_samples"), error.message);
}

static bool stop_at_once(void *user, const char *what, size_t done, size_t total)
{
    (void)user;
    (void)what;
    (void)done;
    (void)total;
    return false;
}

static void test_separation_stops_when_it_is_told_to(void)
{
    request.progress = stop_at_once;
    TEST_ASSERT_EQUAL(error_refused, separate("load_bias", "asymmetric_friction"));
    TEST_ASSERT_NOT_NULL(strstr(error.message, "interrupted"));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_separation_parse_reads_two_causes_and_lists_the_ids_otherwise);
    RUN_TEST(test_variant_stays_within_the_limits_and_says_what_it_cannot_do);
    RUN_TEST(test_variant_levels_strokes_and_speeds_are_what_they_say);
    RUN_TEST(test_separation_finds_an_excitation_for_a_bias_and_an_asymmetry_that_tie_as_given);
    RUN_TEST(test_separation_of_pure_coulomb_asymmetry_and_a_bias_is_refused_by_physics);
    RUN_TEST(test_separation_refuses_a_cause_that_has_nothing_to_act_on);
    RUN_TEST(test_separation_stops_when_it_is_told_to);
    return UNITY_END();
}
