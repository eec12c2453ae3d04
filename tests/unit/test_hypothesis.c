/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/hypothesis.h"

#include "lab/numeric/statistics.h"
#include "unity.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

/// Relative: a logarithm and back.
static const double rounding = 1e-12;

static struct sim_model given;
static struct hypothesis hypothesis;

void setUp(void)
{
    sim_model_default(&given);
    given.motor_inertia_kgm2 = 0.004;
    given.load_inertia_kgm2 = 0.002;
    given.viscous_friction_Nms_per_rad = 0.003;
    given.coulomb_friction_Nm = 0.05;
    given.torque_lag_s = 5e-4;
    hypothesis_init(&hypothesis, &given, false, true);
}

void tearDown(void) {}

static int effect_of(const char *id)
{
    int effect = sim_effect_find(id);
    TEST_ASSERT_TRUE_MESSAGE(effect >= 0, id);
    return effect;
}

static double field_of(const struct sim_model *model, size_t offset)
{
    double value;
    memcpy(&value, (const char *)model + offset, sizeof value);
    return value;
}

static void scan_values(int effect, double *out)
{
    struct sim_coverage coverage = {.position_span = 4.0,
                                    .velocity_rms = 6.0,
                                    .velocity_peak = 15.0,
                                    .torque_rms = 0.4,
                                    .duration_s = 20.0,
                                    .frequency_max_hz = 100.0,
                                    .linear = given.linear};
    struct sim_model current;
    hypothesis_model(&hypothesis, NULL, &current);
    TEST_ASSERT_TRUE(sim_effects[effect]->scan(&current, &coverage, 0, out));
}

static void assert_same_model(const struct sim_model *expected, const struct sim_model *model)
{
    for (size_t offset = offsetof(struct sim_model, motor_inertia_kgm2);
         offset < offsetof(struct sim_model, has_end_stops); offset += sizeof(double)) {
        double value = field_of(expected, offset);
        TEST_ASSERT_DOUBLE_WITHIN(rounding * fabs(value), value, field_of(model, offset));
    }
    TEST_ASSERT_EQUAL_INT(expected->structure, model->structure);
    TEST_ASSERT_EQUAL_MEMORY(expected->effect_on, model->effect_on, sizeof expected->effect_on);
    TEST_ASSERT_EQUAL_MEMORY(&expected->controller, &model->controller, sizeof expected->controller);
    TEST_ASSERT_EQUAL_MEMORY(&expected->sensors, &model->sensors, sizeof expected->sensors);
}

/// Every coordinate is within its box, no field moves twice, and cosine and sine parts lie side by side.
static void assert_sound(void)
{
    TEST_ASSERT_TRUE(hypothesis.count <= hypothesis_coordinates_max);
    for (size_t i = 0; i < hypothesis.count; i++) {
        const struct coordinate *c = &hypothesis.coordinates[i];
        TEST_ASSERT_TRUE(c->lower < c->upper);
        TEST_ASSERT_TRUE(hypothesis.x[i] >= c->lower && hypothesis.x[i] <= c->upper);
        TEST_ASSERT_TRUE(c->unit > 0.0 && c->weight >= 0.0);
        TEST_ASSERT_TRUE(c->effect < 0 || hypothesis.named[c->effect]);
        if (c->scale == coordinate_cosine)
            TEST_ASSERT_TRUE(i + 1 < hypothesis.count && hypothesis.coordinates[i + 1].scale == coordinate_sine &&
                             hypothesis.coordinates[i + 1].effect == c->effect);
        for (size_t j = 0; j < i; j++)
            TEST_ASSERT_TRUE(c->model_offset == SIZE_MAX || c->model_offset != hypothesis.coordinates[j].model_offset);
    }
}

static void test_hypothesis_starts_as_the_given_model_with_its_numbers_in_narrow_boxes(void)
{
    struct sim_model model;
    hypothesis_model(&hypothesis, NULL, &model);
    assert_same_model(&given, &model);
    assert_sound();
    TEST_ASSERT_EQUAL_UINT(5, hypothesis.count); // two inertias, two frictions, one lag: what the model has
    for (size_t i = 0; i < hypothesis.count; i++) {
        const struct coordinate *c = &hypothesis.coordinates[i];
        TEST_ASSERT_EQUAL_INT(-1, c->effect);
        TEST_ASSERT_TRUE(c->weight > 0.0);
        TEST_ASSERT_TRUE(exp(c->upper) <= 1.1001 && exp(c->lower) >= 0.8999);
    }
}

static void test_hypothesis_at_the_walls_gives_values_at_the_walls(void)
{
    struct sim_model model;
    double x[hypothesis_coordinates_max];
    for (size_t i = 0; i < hypothesis.count; i++)
        x[i] = hypothesis.coordinates[i].upper;
    hypothesis_model(&hypothesis, x, &model);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 0.004 * 1.02, model.motor_inertia_kgm2);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 0.05 * 1.10, model.coulomb_friction_Nm);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, model.dead_time_s);
    hypothesis_model(&hypothesis, NULL, &model); // its own coordinates are still where they were
    assert_same_model(&given, &model);
}

static void test_hypothesis_without_reference_leaves_the_actuator_alone(void)
{
    hypothesis_init(&hypothesis, &given, false, false);
    for (size_t i = 0; i < hypothesis.count; i++)
        TEST_ASSERT_TRUE(hypothesis.coordinates[i].model_offset != offsetof(struct sim_model, torque_lag_s));
    for (int e = 0; sim_effects[e]; e++)
        if (sim_effects[e]->place == sim_place_actuator)
            TEST_ASSERT_FALSE(hypothesis_may_name(&hypothesis, e));
}

static void test_hypothesis_of_no_given_model_frees_the_inertia_and_does_not_name_it(void)
{
    hypothesis_init(&hypothesis, &given, true, true);
    bool found = false;
    for (size_t i = 0; i < hypothesis.count; i++)
        if (hypothesis.coordinates[i].model_offset == offsetof(struct sim_model, motor_inertia_kgm2)) {
            TEST_ASSERT_EQUAL_DOUBLE(0.0, hypothesis.coordinates[i].weight);
            TEST_ASSERT_TRUE(hypothesis.coordinates[i].upper > 10.0);
            found = true;
        }
    TEST_ASSERT_TRUE(found);
    TEST_ASSERT_FALSE(hypothesis_may_name(&hypothesis, effect_of("inertia")));
}

static void test_hypothesis_naming_starts_at_the_values_and_opens_the_box(void)
{
    for (int linear = 0; linear <= 1; linear++)
        for (int e = 0; sim_effects[e]; e++) {
            const struct sim_effect *effect = sim_effects[e];
            setUp();
            given.linear = linear;
            hypothesis_init(&hypothesis, &given, false, true);
            hypothesis.sensors_seen = true;
            // What is noticed in the rows is no hypothesis, and a belt's effects take two masses.
            bool expected = !effect->notice && (!effect->applies || effect->applies(&given));
            TEST_ASSERT_EQUAL_INT_MESSAGE(expected, hypothesis_may_name(&hypothesis, e), effect->id);
            if (!expected)
                continue;
            double values[sim_effect_parameters_max] = {0}, got[sim_effect_parameters_max] = {0};
            scan_values(e, values);
            hypothesis_name(&hypothesis, e, values);
            assert_sound();
            TEST_ASSERT_FALSE_MESSAGE(hypothesis_may_name(&hypothesis, e), effect->id);
            hypothesis_parameters(&hypothesis, e, NULL, got, NULL);
            struct sim_model model;
            hypothesis_model(&hypothesis, NULL, &model);
            size_t own = 0;
            for (size_t i = 0; i < effect->parameter_count; i++) {
                TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(rounding * fabs(values[i]) + 1e-15, values[i], got[i], effect->id);
                bool of_model = effect->parameters[i].model_offset != SIZE_MAX;
                double there =
                    of_model ? field_of(&model, effect->parameters[i].model_offset) : model.effect_parameters[e][i];
                TEST_ASSERT_EQUAL_DOUBLE(got[i], there);
                TEST_ASSERT_EQUAL_INT(!of_model, model.effect_on[e]);
            }
            for (size_t i = 0; i < hypothesis.count; i++)
                if (hypothesis.coordinates[i].effect == e) {
                    bool whole = effect->parameters[hypothesis.coordinates[i].parameter].near_whole > 0.0;
                    TEST_ASSERT_EQUAL_INT(whole, hypothesis.coordinates[i].weight > 0.0);
                    own++;
                }
            TEST_ASSERT_EQUAL_UINT(effect->parameter_count, own);
        }
}

static void test_hypothesis_boxes_of_named_effects_end_at_or_within_the_bounds_of_their_parameters(void)
{
    for (int linear = 0; linear <= 1; linear++)
        for (int e = 0; sim_effects[e]; e++) {
            setUp();
            given.linear = linear;
            hypothesis_init(&hypothesis, &given, false, true);
            if (!hypothesis_may_name(&hypothesis, e))
                continue;
            double values[sim_effect_parameters_max] = {0};
            scan_values(e, values);
            hypothesis_name(&hypothesis, e, values);
            for (size_t i = 0; i < hypothesis.count; i++) {
                const struct coordinate *c = &hypothesis.coordinates[i];
                if (c->effect != e)
                    continue;
                const struct sim_parameter *p = &sim_effects[e]->parameters[c->parameter];
                double low = linear ? p->linear_minimum : p->minimum, high = linear ? p->linear_maximum : p->maximum;
                if (c->scale == coordinate_linear) {
                    TEST_ASSERT_DOUBLE_WITHIN(rounding * fabs(low), low, c->unit * c->lower);
                    TEST_ASSERT_DOUBLE_WITHIN(rounding * high, high, c->unit * c->upper);
                } else if (c->scale == coordinate_logarithmic) {
                    TEST_ASSERT_TRUE(c->unit * exp(c->lower) >= low * (1.0 - rounding));
                    TEST_ASSERT_TRUE(c->unit * exp(c->upper) <= high * (1.0 + rounding));
                    TEST_ASSERT_TRUE_MESSAGE(c->upper > 1.0 || c->lower < -1.0, sim_effects[e]->id);
                } else if (c->scale == coordinate_cosine) {
                    TEST_ASSERT_DOUBLE_WITHIN(rounding * high, high, c->unit * c->upper);
                }
            }
        }
}

static void test_hypothesis_unnaming_gives_back_what_was_before(void)
{
    for (int e = 0; sim_effects[e]; e++) {
        struct hypothesis before = hypothesis;
        if (!hypothesis_may_name(&hypothesis, e))
            continue;
        double values[sim_effect_parameters_max] = {0};
        scan_values(e, values);
        hypothesis_name(&hypothesis, e, values);
        hypothesis_unname(&hypothesis, e);
        assert_sound();
        TEST_ASSERT_EQUAL_UINT_MESSAGE(before.count, hypothesis.count, sim_effects[e]->id);
        struct sim_model model;
        hypothesis_model(&hypothesis, NULL, &model);
        assert_same_model(&given, &model);
        TEST_ASSERT_TRUE(hypothesis_may_name(&hypothesis, e));
        hypothesis = before;
    }
}

static void test_hypothesis_effects_come_and_go_in_any_order_and_keep_the_others_values(void)
{
    // Every ordered pair: name both, move the coordinates of the second, take the first back.
    for (int a = 0; sim_effects[a]; a++)
        for (int b = 0; sim_effects[b]; b++) {
            if (a == b)
                continue;
            setUp();
            double values[sim_effect_parameters_max] = {0}, before[sim_effect_parameters_max],
                   after[sim_effect_parameters_max];
            if (!hypothesis_may_name(&hypothesis, a))
                continue;
            scan_values(a, values);
            hypothesis_name(&hypothesis, a, values);
            if (!hypothesis_may_name(&hypothesis, b))
                continue;
            scan_values(b, values);
            hypothesis_name(&hypothesis, b, values);
            assert_sound();
            for (size_t i = 0; i < hypothesis.count; i++)
                if (hypothesis.coordinates[i].effect == b)
                    hypothesis.x[i] = 0.9 * hypothesis.x[i] + 0.1 * fmin(hypothesis.coordinates[i].upper, 1.5);
            hypothesis_parameters(&hypothesis, b, NULL, before, NULL);
            hypothesis_unname(&hypothesis, a);
            assert_sound();
            if (!hypothesis.named[b]) { // it had nothing to act on without the first
                TEST_ASSERT_NOT_NULL_MESSAGE(sim_effects[b]->applies, sim_effects[b]->id);
                TEST_ASSERT_FALSE_MESSAGE(sim_effects[b]->applies(&given), sim_effects[b]->id);
                continue;
            }
            hypothesis_parameters(&hypothesis, b, NULL, after, NULL);
            for (size_t i = 0; i < sim_effects[b]->parameter_count; i++)
                TEST_ASSERT_EQUAL_DOUBLE_MESSAGE(before[i], after[i], sim_effects[b]->id);
            hypothesis_unname(&hypothesis, b);
            struct sim_model model;
            hypothesis_model(&hypothesis, NULL, &model);
            assert_same_model(&given, &model);
        }
}

/// How far up the motor's inertia may move, as a logarithm.
static double motor_inertia_room(void)
{
    for (size_t i = 0; i < hypothesis.count; i++)
        if (hypothesis.coordinates[i].model_offset == offsetof(struct sim_model, motor_inertia_kgm2))
            return hypothesis.coordinates[i].upper;
    TEST_FAIL_MESSAGE("the motor's inertia may not move at all");
    return 0.0;
}

static void test_hypothesis_engaging_a_structure_frees_how_the_inertia_splits_and_unnaming_binds_it_again(void)
{
    int e = effect_of("belt_elasticity");
    for (int load_known = 0; load_known <= 1; load_known++) {
        given.load_inertia_kgm2 = load_known ? 0.002 : 0.0;
        hypothesis_init(&hypothesis, &given, false, true);
        double values[sim_effect_parameters_max] = {0}, rigid = motor_inertia_room();
        scan_values(e, values);
        hypothesis_name(&hypothesis, e, values);
        struct sim_model model;
        hypothesis_model(&hypothesis, NULL, &model);
        TEST_ASSERT_EQUAL_INT(sim_structure_two_mass, model.structure);
        double total = given.motor_inertia_kgm2 + given.load_inertia_kgm2;
        TEST_ASSERT_DOUBLE_WITHIN(rounding, total, model.motor_inertia_kgm2 + model.load_inertia_kgm2);
        // A model that names no load leaves the split to the data altogether.
        TEST_ASSERT_TRUE(motor_inertia_room() > (load_known ? 5.0 * rigid : log(10.0)));
        hypothesis_unname(&hypothesis, e);
        TEST_ASSERT_EQUAL_DOUBLE(rigid, motor_inertia_room());
    }
}

static void test_hypothesis_does_not_name_what_the_given_model_has_on(void)
{
    int e = effect_of("load_bias");
    given.effect_on[e] = true;
    given.effect_parameters[e][0] = 0.02;
    hypothesis_init(&hypothesis, &given, false, true);
    TEST_ASSERT_FALSE(hypothesis_may_name(&hypothesis, e));
    struct sim_model model;
    int other = effect_of("cogging");
    double values[sim_effect_parameters_max] = {0.01, 0.3, 5.0};
    hypothesis_name(&hypothesis, other, values);
    hypothesis_model(&hypothesis, NULL, &model);
    TEST_ASSERT_TRUE(model.effect_on[e] && model.effect_on[other]);
    TEST_ASSERT_EQUAL_DOUBLE(0.02, model.effect_parameters[e][0]);
}

// ---- Deviations

/// Draws x from its covariance (lower factor L, correlated with neighbours) and compares scatters with predicted
/// deviations.
static void assert_deviations(int effect, const double *values, double size)
{
    enum { draws = 20000 };
    const uint64_t seed = 11;
    // Five standard deviations of a deviation estimated from that many draws, 5 / sqrt(2 draws), and the curvature of
    // size^2.
    const double chance = 0.025;
    hypothesis.sensors_seen = true;
    hypothesis_name(&hypothesis, effect, values);
    size_t n = hypothesis.count;
    for (size_t i = 0; i < n; i++) // a search moves on from where it started
        if (hypothesis.coordinates[i].scale != coordinate_logarithmic)
            hypothesis.x[i] *= 1.7;
    static double covariance[hypothesis_coordinates_max * hypothesis_coordinates_max];
    double L[2] = {
        0.8, 0.6}; // x_i = size (0.8 z_i + 0.6 z_(i-1)): unit variance times size^2, neighbours correlated by 0.48
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++)
            covariance[i * n + j] = size * size * (i == j ? 1.0 : i + 1 == j || j + 1 == i ? L[0] * L[1] : 0.0);
    double at[sim_effect_parameters_max], deviations[sim_effect_parameters_max], sums[sim_effect_parameters_max] = {0};
    hypothesis_parameters(&hypothesis, effect, covariance, at, deviations);

    struct random random;
    struct hypothesis drawn = hypothesis;
    random_seed(&random, seed);
    for (size_t d = 0; d < draws; d++) {
        double z = random_normal(&random);
        for (size_t i = 0; i < n; i++) {
            double last = z;
            z = random_normal(&random);
            drawn.x[i] = hypothesis.x[i] + size * (L[0] * z + L[1] * last);
        }
        double got[sim_effect_parameters_max];
        hypothesis_parameters(&drawn, effect, NULL, got, NULL);
        for (size_t i = 0; i < sim_effects[effect]->parameter_count; i++)
            sums[i] += (got[i] - at[i]) * (got[i] - at[i]) / draws;
    }
    for (size_t i = 0; i < sim_effects[effect]->parameter_count; i++) {
        char message[100];
        snprintf(message, sizeof message, "%s, %s, seed %u", sim_effects[effect]->id,
                 sim_effects[effect]->parameters[i].name, (unsigned)seed);
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(chance * deviations[i], deviations[i], sqrt(sums[i]), message);
    }
}

static void test_hypothesis_deviations_are_the_scatter_of_the_parameters(void)
{
    for (int e = 0; sim_effects[e]; e++) {
        double values[sim_effect_parameters_max] = {0};
        setUp();
        scan_values(e, values);
        assert_deviations(e, values, 0.02);
    }
}

static void test_hypothesis_deviations_of_amplitude_and_phase_hold_at_any_phase(void)
{
    int e = effect_of("cogging");
    for (double phase = -2.5; phase < 3.0; phase += 0.8) {
        double values[sim_effect_parameters_max] = {0.02, phase, 9.0};
        setUp();
        assert_deviations(e, values, 0.02);
    }
}

static void test_hypothesis_takes_what_only_two_motion_columns_show_as_usual_without_them(void)
{
    for (int e = 0; sim_effects[e]; e++)
        for (size_t i = 0; sim_effects[e]->sense && i < sim_effects[e]->parameter_count; i++) {
            double values[sim_effect_parameters_max] = {0}, got[sim_effect_parameters_max] = {0};
            const struct sim_parameter *p = &sim_effects[e]->parameters[i];
            if (!p->optional)
                continue;
            hypothesis_init(&hypothesis, &given, false, true);
            scan_values(e, values);
            values[i] = 0.5 * (p->minimum + p->maximum);
            hypothesis_name(&hypothesis, e, values);
            hypothesis_parameters(&hypothesis, e, NULL, got, NULL);
            TEST_ASSERT_EQUAL_DOUBLE(p->usual, got[i]);
            struct sim_model model;
            hypothesis_model(&hypothesis, NULL, &model);
            TEST_ASSERT_EQUAL_DOUBLE(p->usual, model.effect_parameters[e][i]);
        }
}

static void test_hypothesis_leaves_the_inertia_of_a_rigid_body_to_a_free_gain(void)
{
    int inertia = effect_of("inertia");
    TEST_ASSERT_TRUE(hypothesis_may_name(&hypothesis, inertia));
    hypothesis.gain_free = true;
    TEST_ASSERT_FALSE(hypothesis_may_name(&hypothesis, inertia));
}

/// What the speed carries of an encoder's error: all or nothing, and a fit that says neither pays for it.
static void test_hypothesis_keeps_what_is_0_or_1_by_construction_near_it(void)
{
    int effect = effect_of("encoder_eccentricity");
    hypothesis.sensors_seen = true;
    for (int whole = 0; whole < 2; whole++) {
        struct hypothesis named = hypothesis;
        hypothesis_name(&named, effect, (double[]){1e-3, 0.0, whole == 0 ? 0.1 : 1.0});
        const struct coordinate *c = named.coordinates;
        while (c->effect != effect || c->parameter != 2)
            TEST_ASSERT_TRUE(++c < named.coordinates + named.count);
        TEST_ASSERT_DOUBLE_WITHIN(rounding, whole, c->centre * c->unit);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1.0 / 0.05, c->weight / c->unit);
    }
}

/// A bristle too short to be told from a switch belongs to the drive; a longer one is a cause.
static void test_hypothesis_claims_what_is_no_detail(void)
{
    int effect = effect_of("presliding");
    const double lengths[] = {2e-5, 2e-4};
    TEST_ASSERT_FALSE(hypothesis_is_detail(&hypothesis, effect));
    for (size_t claims = 0; claims < 2; claims++) {
        struct hypothesis named = hypothesis;
        hypothesis_name(&named, effect, (double[]){lengths[claims], 1.0, 1e-4});
        TEST_ASSERT_EQUAL(claims == 0, hypothesis_is_detail(&named, effect));
        TEST_ASSERT_EQUAL(claims, hypothesis_claims(&named));
    }
}

/// exp(log 3) is more than 3, which a model file would refuse.
static void test_hypothesis_a_number_at_its_wall_is_within_its_bounds_to_the_last_digit(void)
{
    int effect = effect_of("presliding");
    double values[sim_effect_parameters_max];
    scan_values(effect, values);
    hypothesis_name(&hypothesis, effect, values);
    for (size_t i = 0; i < hypothesis.count; i++) {
        const struct coordinate *c = &hypothesis.coordinates[i];
        if (c->effect != effect)
            continue;
        const struct sim_parameter *p = &sim_effects[effect]->parameters[c->parameter];
        for (int side = 0; side < 2; side++) {
            struct sim_model model;
            hypothesis.x[i] = side ? c->upper : c->lower;
            hypothesis_model(&hypothesis, NULL, &model);
            double value = model.effect_parameters[effect][c->parameter];
            TEST_ASSERT_TRUE_MESSAGE(value >= p->minimum && value <= p->maximum, p->name);
        }
    }
}

/// What is changed along the travel is changed about its middle: the belt there is as stiff as it was.
static void test_hypothesis_naming_what_changes_along_the_travel_leaves_its_middle_alone(void)
{
    const double slope = 0.01, middle = 4.0, there = 60.0;
    int effect = effect_of("position_dependent_stiffness");
    struct sim_model model;
    given.structure = sim_structure_two_mass;
    given.belt_stiffness_Nm_per_rad = there;
    hypothesis_init(&hypothesis, &given, false, true);
    hypothesis.middle = middle;
    hypothesis_name(&hypothesis, effect, &slope);
    hypothesis_model(&hypothesis, NULL, &model);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9 * there, there, model.belt_stiffness_Nm_per_rad * (1.0 + slope * middle));
    for (size_t i = 0; i < hypothesis.count; i++) {
        if (hypothesis.coordinates[i].effect != effect)
            continue;
        size_t along = hypothesis_along(&hypothesis, i);
        TEST_ASSERT_TRUE(along < hypothesis.count);
        TEST_ASSERT_EQUAL_size_t(offsetof(struct sim_model, belt_stiffness_Nm_per_rad),
                                 hypothesis.coordinates[along].model_offset);
        double shift = hypothesis_along_shift(&hypothesis, hypothesis.x, i, 2.0 * hypothesis.x[i]);
        hypothesis.x[along] += shift;
        hypothesis.x[i] *= 2.0;
    }
    hypothesis_model(&hypothesis, NULL, &model);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9 * there, there, model.belt_stiffness_Nm_per_rad * (1.0 + 2.0 * slope * middle));
    hypothesis_unname(&hypothesis, effect);
    hypothesis_model(&hypothesis, NULL, &model);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9 * there, there, model.belt_stiffness_Nm_per_rad);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_hypothesis_keeps_what_is_0_or_1_by_construction_near_it);
    RUN_TEST(test_hypothesis_starts_as_the_given_model_with_its_numbers_in_narrow_boxes);
    RUN_TEST(test_hypothesis_at_the_walls_gives_values_at_the_walls);
    RUN_TEST(test_hypothesis_claims_what_is_no_detail);
    RUN_TEST(test_hypothesis_a_number_at_its_wall_is_within_its_bounds_to_the_last_digit);
    RUN_TEST(test_hypothesis_without_reference_leaves_the_actuator_alone);
    RUN_TEST(test_hypothesis_of_no_given_model_frees_the_inertia_and_does_not_name_it);
    RUN_TEST(test_hypothesis_naming_starts_at_the_values_and_opens_the_box);
    RUN_TEST(test_hypothesis_boxes_of_named_effects_end_at_or_within_the_bounds_of_their_parameters);
    RUN_TEST(test_hypothesis_unnaming_gives_back_what_was_before);
    RUN_TEST(test_hypothesis_effects_come_and_go_in_any_order_and_keep_the_others_values);
    RUN_TEST(test_hypothesis_engaging_a_structure_frees_how_the_inertia_splits_and_unnaming_binds_it_again);
    RUN_TEST(test_hypothesis_naming_what_changes_along_the_travel_leaves_its_middle_alone);
    RUN_TEST(test_hypothesis_does_not_name_what_the_given_model_has_on);
    RUN_TEST(test_hypothesis_deviations_are_the_scatter_of_the_parameters);
    RUN_TEST(test_hypothesis_deviations_of_amplitude_and_phase_hold_at_any_phase);
    RUN_TEST(test_hypothesis_takes_what_only_two_motion_columns_show_as_usual_without_them);
    RUN_TEST(test_hypothesis_leaves_the_inertia_of_a_rigid_body_to_a_free_gain);
    return UNITY_END();
}
