/* SPDX-License-Identifier: MIT */
/// The diagnosis as JSON: every member that a reader counts on, names of both kinds of axis, no NaN.
#include "lab/diagnose/diagnosis.h"
#include "lab/record/json_out.h"
#include "tests/support/sample_diagnosis.h"

#include "unity.h"

#include <cjson/cJSON.h>

static struct diagnosis diagnosis;
static cJSON *written;
static cJSON *root;

void setUp(void)
{
    written = NULL;
    root = NULL;
}

void tearDown(void)
{
    cJSON_Delete(written);
    cJSON_Delete(root);
    diagnosis_free(&diagnosis);
}

/// Prints the object as the program does and reads the text back, as a foreign program would.
static void print_and_read(void)
{
    char *text = NULL;
    size_t length = 0;
    written = diagnosis_json(&diagnosis);
    TEST_ASSERT_NOT_NULL(written);
    FILE *stream = open_memstream(&text, &length);
    TEST_ASSERT_NOT_NULL(stream);
    json_print(stream, written);
    fclose(stream);
    root = cJSON_Parse(text);
    free(text);
    TEST_ASSERT_NOT_NULL_MESSAGE(root, "not JSON");
}

static const cJSON *member(const cJSON *object, const char *name)
{
    const cJSON *found = cJSON_GetObjectItemCaseSensitive(object, name);
    TEST_ASSERT_NOT_NULL_MESSAGE(found, name);
    return found;
}

static double number(const cJSON *object, const char *name)
{
    TEST_ASSERT_TRUE_MESSAGE(cJSON_IsNumber(member(object, name)), name);
    return member(object, name)->valuedouble;
}

static const char *string(const cJSON *object, const char *name)
{
    TEST_ASSERT_TRUE_MESSAGE(cJSON_IsString(member(object, name)), name);
    return member(object, name)->valuestring;
}

static void test_diagnosis_json_has_verdict_causes_and_their_estimates(void)
{
    sample_diagnosis(false, &diagnosis);
    print_and_read();
    TEST_ASSERT_EQUAL_STRING("explained", string(root, "verdict"));
    TEST_ASSERT_EQUAL_INT(2, cJSON_GetArraySize(member(root, "causes")));
    const cJSON *cause = cJSON_GetArrayItem(member(root, "causes"), 0);
    TEST_ASSERT_EQUAL_STRING("cogging", string(cause, "id"));
    TEST_ASSERT_EQUAL_DOUBLE(1234.5, number(cause, "evidence"));
    TEST_ASSERT_EQUAL_STRING(diagnosis.causes[0].says, string(cause, "says"));
    const cJSON *amplitude = member(member(cause, "parameters"), "amplitude_Nm");
    TEST_ASSERT_EQUAL_DOUBLE(0.0312, number(amplitude, "value"));
    TEST_ASSERT_EQUAL_DOUBLE(0.00042, number(amplitude, "std"));
    const cJSON *periods = member(member(cause, "parameters"), "periods_per_rev");
    TEST_ASSERT_EQUAL_DOUBLE(12.0, number(periods, "value"));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, number(periods, "std"));
}

static void test_diagnosis_json_has_ties_untestable_and_figures(void)
{
    sample_diagnosis(false, &diagnosis);
    print_and_read();
    const cJSON *tie = cJSON_GetArrayItem(member(root, "ties"), 0);
    TEST_ASSERT_EQUAL_STRING("load_bias", cJSON_GetArrayItem(member(tie, "causes"), 0)->valuestring);
    TEST_ASSERT_EQUAL_STRING("asymmetric_friction", cJSON_GetArrayItem(member(tie, "causes"), 1)->valuestring);
    TEST_ASSERT_EQUAL_STRING(diagnosis.ties[0].next, string(tie, "next"));
    const cJSON *untestable = cJSON_GetArrayItem(member(root, "untestable"), 0);
    TEST_ASSERT_EQUAL_STRING("belt_elasticity", string(untestable, "id"));
    TEST_ASSERT_EQUAL_STRING(diagnosis.untestable[0].why, string(untestable, "why"));
    TEST_ASSERT_EQUAL_DOUBLE(0.2134, number(member(root, "nominal"), "validation_nrmse"));
    TEST_ASSERT_EQUAL_DOUBLE(3.4, number(member(root, "refitted"), "whitened_rms"));
    TEST_ASSERT_EQUAL_DOUBLE(10.2, number(member(root, "refitted"), "mean_rms"));
    TEST_ASSERT_EQUAL_DOUBLE(0.0502, number(member(root, "extended"), "validation_nrmse"));
    TEST_ASSERT_EQUAL_DOUBLE(0.0481, number(root, "noise_floor_nrmse"));
    TEST_ASSERT_EQUAL_INT(0, cJSON_GetArraySize(member(root, "candidates")));
}

static void test_diagnosis_json_uses_linear_names_on_a_linear_axis(void)
{
    sample_diagnosis(true, &diagnosis);
    print_and_read();
    const cJSON *parameters = member(cJSON_GetArrayItem(member(root, "causes"), 0), "parameters");
    TEST_ASSERT_EQUAL_DOUBLE(0.0312, number(member(parameters, "amplitude_N"), "value"));
    TEST_ASSERT_NULL(cJSON_GetObjectItemCaseSensitive(parameters, "amplitude_Nm"));
    parameters = member(cJSON_GetArrayItem(member(root, "causes"), 1), "parameters");
    TEST_ASSERT_EQUAL_DOUBLE(0.98, number(member(parameters, "stribeck_velocity_m_per_s"), "value"));
}

static void test_diagnosis_json_says_what_is_unexplained_only_then(void)
{
    sample_unexplained(&diagnosis);
    print_and_read();
    TEST_ASSERT_EQUAL_STRING("unexplained", string(root, "verdict"));
    TEST_ASSERT_EQUAL_STRING(diagnosis.where, string(member(root, "unexplained"), "where"));
    TEST_ASSERT_EQUAL_DOUBLE(0.31, number(member(root, "unexplained"), "share"));
    TEST_ASSERT_EQUAL_STRING("stribeck_friction", string(cJSON_GetArrayItem(member(root, "candidates"), 0), "id"));
    tearDown();
    setUp();
    sample_no_discrepancy(&diagnosis);
    print_and_read();
    TEST_ASSERT_EQUAL_STRING("no_discrepancy", string(root, "verdict"));
    TEST_ASSERT_EQUAL_INT(0, cJSON_GetArraySize(member(root, "causes")));
    TEST_ASSERT_NULL(cJSON_GetObjectItemCaseSensitive(root, "unexplained"));
}

static void test_diagnosis_json_has_null_where_there_is_no_number(void)
{
    sample_diagnosis(false, &diagnosis);
    diagnosis.causes[0].deviations[0] = NAN;
    diagnosis.causes[1].evidence = INFINITY;
    diagnosis.noise_floor_nrmse = NAN;
    diagnosis.extended.whitened_rms = -INFINITY;
    print_and_read();
    const cJSON *cause = cJSON_GetArrayItem(member(root, "causes"), 0);
    TEST_ASSERT_TRUE(cJSON_IsNull(member(member(member(cause, "parameters"), "amplitude_Nm"), "std")));
    TEST_ASSERT_TRUE(cJSON_IsNull(member(cJSON_GetArrayItem(member(root, "causes"), 1), "evidence")));
    TEST_ASSERT_TRUE(cJSON_IsNull(member(root, "noise_floor_nrmse")));
    TEST_ASSERT_TRUE(cJSON_IsNull(member(member(root, "extended"), "whitened_rms")));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_diagnosis_json_has_verdict_causes_and_their_estimates);
    RUN_TEST(test_diagnosis_json_has_ties_untestable_and_figures);
    RUN_TEST(test_diagnosis_json_uses_linear_names_on_a_linear_axis);
    RUN_TEST(test_diagnosis_json_says_what_is_unexplained_only_then);
    RUN_TEST(test_diagnosis_json_has_null_where_there_is_no_number);
    return UNITY_END();
}
