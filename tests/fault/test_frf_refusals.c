/* SPDX-License-Identifier: MIT */
#include "lab/estimate/arbitrary.h"
#include "lab/estimate/method.h"
#include "lab/estimate/periodic.h"
#include "lab/numeric/statistics.h"

#include "unity.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;

enum { length = 120, periods = 6, lines = 10 };

static struct run run;
static struct periodic recording;
static struct error error;

static void make_run(void)
{
    static char path[] = "made.csv";
    struct random random;
    random_seed(&random, 1);
    run = (struct run){.path = path, .sample_rate_hz = 1000.0, .rows = length * periods};
    double *torque = run_add_column(&run, "torque_Nm");
    double *velocity = run_add_column(&run, "velocity_rad_per_s");
    for (size_t n = 0; n < run.rows; n++) {
        for (int k = 1; k <= lines; k++) {
            torque[n] += cos(two_pi * k * (double)n / length + 0.3 * k * k);
        }
        velocity[n] = 3.0 * torque[n] + 0.01 * random_normal(&random);
    }
}

void setUp(void)
{
    make_run();
}

void tearDown(void)
{
    run.path = NULL;
    run_free(&run);
}

static void expect_refusal(const struct periodic_options *options, const char *text)
{
    TEST_ASSERT_EQUAL_INT(error_refused, periodic_cut(&run, options, &recording, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, text), error.message);
}

static void test_periodic_finds_period_and_lines_nobody_said(void)
{
    TEST_ASSERT_EQUAL_INT(0, periodic_cut(&run, &(struct periodic_options){0}, &recording, &error));
    TEST_ASSERT_TRUE(recording.period_found && recording.bins_found);
    TEST_ASSERT_EQUAL_size_t(length, recording.period_samples);
    TEST_ASSERT_EQUAL_size_t(lines, recording.bin_count);
    periodic_free(&recording);
}

static void test_periodic_refuses_columns_that_are_not_there(void)
{
    expect_refusal(&(struct periodic_options){.input = "force_N"}, "no column 'force_N'");
    free(run.columns[1].name);
    run.columns[1].name = strdup("speed");
    expect_refusal(&(struct periodic_options){0}, "--output COLUMN");
}

static void test_periodic_refuses_numbers_that_are_not_finite(void)
{
    run.columns[1].data[400] = NAN;
    expect_refusal(&(struct periodic_options){0}, "row 401 of velocity_rad_per_s");
    run.columns[1].data[400] = INFINITY;
    expect_refusal(&(struct periodic_options){0}, "row 401 of velocity_rad_per_s");
}

static void test_periodic_refuses_aperiodic_input(void)
{
    struct random random;
    random_seed(&random, 2);
    for (size_t n = 0; n < run.rows; n++) {
        run.columns[0].data[n] = random_normal(&random);
    }
    expect_refusal(&(struct periodic_options){0}, "--period SAMPLES");
}

static void test_periodic_refuses_fewer_than_two_periods(void)
{
    expect_refusal(&(struct periodic_options){.period_samples = length * periods - 1}, "expected at least 2");
    expect_refusal(
        &(struct periodic_options){.period_samples = length, .settle = periodic_settle_given, .settle_periods = 5},
        "1 of 6 periods count (5 left out for settling, 0 for lost samples)");
    expect_refusal(
        &(struct periodic_options){.period_samples = length, .settle = periodic_settle_given, .settle_periods = 99},
        "0 of 6 periods count");
    double *valid = run_add_column(&run, "valid");
    for (size_t n = 0; n < run.rows; n++) {
        valid[n] = n % length != 3 || n < length;
    }
    expect_refusal(&(struct periodic_options){.period_samples = length}, "1 of 6 periods count");
}

static void test_periodic_refuses_lines_beyond_half_the_period(void)
{
    const uint32_t beyond[] = {1, 60};
    const uint32_t zero[] = {0, 5};
    const uint32_t falling[] = {5, 4};
    expect_refusal(&(struct periodic_options){.period_samples = length, .bins = beyond, .bin_count = 2},
                   "excited bin 60");
    expect_refusal(&(struct periodic_options){.period_samples = length, .bins = zero, .bin_count = 2}, "excited bin 0");
    expect_refusal(&(struct periodic_options){.period_samples = length, .bins = falling, .bin_count = 2},
                   "excited bin 4");
}

static void test_method_names_that_are_not_there_are_refused_with_a_list(void)
{
    TEST_ASSERT_NULL(estimate_method_find("nonsense", &error));
    TEST_ASSERT_EQUAL_INT(error_usage, error.status);
    TEST_ASSERT_NOT_NULL_MESSAGE(
        strstr(error.message, "'nonsense' is not in this build: expected one of mean, hann, lpm, h1, indirect"),
        error.message);
    TEST_ASSERT_NOT_NULL(estimate_method_find("hann", &error));
}

static void expect_method_refusal(const char *name, const struct periodic_options *cut,
                                  const struct estimate_options *tuning, const char *text)
{
    struct frf frf;
    const struct estimate_method *method = estimate_method_find(name, &error);
    TEST_ASSERT_NOT_NULL(method);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, periodic_cut(&run, cut, &recording, &error), error.message);
    TEST_ASSERT_EQUAL_INT(error_refused, method->estimate(&recording, tuning, &frf, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, text), error.message);
    periodic_free(&recording);
}

static void test_lpm_refuses_polynomials_that_its_lines_do_not_determine(void)
{
    const struct periodic_options cut = {.period_samples = length};
    expect_method_refusal("lpm", &cut, &(struct estimate_options){.order = 4, .half_width = 2},
                          "order 4 with 2 lines on each side");
    expect_method_refusal("lpm", &cut, &(struct estimate_options){.order = 11}, "an order from 0 to 10");
    /* 6 periods of 120 samples: 359 lines, 59 of them excited. */
    expect_method_refusal("lpm", &cut, &(struct estimate_options){.order = 2, .half_width = 151},
                          "needs 302 lines between the excited ones, 6 periods of 120 samples have 300");
}

static void test_lpm_refuses_periods_of_which_no_two_follow_each_other(void)
{
    double *valid = run_add_column(&run, "valid");
    for (size_t n = 0; n < run.rows; n++) {
        valid[n] = n / length % 2 == 0;
    }
    expect_method_refusal("lpm", &(struct periodic_options){.period_samples = length}, NULL,
                          "the longest stretch without a gap has 1 periods");
}

static void test_methods_refuse_an_input_without_power(void)
{
    const uint32_t dead[] = {40, 41};
    const struct periodic_options cut = {.period_samples = length, .bins = dead, .bin_count = 2};
    struct random random;
    random_seed(&random, 3);
    TEST_ASSERT_NOT_NULL(run_add_column(&run, "velocity_ref_rad_per_s"));
    for (size_t n = 0; n < run.rows; n++) {
        run.columns[0].data[n] += 0.01 * random_normal(&random);
        run.columns[2].data[n] = random_normal(&random);
    }
    const char *const names[] = {"mean", "hann", "lpm", "h1", "indirect"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        expect_method_refusal(names[i], &cut, NULL, "no power above its scatter on any of 2 lines");
    }
}

static void test_indirect_refuses_a_reference_that_is_none(void)
{
    const struct periodic_options cut = {.period_samples = length};
    expect_method_refusal("indirect", &cut, NULL, "say --reference COLUMN");
    expect_method_refusal("indirect", &(struct periodic_options){.period_samples = length, .reference = "torque_Nm"},
                          NULL, "reference and input are both torque_Nm");
    expect_refusal(&(struct periodic_options){.reference = "position_ref_rad"}, "no column 'position_ref_rad'");
    TEST_ASSERT_NOT_NULL(run_add_column(&run, "velocity_ref_rad_per_s"));
    expect_method_refusal("indirect", &cut, NULL, "say --reference COLUMN");
    expect_refusal(&(struct periodic_options){.reference = "velocity_ref_rad_per_s"},
                   "velocity_ref_rad_per_s does not change");
    run.columns[2].data[7] = NAN;
    expect_refusal(&(struct periodic_options){.period_samples = length}, "row 8 of velocity_ref_rad_per_s");
}

static void expect_arbitrary_refusal(const char *name, const struct estimate_options *tuning, const char *text)
{
    struct arbitrary arbitrary;
    struct frf frf;
    const struct estimate_method *method = estimate_method_find(name, &error);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, arbitrary_cut(&run, &(struct arbitrary_options){0}, &arbitrary, &error),
                                  error.message);
    TEST_ASSERT_EQUAL_INT(error_refused, method->estimate_arbitrary(&arbitrary, tuning, &frf, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, text), error.message);
}

static void test_methods_without_periods_refuse_too_little(void)
{
    struct arbitrary arbitrary;
    expect_arbitrary_refusal("h1", &(struct estimate_options){.segment_samples = 400}, "2 segments of 400 samples");
    expect_arbitrary_refusal("h1", &(struct estimate_options){.segment_samples = 8}, "at least 16 samples");
    expect_arbitrary_refusal("indirect", NULL, "say --reference COLUMN");
    expect_arbitrary_refusal("lpm", &(struct estimate_options){.order = 2, .half_width = 2},
                             "fewer unknowns (6) than lines (5)");
    expect_arbitrary_refusal("lpm", &(struct estimate_options){.order = 2, .half_width = 200}, "needs 401 around");
    double *valid = run_add_column(&run, "valid");
    for (size_t n = 0; n < run.rows; n++) {
        valid[n] = n % 50 != 20;
    }
    TEST_ASSERT_EQUAL_INT(error_refused, arbitrary_cut(&run, &(struct arbitrary_options){0}, &arbitrary, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "without lost samples has 49 rows"), error.message);
    run.columns[1].data[3] = NAN;
    TEST_ASSERT_EQUAL_INT(error_refused, arbitrary_cut(&run, &(struct arbitrary_options){0}, &arbitrary, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "row 4 of velocity_rad_per_s"), error.message);
}

/// A cut that fails for want of a period says so to those who can do without one.
static void test_periodic_tells_when_only_the_period_is_missing(void)
{
    struct random random;
    random_seed(&random, 2);
    TEST_ASSERT_EQUAL_INT(error_refused,
                          periodic_cut(&run, &(struct periodic_options){.input = "x"}, &recording, &error));
    TEST_ASSERT_FALSE(recording.aperiodic);
    for (size_t n = 0; n < run.rows; n++) {
        run.columns[0].data[n] = random_normal(&random);
    }
    TEST_ASSERT_EQUAL_INT(error_refused, periodic_cut(&run, &(struct periodic_options){0}, &recording, &error));
    TEST_ASSERT_TRUE(recording.aperiodic);
    TEST_ASSERT_NOT_NULL(strstr(error.message, "--method lpm, h1 or indirect"));
}

/// What rounding leaves of a constant or a ramp is the same in every period, and must not pass for a line.
static void test_periodic_refuses_inputs_without_power_with_the_figure(void)
{
    const uint32_t bins[] = {1, 2, 3, 4, 5};
    const struct periodic_options options = {.period_samples = length, .bins = bins, .bin_count = 5};
    const struct periodic_options found = {.period_samples = length};
    double *torque = run.columns[0].data;
    for (size_t n = 0; n < run.rows; n++) {
        torque[n] = 0.2185;
    }
    expect_refusal(&options, "torque_Nm is 0.2185 in all 720 rows");
    torque[5] = nextafter(torque[5], 1.0);
    expect_refusal(&options, "torque_Nm has no power on any of 5 lines: the strongest, ");
    expect_refusal(&found, "no line of torque_Nm repeats");
    for (size_t n = 0; n < run.rows; n++) {
        torque[n] = 17.0 + 1e-3 * (double)n;
    }
    expect_refusal(&options, "torque_Nm has no power on any of 5 lines: the strongest, ");
    expect_refusal(&options, "and rounding alone may leave ");
    expect_refusal(&found, "no line of torque_Nm repeats");
    expect_refusal(&(struct periodic_options){.output = "torque_Nm"}, "input and output are both torque_Nm");
    struct arbitrary arbitrary;
    TEST_ASSERT_EQUAL_INT(error_refused, arbitrary_cut(&run, &(struct arbitrary_options){0}, &arbitrary, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "torque_Nm is a straight line from 17 to 17.719"),
                                 error.message);
}

/// A line that nobody excites is not valid, though the others are.
static void test_methods_give_no_line_that_is_rounding(void)
{
    const uint32_t bins[] = {1, 2, 3, 4, 5, 20};
    const struct periodic_options options = {.period_samples = length, .bins = bins, .bin_count = 6};
    for (const struct estimate_method *method = estimate_methods; method->name; method++) {
        struct frf frf;
        if (strcmp(method->name, "parametric") == 0) {
            continue; // its lines are those of the model
        }
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, periodic_cut(&run, &options, &recording, &error), error.message);
        recording.reference = run.columns[1].name;
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, method->estimate(&recording, NULL, &frf, &error), error.message);
        TEST_ASSERT_TRUE_MESSAGE(frf.valid[4], method->name);
        TEST_ASSERT_FALSE_MESSAGE(frf.valid[5], method->name);
        frf_free(&frf);
        periodic_free(&recording);
    }
}

/// Whatever stands in lost samples: the same period, lines and response.
static void test_periodic_ignores_what_stands_in_lost_samples(void)
{
    struct frf responses[2];
    double *valid = run_add_column(&run, "valid");
    for (size_t n = 0; n < run.rows; n++) {
        valid[n] = n < 2 * length || n > 2 * length + 3;
    }
    for (int garbage = 0; garbage < 2; garbage++) {
        for (size_t n = 2 * length; n < 2 * length + 4 && garbage; n++) {
            run.columns[0].data[n] = 1e30;
            run.columns[1].data[n] = -1e25;
        }
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, periodic_cut(&run, &(struct periodic_options){0}, &recording, &error),
                                      error.message);
        TEST_ASSERT_EQUAL_size_t(length, recording.period_samples);
        TEST_ASSERT_EQUAL_size_t(lines, recording.bin_count);
        TEST_ASSERT_EQUAL_size_t(1, recording.lost);
        TEST_ASSERT_EQUAL_INT(0, estimate_methods[0].estimate(&recording, NULL, &responses[garbage], &error));
        periodic_free(&recording);
    }
    for (size_t line = 0; line < lines; line++) {
        TEST_ASSERT_EQUAL_DOUBLE(responses[0].real[line], responses[1].real[line]);
        TEST_ASSERT_EQUAL_DOUBLE(responses[0].std[line], responses[1].std[line]);
    }
    frf_free(&responses[0]);
    frf_free(&responses[1]);
}

static void test_average_refuses_other_lines_and_names(void)
{
    struct frf both[2];
    struct frf average;
    for (size_t r = 0; r < 2; r++) {
        struct periodic_options options = {.period_samples = length};
        TEST_ASSERT_EQUAL_INT(0, periodic_cut(&run, &options, &recording, &error));
        TEST_ASSERT_EQUAL_INT(0, estimate_methods[0].estimate(&recording, NULL, &both[r], &error));
        periodic_free(&recording);
    }
    TEST_ASSERT_EQUAL_INT(0, estimate_average(both, 2, &average, &error));
    TEST_ASSERT_EQUAL_DOUBLE(both[0].real[4], average.real[4]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, both[0].noise_std[4] / sqrt(2.0), average.noise_std[4]);
    frf_free(&average);
    both[1].frequency_hz[4] *= 1.001;
    TEST_ASSERT_EQUAL_INT(error_refused, estimate_average(both, 2, &average, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "line 5"), error.message);
    TEST_ASSERT_TRUE(frf_set_text(&both[1].output, "position_rad"));
    TEST_ASSERT_EQUAL_INT(error_refused, estimate_average(both, 2, &average, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "position_rad"), error.message);
    frf_free(&both[0]);
    frf_free(&both[1]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_periodic_finds_period_and_lines_nobody_said);
    RUN_TEST(test_periodic_refuses_columns_that_are_not_there);
    RUN_TEST(test_periodic_refuses_numbers_that_are_not_finite);
    RUN_TEST(test_periodic_refuses_aperiodic_input);
    RUN_TEST(test_periodic_refuses_fewer_than_two_periods);
    RUN_TEST(test_periodic_refuses_lines_beyond_half_the_period);
    RUN_TEST(test_method_names_that_are_not_there_are_refused_with_a_list);
    RUN_TEST(test_lpm_refuses_polynomials_that_its_lines_do_not_determine);
    RUN_TEST(test_lpm_refuses_periods_of_which_no_two_follow_each_other);
    RUN_TEST(test_methods_refuse_an_input_without_power);
    RUN_TEST(test_indirect_refuses_a_reference_that_is_none);
    RUN_TEST(test_methods_without_periods_refuse_too_little);
    RUN_TEST(test_periodic_tells_when_only_the_period_is_missing);
    RUN_TEST(test_periodic_refuses_inputs_without_power_with_the_figure);
    RUN_TEST(test_methods_give_no_line_that_is_rounding);
    RUN_TEST(test_periodic_ignores_what_stands_in_lost_samples);
    RUN_TEST(test_average_refuses_other_lines_and_names);
    return UNITY_END();
}
