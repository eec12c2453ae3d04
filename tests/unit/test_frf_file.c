/* SPDX-License-Identifier: MIT */
#include "lab/record/frf_file.h"
#include "tests/support/scratch.h"
#include "unity.h"

#include <math.h>

static struct frf frf;
static struct error error;

void setUp(void)
{
    scratch_empty();
    error = (struct error){0};
}

void tearDown(void)
{
    frf_free(&frf);
}

static void read_text(const char *text)
{
    frf_free(&frf);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, frf_read(scratch_text("frf.csv", text), &frf, &error), error.message);
}

static void refuse(const char *text, const char *message)
{
    frf_free(&frf);
    TEST_ASSERT_EQUAL_INT(error_refused, frf_read(scratch_text("frf.csv", text), &frf, &error));
    const char *name = strstr(error.message, "frf.csv");
    TEST_ASSERT_EQUAL_STRING(message, name ? name : error.message);
    TEST_ASSERT_NULL(frf.frequency_hz);
    TEST_ASSERT_EQUAL_UINT(0, frf.count);
}

static void test_frf_alloc_knows_nothing(void)
{
    TEST_ASSERT_EQUAL_INT(0, frf_alloc(&frf, 3, &error));
    for (size_t k = 0; k < 3; k++) {
        TEST_ASSERT_FALSE(frf_known(frf.std[k]) || frf_known(frf.noise_std[k]));
        TEST_ASSERT_FALSE(frf_known(frf.odd_distortion[k]) || frf_known(frf.even_distortion[k]));
        TEST_ASSERT_FALSE(frf.valid[k]);
    }
    TEST_ASSERT_EQUAL_STRING("", frf.method);
    TEST_ASSERT_TRUE(frf_known(0));
    TEST_ASSERT_FALSE(frf_known(NAN));
}

static void test_frf_write_reads_back_bit_for_bit(void)
{
    struct frf out;
    const char *path = scratch_path("frf.csv");
    TEST_ASSERT_EQUAL_INT(0, frf_alloc(&out, 4, &error));
    for (size_t k = 0; k < 4; k++) {
        out.frequency_hz[k] = 0.5 * (double)(k + 1) / 3;
        out.real[k] = -1.0 / (double)(k + 3);
        out.imag[k] = k % 2 ? -0.0 : 1e-300;
        out.std[k] = 0.1 * (double)k;
        out.valid[k] = k != 2;
    }
    out.noise_std[1] = 0;
    out.even_distortion[3] = 1e-9 / 7;
    out.periods = 10;
    out.degrees_of_freedom = 8.5;
    TEST_ASSERT_TRUE(frf_set_text(&out.input, "torque_Nm") && frf_set_text(&out.output, "velocity_rad_per_s"));
    TEST_ASSERT_TRUE(frf_set_text(&out.units, "rad_per_s/Nm") && frf_set_text(&out.method, "mean"));
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, frf_write(path, &out, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, frf_read(path, &frf, &error), error.message);
    TEST_ASSERT_EQUAL_UINT(4, frf.count);
    TEST_ASSERT_EQUAL_MEMORY(out.frequency_hz, frf.frequency_hz, 4 * sizeof(double));
    TEST_ASSERT_EQUAL_MEMORY(out.real, frf.real, 4 * sizeof(double));
    TEST_ASSERT_EQUAL_MEMORY(out.imag, frf.imag, 4 * sizeof(double));
    TEST_ASSERT_EQUAL_MEMORY(out.std, frf.std, 4 * sizeof(double));
    TEST_ASSERT_EQUAL_MEMORY(out.noise_std, frf.noise_std, 4 * sizeof(double));
    TEST_ASSERT_EQUAL_MEMORY(out.odd_distortion, frf.odd_distortion, 4 * sizeof(double));
    TEST_ASSERT_EQUAL_MEMORY(out.even_distortion, frf.even_distortion, 4 * sizeof(double));
    TEST_ASSERT_EQUAL_MEMORY(out.valid, frf.valid, 4 * sizeof(bool));
    TEST_ASSERT_EQUAL_UINT(10, frf.periods);
    TEST_ASSERT_EQUAL_DOUBLE(8.5, frf.degrees_of_freedom);
    TEST_ASSERT_EQUAL_STRING("torque_Nm", frf.input);
    TEST_ASSERT_EQUAL_STRING("velocity_rad_per_s", frf.output);
    TEST_ASSERT_EQUAL_STRING("rad_per_s/Nm", frf.units);
    TEST_ASSERT_EQUAL_STRING("mean", frf.method);
    frf_free(&out);
}

static void test_frf_read_takes_empty_cells_and_missing_columns_for_unknown(void)
{
    read_text("# method: h1\n# remark: by hand\nreal,imag,frequency_hz,std,colour\n1,2,3,,red\n4,5,6,0,blue\n");
    TEST_ASSERT_FALSE(frf_known(frf.std[0]));
    TEST_ASSERT_TRUE(frf_known(frf.std[1]));
    TEST_ASSERT_FALSE(frf_known(frf.odd_distortion[1]));
    TEST_ASSERT_TRUE(frf.valid[0] && frf.valid[1]);
    TEST_ASSERT_EQUAL_UINT(1, frf.key_count);
    TEST_ASSERT_EQUAL_STRING("by hand", frf.keys[0].value);
}

static void test_frf_read_names_line_column_and_value_of_what_is_wrong(void)
{
    refuse("real,imag\n1,2\n", "frf.csv:1: there is no column frequency_hz: a frequency response file was expected");
    refuse("frequency_hz,real,imag,std\n1,2,3,nan\n", "frf.csv:2: std: 'nan' is not a number");
    refuse("frequency_hz,real,imag\n1,,3\n", "frf.csv:2: real: '' is empty, a number was expected");
    refuse("frequency_hz,real,imag,std\n1,2,3,-1\n",
           "frf.csv:2: std: -1: a magnitude was expected: 0 or more, or an empty cell");
    refuse("frequency_hz,real,imag,even_distortion\n1,2,3,-2\n",
           "frf.csv:2: even_distortion: -2: a magnitude was expected: 0 or more, or an empty cell");
    refuse("frequency_hz,real,imag\n2,2,3\n2,2,3\n",
           "frf.csv:3: frequency_hz: 2: frequencies from 0 on, in ascending order, were expected");
    refuse("frequency_hz,real,imag,valid\n2,2,3,0.5\n", "frf.csv:2: valid: 0.5: 0 or 1 was expected");
    refuse("frequency_hz,real,imag,real\n2,2,3,4\n", "frf.csv:1: there are two columns real");
    refuse("# periods: 1.5\nfrequency_hz,real,imag\n2,2,3\n",
           "frf.csv:1: periods: '1.5': a whole number from 0 on was expected");
    refuse("# degrees_of_freedom: -1\nfrequency_hz,real,imag\n2,2,3\n",
           "frf.csv:1: degrees_of_freedom: '-1': a number from 0 on was expected");
    refuse("# method: a\n# method: b\nfrequency_hz,real,imag\n2,2,3\n",
           "frf.csv:2: method: is there twice, first in line 1");
}

static void test_frf_write_refuses_numbers_that_are_not_finite_or_ordered(void)
{
    const char *path = scratch_path("frf.csv");
    TEST_ASSERT_EQUAL_INT(0, frf_alloc(&frf, 2, &error));
    frf.frequency_hz[1] = 1;
    frf.std[1] = NAN;
    TEST_ASSERT_EQUAL_INT(error_refused, frf_write(path, &frf, &error));
    frf.std[1] = FRF_UNKNOWN;
    frf.imag[0] = INFINITY;
    TEST_ASSERT_EQUAL_INT(error_refused, frf_write(path, &frf, &error));
    frf.imag[0] = 0;
    frf.frequency_hz[1] = 0;
    TEST_ASSERT_EQUAL_INT(error_refused, frf_write(path, &frf, &error));
    TEST_ASSERT_EQUAL_INT(0, scratch_count());
    frf.frequency_hz[1] = 1;
    TEST_ASSERT_EQUAL_INT(0, frf_write(path, &frf, &error));
}

int main(void)
{
    scratch_open();
    UNITY_BEGIN();
    RUN_TEST(test_frf_alloc_knows_nothing);
    RUN_TEST(test_frf_write_reads_back_bit_for_bit);
    RUN_TEST(test_frf_read_takes_empty_cells_and_missing_columns_for_unknown);
    RUN_TEST(test_frf_read_names_line_column_and_value_of_what_is_wrong);
    RUN_TEST(test_frf_write_refuses_numbers_that_are_not_finite_or_ordered);
    int failures = UNITY_END();
    scratch_close();
    return failures;
}
