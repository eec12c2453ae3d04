/* SPDX-License-Identifier: MIT */
/// What every effect in the catalogue has to keep, whichever there are: nothing in the loops knows one by name.
#include "sim/effect.h"
#include "sim/model.h"

#include "unity.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

/// docs/files.md, cause ids: files and users know these names, so they stay.
static const char *const known_ids[] = {"inertia",
                                        "viscous_friction",
                                        "coulomb_friction",
                                        "stribeck_friction",
                                        "asymmetric_friction",
                                        "load_bias",
                                        "presliding",
                                        "belt_elasticity",
                                        "second_mode",
                                        "position_dependent_stiffness",
                                        "hardening_stiffness",
                                        "backlash",
                                        "cogging",
                                        "encoder_eccentricity",
                                        "torque_lag",
                                        "dead_time",
                                        "torque_saturation",
                                        "periodic_disturbance",
                                        "friction_drift",
                                        "lost_samples"};

static char message[400];

void setUp(void) {}

void tearDown(void) {}

static const char *named(const struct sim_effect *effect, const char *what)
{
    snprintf(message, sizeof message, "%s: %s", effect->id, what);
    return message;
}

static bool ends_with(const char *text, const char *end)
{
    size_t length = strlen(text), size = strlen(end);
    return length >= size && strcmp(text + length - size, end) == 0;
}

static bool ends_with_one_of(const char *text, const char *const *ends)
{
    for (size_t i = 0; ends[i]; i++)
        if (ends_with(text, ends[i]))
            return true;
    return false;
}

static void test_effects_have_unique_known_ids_and_can_be_found(void)
{
    size_t count = 0;
    for (size_t e = 0; sim_effects[e]; e++, count++) {
        bool known = false;
        for (size_t i = 0; i < sizeof known_ids / sizeof known_ids[0]; i++)
            known = known || strcmp(known_ids[i], sim_effects[e]->id) == 0;
        TEST_ASSERT_TRUE_MESSAGE(known, named(sim_effects[e], "no known cause id"));
        TEST_ASSERT_EQUAL_INT_MESSAGE((int)e, sim_effect_find(sim_effects[e]->id),
                                      named(sim_effects[e], "found elsewhere"));
    }
    TEST_ASSERT_TRUE(count >= 10);
    TEST_ASSERT_TRUE(count <= sim_effects_max);
    TEST_ASSERT_EQUAL_INT(-1, sim_effect_find("no_such_effect"));
}

static void test_effects_parameters_have_units_at_the_end_of_their_names_on_both_axes(void)
{
    static const char *const rotary[] = {"_Nm",        "_Nms_per_rad", "_Nm_per_rad", "_kgm2",     "_rad",
                                         "_rad_per_s", "_s",           "_hz",         "_per_rev",  "_per_rad",
                                         "_per_rad2",  "_ratio",       "share",       "_exponent", NULL};
    static const char *const linear[] = {"_N",     "_Ns_per_m", "_N_per_m", "_kg",  "_m",    "_m_per_s",  "_s", "_hz",
                                         "_per_m", "_per_m2",   "_ratio",   "_rad", "share", "_exponent", NULL};
    for (size_t e = 0; sim_effects[e]; e++) {
        const struct sim_effect *effect = sim_effects[e];
        TEST_ASSERT_TRUE_MESSAGE(effect->parameter_count >= 1 && effect->parameter_count <= sim_effect_parameters_max,
                                 named(effect, "number of parameters"));
        for (size_t i = 0; i < effect->parameter_count; i++) {
            const struct sim_parameter *p = &effect->parameters[i];
            TEST_ASSERT_TRUE_MESSAGE(ends_with_one_of(p->name, rotary), named(effect, p->name));
            TEST_ASSERT_TRUE_MESSAGE(ends_with_one_of(p->linear_name, linear), named(effect, p->linear_name));
            // A torque, an inertia or a speed has to change its name with its unit; an angle may stay one (a phase).
            if (strstr(p->name, "Nm") || strstr(p->name, "kgm2") || strstr(p->name, "rad_per_s") ||
                strstr(p->name, "rev"))
                TEST_ASSERT_TRUE_MESSAGE(strcmp(p->name, p->linear_name) != 0, named(effect, p->name));
            for (size_t j = 0; j < i; j++)
                TEST_ASSERT_TRUE_MESSAGE(strcmp(p->name, effect->parameters[j].name) != 0, named(effect, p->name));
        }
    }
}

static void assert_bounds(const struct sim_effect *effect, const struct sim_parameter *p, double low, double high)
{
    TEST_ASSERT_TRUE_MESSAGE(isfinite(low) && isfinite(high) && low < high, named(effect, p->name));
    if (p->kind == sim_parameter_positive)
        TEST_ASSERT_TRUE_MESSAGE(low > 0.0, named(effect, p->name)); // its logarithm is searched
    if (p->kind == sim_parameter_amplitude)
        TEST_ASSERT_TRUE_MESSAGE(low == 0.0, named(effect, p->name));
}

static void test_effects_parameters_have_sane_bounds(void)
{
    for (size_t e = 0; sim_effects[e]; e++)
        for (size_t i = 0; i < sim_effects[e]->parameter_count; i++) {
            const struct sim_parameter *p = &sim_effects[e]->parameters[i];
            assert_bounds(sim_effects[e], p, p->minimum, p->maximum);
            assert_bounds(sim_effects[e], p, p->linear_minimum, p->linear_maximum);
            bool next_is_phase = i + 1 < sim_effects[e]->parameter_count &&
                                 sim_effects[e]->parameters[i + 1].kind == sim_parameter_phase;
            TEST_ASSERT_TRUE_MESSAGE((p->kind == sim_parameter_amplitude) == next_is_phase,
                                     named(sim_effects[e], p->name));
            TEST_ASSERT_TRUE_MESSAGE(p->model_offset == SIZE_MAX ||
                                         p->model_offset + sizeof(double) <= sizeof(struct sim_model),
                                     named(sim_effects[e], p->name));
        }
}

static void test_effects_have_all_that_diagnosis_asks_for(void)
{
    for (size_t e = 0; sim_effects[e]; e++) {
        const struct sim_effect *effect = sim_effects[e];
        TEST_ASSERT_NOT_NULL_MESSAGE(effect->scan, named(effect, "scan"));
        TEST_ASSERT_NOT_NULL_MESSAGE(effect->say, named(effect, "say"));
        TEST_ASSERT_NOT_NULL_MESSAGE(effect->measure, named(effect, "measure"));
        TEST_ASSERT_TRUE_MESSAGE(strlen(effect->measure) > 10, named(effect, "measure"));
        bool of_model = effect->parameters[0].model_offset != SIZE_MAX;
        bool hooked = effect->oppose || effect->build_up || effect->bend || effect->attach || effect->limit ||
                      effect->sense || effect->lose;
        TEST_ASSERT_TRUE_MESSAGE(of_model || hooked, named(effect, "does nothing"));
        TEST_ASSERT_TRUE_MESSAGE(!effect->steady || effect->oppose, named(effect, "steady at nothing"));
        TEST_ASSERT_TRUE_MESSAGE(!effect->lose == !effect->notice, named(effect, "rows lost that nobody finds"));
        bool belt = effect->place == sim_place_belt, two = false;
        if (belt) { // without a second mass there is no belt
            struct sim_model rigid;
            sim_model_default(&rigid);
            TEST_ASSERT_NOT_NULL_MESSAGE(effect->applies, named(effect, "applies"));
            two = !effect->applies(&rigid);
        }
        TEST_ASSERT_EQUAL_INT_MESSAGE(belt, two, named(effect, "applies to a rigid drive"));
    }
}

static struct sim_coverage coverage_of(bool linear)
{
    return linear ? (struct sim_coverage){.position_span = 0.2,
                                          .velocity_rms = 0.1,
                                          .velocity_peak = 0.3,
                                          .torque_rms = 40.0,
                                          .torque_peak = 120.0,
                                          .reference_peak = 130.0,
                                          .duration_s = 20.0,
                                          .frequency_max_hz = 50.0,
                                          .linear = true}
                  : (struct sim_coverage){.position_span = 4.0,
                                          .velocity_rms = 6.0,
                                          .velocity_peak = 15.0,
                                          .torque_rms = 0.4,
                                          .torque_peak = 1.2,
                                          .reference_peak = 1.3,
                                          .duration_s = 20.0,
                                          .frequency_max_hz = 100.0};
}

/// A model that lacks everything, or has some of everything that is part of a base model.
static struct sim_model model_of(bool linear, bool full, double rate_hz)
{
    struct sim_model model;
    sim_model_default(&model);
    model.linear = linear;
    model.sample_rate_hz = rate_hz;
    if (linear)
        model.motor_inertia_kgm2 = 5.0;
    if (full) {
        double size = linear ? 1000.0 : 1.0;
        model.structure = sim_structure_two_mass;
        model.load_inertia_kgm2 = 0.004 * size;
        model.belt_stiffness_Nm_per_rad = 80.0 * size;
        model.belt_damping_Nms_per_rad = 0.01 * size;
        model.viscous_friction_Nms_per_rad = 0.002 * size;
        model.coulomb_friction_Nm = 0.05 * size;
        model.torque_lag_s = 5e-4;
        model.dead_time_s = 5e-4;
    }
    return model;
}

static void assert_scan(const struct sim_effect *effect, bool linear, bool full, double rate_hz)
{
    const size_t longest = 5000;
    struct sim_model model = model_of(linear, full, rate_hz);
    struct sim_coverage coverage = coverage_of(linear);
    if (effect->applies && !effect->applies(&model))
        return;
    size_t index = 0;
    for (; index < longest; index++) {
        double values[sim_effect_parameters_max] = {NAN, NAN, NAN, NAN};
        if (!effect->scan(&model, &coverage, index, values))
            break;
        for (size_t i = 0; i < effect->parameter_count; i++) {
            const struct sim_parameter *p = &effect->parameters[i];
            double low = linear ? p->linear_minimum : p->minimum, high = linear ? p->linear_maximum : p->maximum;
            snprintf(message, sizeof message, "%s: scan value %zu of %s is %g (linear %d, full %d, %g Hz)", effect->id,
                     index, p->name, values[i], linear, full, rate_hz);
            TEST_ASSERT_TRUE_MESSAGE(values[i] >= low && values[i] <= high, message);
            // A search that starts at nothing goes nowhere: its steps are shares of where it starts.
            if (p->kind != sim_parameter_phase)
                TEST_ASSERT_TRUE_MESSAGE(values[i] != 0.0, message);
        }
    }
    TEST_ASSERT_TRUE_MESSAGE(index >= 1, named(effect, "nothing to scan"));
    TEST_ASSERT_TRUE_MESSAGE(index < longest, named(effect, "scan does not end"));
}

static void test_effects_scans_end_and_stay_within_the_bounds(void)
{
    static const double rates_hz[] = {50.0, 440.0, 1000.0, 20000.0};
    for (size_t e = 0; sim_effects[e]; e++)
        for (int linear = 0; linear <= 1; linear++)
            for (int full = 0; full <= 1; full++)
                for (size_t r = 0; r < sizeof rates_hz / sizeof rates_hz[0]; r++)
                    assert_scan(sim_effects[e], linear, full, rates_hz[r]);
}

/// Sentences in which only one number changes: it has to be heard.
static void say(const struct sim_effect *effect, bool linear, const double *values, double nominal, char *out,
                size_t size)
{
    const double deviations[sim_effect_parameters_max] = {1e-3, 2e-3, 3e-3, 4e-3};
    const double given[sim_effect_parameters_max] = {nominal, nominal, nominal, nominal};
    struct sim_finding finding = {.parameters = values, .deviations = deviations, .nominal = given, .linear = linear};
    memset(out, 0x55, size);
    effect->say(&finding, out, size);
    TEST_ASSERT_NOT_NULL_MESSAGE(memchr(out, 0, size), named(effect, "sentence not ended"));
}

static void assert_sentence(const struct sim_effect *effect, const char *text)
{
    size_t length = strlen(text);
    TEST_ASSERT_TRUE_MESSAGE(length > 20 && text[length - 1] == '.', named(effect, text));
    TEST_ASSERT_TRUE_MESSAGE(text[0] >= 'A' && text[0] <= 'Z', named(effect, text));
    TEST_ASSERT_TRUE_MESSAGE(strpbrk(text, "0123456789") != NULL, named(effect, text));
    TEST_ASSERT_NULL_MESSAGE(strstr(text, "nan"), named(effect, text));
    TEST_ASSERT_NULL_MESSAGE(strstr(text, "inf"), named(effect, text));
    TEST_ASSERT_NULL_MESSAGE(strchr(text, '\n'), named(effect, text));
}

static void test_effects_say_one_sentence_with_their_numbers(void)
{
    for (size_t e = 0; sim_effects[e]; e++)
        for (int linear = 0; linear <= 1; linear++)
            for (int with_nominal = 0; with_nominal <= 1; with_nominal++) {
                char text[300], other[300];
                double values[sim_effect_parameters_max] = {0.123, 0.456, 7.89, 0.321};
                say(sim_effects[e], linear, values, with_nominal ? 0.05 : 0.0, text, sizeof text);
                assert_sentence(sim_effects[e], text);
                values[0] *= 1.5;
                say(sim_effects[e], linear, values, with_nominal ? 0.05 : 0.0, other, sizeof other);
                TEST_ASSERT_TRUE_MESSAGE(strcmp(text, other) != 0,
                                         named(sim_effects[e], "deaf to its first parameter"));
            }
}

static void test_effects_say_in_the_units_of_the_axis(void)
{
    for (size_t e = 0; sim_effects[e]; e++) {
        char text[300];
        const double values[sim_effect_parameters_max] = {0.123, 0.456, 7.89, 0.321};
        say(sim_effects[e], true, values, 0.05, text, sizeof text);
        TEST_ASSERT_NULL_MESSAGE(strstr(text, "Nm"), named(sim_effects[e], text));
        TEST_ASSERT_NULL_MESSAGE(strstr(text, "rad"), named(sim_effects[e], text));
        TEST_ASSERT_NULL_MESSAGE(strstr(text, "turn"), named(sim_effects[e], text));
        say(sim_effects[e], false, values, 0.05, text, sizeof text);
        TEST_ASSERT_NULL_MESSAGE(strstr(text, " N "), named(sim_effects[e], text));
        TEST_ASSERT_NULL_MESSAGE(strstr(text, " m "), named(sim_effects[e], text));
    }
}

static void test_effects_say_never_writes_past_its_buffer(void)
{
    for (size_t e = 0; sim_effects[e]; e++) {
        char text[64];
        const double values[sim_effect_parameters_max] = {0.123, 0.456, 7.89, 0.321};
        memset(text, 0x55, sizeof text);
        struct sim_finding finding = {.parameters = values, .deviations = values, .nominal = values};
        sim_effects[e]->say(&finding, text, 16);
        for (size_t i = 16; i < sizeof text; i++)
            TEST_ASSERT_EQUAL_HEX8_MESSAGE(0x55, text[i], sim_effects[e]->id);
    }
}

static void assert_reason(const struct sim_effect *effect, const char *why)
{
    TEST_ASSERT_TRUE_MESSAGE(strlen(why) > 10, named(effect, "no reason why it cannot show"));
    TEST_ASSERT_TRUE_MESSAGE(strpbrk(why, "0123456789") != NULL, named(effect, why));
    TEST_ASSERT_TRUE_MESSAGE(why[strlen(why) - 1] != '.', named(effect, why)); // a clause, not a sentence
    TEST_ASSERT_NULL_MESSAGE(strstr(why, "nan"), named(effect, why));
}

/// A recording that covers hardly anything: whatever cannot show in it has to say why, and a good one shows most scan
/// values.
static void test_effects_that_cannot_show_say_why(void)
{
    size_t reasons = 0;
    for (size_t e = 0; sim_effects[e]; e++)
        for (int linear = 0; linear <= 1; linear++) {
            const struct sim_effect *effect = sim_effects[e];
            struct sim_model model = model_of(linear, false, 1000.0);
            struct sim_coverage good = coverage_of(linear), poor = good;
            poor.position_span *= 1e-6;
            poor.velocity_rms *= 1e-6;
            poor.velocity_peak *= 1e-6;
            poor.duration_s *= 1e-6;
            poor.reference_peak *= 1e-6;
            double values[sim_effect_parameters_max] = {0};
            TEST_ASSERT_TRUE(effect->scan(&model, &good, 0, values));
            for (size_t i = 1; effect->detail && effect->detail(values, linear); i++)
                TEST_ASSERT_TRUE_MESSAGE(effect->scan(&model, &good, i, values), named(effect, "details only"));
            char why[160] = "";
            if (effect->testable) {
                TEST_ASSERT_TRUE_MESSAGE(effect->testable(values, &good, why, sizeof why),
                                         named(effect, "the first scan value that is a claim"));
                TEST_ASSERT_FALSE_MESSAGE(effect->testable(values, &poor, why, sizeof why),
                                          named(effect, "testable in nothing"));
                assert_reason(effect, why);
                reasons++;
            }
            if (effect->blind && effect->blind(&poor, why, sizeof why)) {
                assert_reason(effect, why);
                reasons++;
            }
        }
    TEST_ASSERT_TRUE(reasons >= 4);
}

static void test_effects_drift_that_is_over_before_anything_counts_is_not_testable(void)
{
    const struct sim_effect *drift = sim_effects[sim_effect_find("friction_drift")];
    struct sim_coverage coverage = coverage_of(false);
    char why[160] = "";
    const double fast[] = {0.5, 0.8}, slow[] = {0.5, 6.0};
    TEST_ASSERT_TRUE(drift->testable(fast, &coverage, why, sizeof why));
    coverage.start_s = 4.0;
    TEST_ASSERT_FALSE(drift->testable(fast, &coverage, why, sizeof why));
    assert_reason(drift, why);
    TEST_ASSERT_TRUE(drift->testable(slow, &coverage, why, sizeof why));
}

static void test_effects_engage_makes_a_valid_model_in_which_they_apply(void)
{
    for (size_t e = 0; sim_effects[e]; e++)
        for (int linear = 0; linear <= 1; linear++) {
            const struct sim_effect *effect = sim_effects[e];
            if (!effect->engage)
                continue;
            struct sim_model model = model_of(linear, false, 1000.0);
            double before = model.motor_inertia_kgm2 + model.load_inertia_kgm2, values[sim_effect_parameters_max] = {0};
            struct sim_coverage coverage = coverage_of(linear);
            TEST_ASSERT_TRUE(effect->scan(&model, &coverage, 0, values));
            effect->engage(&model);
            for (size_t i = 0; i < effect->parameter_count; i++)
                if (effect->parameters[i].model_offset != SIZE_MAX)
                    memcpy((char *)&model + effect->parameters[i].model_offset, &values[i], sizeof values[i]);
            TEST_ASSERT_NULL_MESSAGE(sim_model_check(&model, message, sizeof message), message);
            TEST_ASSERT_DOUBLE_WITHIN(1e-12, before, model.motor_inertia_kgm2 + model.load_inertia_kgm2);
        }
}

static void test_effects_of_no_size_oppose_nothing(void)
{
    for (size_t e = 0; sim_effects[e]; e++) {
        const struct sim_effect *effect = sim_effects[e];
        if (!effect->oppose)
            continue;
        double values[sim_effect_parameters_max] = {0.0, 0.5, 3.0, 0.5}; // the first parameter is the size
        struct sim_motion motion = {.position = 0.7, .velocity = 1.3, .time_s = 0.2};
        struct sim_opposing o = {.viscous = 0.2, .dry = 0.1, .positive_factor = 1.0, .negative_factor = 1.0};
        effect->oppose(values, &motion, &o);
        TEST_ASSERT_EQUAL_DOUBLE_MESSAGE(0.0, o.smooth, effect->id);
        TEST_ASSERT_EQUAL_DOUBLE_MESSAGE(0.2, o.viscous, effect->id);
        TEST_ASSERT_EQUAL_DOUBLE_MESSAGE(0.1, o.dry, effect->id);
        TEST_ASSERT_EQUAL_DOUBLE_MESSAGE(1.0, o.positive_factor, effect->id);
        TEST_ASSERT_EQUAL_DOUBLE_MESSAGE(1.0, o.negative_factor, effect->id);
    }
}

/// Whether a recording can show friction that rises towards standstill within `speed`.
static bool shows_rise_within(double speed, const struct sim_coverage *coverage)
{
    char why[160];
    const double values[] = {0.01, speed};
    return sim_effects[sim_effect_find("stribeck_friction")]->testable(values, coverage, why, sizeof why);
}

static void test_effects_rise_of_friction_shows_between_the_slowest_and_the_largest_speed(void)
{
    struct sim_coverage shaken = {.velocity_rms = 0.28, .velocity_peak = 1.4, .velocity_slow = 0.0014},
                        stroked = {.velocity_rms = 8.3, .velocity_peak = 13.0, .velocity_slow = 0.05};
    TEST_ASSERT_TRUE(shows_rise_within(0.49, &shaken)); // 1.7 times the RMS
    TEST_ASSERT_FALSE(shows_rise_within(1.5, &shaken));
    TEST_ASSERT_FALSE(shows_rise_within(0.001, &shaken));
    TEST_ASSERT_TRUE(shows_rise_within(0.11, &stroked)); // 0.013 times the RMS
    TEST_ASSERT_FALSE(shows_rise_within(0.04, &stroked));
    struct sim_coverage resting = stroked;
    resting.velocity_slow = 0.0; // an axis at rest part of the time
    TEST_ASSERT_FALSE(shows_rise_within(0.01, &resting));
}

static void test_effects_rise_of_friction_is_scanned_all_over_what_a_recording_can_show(void)
{
    const struct sim_coverage coverage = {
        .velocity_rms = 8.3, .velocity_peak = 13.0, .velocity_slow = 0.05, .torque_rms = 0.6};
    const struct sim_effect *effect = sim_effects[sim_effect_find("stribeck_friction")];
    double values[sim_effect_parameters_max], before = coverage.velocity_slow;
    size_t count = 0;
    while (effect->scan(NULL, &coverage, count, values)) {
        TEST_ASSERT_TRUE(shows_rise_within(values[1], &coverage));
        TEST_ASSERT_TRUE(values[1] < 3.0 * before); // a fit reaches the next value
        before = values[1];
        count++;
    }
    TEST_ASSERT_TRUE(3.0 * before > coverage.velocity_peak);
}

static void test_effects_scan_of_dead_time_goes_by_the_one_that_the_model_has(void)
{
    const struct sim_effect *effect = sim_effects[sim_effect_find("dead_time")];
    struct sim_coverage coverage = coverage_of(false);
    const double given[] = {0.0, 2e-5, 4.5e-4, 7e-4, 4.7e-3};
    for (size_t i = 0; i < sizeof given / sizeof given[0]; i++) {
        struct sim_model model = model_of(false, true, 1000.0);
        double value, before = 0.0;
        bool found = false;
        model.dead_time_s = given[i];
        for (size_t index = 0; effect->scan(&model, &coverage, index, &value); index++) {
            TEST_ASSERT_TRUE(value >= before && value > 0.0);
            found = found || fabs(value - given[i]) < 1e-12;
            before = value;
        }
        TEST_ASSERT_EQUAL(given[i] > 0.0, found);
        TEST_ASSERT_TRUE(before >= 3.6e-3); // the others are still there
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_effects_have_unique_known_ids_and_can_be_found);
    RUN_TEST(test_effects_parameters_have_units_at_the_end_of_their_names_on_both_axes);
    RUN_TEST(test_effects_parameters_have_sane_bounds);
    RUN_TEST(test_effects_have_all_that_diagnosis_asks_for);
    RUN_TEST(test_effects_scans_end_and_stay_within_the_bounds);
    RUN_TEST(test_effects_say_one_sentence_with_their_numbers);
    RUN_TEST(test_effects_say_in_the_units_of_the_axis);
    RUN_TEST(test_effects_say_never_writes_past_its_buffer);
    RUN_TEST(test_effects_that_cannot_show_say_why);
    RUN_TEST(test_effects_drift_that_is_over_before_anything_counts_is_not_testable);
    RUN_TEST(test_effects_engage_makes_a_valid_model_in_which_they_apply);
    RUN_TEST(test_effects_of_no_size_oppose_nothing);
    RUN_TEST(test_effects_rise_of_friction_shows_between_the_slowest_and_the_largest_speed);
    RUN_TEST(test_effects_rise_of_friction_is_scanned_all_over_what_a_recording_can_show);
    RUN_TEST(test_effects_scan_of_dead_time_goes_by_the_one_that_the_model_has);
    return UNITY_END();
}
