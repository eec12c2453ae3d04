/* SPDX-License-Identifier: MIT */
/// The frequency-response section: what it counts, what it leaves out, and that nothing in it is not a number.
#include "lab/estimate/report.h"
#include "lab/page/page.h"

#include "unity.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { lines = 8 };

static struct frf frf;
static char *text;

void setUp(void)
{
    struct error error;
    TEST_ASSERT_EQUAL(0, frf_alloc(&frf, lines, &error));
    TEST_ASSERT_TRUE(frf_set_text(&frf.input, "torque_Nm") && frf_set_text(&frf.output, "velocity_rad_per_s") &&
                     frf_set_text(&frf.units, "rad_per_s/Nm") && frf_set_text(&frf.method, "mean"));
    frf.periods = 10;
    frf.degrees_of_freedom = 18;
    for (size_t k = 0; k < lines; k++) {
        frf.frequency_hz[k] = 1.0 + (double)k;
        frf.real[k] = 0.0;
        frf.imag[k] = -1.0 / frf.frequency_hz[k];
        frf.std[k] = frf.noise_std[k] = 0.01;
        frf.valid[k] = true;
    }
}

void tearDown(void)
{
    frf_free(&frf);
    free(text);
    text = NULL;
}

static void write_section(const struct frf_report_options *options)
{
    size_t size = 0;
    struct page page;
    FILE *stream = open_memstream(&text, &size);
    TEST_ASSERT_NOT_NULL(stream);
    page_start(&page, stream, "test", NULL);
    frf_report_section(&page, &frf, options);
    TEST_ASSERT_EQUAL(0, page_end(&page, NULL));
    fclose(stream);
    const char *body = strstr(text, "<main>");
    TEST_ASSERT_NOT_NULL(body);
    TEST_ASSERT_NULL(strstr(body, "nan"));
    TEST_ASSERT_NULL(strstr(body, "inf"));
}

static void says(const char *part)
{
    TEST_ASSERT_TRUE_MESSAGE(strstr(text, part) != NULL, part);
}

static void test_frf_report_counts_valid_lines(void)
{
    frf.valid[3] = false;
    write_section(NULL);
    says("7 of 8 lines valid");
    says("magnitude in dB of 1 (rad/s)/Nm");
    TEST_ASSERT_NULL(strstr(text, "error of the model"));
    TEST_ASSERT_NULL(strstr(text, "known delay"));
}

static void test_frf_report_counts_lines_beyond_two_std(void)
{
    // A model at every other line; at 1 Hz it is off by 1.9 std, at 3 Hz by 2.1 std, elsewhere exact.
    double frequency[] = {1.0, 3.0, 5.0, 7.0, 9.5};
    double real[] = {0.019, 0.021, 0.0, 0.0, 0.0};
    double imag[] = {-1.0, -1.0 / 3.0, -1.0 / 5.0, -1.0 / 7.0, 0.0};
    const struct frf_model_curve curve = {"nominal model", 5, frequency, real, imag};
    const struct frf_report_options options = {.known_delay_s = 0.0005, .curve_count = 1, .curves = &curve};
    write_section(&options);
    says("off by more than 2 std at 1 of 4 lines");
    says("known delay of 0.5 ms");
    says("error of the model over 2 std");
}

static void test_frf_report_skips_invalid_lines_in_the_count(void)
{
    const struct frf_model_curve curve = {"shifted", lines, frf.frequency_hz, frf.imag, frf.imag};
    const struct frf_report_options options = {.curve_count = 1, .curves = &curve};
    frf.valid[0] = frf.valid[7] = false;
    write_section(&options);
    says("off by more than 2 std at 6 of 6 lines");
}

static void test_frf_report_shows_noise_apart_only_where_it_differs(void)
{
    write_section(NULL);
    TEST_ASSERT_NULL(strstr(text, "noise alone"));
    free(text);
    frf.std[2] = 0.05;
    write_section(NULL);
    says("noise alone");
}

static void test_frf_report_takes_unknown_and_zero_numbers(void)
{
    frf.std[0] = frf.noise_std[0] = FRF_UNKNOWN;
    frf.std[1] = frf.noise_std[1] = 0.0;
    frf.imag[2] = 0.0; // no magnitude: no place on a scale in dB
    write_section(NULL);
    says("8 of 8 lines valid");
}

static void test_frf_report_takes_no_valid_line(void)
{
    for (size_t k = 0; k < lines; k++) {
        frf.valid[k] = false;
    }
    write_section(NULL);
    says("0 of 8 lines valid");
    says("no data");
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_frf_report_counts_valid_lines);
    RUN_TEST(test_frf_report_counts_lines_beyond_two_std);
    RUN_TEST(test_frf_report_skips_invalid_lines_in_the_count);
    RUN_TEST(test_frf_report_shows_noise_apart_only_where_it_differs);
    RUN_TEST(test_frf_report_takes_unknown_and_zero_numbers);
    RUN_TEST(test_frf_report_takes_no_valid_line);
    return UNITY_END();
}
