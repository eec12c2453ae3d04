/* SPDX-License-Identifier: MIT */
/// The distortion section: when it is there, and that nothing in it is not a number.
#include "lab/estimate/report_distortion.h"

#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { lines = 6 };

static struct frf frf;
static char *text;

void setUp(void)
{
    struct error error;
    TEST_ASSERT_EQUAL(0, frf_alloc(&frf, lines, &error));
    for (size_t k = 0; k < lines; k++) {
        frf.frequency_hz[k] = 1.0 + (double)k;
        frf.real[k] = 2.0;
        frf.std[k] = frf.noise_std[k] = 0.01;
        frf.valid[k] = k != 2;
    }
}

void tearDown(void)
{
    frf_free(&frf);
    free(text);
    text = NULL;
}

static void write_section(const double *thd_db)
{
    size_t size = 0;
    struct page page;
    FILE *stream = open_memstream(&text, &size);
    TEST_ASSERT_NOT_NULL(stream);
    page_start(&page, stream, "test", NULL);
    frf_report_distortion_section(&page, &frf, thd_db);
    TEST_ASSERT_EQUAL(0, page_end(&page, NULL));
    fclose(stream);
    const char *body = strstr(text, "<main>");
    TEST_ASSERT_NOT_NULL(body);
    TEST_ASSERT_NULL(strstr(body, "nan"));
    TEST_ASSERT_NULL(strstr(body, "inf"));
}

static bool says(const char *part)
{
    return strstr(text, part) != NULL;
}

static void test_report_distortion_is_not_there_without_levels(void)
{
    write_section(NULL);
    TEST_ASSERT_FALSE(says("Nonlinear distortion"));
}

static void test_report_distortion_shows_levels_and_gaps(void)
{
    frf.odd_distortion[1] = 0.1;
    frf.even_distortion[3] = 0.0;
    write_section(NULL);
    TEST_ASSERT_TRUE(says("Nonlinear distortion") && says("5 % of a linear drive"));
    TEST_ASSERT_FALSE(says("std, total") || says("harmonic"));
}

static void test_report_distortion_shows_the_total_of_realisations(void)
{
    frf.odd_distortion[1] = 0.1;
    frf.std[4] = 0.05;
    write_section(NULL);
    TEST_ASSERT_TRUE(says("std, total"));
}

static void test_report_distortion_counts_sines_with_harmonics(void)
{
    const double thd_db[lines] = {-20.0, NAN, -30.0, -40.0, NAN, -50.0};
    write_section(thd_db);
    TEST_ASSERT_TRUE(says("total harmonic distortion in dB") && says("3 of 5 sines have harmonics above the noise"));
    TEST_ASSERT_FALSE(says("Distortion of odd"));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_report_distortion_is_not_there_without_levels);
    RUN_TEST(test_report_distortion_shows_levels_and_gaps);
    RUN_TEST(test_report_distortion_shows_the_total_of_realisations);
    RUN_TEST(test_report_distortion_counts_sines_with_harmonics);
    return UNITY_END();
}
