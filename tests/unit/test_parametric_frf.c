/* SPDX-License-Identifier: MIT */
#include "lab/estimate/parametric_frf.h"

#include "lab/estimate/method.h"
#include "lab/numeric/statistics.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { lines = 100, periods = 10 };

static const double sample_rate_hz = 1000.0;
static const double two_pi = 6.283185307179586476925;

static char path[] = "made.csv";
static struct run run;
static struct periodic recording;
static uint32_t bins[lines];
static double complex input[periods * lines];
static double complex output[periods * lines];

void setUp(void)
{
    run = (struct run){.path = path, .sample_rate_hz = sample_rate_hz, .period_samples = 1000};
    recording = (struct periodic){.run = &run,
                                  .input = "torque_Nm",
                                  .output = "velocity_rad_per_s",
                                  .period_samples = 1000,
                                  .bin_count = lines,
                                  .bins = bins,
                                  .total = periods,
                                  .used = periods,
                                  .input_spectra = input,
                                  .output_spectra = output};
    for (uint32_t b = 0; b < lines; b++) {
        bins[b] = 2 * b + 2;
    }
}

void tearDown(void) {}

/// Poles at 50 Hz with damping 0.1, sampled; gain 3 at 0 Hz.
static double complex plant(double f)
{
    double decay = exp(-0.1 * two_pi * 50.0 / sample_rate_hz);
    double angle = sqrt(1.0 - 0.01) * two_pi * 50.0 / sample_rate_hz;
    double a1 = -2.0 * decay * cos(angle);
    double a2 = decay * decay;
    double complex x = cexp(-I * two_pi * f / sample_rate_hz);
    return 3.0 * (1.0 + a1 + a2) / 2.0 * (x + x * x) / (1.0 + a1 * x + a2 * x * x);
}

static void fill(double noise, uint64_t seed)
{
    struct random random;
    random_seed(&random, seed);
    for (size_t m = 0; m < periods; m++) {
        for (size_t k = 0; k < lines; k++) {
            double complex clean = cexp(I * 1.3 * (double)(k * k));
            double r[4];
            for (size_t i = 0; i < 4; i++) {
                r[i] = noise * random_normal(&random);
            }
            input[m * lines + k] = clean + 0.3 * (r[0] + I * r[1]);
            output[m * lines + k] = plant((double)bins[k]) * clean + r[2] + I * r[3];
        }
    }
}

static double complex value(const struct frf *frf, size_t line)
{
    return frf->real[line] + I * frf->imag[line];
}

static void test_parametric_method_beats_the_mean_and_knows_how_sure_it_is(void)
{
    struct frf frf;
    struct error error = {0};
    double squares = 0.0;
    double gained = 0.0;
    fill(0.05, 1);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, frf_parametric_estimate(&recording, NULL, &frf, &error), error.message);
    TEST_ASSERT_EQUAL_STRING("parametric", frf.method);
    TEST_ASSERT_EQUAL_size_t(lines, frf.count);
    for (size_t k = 0; k < lines; k++) {
        TEST_ASSERT_TRUE(frf.valid[k]);
        double share = cabs(value(&frf, k) - plant((double)bins[k])) / frf.std[k];
        double mean_std = sqrt(2.0 / periods) * 0.05 * sqrt(1.0 + 0.09 * pow(cabs(plant((double)bins[k])), 2.0));
        squares += share * share / lines;
        gained += frf.std[k] / mean_std / lines;
    }
    // All lines share the same few parameters: a mean square of about five independent numbers.
    TEST_ASSERT_TRUE(squares < 5.0);
    TEST_ASSERT_TRUE(gained < 0.6);
    TEST_ASSERT_EQUAL_STRING("2 over 2 in 1/z, 1 sample late", estimate_key(&frf, "parametric_order"));
    TEST_ASSERT_NOT_NULL(strstr(estimate_key(&frf, "parametric_why"), "order 2 over 2"));
    TEST_ASSERT_NOT_NULL(strstr(estimate_key(&frf, "parametric_cost"), "expected"));
    TEST_ASSERT_TRUE(strtod(estimate_key(&frf, "parametric_poles"), NULL) > 49.0);
    frf_free(&frf);
}

static void test_parametric_method_says_that_nothing_scatters(void)
{
    struct frf frf;
    struct error error = {0};
    fill(0.0, 1);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, frf_parametric_estimate(&recording, NULL, &frf, &error), error.message);
    for (size_t k = 0; k < lines; k++) {
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.0, cabs(value(&frf, k) - plant((double)bins[k])));
    }
    TEST_ASSERT_NOT_NULL(strstr(estimate_key(&frf, "parametric_weights"), "equal"));
    frf_free(&frf);
}

/// What repeats with the period, as friction does, is no noise: the total standard deviation has to cover it.
static void test_parametric_method_covers_what_no_order_explains(void)
{
    struct frf frf;
    struct error error = {0};
    double squares = 0.0;
    fill(0.01, 1);
    for (size_t m = 0; m < periods; m++) {
        struct random random;
        random_seed(&random, 5); // the same in all periods
        for (size_t k = 0; k < lines; k++) {
            double real = random_normal(&random);
            output[m * lines + k] += 0.1 * (real + I * random_normal(&random));
        }
    }
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, frf_parametric_estimate(&recording, NULL, &frf, &error), error.message);
    for (size_t k = 0; k < lines; k++) {
        double share = cabs(value(&frf, k) - plant((double)bins[k])) / frf.std[k];
        squares += share * share / lines;
        TEST_ASSERT_TRUE(frf.std[k] > 3.0 * frf.noise_std[k]);
    }
    TEST_ASSERT_TRUE(squares < 10.0); // by noise_std it would be about a thousand
    TEST_ASSERT_NOT_NULL(strstr(estimate_key(&frf, "parametric_warning"), "times the variance"));
    frf_free(&frf);
}

/// Two periods say little of one line's noise, but lines that scatter alike say enough together.
static void test_parametric_method_takes_two_periods_of_even_noise(void)
{
    struct frf frf;
    struct error error = {0};
    double squares = 0.0;
    fill(0.05, 1);
    recording.used = 2;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, frf_parametric_estimate(&recording, NULL, &frf, &error), error.message);
    for (size_t k = 0; k < lines; k++) {
        double share = cabs(value(&frf, k) - plant((double)bins[k])) / frf.std[k];
        squares += share * share / lines;
    }
    TEST_ASSERT_TRUE(squares < 5.0);
    TEST_ASSERT_EQUAL_STRING("21", estimate_key(&frf, "parametric_pooled_lines"));
    frf_free(&frf);
}

/// Neighbours that scatter by very different amounts are not taken together, and then three periods are too few.
static void test_parametric_method_refuses_three_periods_of_uneven_noise(void)
{
    struct frf frf;
    struct error error = {0};
    struct random random;
    fill(0.001, 1);
    random_seed(&random, 4);
    for (size_t i = 0; i < periods * lines; i++) {
        double size = i % lines % 2 ? 0.1 : 0.0;
        double real = random_normal(&random);
        output[i] += size * (real + I * random_normal(&random));
    }
    recording.used = 3;
    TEST_ASSERT_EQUAL_INT(error_refused, frf_parametric_estimate(&recording, NULL, &frf, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "4 periods"), error.message);
    TEST_ASSERT_NULL(frf.real);
}

/// A response with standard deviations gives the model that its spectra give.
static void test_parametric_fits_a_response_file_and_writes_json(void)
{
    const struct parametric_structure structure = {
        .domain = parametric_continuous, .numerator_order = 0, .denominator_order = 2};
    struct frf frf;
    struct parametric_spectra spectra;
    struct parametric_model model;
    struct error error = {0};
    TEST_ASSERT_EQUAL_INT(0, frf_alloc(&frf, lines, NULL));
    for (size_t k = 0; k < lines; k++) {
        double complex s = I * (double)(k + 1) / 40.0;
        double complex response = 2.0 / (1.0 + 0.1 * s + s * s);
        frf.frequency_hz[k] = (double)(k + 1);
        frf.real[k] = creal(response);
        frf.imag[k] = cimag(response);
        frf.std[k] = 0.01;
        frf.valid[k] = k != 7;
    }
    TEST_ASSERT_EQUAL_INT(0, parametric_spectra_from_frf(&frf, "frf.csv", 0.0, false, &spectra, &error));
    TEST_ASSERT_EQUAL_size_t(lines - 1, spectra.data.count);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, parametric_fit(&spectra.data, &structure, NULL, &model, &error), error.message);
    cJSON *json = parametric_json(&model, NULL);
    const cJSON *pole = cJSON_GetArrayItem(cJSON_GetObjectItem(json, "poles"), 0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 40.0, cJSON_GetNumberValue(cJSON_GetObjectItem(pole, "frequency_hz")));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.05, cJSON_GetNumberValue(cJSON_GetObjectItem(pole, "damping")));
    TEST_ASSERT_TRUE(cJSON_GetNumberValue(cJSON_GetObjectItem(pole, "frequency_std_hz")) > 0.0);
    // In powers of s in rad/s: s^2 + 0.1 w s + w^2, and 2 w^2 above it.
    const cJSON *below = cJSON_GetObjectItem(json, "denominator");
    const cJSON *above = cJSON_GetObjectItem(json, "numerator");
    double w = two_pi * 40.0;
    TEST_ASSERT_DOUBLE_WITHIN(1e-9 * w * w, w * w, cJSON_GetNumberValue(cJSON_GetArrayItem(below, 0)));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9 * w, 0.1 * w, cJSON_GetNumberValue(cJSON_GetArrayItem(below, 1)));
    TEST_ASSERT_EQUAL_DOUBLE(1.0, cJSON_GetNumberValue(cJSON_GetArrayItem(below, 2)));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9 * w * w, 2.0 * w * w, cJSON_GetNumberValue(cJSON_GetArrayItem(above, 0)));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 2.0, cJSON_GetNumberValue(cJSON_GetObjectItem(json, "dc_gain")));
    cJSON_Delete(json);
    parametric_spectra_free(&spectra);
    frf.std[3] = FRF_UNKNOWN;
    TEST_ASSERT_EQUAL_INT(0, parametric_spectra_from_frf(&frf, "frf.csv", 0.0, false, &spectra, &error));
    TEST_ASSERT_EQUAL_INT(error_refused, parametric_fit(&spectra.data, &structure, NULL, &model, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "line 4 (4 Hz)"), error.message);
    parametric_spectra_free(&spectra);
    frf_free(&frf);
}

/// A response without spectra, such as that of a sequence, keeps its keys and gets the model's lines; noise_std is what
/// the noise alone does to it.
static void test_parametric_fits_what_several_runs_give_together(void)
{
    struct frf measured;
    struct frf frf;
    struct random random;
    static struct parametric_outcome outcome;
    const struct estimate_options options = {.order = estimate_order_auto, .parametric = &outcome};
    struct error error = {0};
    TEST_ASSERT_EQUAL_INT(0, frf_alloc(&measured, lines, NULL));
    random_seed(&random, 6);
    for (size_t k = 0; k < lines; k++) {
        double real = random_normal(&random);
        double complex response = plant((double)bins[k]) + 0.02 * sqrt(0.5) * (real + I * random_normal(&random));
        measured.frequency_hz[k] = (double)bins[k];
        measured.real[k] = creal(response);
        measured.imag[k] = cimag(response);
        measured.std[k] = 0.02;
        measured.noise_std[k] = 0.01;
        measured.valid[k] = k != 7;
    }
    measured.degrees_of_freedom = 8.0;
    TEST_ASSERT_TRUE(frf_set_text(&measured.input, "torque_Nm") && frf_set_text(&measured.output, "position_rad") &&
                     frf_set_text(&measured.units, "rad/Nm") && frf_set_text(&measured.method, "mean"));
    TEST_ASSERT_EQUAL_INT(error_refused, frf_parametric_fit(&measured, "seq.json", &options, &frf, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "sample rate"), error.message);
    TEST_ASSERT_TRUE(estimate_set_key(&measured, "sample_rate_hz", "%g", sample_rate_hz) &&
                     estimate_set_key(&measured, "segments", "3"));
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, frf_parametric_fit(&measured, "seq.json", &options, &frf, &error), error.message);
    TEST_ASSERT_EQUAL_STRING("parametric", frf.method);
    TEST_ASSERT_EQUAL_STRING("3", estimate_key(&frf, "segments"));
    TEST_ASSERT_TRUE(outcome.made);
    TEST_ASSERT_EQUAL_size_t(2, outcome.model.structure.denominator_order);
    for (size_t k = 0; k < lines; k++) {
        TEST_ASSERT_TRUE(frf.valid[k]);
        TEST_ASSERT_DOUBLE_WITHIN(5.0 * frf.std[k], 0.0, cabs(value(&frf, k) - plant((double)bins[k])));
        TEST_ASSERT_DOUBLE_WITHIN(1e-3 * frf.std[k], 0.5 * frf.std[k], frf.noise_std[k]);
    }
    frf_free(&measured);
    frf_free(&frf);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_parametric_method_beats_the_mean_and_knows_how_sure_it_is);
    RUN_TEST(test_parametric_method_says_that_nothing_scatters);
    RUN_TEST(test_parametric_method_covers_what_no_order_explains);
    RUN_TEST(test_parametric_method_takes_two_periods_of_even_noise);
    RUN_TEST(test_parametric_method_refuses_three_periods_of_uneven_noise);
    RUN_TEST(test_parametric_fits_what_several_runs_give_together);
    RUN_TEST(test_parametric_fits_a_response_file_and_writes_json);
    return UNITY_END();
}
