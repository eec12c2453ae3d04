/* SPDX-License-Identifier: MIT */
/// Every non-parametric method against numpy: frf_reference.py made the recordings and the responses, from a seed that
/// frf_reference.csv names.
#include "lab/estimate/method.h"
#include "lab/record/run.h"

#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { reference_lines_max = 600, name_size = 32 };

/// Asked for; what is left is rounding of two different orders of summation.
static const double relative_tolerance = 1e-9;

struct reference_line {
    char method[name_size];
    double frequency_hz;
    double real;
    double imag;
    double std;
};

static struct reference_line reference[reference_lines_max];
static size_t reference_count;

void tearDown(void) {}

static const char *source_path(const char *name)
{
    static char path[1024];
    const char *source = getenv("SERVOSCOPE_SOURCE");
    TEST_ASSERT_NOT_NULL_MESSAGE(source, "SERVOSCOPE_SOURCE, the source tree, is not set");
    snprintf(path, sizeof path, "%s/tests/golden/%s", source, name);
    return path;
}

static void read_reference(void)
{
    char line[256];
    FILE *stream = fopen(source_path("frf_reference.csv"), "r");
    TEST_ASSERT_NOT_NULL(stream);
    reference_count = 0;
    while (fgets(line, sizeof line, stream)) {
        struct reference_line *one = &reference[reference_count];
        TEST_ASSERT_LESS_THAN_size_t(reference_lines_max, reference_count);
        reference_count += sscanf(line, "%31[a-z0-9_],%lf,%lf,%lf,%lf", one->method, &one->frequency_hz, &one->real,
                                  &one->imag, &one->std) == 5;
    }
    fclose(stream);
}

void setUp(void)
{
    read_reference();
}

static void compare(const char *name, const struct frf *frf)
{
    double worst = 0.0;
    double worst_std = 0.0;
    size_t line = 0;
    for (size_t i = 0; i < reference_count; i++) {
        const struct reference_line *one = &reference[i];
        if (strcmp(one->method, name) != 0) {
            continue;
        }
        TEST_ASSERT_LESS_THAN_size_t(frf->count, line);
        TEST_ASSERT_TRUE(frf->valid[line]);
        TEST_ASSERT_DOUBLE_WITHIN(relative_tolerance * one->frequency_hz, one->frequency_hz, frf->frequency_hz[line]);
        double error = hypot(frf->real[line] - one->real, frf->imag[line] - one->imag);
        worst = fmax(worst, error / hypot(one->real, one->imag));
        /* The noise: std may hold what segments do not resolve, too. */
        worst_std = fmax(worst_std, fabs(frf->noise_std[line] / one->std - 1.0));
        line++;
    }
    TEST_ASSERT_EQUAL_size_t(frf->count, line);
    TEST_ASSERT_GREATER_THAN_size_t(0, line);
    printf("%-14s %zu lines, largest relative difference to numpy: response %.2g, std %.2g\n", name, line, worst,
           worst_std);
    TEST_ASSERT_TRUE(worst <= relative_tolerance);
    TEST_ASSERT_TRUE(worst_std <= relative_tolerance);
}

static void check_periods(const char *method_name, const char *name, int order, size_t settle)
{
    const struct periodic_options options = {.settle = periodic_settle_given, .settle_periods = settle};
    const struct estimate_options tuning = {.order = order};
    struct run run;
    struct periodic recording;
    struct frf frf;
    struct error error = {0};
    const struct estimate_method *method = estimate_method_find(method_name, &error);
    TEST_ASSERT_NOT_NULL_MESSAGE(method, error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(
        0, run_read(source_path("frf_reference_periodic.csv"), &(struct run_options){0}, &run, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, periodic_cut(&run, &options, &recording, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, method->estimate(&recording, &tuning, &frf, &error), error.message);
    compare(name, &frf);
    frf_free(&frf);
    periodic_free(&recording);
    run_free(&run);
}

static void check_arbitrary(const char *method_name, const char *name)
{
    const struct estimate_options tuning = {.order = estimate_order_auto,
                                            .segment_samples = strcmp(method_name, "lpm") == 0 ? 0 : 100};
    struct run run;
    struct arbitrary recording;
    struct frf frf;
    struct error error = {0};
    const struct estimate_method *method = estimate_method_find(method_name, &error);
    TEST_ASSERT_NOT_NULL_MESSAGE(method, error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(
        0, run_read(source_path("frf_reference_arbitrary.csv"), &(struct run_options){0}, &run, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, arbitrary_cut(&run, &(struct arbitrary_options){0}, &recording, &error),
                                  error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, method->estimate_arbitrary(&recording, &tuning, &frf, &error), error.message);
    compare(name, &frf);
    frf_free(&frf);
    run_free(&run);
}

static void test_mean_and_hann_agree_with_numpy(void)
{
    check_periods("mean", "mean", estimate_order_auto, 2);
    check_periods("hann", "hann", estimate_order_auto, 2);
}

static void test_lpm_agrees_with_numpy(void)
{
    check_periods("lpm", "lpm2", 2, 0);
    check_periods("lpm", "lpm4", 4, 0);
}

static void test_methods_for_arbitrary_signals_agree_with_numpy(void)
{
    check_arbitrary("h1", "h1");
    check_arbitrary("indirect", "indirect");
    check_arbitrary("lpm", "lpm_arbitrary");
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_mean_and_hann_agree_with_numpy);
    RUN_TEST(test_lpm_agrees_with_numpy);
    RUN_TEST(test_methods_for_arbitrary_signals_agree_with_numpy);
    return UNITY_END();
}
