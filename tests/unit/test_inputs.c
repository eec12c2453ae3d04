/* SPDX-License-Identifier: MIT */
#include "lab/estimate/inputs.h"

#include "lab/estimate/frf_mean.h"
#include "lab/numeric/cmplx.h"
#include "lab/numeric/statistics.h"

#include "unity.h"

#include <complex.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;

enum { length = 600, periods = 4, settling = 20, lines = 60 };

/// Required of a linear plant with two inputs and two outputs in steady state.
static const double required_db = 1e-6;

static struct run run;
static struct inputs inputs;
static struct error error;
static char path[] = "made.csv";

void setUp(void)
{
    run = (struct run){.path = path, .sample_rate_hz = 1000.0, .rows = periods * length, .period_samples = length};
    inputs = (struct inputs){0};
}

void tearDown(void)
{
    inputs_free(&inputs);
    for (size_t k = 0; k < run.key_count; k++) {
        free(run.keys[k].key);
        free(run.keys[k].value);
    }
    free(run.keys);
    run.keys = NULL;
    run.key_count = 0;
    free(run.bins);
    run.bins = NULL;
    run.path = NULL;
    run_free(&run);
}

/// x+ = A x + B u, y = x: coupled both ways.
static const double A[2][2] = {{0.9, 0.05}, {-0.08, 0.85}};
static const double B[2][2] = {{0.1, 0.02}, {0.3, 0.7}};

static double complex truth(size_t output, size_t input, uint32_t bin)
{
    const double complex z = cexp(I * two_pi * bin / length);
    const double complex determinant = (z - A[0][0]) * (z - A[1][1]) - A[0][1] * A[1][0];
    return output == 0 ? ((z - A[1][1]) * B[0][input] + A[0][1] * B[1][input]) / determinant
                       : (A[1][0] * B[0][input] + (z - A[0][0]) * B[1][input]) / determinant;
}

/// Input p on bins 1 + p, 3 + p, ..: interleaved.
static double input_at(size_t p, size_t n)
{
    double sum = 0.0;
    for (size_t b = 0; b < lines; b++) {
        const size_t bin = 1 + p + 2 * b;
        sum += (0.2 + 0.8 * (double)b / lines) * cos(two_pi * (double)(bin * n % length) / length + (double)(b * b));
    }
    return sum;
}

/// Columns in an order that is not that of their numbers.
static void play(double noise, double feedback)
{
    struct random random;
    double x[2] = {0.0, 0.0};
    random_seed(&random, 71);
    TEST_ASSERT_NOT_NULL(run_add_column(&run, "velocity_2_rad_per_s"));
    TEST_ASSERT_NOT_NULL(run_add_column(&run, "torque_2_Nm"));
    TEST_ASSERT_NOT_NULL(run_add_column(&run, "torque_1_Nm"));
    TEST_ASSERT_NOT_NULL(run_add_column(&run, "velocity_1_rad_per_s"));
    for (size_t n = 0; n < settling * length + run.rows; n++) {
        const double u[2] = {input_at(0, n) - feedback * x[0], input_at(1, n) - feedback * x[1]};
        if (n >= settling * length) {
            const size_t row = n - settling * length;
            run.columns[0].data[row] = x[1] + noise * random_normal(&random);
            run.columns[1].data[row] = u[1];
            run.columns[2].data[row] = u[0];
            run.columns[3].data[row] = x[0] + noise * random_normal(&random);
        }
        const double next = A[0][0] * x[0] + A[0][1] * x[1] + B[0][0] * u[0] + B[0][1] * u[1];
        x[1] = A[1][0] * x[0] + A[1][1] * x[1] + B[1][0] * u[0] + B[1][1] * u[1];
        x[0] = next;
    }
}

static void expect_interleaved_lines(void)
{
    TEST_ASSERT_EQUAL_size_t(2, inputs.count);
    TEST_ASSERT_EQUAL_STRING("torque_1_Nm", inputs.names[0]);
    TEST_ASSERT_EQUAL_STRING("torque_2_Nm", inputs.names[1]);
    for (size_t p = 0; p < 2; p++) {
        TEST_ASSERT_EQUAL_size_t(lines, inputs.bin_count[p]);
        for (size_t b = 0; b < lines; b++) {
            TEST_ASSERT_EQUAL_UINT32(1 + p + 2 * b, inputs.bins[p][b]);
        }
    }
}

static void test_inputs_give_the_matrix_of_a_linear_plant(void)
{
    const char *outputs[inputs_max];
    double worst_db = 0.0;
    play(0.0, 0.0);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, inputs_find(&run, &(struct inputs_known){0}, &inputs, &error), error.message);
    expect_interleaved_lines();
    TEST_ASSERT_TRUE(inputs.foreign_share < 1e-12);
    TEST_ASSERT_EQUAL_size_t(2, inputs_list_outputs(&run, outputs));
    for (size_t i = 0; i < 2; i++) {
        for (size_t j = 0; j < 2; j++) {
            struct periodic recording;
            struct frf frf;
            const struct periodic_options cut = {.input = inputs.names[j],
                                                 .output = outputs[i],
                                                 .bins = inputs.bins[j],
                                                 .bin_count = inputs.bin_count[j]};
            TEST_ASSERT_EQUAL_INT_MESSAGE(0, periodic_cut(&run, &cut, &recording, &error), error.message);
            TEST_ASSERT_EQUAL_INT_MESSAGE(0, frf_mean_estimate(&recording, NULL, &frf, &error), error.message);
            for (size_t k = 0; k < frf.count; k++) {
                const double complex ratio = CMPLX(frf.real[k], frf.imag[k]) / truth(i, j, inputs.bins[j][k]);
                worst_db = fmax(worst_db, fabs(20.0 * log10(cabs(ratio))));
                worst_db = fmax(worst_db, 20.0 * log10(1.0 + cabs(ratio - 1.0)));
            }
            frf_free(&frf);
            periodic_free(&recording);
        }
    }
    printf("2 x 2 in steady state: worst error %.2g dB\n", worst_db);
    TEST_ASSERT_TRUE(worst_db <= required_db);
}

static void test_inputs_find_period_and_lines_nobody_said_through_noise(void)
{
    run.period_samples = 0;
    play(0.1, 0.0);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, inputs_find(&run, &(struct inputs_known){0}, &inputs, &error), error.message);
    expect_interleaved_lines();
}

static void test_inputs_say_how_much_the_others_answer(void)
{
    play(0.0, 0.3);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, inputs_find(&run, &(struct inputs_known){0}, &inputs, &error), error.message);
    expect_interleaved_lines();
    TEST_ASSERT_TRUE(inputs.foreign_share > 0.01);
}

static void test_inputs_take_only_lines_that_the_run_says(void)
{
    play(0.0, 0.0);
    run.bins = malloc(3 * sizeof *run.bins);
    run.bin_count = 3;
    memcpy(run.bins, (const uint32_t[]){3, 4, 9}, 3 * sizeof *run.bins);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, inputs_find(&run, &(struct inputs_known){0}, &inputs, &error), error.message);
    TEST_ASSERT_EQUAL_size_t(2, inputs.bin_count[0]);
    TEST_ASSERT_EQUAL_size_t(1, inputs.bin_count[1]);
    TEST_ASSERT_EQUAL_UINT32(4, inputs.bins[1][0]);
    size_t count;
    uint32_t *others = inputs_others(&inputs, 1, &count);
    TEST_ASSERT_EQUAL_size_t(2, count);
    TEST_ASSERT_EQUAL_UINT32(3, others[0]);
    TEST_ASSERT_EQUAL_UINT32(9, others[1]);
    free(others);
}

static void expect_refusal(const struct inputs_known *known, const char *text)
{
    TEST_ASSERT_EQUAL_INT(error_refused, inputs_find(&run, known, &inputs, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, text), error.message);
    TEST_ASSERT_EQUAL_size_t(0, inputs.count);
}

static void test_inputs_on_the_same_lines_are_refused(void)
{
    play(0.0, 0.0);
    for (size_t n = 0; n < run.rows; n++) {
        run.columns[1].data[n] += 0.25 * cos(two_pi * (double)(7 * n % length) / length);
    }
    expect_refusal(&(struct inputs_known){0}, "both torque_1_Nm and torque_2_Nm are excited on bin 7");
}

static void test_inputs_that_cannot_be_used_are_refused(void)
{
    run.columns = NULL;
    TEST_ASSERT_NOT_NULL(run_add_column(&run, "torque_Nm"));
    TEST_ASSERT_NOT_NULL(run_add_column(&run, "torque_2_Nm"));
    expect_refusal(&(struct inputs_known){0}, "no two inputs");
    TEST_ASSERT_NOT_NULL(run_add_column(&run, "torque_1_Nm"));
    for (size_t n = 0; n < run.rows; n++) {
        run.columns[2].data[n] = input_at(0, n);
    }
    expect_refusal(&(struct inputs_known){0}, "torque_2_Nm has no line of its own");
    run.columns[1].data[5] = NAN;
    expect_refusal(&(struct inputs_known){0}, "row 6 of torque_2_Nm");
    run.columns[1].data[5] = 0.0;
    expect_refusal(&(struct inputs_known){.period_samples = 2000}, "two periods");
}

/// A design with two inputs and two segments; the second one's lines are wanted.
static void make_design(struct sequence_file *out, const uint32_t *first, const uint32_t *second)
{
    TEST_ASSERT_EQUAL_INT(0, sequence_file_alloc(out, 2, 2, &error));
    out->period_samples = length;
    out->path = strdup("belt.json");
    const uint32_t *const bins[2] = {first, second};
    for (size_t p = 0; p < 2; p++) {
        struct sequence_table *table = &out->segments[1].tables[p];
        table->bins = malloc(2 * sizeof *table->bins);
        memcpy(table->bins, bins[p], 2 * sizeof *table->bins);
        table->bin_count = 2;
    }
}

static void test_inputs_have_the_lines_of_their_design(void)
{
    struct sequence_file design = {0};
    make_design(&design, (const uint32_t[]){1, 5}, (const uint32_t[]){2, 6});
    const struct inputs_known known = {.design = &design};
    play(0.0, 0.0);
    expect_refusal(&known, "made.csv: segment: '': expected which of the 2 segments of belt.json");
    TEST_ASSERT_TRUE(run_set_key(&run, "segment", "3 of 2"));
    expect_refusal(&known, "segment: '3 of 2'");
    TEST_ASSERT_TRUE(run_set_key(&run, "segment", "2 of 2"));
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, inputs_find(&run, &known, &inputs, &error), error.message);
    TEST_ASSERT_EQUAL_size_t(2, inputs.bin_count[1]);
    TEST_ASSERT_EQUAL_UINT32(6, inputs.bins[1][1]);
    inputs_free(&inputs);
    run.period_samples = 300;
    expect_refusal(&known, "period of 300 samples: expected the 600 of belt.json");
    run.period_samples = length;
    TEST_ASSERT_NOT_NULL(run_add_column(&run, "torque_3_Nm"));
    expect_refusal(&known, "3 inputs, torque_1_Nm to torque_3_Nm: expected the 2 of belt.json");
    sequence_file_free(&design);
}

static void test_inputs_outputs_may_be_one_without_a_number(void)
{
    const char *names[inputs_max];
    TEST_ASSERT_EQUAL_size_t(0, inputs_list_outputs(&run, names));
    TEST_ASSERT_NOT_NULL(run_add_column(&run, "position_rad"));
    TEST_ASSERT_NOT_NULL(run_add_column(&run, "velocity_ref_rad_per_s"));
    TEST_ASSERT_EQUAL_size_t(1, inputs_list_outputs(&run, names));
    TEST_ASSERT_EQUAL_STRING("position_rad", names[0]);
    TEST_ASSERT_NOT_NULL(run_add_column(&run, "velocity_10_rad_per_s"));
    TEST_ASSERT_NOT_NULL(run_add_column(&run, "velocity_9_rad_per_s"));
    TEST_ASSERT_EQUAL_size_t(2, inputs_list_outputs(&run, names));
    TEST_ASSERT_EQUAL_STRING("velocity_9_rad_per_s", names[0]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_inputs_give_the_matrix_of_a_linear_plant);
    RUN_TEST(test_inputs_find_period_and_lines_nobody_said_through_noise);
    RUN_TEST(test_inputs_say_how_much_the_others_answer);
    RUN_TEST(test_inputs_take_only_lines_that_the_run_says);
    RUN_TEST(test_inputs_on_the_same_lines_are_refused);
    RUN_TEST(test_inputs_that_cannot_be_used_are_refused);
    RUN_TEST(test_inputs_have_the_lines_of_their_design);
    RUN_TEST(test_inputs_outputs_may_be_one_without_a_number);
    return UNITY_END();
}
