/* SPDX-License-Identifier: MIT */
#include "lab/record/json_out.h"
#include "lab/record/model_file.h"
#include "sim/effect.h"
#include "tests/support/scratch.h"
#include "unity.h"

#include <math.h>
#include <stdint.h>

/* Numbers that are computed from each other differ by rounding alone. */
static const double rounding = 1e-12;

static struct sim_model model;
static struct error error;

void setUp(void)
{
    scratch_empty();
    error = (struct error){0};
}

void tearDown(void) {}

static void read_text(const char *text)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, model_file_read(scratch_text("m.json", text), &model, &error), error.message);
}

static void refuse(const char *text, const char *message)
{
    TEST_ASSERT_EQUAL_INT(error_refused, model_file_read(scratch_text("m.json", text), &model, &error));
    const char *name = strstr(error.message, "m.json");
    TEST_ASSERT_EQUAL_STRING_LEN(message, name ? name : error.message, strlen(message));
}

static double own_parameter(const char *effect, const char *name)
{
    int e = sim_effect_find(effect);
    TEST_ASSERT_TRUE(e >= 0);
    TEST_ASSERT_TRUE(model.effect_on[e]);
    for (size_t i = 0; i < sim_effects[e]->parameter_count; i++)
        if (strcmp(sim_effects[e]->parameters[i].name, name) == 0 ||
            strcmp(sim_effects[e]->parameters[i].linear_name, name) == 0)
            return model.effect_parameters[e][i];
    TEST_FAIL_MESSAGE(name);
    return NAN;
}

static void test_model_read_takes_defaults_for_what_is_left_out(void)
{
    struct sim_model usual;
    sim_model_default(&usual);
    read_text("{\"structure\": \"rigid\", \"motor_inertia_kgm2\": 0.01}");
    TEST_ASSERT_EQUAL_INT(sim_structure_rigid, model.structure);
    TEST_ASSERT_FALSE(model.linear);
    TEST_ASSERT_EQUAL_DOUBLE(0.01, model.motor_inertia_kgm2);
    TEST_ASSERT_EQUAL_DOUBLE(0, model.load_inertia_kgm2);
    TEST_ASSERT_EQUAL_DOUBLE(0, model.viscous_friction_Nms_per_rad);
    TEST_ASSERT_EQUAL_DOUBLE(0, model.coulomb_friction_Nm);
    TEST_ASSERT_EQUAL_DOUBLE(0, model.torque_lag_s);
    TEST_ASSERT_EQUAL_DOUBLE(1000, model.sample_rate_hz);
    TEST_ASSERT_EQUAL_MEMORY(&usual.sensors, &model.sensors, sizeof usual.sensors);
    TEST_ASSERT_EQUAL_DOUBLE(usual.controller.position_gain_per_s, model.controller.position_gain_per_s);
    double bandwidth =
        usual.controller.velocity_gain_Nms_per_rad / (usual.motor_inertia_kgm2 + usual.load_inertia_kgm2);
    TEST_ASSERT_DOUBLE_WITHIN(rounding * bandwidth, bandwidth, model.controller.velocity_gain_Nms_per_rad / 0.01);
    TEST_ASSERT_FALSE(model.has_end_stops);
    for (size_t e = 0; sim_effects[e]; e++)
        TEST_ASSERT_FALSE(model.effect_on[e]);
}

static void test_model_read_takes_every_field(void)
{
    read_text(
        "{\"structure\": \"two_mass\", \"motor_inertia_kgm2\": 0.001, \"load_inertia_kgm2\": 0.004,\n"
        " \"belt_stiffness_Nm_per_rad\": 60, \"belt_damping_Nms_per_rad\": 0.01, \"viscous_friction_Nms_per_rad\": "
        "0.003,\n"
        " \"coulomb_friction_Nm\": 0.05, \"torque_lag_s\": 0.0005, \"dead_time_s\": 0.0002, \"pulley_radius_m\": "
        "0.02,\n"
        " \"sample_rate_hz\": 2000, \"process_noise_Nm\": 0.002, \"end_stops_rad\": [-3, 4], \"seed\": 7,\n"
        " \"controller\": {\"position_gain_per_s\": 11, \"velocity_gain_Nms_per_rad\": 0.5,\n"
        "   \"velocity_integral_time_s\": 0.1, \"velocity_feedforward\": 0.9, \"torque_feedforward\": 0.8},\n"
        " \"sensors\": {\"counts_per_rev\": 4096, \"position_noise_rad\": 1e-4, \"velocity_noise_rad_per_s\": 0.01,\n"
        "   \"torque_noise_Nm\": 0.004, \"velocity_filter_s\": 0.001},\n"
        " \"effects\": {\"cogging\": {\"amplitude_Nm\": 0.03, \"periods_per_rev\": 12, \"phase_rad\": 0.4}},\n"
        " \"std\": {\"coulomb_friction_Nm\": 0.001}, \"made_by\": [\"someone\"]}\n");
    const double expected[] = {0.001, 0.004, 60,  0.01, 0.003, 0.05, 0.0005, 0.0002, 0.02, 2000,  0.002, -3,
                               4,     11,    0.5, 0.1,  0.9,   0.8,  4096,   1e-4,   0.01, 0.004, 0.001};
    const double actual[] = {model.motor_inertia_kgm2,
                             model.load_inertia_kgm2,
                             model.belt_stiffness_Nm_per_rad,
                             model.belt_damping_Nms_per_rad,
                             model.viscous_friction_Nms_per_rad,
                             model.coulomb_friction_Nm,
                             model.torque_lag_s,
                             model.dead_time_s,
                             model.pulley_radius_m,
                             model.sample_rate_hz,
                             model.process_noise_Nm,
                             model.end_stops_rad[0],
                             model.end_stops_rad[1],
                             model.controller.position_gain_per_s,
                             model.controller.velocity_gain_Nms_per_rad,
                             model.controller.velocity_integral_time_s,
                             model.controller.velocity_feedforward,
                             model.controller.torque_feedforward,
                             model.sensors.counts_per_rev,
                             model.sensors.position_noise_rad,
                             model.sensors.velocity_noise_rad_per_s,
                             model.sensors.torque_noise_Nm,
                             model.sensors.velocity_filter_s};
    TEST_ASSERT_EQUAL_MEMORY(expected, actual, sizeof expected);
    TEST_ASSERT_EQUAL_INT(sim_structure_two_mass, model.structure);
    TEST_ASSERT_TRUE(model.has_end_stops);
    TEST_ASSERT_EQUAL_UINT64(7, model.seed);
    TEST_ASSERT_EQUAL_DOUBLE(0.03, own_parameter("cogging", "amplitude_Nm"));
    TEST_ASSERT_EQUAL_DOUBLE(12, own_parameter("cogging", "periods_per_rev"));
    TEST_ASSERT_EQUAL_DOUBLE(0.4, own_parameter("cogging", "phase_rad"));
}

static void test_model_read_takes_the_twins_of_a_linear_axis(void)
{
    struct sim_model usual;
    sim_model_default(&usual);
    read_text("{\"structure\": \"rigid\", \"mass_kg\": 95.1, \"viscous_friction_Ns_per_m\": 203.5, "
              "\"coulomb_friction_N\": 20.4,\n"
              " \"pulley_radius_m\": 0.05, \"effects\": {\"load_bias\": {\"bias_N\": -3.2}}, \"sensors\": "
              "{\"counts_per_m\": 1e6}}");
    TEST_ASSERT_TRUE(model.linear);
    TEST_ASSERT_EQUAL_DOUBLE(95.1, model.motor_inertia_kgm2 + model.load_inertia_kgm2);
    TEST_ASSERT_EQUAL_DOUBLE(203.5, model.viscous_friction_Nms_per_rad);
    TEST_ASSERT_EQUAL_DOUBLE(20.4, model.coulomb_friction_Nm);
    TEST_ASSERT_EQUAL_DOUBLE(-3.2, own_parameter("load_bias", "bias_N"));
    TEST_ASSERT_EQUAL_DOUBLE(1e6, model.sensors.counts_per_rev);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, usual.sensors.torque_noise_Nm / 0.05, model.sensors.torque_noise_Nm);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, usual.sensors.position_noise_rad * 0.05, model.sensors.position_noise_rad);
}

static void test_model_read_lets_an_effect_set_the_field_that_it_is(void)
{
    read_text(
        "{\"structure\": \"rigid\", \"motor_inertia_kgm2\": 0.01, \"viscous_friction_Nms_per_rad\": 0.001,\n"
        " \"effects\": {\"viscous_friction\": {\"viscous_friction_Nms_per_rad\": 0.004},\n"
        "  \"inertia\": {\"load_inertia_kgm2\": 0.002}, \"belt_elasticity\": {\"belt_stiffness_Nm_per_rad\": 50}}}");
    TEST_ASSERT_EQUAL_DOUBLE(0.004, model.viscous_friction_Nms_per_rad);
    TEST_ASSERT_EQUAL_DOUBLE(0.002, model.load_inertia_kgm2);
    TEST_ASSERT_EQUAL_INT(sim_structure_two_mass, model.structure);
    TEST_ASSERT_EQUAL_DOUBLE(50, model.belt_stiffness_Nm_per_rad);
    for (size_t e = 0; sim_effects[e]; e++)
        TEST_ASSERT_FALSE(model.effect_on[e]);
}

static void test_model_read_says_line_key_value_and_expectation(void)
{
    refuse("{\n \"structure\": \"rigid\",,\n}", "m.json:2: at ',': is not valid JSON");
    refuse("", "m.json:1: at 'end of file': is not valid JSON");
    refuse("{\"structure\": \"rigid\"} {", "m.json:1: at '{': is not valid JSON");
    refuse("[1]", "m.json:1: an object { } was expected");
    refuse("{\"seed\": 1,\n\"seed\": 2}", "m.json:1: seed: is there twice");
    refuse("{\"motor_inertia_kgm2\": 1}", "m.json: structure: is missing: \"rigid\" or \"two_mass\" was expected");
    refuse("{\n\"structure\": \"three\"}", "m.json:2: structure: \"three\": \"rigid\" or \"two_mass\" was expected");
    refuse("{\"structure\": \"rigid\"}", "m.json: motor_inertia_kgm2: is missing: a number was expected");
    refuse("{\"structure\": \"rigid\", \"linear\": true}", "m.json: mass_kg: is missing: a number was expected");
    refuse("{\"structure\": \"two_mass\", \"motor_inertia_kgm2\": 1}",
           "m.json: load_inertia_kgm2: is missing: a two-mass drive needs both");
    refuse("{\"structure\": \"rigid\",\n\n\"motor_inertia_kgm2\": \"1\"}",
           "m.json:3: motor_inertia_kgm2: \"1\": a finite number was expected");
    refuse("{\"structure\": \"rigid\", \"motor_inertia_kgm2\": 1e999}",
           "m.json:1: motor_inertia_kgm2: too large: a finite number was expected");
    refuse("{\"structure\": \"rigid\",\n\"motor_inertia_kgm2\": -1}", "m.json:2: motor_inertia_kgm2: -1 is not within");
    refuse("{\"structure\": \"rigid\",\n\"mass_kg\": -1}", "m.json:2: mass_kg: -1 is not within");
    refuse(
        "{\"structure\": \"rigid\", \"mass_kg\": 1,\n\"coulomb_friction_Nm\": 1}",
        "m.json:1: mass_kg is of a linear axis, coulomb_friction_Nm (line 2) of a rotary one: one kind was expected");
    refuse("{\"structure\": \"rigid\", \"linear\": false, \"mass_kg\": 1}",
           "m.json:1: linear: does not go with mass_kg (line 1)");
    refuse(
        "{\"structure\": \"rigid\", \"motor_inertia_kgm2\": 1,\n\"sensors\": {\"seed\": 1,\n\"counts_per_rev\": -1}}",
        "m.json:3: sensors.counts_per_rev: -1 is not within");
    refuse("{\"structure\": \"rigid\", \"motor_inertia_kgm2\": 1, \"sensors\": 5}",
           "m.json:1: sensors: 5: an object { } was expected");
    refuse("{\"structure\": \"rigid\", \"motor_inertia_kgm2\": 1, \"end_stops_rad\": [1]}",
           "m.json:1: end_stops_rad: [1]: two finite numbers [low, high] were expected");
    refuse("{\"structure\": \"rigid\", \"motor_inertia_kgm2\": 1, \"end_stops_rad\": [2, 1]}",
           "m.json:1: end_stops_rad: 2, 1: the first has to be below the second");
    refuse("{\"structure\": \"rigid\", \"motor_inertia_kgm2\": 1, \"seed\": 1.5}",
           "m.json:1: seed: 1.5: a whole number from 0 to 2^53");
    refuse("{\"structure\": \"rigid\", \"motor_inertia_kgm2\": 1, \"seed\": \"99999999999999999999\"}",
           "m.json:1: seed: \"99999999999999999999\": a whole number");
}

static void test_model_read_refuses_effects_that_cannot_run(void)
{
    static const char start[] = "{\"structure\": \"rigid\", \"motor_inertia_kgm2\": 1,\n \"effects\": {\n  ";
    static const struct {
        const char *effects, *message;
    } cases[] = {
        {"\"gremlins\": {}", "m.json:3: effects.gremlins: {}: one of these was expected: "},
        {"\"cogging\": 1", "m.json:3: effects.cogging: 1: an object { } of parameters was expected"},
        {"\"cogging\": {\"amplitude_Nm\": 1}",
         "m.json: effects.cogging.periods_per_rev: is missing: running the effect needs it"},
        {"\"cogging\": {\"amplitude_Nm\": true, \"periods_per_rev\": 1}",
         "m.json:3: effects.cogging.amplitude_Nm: true: a finite number was expected"},
        {"\"cogging\": {\"amplitude_Nm\": -1, \"periods_per_rev\": 1}",
         "m.json:3: effects.cogging.amplitude_Nm: -1 is not within"},
        {"\"viscous_friction\": {}", "m.json:3: effects.viscous_friction: {}: at least one parameter was expected"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char text[256];
        snprintf(text, sizeof text, "%s%s}}", start, cases[i].effects);
        refuse(text, cases[i].message);
    }
}

/* Every effect on, every parameter inside its bounds and awkward to print. */
static void fill_model(bool linear)
{
    sim_model_default(&model);
    model.linear = linear;
    model.structure = sim_structure_two_mass;
    model.motor_inertia_kgm2 = 0.01 / 3;
    model.load_inertia_kgm2 = 0.1 / 7;
    model.belt_stiffness_Nm_per_rad = 1e3 / 3;
    model.belt_damping_Nms_per_rad = 1.0 / 3;
    model.viscous_friction_Nms_per_rad = 1e-3 / 3;
    model.coulomb_friction_Nm = 0.1 / 3;
    model.torque_lag_s = 1e-3 / 3;
    model.dead_time_s = 2e-3 / 3;
    model.process_noise_Nm = 1e-4 / 3;
    model.has_end_stops = true;
    model.end_stops_rad[0] = -10.0 / 3;
    model.end_stops_rad[1] = 1.0 / 3;
    model.seed = UINT64_MAX - 12;
    for (size_t e = 0; sim_effects[e]; e++) {
        for (size_t i = 0; i < sim_effects[e]->parameter_count; i++) {
            const struct sim_parameter *p = &sim_effects[e]->parameters[i];
            if (p->model_offset != SIZE_MAX)
                continue;
            double low = linear ? p->linear_minimum : p->minimum, high = linear ? p->linear_maximum : p->maximum;
            model.effect_on[e] = true;
            model.effect_parameters[e][i] = low + fmin(1.0, high - low) / 3;
        }
    }
}

static void round_trip(bool linear)
{
    const char *path = scratch_path("m.json");
    fill_model(linear);
    struct sim_model out = model;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, model_file_write(path, &out, NULL, &error), error.message);
    memset(&model, 0, sizeof model);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, model_file_read(path, &model, &error), error.message);
    // sim_model_default sets the whole struct, padding included, so that all of it compares.
    TEST_ASSERT_EQUAL_MEMORY(&out, &model, sizeof model);
}

static void test_model_optional_parameters_of_effects_have_usual_values(void)
{
    read_text("{\"structure\": \"rigid\", \"motor_inertia_kgm2\": 0.004, \"effects\": {"
              "\"second_mode\": {\"mode_frequency_hz\": 40, \"mode_inertia_kgm2\": 0.0003},"
              "\"encoder_eccentricity\": {\"amplitude_rad\": 0.001, \"phase_rad\": 1}}}");
    TEST_ASSERT_EQUAL_DOUBLE(0.02, own_parameter("second_mode", "mode_damping_ratio"));
    TEST_ASSERT_EQUAL_DOUBLE(1.0, own_parameter("encoder_eccentricity", "speed_error_ratio"));
}

static void test_model_refuses_belts_of_rigid_drives(void)
{
    refuse(
        "{\"structure\": \"rigid\", \"motor_inertia_kgm2\": 0.004, \"effects\": {\"backlash\": {\"gap_rad\": 0.001}}}",
        "m.json:1: effects.backlash: a drive of two masses is needed");
}

static void test_model_write_reads_back_bit_for_bit(void)
{
    round_trip(false);
    round_trip(true);
}

static void test_model_write_puts_deviations_beside_what_they_belong_to(void)
{
    const char *path = scratch_path("m.json");
    struct model_deviations deviations = {0};
    fill_model(false);
    TEST_ASSERT_TRUE(model_deviations_add(&deviations, NULL, "coulomb_friction_Nm", 0.25));
    TEST_ASSERT_TRUE(model_deviations_add(&deviations, "viscous_friction", "viscous_friction_Nms_per_rad", 0.5));
    TEST_ASSERT_TRUE(model_deviations_add(&deviations, "cogging", "amplitude_Nm", 0.125));
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, model_file_write(path, &model, &deviations, &error), error.message);
    char *text = scratch_load(path, NULL);
    cJSON *root = cJSON_Parse(text);
    const cJSON *std = cJSON_GetObjectItem(root, "std");
    const cJSON *cogging = cJSON_GetObjectItem(cJSON_GetObjectItem(root, "effects"), "cogging");
    TEST_ASSERT_EQUAL_DOUBLE(0.25, cJSON_GetNumberValue(cJSON_GetObjectItem(std, "coulomb_friction_Nm")));
    TEST_ASSERT_EQUAL_DOUBLE(0.5, cJSON_GetNumberValue(cJSON_GetObjectItem(std, "viscous_friction_Nms_per_rad")));
    const cJSON *amplitude = cJSON_GetObjectItem(cJSON_GetObjectItem(cogging, "std"), "amplitude_Nm");
    TEST_ASSERT_EQUAL_DOUBLE(0.125, cJSON_GetNumberValue(amplitude));
    cJSON_Delete(root);
    free(text);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, model_file_read(path, &model, &error), error.message);
    while (model_deviations_add(&deviations, NULL, "coulomb_friction_Nm", 0))
        ;
    TEST_ASSERT_EQUAL_UINT(model_deviations_max, deviations.count);
}

static void test_model_write_refuses_what_could_not_be_read(void)
{
    const char *path = scratch_path("m.json");
    struct model_deviations deviations = {0};
    fill_model(false);
    model_deviations_add(&deviations, NULL, "coulomb_friction_Nm", NAN);
    TEST_ASSERT_EQUAL_INT(error_refused, model_file_write(path, &model, &deviations, &error));
    model.controller.torque_feedforward = NAN;
    TEST_ASSERT_EQUAL_INT(error_refused, model_file_write(path, &model, NULL, &error));
    fill_model(false);
    model.motor_inertia_kgm2 = -1;
    TEST_ASSERT_EQUAL_INT(error_refused, model_file_write(path, &model, NULL, &error));
    TEST_ASSERT_EQUAL_INT(0, scratch_count());
}

static void test_json_write_keeps_bits_escapes_text_and_has_no_nan(void)
{
    const char *path = scratch_path("out.json");
    const char awkward_text[] = "quote \" backslash \\ line\nbell\x07 µ";
    cJSON *root = cJSON_CreateObject();
    cJSON_AddNumberToObject(root, "third", 1.0 / 3);
    cJSON_AddNumberToObject(root, "not", NAN);
    cJSON_AddStringToObject(root, awkward_text, awkward_text);
    cJSON_AddItemToArray(cJSON_AddArrayToObject(root, "list"), cJSON_CreateNumber(0.1));
    TEST_ASSERT_EQUAL_INT(0, json_write(path, root, &error));
    cJSON_Delete(root);
    char *text = scratch_load(path, NULL);
    root = cJSON_Parse(text);
    TEST_ASSERT_NOT_NULL_MESSAGE(root, text);
    double third = cJSON_GetNumberValue(cJSON_GetObjectItem(root, "third")), expected = 1.0 / 3;
    TEST_ASSERT_EQUAL_MEMORY(&expected, &third, sizeof third);
    TEST_ASSERT_TRUE(cJSON_IsNull(cJSON_GetObjectItem(root, "not")));
    TEST_ASSERT_EQUAL_STRING(awkward_text, cJSON_GetStringValue(cJSON_GetObjectItem(root, awkward_text)));
    cJSON_Delete(root);
    free(text);
}

int main(void)
{
    scratch_open();
    UNITY_BEGIN();
    RUN_TEST(test_model_read_takes_defaults_for_what_is_left_out);
    RUN_TEST(test_model_read_takes_every_field);
    RUN_TEST(test_model_read_takes_the_twins_of_a_linear_axis);
    RUN_TEST(test_model_read_lets_an_effect_set_the_field_that_it_is);
    RUN_TEST(test_model_read_says_line_key_value_and_expectation);
    RUN_TEST(test_model_read_refuses_effects_that_cannot_run);
    RUN_TEST(test_model_optional_parameters_of_effects_have_usual_values);
    RUN_TEST(test_model_refuses_belts_of_rigid_drives);
    RUN_TEST(test_model_write_reads_back_bit_for_bit);
    RUN_TEST(test_model_write_puts_deviations_beside_what_they_belong_to);
    RUN_TEST(test_model_write_refuses_what_could_not_be_read);
    RUN_TEST(test_json_write_keeps_bits_escapes_text_and_has_no_nan);
    int failures = UNITY_END();
    scratch_close();
    return failures;
}
