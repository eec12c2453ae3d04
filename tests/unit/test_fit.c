/* SPDX-License-Identifier: MIT */
/// Fits to runs of the simulated drive whose truth and noise are known.
#include "lab/diagnose/fit.h"

#include "lab/diagnose/hidden_mass.h"
#include "lab/diagnose/repeat.h"
#include "lab/diagnose/search.h"
#include "lab/numeric/statistics.h"
#include "tests/support/recorded_drive.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static struct sim_model truth, given;
static struct recorded_drive drive;
static struct hypothesis hypothesis;

void setUp(void)
{
    sim_model_default(&truth);
    truth.sensors = (struct sim_sensors){.velocity_noise_rad_per_s = 5e-3, .torque_noise_Nm = 3e-3};
    // Torque noise is alike at neighbouring bins. The noise of a speed alone is not at the lowest, where it would be
    // taken for larger than it is, and deviations with it.
    truth.process_noise_Nm = 0.01;
    truth.motor_inertia_kgm2 = 0.004;
    truth.load_inertia_kgm2 = 0.001;
    truth.viscous_friction_Nms_per_rad = 0.004;
    truth.coulomb_friction_Nm = 0.03;
    truth.torque_lag_s = 6e-4;
    given = truth;
}

void tearDown(void)
{
    recorded_drive_free(&drive);
}

/// A multisine.
static double command_at(size_t n, double rate_hz, struct sim_command *out)
{
    *out = (struct sim_command){.control = sim_control_cascade};
    for (int line = 1; line <= 40; line += 3) {
        double w = recorded_two_pi * line * rate_hz / recorded_samples, angle = w * (double)n / rate_hz;
        out->position += 3.0 / w * sin(angle + line * line);
        out->velocity += 3.0 * cos(angle + line * line);
    }
    return 0.0;
}

static void record(uint64_t seed)
{
    truth.seed = seed;
    TEST_ASSERT_TRUE(recorded_drive_init(&drive, &truth, 0.0, command_at, 3 * recorded_samples, 10));
}

static int name(const char *id, double value)
{
    int effect = sim_effect_find(id);
    TEST_ASSERT_TRUE_MESSAGE(effect >= 0, id);
    hypothesis_name(&hypothesis, effect, &value);
    return effect;
}

static void test_fit_finds_a_friction_that_the_given_model_has_wrong(void)
{
    record(1);
    given.viscous_friction_Nms_per_rad = 0.002;
    hypothesis_init(&hypothesis, &given, false, true);
    double before = fit_cost(&drive.fit, &drive.data, &hypothesis, hypothesis.x);
    int effect = name("viscous_friction", 0.002);
    TEST_ASSERT_TRUE(fit_run(&drive.fit, &drive.data, &hypothesis, 10));
    double value, deviation;
    hypothesis_parameters(&hypothesis, effect, drive.fit.covariance, &value, &deviation);
    TEST_ASSERT_TRUE(deviation > 0.0 && deviation < 1e-4);
    TEST_ASSERT_DOUBLE_WITHIN(5.0 * deviation, 0.004, value);
    TEST_ASSERT_TRUE(drive.fit.cost < before - 100.0);
    // A right model leaves noise: one a value, with the scatter of the noise estimated from so few periods.
    TEST_ASSERT_DOUBLE_WITHIN(0.4, 1.0, drive.fit.cost / (double)drive.data.values);
}

static void test_fit_cost_is_the_sum_of_squares_and_priors(void)
{
    record(2);
    hypothesis_init(&hypothesis, &given, false, true);
    hypothesis.x[0] = 0.003;
    double cost = fit_cost(&drive.fit, &drive.data, &hypothesis, hypothesis.x), sum = 0.0, prior = 0.0;
    struct sim_model model;
    double *residual = malloc(drive.data.values * sizeof *residual);
    TEST_ASSERT_NOT_NULL(residual);
    hypothesis_model(&hypothesis, NULL, &model);
    fit_residual(&drive.data, &model, residual);
    for (size_t i = 0; i < drive.data.values; i++) {
        sum += residual[i] * residual[i];
        TEST_ASSERT_EQUAL_DOUBLE(residual[i], drive.fit.residual[i]);
    }
    free(residual);
    for (size_t i = 0; i < hypothesis.count; i++)
        prior += pow(hypothesis.coordinates[i].weight * (hypothesis.x[i] - hypothesis.coordinates[i].centre), 2);
    TEST_ASSERT_TRUE(prior > 0.0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12 * prior, prior, drive.fit.prior);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12 * cost, sum + prior, cost);
}

static void test_fit_stays_within_its_boxes_and_gives_no_deviation_at_a_wall(void)
{
    record(3);
    given.coulomb_friction_Nm = 0.02; // the truth is half as large again: the box of an unnamed number ends far before
    hypothesis_init(&hypothesis, &given, false, true);
    TEST_ASSERT_TRUE(fit_run(&drive.fit, &drive.data, &hypothesis, 10));
    bool found = false;
    for (size_t i = 0; i < hypothesis.count; i++) {
        const struct coordinate *c = &hypothesis.coordinates[i];
        TEST_ASSERT_TRUE(hypothesis.x[i] >= c->lower && hypothesis.x[i] <= c->upper);
        if (c->model_offset == offsetof(struct sim_model, coulomb_friction_Nm)) {
            found = true;
            TEST_ASSERT_EQUAL_DOUBLE(c->upper, hypothesis.x[i]);
            TEST_ASSERT_EQUAL_DOUBLE(0.0, drive.fit.covariance[i * hypothesis.count + i]);
        }
    }
    TEST_ASSERT_TRUE(found);
}

static void test_fit_never_makes_it_worse(void)
{
    record(4);
    static const double starts[] = {1e-4, 0.01, 0.2};
    for (size_t i = 0; i < sizeof starts / sizeof starts[0]; i++) {
        hypothesis_init(&hypothesis, &given, false, true);
        name("coulomb_friction", starts[i]);
        double before = fit_cost(&drive.fit, &drive.data, &hypothesis, hypothesis.x);
        for (size_t iterations = 1; iterations <= 4; iterations++) {
            TEST_ASSERT_TRUE(fit_run(&drive.fit, &drive.data, &hypothesis, iterations));
            TEST_ASSERT_TRUE(drive.fit.cost <= before);
            before = drive.fit.cost;
            TEST_ASSERT_DOUBLE_WITHIN(1e-9 * before, before,
                                      fit_cost(&drive.fit, &drive.data, &hypothesis, hypothesis.x));
        }
    }
}

static void test_fit_step_with_borrowed_derivatives_is_the_first_step_of_a_fit(void)
{
    record(5);
    given.viscous_friction_Nms_per_rad = 0.0;
    hypothesis_init(&hypothesis, &given, false, true);
    TEST_ASSERT_TRUE(fit_run(&drive.fit, &drive.data, &hypothesis, 6));
    struct hypothesis stepped = hypothesis, whole;
    double value = 0.003;
    hypothesis_name(&stepped, sim_effect_find("viscous_friction"), &value);
    whole = stepped;
    struct fit step = {0};
    TEST_ASSERT_TRUE(fit_init(&step, &drive.data));
    double start = fit_cost(&step, &drive.data, &stepped, stepped.x);
    TEST_ASSERT_TRUE(fit_step(&step, &drive.data, &hypothesis, &drive.fit, &stepped));
    double cost = step.cost;
    TEST_ASSERT_TRUE(fit_run(&step, &drive.data, &whole, 6));
    double best = step.cost;
    fit_free(&step);
    // The model is nearly linear in friction: one step gets nearly all of the way.
    TEST_ASSERT_TRUE(best < start - 1000.0);
    TEST_ASSERT_TRUE(start - cost > 0.99 * (start - best));
}

/// A given model whose numbers are off by as much as its priors say.
static void draw_given(struct random *random)
{
    hypothesis_init(&hypothesis, &truth, false, true);
    for (size_t i = 0; i < hypothesis.count; i++) {
        const struct coordinate *c = &hypothesis.coordinates[i];
        double off = random_normal(random) / c->weight;
        hypothesis.x[i] = fmin(fmax(off, 0.9 * c->lower), 0.9 * c->upper);
    }
    hypothesis_model(&hypothesis, NULL, &given);
}

/// Over fresh noise and fresh errors of the given model the estimates scatter as their deviations say: chi-square.
static void assert_deviations(const char *id, double start, double expected)
{
    enum { draws = 16 };
    const uint64_t seed = 100;
    double sum = 0.0;
    char message[120];
    struct random random;
    random_seed(&random, seed);
    for (uint64_t d = 0; d < draws; d++) {
        record(seed + d);
        draw_given(&random);
        hypothesis_init(&hypothesis, &given, false, true);
        int effect = name(id, start);
        TEST_ASSERT_TRUE(fit_run(&drive.fit, &drive.data, &hypothesis, 8));
        double value, deviation;
        hypothesis_parameters(&hypothesis, effect, drive.fit.covariance, &value, &deviation);
        sum += pow((value - expected) / deviation, 2);
        tearDown();
    }
    snprintf(message, sizeof message, "%s, seeds %u..%u: chi-square %g of %d", id, (unsigned)seed,
             (unsigned)(seed + draws - 1), sum, draws);
    // Chance leaves these bounds once in a thousand; the noise, known from ten periods only, makes them a little wider.
    TEST_ASSERT_TRUE_MESSAGE(sum < 1.25 * statistics_chi2_quantile(0.9995, draws), message);
    TEST_ASSERT_TRUE_MESSAGE(sum > statistics_chi2_quantile(0.0005, draws), message);
}

/// A belt with a gap between motor and load, that the given model does not have.
static void make_loose_belt(void)
{
    truth.structure = sim_structure_two_mass;
    truth.belt_stiffness_Nm_per_rad = 80.0;
    truth.belt_damping_Nms_per_rad = 0.05;
    given = truth;
    int gap = sim_effect_find("backlash");
    truth.effect_on[gap] = true;
    truth.effect_parameters[gap][0] = 4e-4;
}

/// A slope over the jump of a single contact would stop a fit short, or state a tenth of the deviation.
static void test_fit_of_a_rough_residual_has_one_end_and_one_deviation(void)
{
    static const double starts[] = {0.7, 0.9, 0.95, 1.0, 1.05, 1.1, 1.3};
    const double jump = 4.0, most_off = 3.0, alike = 0.3;
    double first_cost = 0.0, first_deviation = 0.0;
    make_loose_belt();
    int gap = sim_effect_find("backlash");
    double right = truth.effect_parameters[gap][0];
    record(6);
    for (size_t i = 0; i < sizeof starts / sizeof starts[0]; i++) {
        double value, deviation;
        hypothesis_init(&hypothesis, &given, false, true);
        name("backlash", starts[i] * right);
        TEST_ASSERT_TRUE(fit_run(&drive.fit, &drive.data, &hypothesis, 8));
        hypothesis_parameters(&hypothesis, gap, drive.fit.covariance, &value, &deviation);
        first_cost = i == 0 ? drive.fit.cost : first_cost;
        first_deviation = i == 0 ? deviation : first_deviation;
        TEST_ASSERT_DOUBLE_WITHIN(jump, first_cost, drive.fit.cost);
        TEST_ASSERT_DOUBLE_WITHIN(most_off * deviation, right, value);
        TEST_ASSERT_DOUBLE_WITHIN(alike * first_deviation, first_deviation, deviation);
    }
}

static void test_fit_deviations_are_the_scatter_over_fresh_noise(void)
{
    assert_deviations("viscous_friction", 0.003, truth.viscous_friction_Nms_per_rad);
    assert_deviations("coulomb_friction", 0.02, truth.coulomb_friction_Nm);
}

static void test_repeat_adds_by_how_much_other_data_give_another_number(void)
{
    record(9);
    given.viscous_friction_Nms_per_rad = 0.002;
    hypothesis_init(&hypothesis, &given, false, true);
    int effect = name("viscous_friction", 0.002);
    TEST_ASSERT_TRUE(fit_run(&drive.fit, &drive.data, &hypothesis, 10));
    struct repeat repeat;
    TEST_ASSERT_TRUE(repeat_compare(&drive.data, &hypothesis, &drive.fit, &drive.data, &drive.evidence, &repeat));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, repeat.variance[effect][0]); // the same data
    // A value that is fifty deviations from what the other data say, both deviations alike.
    double value, deviation;
    hypothesis_parameters(&hypothesis, effect, drive.fit.covariance, &value, &deviation);
    for (size_t i = 0; i < hypothesis.count; i++)
        if (hypothesis.coordinates[i].effect == effect) // on a linear scale
            hypothesis.x[i] = (value + 50.0 * deviation) / hypothesis.coordinates[i].unit;
    TEST_ASSERT_TRUE(repeat_compare(&drive.data, &hypothesis, &drive.fit, &drive.data, &drive.evidence, &repeat));
    TEST_ASSERT_DOUBLE_WITHIN(0.05 * 50.0 * deviation, 50.0 * deviation, sqrt(repeat.variance[effect][0]));
}

/// The load is hidden behind a belt that the given model does not have.
static void test_fit_of_a_hidden_mass_ends_at_the_truth_when_the_noise_follows(void)
{
    const double most_share = 0.1; // of the stiffness: five deviations of these data
    truth.structure = sim_structure_two_mass;
    truth.motor_inertia_kgm2 = 0.002;
    truth.load_inertia_kgm2 = 0.003;
    truth.belt_stiffness_Nm_per_rad = 400.0;
    truth.belt_damping_Nms_per_rad = 0.05;
    given = truth;
    given.structure = sim_structure_rigid;
    record(10);
    int effect = sim_effect_find("belt_elasticity");
    double values[sim_effect_parameters_max] = {500.0, 0.05}, deviations[sim_effect_parameters_max] = {0.0};
    TEST_ASSERT_TRUE(effect >= 0);
    hypothesis_init(&hypothesis, &given, false, true);
    TEST_ASSERT_FALSE(hidden_mass_concerns(&drive.data, &hypothesis));
    hypothesis_name(&hypothesis, effect, values);
    TEST_ASSERT_TRUE(hidden_mass_concerns(&drive.data, &hypothesis));
    TEST_ASSERT_TRUE(hidden_mass_fit(&drive.data, &drive.evidence, &drive.fit, &hypothesis));
    hypothesis_parameters(&hypothesis, effect, drive.fit.covariance, values, deviations);
    TEST_ASSERT_DOUBLE_WITHIN(most_share * 400.0, 400.0, values[0]);
    TEST_ASSERT_DOUBLE_WITHIN(5.0 * deviations[0], 400.0, values[0]);
    // What is held stays, and is free again afterwards.
    struct hypothesis free_again;
    double x = hypothesis.x[0];
    hidden_mass_hold(&hypothesis, &free_again);
    TEST_ASSERT_TRUE(hidden_mass_holds(&hypothesis, effect));
    TEST_ASSERT_TRUE(fit_run(&drive.fit, &drive.data, &hypothesis, 3));
    hidden_mass_release(&free_again, &hypothesis);
    TEST_ASSERT_FALSE(hidden_mass_holds(&hypothesis, effect));
    TEST_ASSERT_EQUAL_DOUBLE(x, hypothesis.x[0]);
}

static void test_hidden_mass_cost_below_what_noise_leaves_is_not_believed(void)
{
    drive.data.values = 800; // chance: 800 +- 40
    TEST_ASSERT_EQUAL_DOUBLE(801.0, hidden_mass_credible_cost(&drive.data, 801.0));
    TEST_ASSERT_EQUAL_DOUBLE(740.0, hidden_mass_credible_cost(&drive.data, 740.0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 800.0 - 1.645 * 40.0, hidden_mass_credible_cost(&drive.data, 600.0));
}

/* A fit in which the noise followed says what is left without a name; under other noise that is worth nothing. */
static void test_search_evidence_is_by_what_was_remembered_until_the_noise_is_another(void)
{
    static struct search_memo memo;
    memset(&memo, 0, sizeof memo);
    record(9);
    drive.data.memo = &memo;
    given.viscous_friction_Nms_per_rad = 0.0;
    hypothesis_init(&hypothesis, &given, false, true);
    const struct hypothesis without = hypothesis;
    int effect = name("viscous_friction", 0.004);
    TEST_ASSERT_TRUE(fit_run(&drive.fit, &drive.data, &hypothesis, 8));
    double fitted = search_evidence(&drive.data, &hypothesis, &drive.fit, effect);
    TEST_ASSERT_TRUE(fitted > 20.0);
    search_remember(&drive.data, &without, drive.fit.cost + 200.0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 100.0, search_evidence(&drive.data, &hypothesis, &drive.fit, effect));
    search_remember(&drive.data, &without, drive.fit.cost + 300.0); // the last word counts, also where it is more
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 150.0, search_evidence(&drive.data, &hypothesis, &drive.fit, effect));
    truth.motor_inertia_kgm2 *= 1.01;
    TEST_ASSERT_TRUE(evidence_estimate_noise(&drive.evidence, &truth));
    TEST_ASSERT_TRUE(fit_run(&drive.fit, &drive.data, &hypothesis, 8));
    TEST_ASSERT_DOUBLE_WITHIN(0.1 * fitted, fitted, search_evidence(&drive.data, &hypothesis, &drive.fit, effect));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_hidden_mass_cost_below_what_noise_leaves_is_not_believed);
    RUN_TEST(test_fit_finds_a_friction_that_the_given_model_has_wrong);
    RUN_TEST(test_fit_cost_is_the_sum_of_squares_and_priors);
    RUN_TEST(test_fit_stays_within_its_boxes_and_gives_no_deviation_at_a_wall);
    RUN_TEST(test_fit_never_makes_it_worse);
    RUN_TEST(test_fit_step_with_borrowed_derivatives_is_the_first_step_of_a_fit);
    RUN_TEST(test_fit_of_a_rough_residual_has_one_end_and_one_deviation);
    RUN_TEST(test_fit_deviations_are_the_scatter_over_fresh_noise);
    RUN_TEST(test_repeat_adds_by_how_much_other_data_give_another_number);
    RUN_TEST(test_fit_of_a_hidden_mass_ends_at_the_truth_when_the_noise_follows);
    RUN_TEST(test_search_evidence_is_by_what_was_remembered_until_the_noise_is_another);
    return UNITY_END();
}
