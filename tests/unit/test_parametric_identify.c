/* SPDX-License-Identifier: MIT */
#include "lab/estimate/parametric_identify.h"

#include "lab/estimate/parametric_frf.h"
#include "lab/estimate/parametric_text.h"
#include "lab/numeric/statistics.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { lines = 100 };

static const double two_pi = 6.283185307179586476925;
static const double sample_rate_hz = 1000.0;

static double frequency_hz[lines];
static double variance[lines], noise_share[lines];
static double complex output[lines];
static struct parametric_data data;
static struct parametric_weights weights;
static struct parametric_outcome outcome;

void setUp(void)
{
    for (size_t k = 0; k < lines; k++) {
        frequency_hz[k] = 4.0 * (double)(k + 1); // to 0.4 of the rate
        variance[k] = 1e-6;
        noise_share[k] = 1.0;
    }
    data = (struct parametric_data){.name = "made",
                                    .count = lines,
                                    .frequency_hz = frequency_hz,
                                    .output = output,
                                    .output_variance = variance,
                                    .sample_rate_hz = sample_rate_hz};
    weights = (struct parametric_weights){.output_variance = variance, .noise_share = noise_share};
}

void tearDown(void) {}

static const double damping = 0.1, resonance_hz = 120.0;

/// A resonance, its input held or band-limited.
static double complex respond(double f, bool held)
{
    double w = two_pi * resonance_hz;
    double complex s = I * two_pi * f;
    double complex pole = w * (-damping + I * sqrt(1.0 - damping * damping));
    double complex z = cexp(s / sample_rate_hz);
    double complex residue = w * w / (pole - conj(pole));
    if (!held) {
        return residue / (s - pole) - residue / (s - conj(pole));
    }
    double complex sum = 0.0;
    for (int i = 0; i < 2; i++) {
        double complex all = cexp(pole / sample_rate_hz);
        sum += (i ? -1.0 : 1.0) * residue / pole * (all - 1.0) / (z - all);
        pole = conj(pole);
    }
    return sum;
}

static void make(bool held, double noise_std, uint64_t seed)
{
    struct random random;
    random_seed(&random, seed);
    for (size_t k = 0; k < lines; k++) {
        double real = random_normal(&random);
        output[k] = respond(frequency_hz[k], held) + noise_std * sqrt(0.5) * (real + I * random_normal(&random));
    }
}

static void identify(enum parametric_domain domain)
{
    const struct parametric_request request = {.domain = domain};
    struct error error = {0};
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, parametric_identify(&data, &weights, &request, &outcome, &error), error.message);
    TEST_ASSERT_TRUE(outcome.made);
}

static void test_parametric_identify_finds_the_drive_behind_the_hold(void)
{
    make(true, 1e-3, 1);
    identify(parametric_discrete);
    TEST_ASSERT_EQUAL_size_t(2, outcome.model.structure.denominator_order);
    TEST_ASSERT_EQUAL_STRING("", outcome.hint);
    TEST_ASSERT_EQUAL_DOUBLE(1.0, outcome.misfit);
    TEST_ASSERT_TRUE(outcome.has_plant);
    const struct parametric_root *pole = &outcome.plant.poles[0];
    TEST_ASSERT_DOUBLE_WITHIN(5.0 * pole->frequency_std_hz, resonance_hz, pole->frequency_hz);
    TEST_ASSERT_DOUBLE_WITHIN(5.0 * pole->damping_std, damping, pole->damping);
}

/// A model in s of held input needs poles that are not there: it says so.
static void test_parametric_identify_notices_held_input(void)
{
    make(true, 1e-3, 1);
    identify(parametric_continuous);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(outcome.hint, "held"), outcome.hint);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(outcome.hint, "1/z with 2 poles"), outcome.hint);
}

static void test_parametric_identify_of_band_limited_input_in_s_is_content(void)
{
    make(false, 1e-3, 1);
    identify(parametric_continuous);
    TEST_ASSERT_EQUAL_STRING("", outcome.hint);
    TEST_ASSERT_EQUAL_size_t(2, outcome.model.structure.denominator_order);
    TEST_ASSERT_FALSE(outcome.has_plant);
}

/// What repeats with the period scatters less than it is wrong: the poles' deviations allow for it, and noise's own
/// part in them is what it is without.
static void test_parametric_identify_allows_for_what_no_order_explains(void)
{
    make(true, 1e-3, 1);
    identify(parametric_discrete);
    double alone = outcome.model.poles[0].frequency_std_hz;
    setUp();
    make(true, 20e-3, 2);
    identify(parametric_discrete);
    TEST_ASSERT_DOUBLE_WITHIN(150.0, 400.0, outcome.misfit);
    TEST_ASSERT_EQUAL_size_t(2, outcome.model.structure.denominator_order);
    TEST_ASSERT_DOUBLE_WITHIN(8.0 * alone, 20.0 * alone, outcome.model.poles[0].frequency_std_hz);
    TEST_ASSERT_DOUBLE_WITHIN(0.3 * alone, alone, outcome.noise.poles[0].frequency_std_hz);
    TEST_ASSERT_DOUBLE_WITHIN(5.0 * outcome.model.poles[0].frequency_std_hz, resonance_hz,
                              outcome.model.poles[0].frequency_hz);
}

/// Poles and zeros that noise alone puts beside each other are marked; those of the drive are not.
static void test_parametric_marks_a_pole_on_a_zero(void)
{
    const struct parametric_structure higher = {
        .domain = parametric_discrete, .numerator_order = 3, .denominator_order = 4, .delay_s = 1.0 / sample_rate_hz};
    struct parametric_model model;
    size_t marked = 0;
    for (uint64_t seed = 1; seed <= 20; seed++) {
        make(true, 1e-3, seed);
        TEST_ASSERT_EQUAL_INT(0, parametric_fit(&data, &higher, NULL, &model, NULL));
        marked += parametric_mark_cancelling(&model);
        for (size_t i = 0; i < model.pole_count; i++) {
            bool own = fabs(model.poles[i].frequency_hz - resonance_hz) < 2.0 && model.poles[i].damping > 0.08;
            TEST_ASSERT_FALSE(own && model.poles[i].cancels);
        }
    }
    // The others found two poles and zeros apart, far above the lines.
    TEST_ASSERT_TRUE(marked >= 8);
}

static void test_parametric_text_says_what_was_found(void)
{
    char text[parametric_text_size];
    make(true, 1e-3, 1);
    identify(parametric_discrete);
    parametric_text_order(&outcome.model, text);
    TEST_ASSERT_EQUAL_STRING("2 over 2 in 1/z, 1 sample late", text);
    parametric_text_roots(&outcome.model, true, 0.0, text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, " Hz, damping 0."), text);
    parametric_text_delay_and_gain(parametric_shown(&outcome), text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "gain at 0 Hz "), text);
    parametric_text_cost(&outcome, text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "expected"), text);
    TEST_ASSERT_NULL_MESSAGE(strstr(text, "times the noise"), text);
    outcome.model.poles[0] = (struct parametric_root){.s_rad_per_s = -700.0 + I * two_pi * 500.0, .cancels = true};
    parametric_text_roots(&outcome.model, true, 0.0, text);
    TEST_ASSERT_EQUAL_STRING("z = -0.497 (cancelled by a zero)", text);
    outcome.model.poles[0] = (struct parametric_root){.s_rad_per_s = 7.0, .frequency_hz = 1.114, .damping = -1.0};
    parametric_text_roots(&outcome.model, true, 0.0, text);
    TEST_ASSERT_EQUAL_STRING("1.114 +- 0 Hz, real, unstable", text);
    parametric_text_roots(&outcome.model, true, 1.0, text);
    TEST_ASSERT_EQUAL_STRING("1 above 1 Hz", text);
}

static void test_parametric_page_and_json_have_the_model(void)
{
    char *bytes = NULL;
    size_t size = 0;
    FILE *stream = open_memstream(&bytes, &size);
    struct page page;
    make(true, 20e-3, 2);
    identify(parametric_discrete);
    page_start(&page, stream, "test", NULL);
    parametric_add_page(&outcome, "run.csv", &page);
    TEST_ASSERT_EQUAL_INT(0, page_end(&page, NULL));
    fclose(stream);
    TEST_ASSERT_NOT_NULL(strstr(bytes, "order 2 over 2 in 1/z"));
    TEST_ASSERT_NOT_NULL(strstr(bytes, "pole pair"));
    TEST_ASSERT_NOT_NULL(strstr(bytes, "times the noise"));
    free(bytes);
    cJSON *json = parametric_outcome_json(&outcome, false);
    TEST_ASSERT_NULL(cJSON_GetObjectItem(json, "orders"));
    TEST_ASSERT_DOUBLE_WITHIN(150.0, 400.0, cJSON_GetNumberValue(cJSON_GetObjectItem(json, "noise_misfit")));
    const cJSON *plant = cJSON_GetObjectItem(json, "continuous");
    const cJSON *pole = cJSON_GetArrayItem(cJSON_GetObjectItem(plant, "poles"), 0);
    TEST_ASSERT_DOUBLE_WITHIN(2.0, resonance_hz, cJSON_GetNumberValue(cJSON_GetObjectItem(pole, "frequency_hz")));
    TEST_ASSERT_TRUE(cJSON_IsFalse(cJSON_GetObjectItem(pole, "cancels")));
    cJSON_Delete(json);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_parametric_identify_finds_the_drive_behind_the_hold);
    RUN_TEST(test_parametric_identify_notices_held_input);
    RUN_TEST(test_parametric_identify_of_band_limited_input_in_s_is_content);
    RUN_TEST(test_parametric_identify_allows_for_what_no_order_explains);
    RUN_TEST(test_parametric_marks_a_pole_on_a_zero);
    RUN_TEST(test_parametric_text_says_what_was_found);
    RUN_TEST(test_parametric_page_and_json_have_the_model);
    return UNITY_END();
}
