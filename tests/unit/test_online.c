/* SPDX-License-Identifier: MIT */
#include "lab/estimate/online.h"

#include "lab/estimate/frf_mean.h"
#include "lab/estimate/method.h"
#include "lab/numeric/statistics.h"

#include "unity.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { length = 200, periods = 60, lines = 30, rows = length * periods, tail = 77 };

static const double two_pi = 6.283185307179586476925;

/// Both ways sum the same numbers in another order; 60 periods lose two or three digits of sixteen.
static const double same = 1e-12;
/// Where the same noise is in both signals, the scatter of Y - G U is what is left of numbers 10^5 times as large.
static const double same_after_cancellation = 1e-6;

static struct run whole;
static struct run leading;
static struct frf expected;
static struct frf found;
static struct error error;

void setUp(void)
{
    static char path[] = "made";
    whole = (struct run){.path = path, .sample_rate_hz = 1000.0, .rows = rows + tail, .period_samples = length};
    error = (struct error){0};
}

void tearDown(void)
{
    frf_free(&expected);
    frf_free(&found);
    whole.path = NULL;
    run_free(&whole);
}

struct made {
    const char *output;
    double noise;  ///< of the output
    double common; ///< of the input, which the drive answers
    double start;  ///< transient at the beginning
    double slope;
};

/// A multisine through a first-order lag; the input's noise goes through it too.
static void make(const struct made *made, uint64_t seed)
{
    struct random random;
    random_seed(&random, seed);
    double *input = run_add_column(&whole, "torque_Nm");
    double *output = run_add_column(&whole, made->output);
    double phases[lines];
    for (size_t k = 0; k < lines; k++) {
        phases[k] = two_pi * random_uniform(&random);
    }
    double state = made->start;
    for (size_t n = 0; n < whole.rows; n++) {
        input[n] = made->common * random_normal(&random);
        for (size_t k = 0; k < lines; k++) {
            input[n] += cos(two_pi * (double)((k + 1) * n % length) / length + phases[k]);
        }
        output[n] = state + made->noise * random_normal(&random) + made->slope * (double)n;
        state = 0.99 * state + 0.1 * input[n];
    }
    whole.bins = malloc(lines * sizeof *whole.bins);
    whole.bin_count = lines;
    for (uint32_t k = 0; k < lines; k++) {
        whole.bins[k] = k + 1;
    }
}

static struct periodic estimate_whole(const struct periodic_options *options)
{
    struct periodic recording;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, periodic_cut(&whole, options, &recording, &error), error.message);
    TEST_ASSERT_EQUAL_INT(0, frf_mean_estimate(&recording, NULL, &expected, &error));
    return recording;
}

/// Takes the first rows as the leading part and the rest in pieces of `piece` rows.
static int estimate_pieces(const struct periodic_options *options, size_t leading_rows, size_t piece,
                           struct online_result *out_result)
{
    struct periodic_options all = *options;
    struct periodic cut;
    struct online *online;
    leading = whole;
    leading.rows = leading_rows;
    all.settle = periodic_settle_given;
    all.settle_periods = 0;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, periodic_cut(&leading, &all, &cut, &error), error.message);
    int status = online_begin(&cut, options, &online, &error);
    const double *input = run_column(&whole, cut.input);
    const double *output = run_column(&whole, cut.output);
    const double *valid = run_column(&whole, "valid");
    for (size_t n = leading_rows; n < whole.rows && !status; n += piece) {
        size_t count = whole.rows - n < piece ? whole.rows - n : piece;
        status = online_take(online, input + n, output + n, valid ? valid + n : NULL, count, &error);
    }
    status = status ? status : online_end(online, whole.sample_rate_hz, out_result, &found, &error);
    online_free(online);
    periodic_free(&cut);
    return status;
}

static void assert_same_response(double tolerance)
{
    TEST_ASSERT_EQUAL_UINT(expected.count, found.count);
    TEST_ASSERT_EQUAL_UINT(expected.periods, found.periods);
    TEST_ASSERT_EQUAL_DOUBLE(expected.degrees_of_freedom, found.degrees_of_freedom);
    TEST_ASSERT_EQUAL_STRING(expected.units, found.units);
    TEST_ASSERT_EQUAL_UINT(expected.key_count, found.key_count);
    for (size_t k = 0; k < expected.key_count; k++) {
        TEST_ASSERT_EQUAL_STRING(expected.keys[k].value, estimate_key(&found, expected.keys[k].key));
    }
    for (size_t line = 0; line < found.count; line++) {
        const double size = hypot(expected.real[line], expected.imag[line]);
        TEST_ASSERT_EQUAL_INT(expected.valid[line], found.valid[line]);
        TEST_ASSERT_DOUBLE_WITHIN(size * same, expected.real[line], found.real[line]);
        TEST_ASSERT_DOUBLE_WITHIN(size * same, expected.imag[line], found.imag[line]);
        TEST_ASSERT_DOUBLE_WITHIN(expected.std[line] * tolerance, expected.std[line], found.std[line]);
    }
}

static void assert_same(const struct periodic_options *options, size_t leading_rows, size_t piece, double tolerance)
{
    struct online_result result;
    struct periodic recording = estimate_whole(options);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, estimate_pieces(options, leading_rows, piece, &result), error.message);
    TEST_ASSERT_EQUAL_UINT(recording.total, result.total);
    TEST_ASSERT_EQUAL_UINT(recording.settle, result.settle);
    TEST_ASSERT_EQUAL_INT(recording.settle_source, result.settle_source);
    TEST_ASSERT_EQUAL_UINT(recording.lost, result.lost);
    TEST_ASSERT_EQUAL_UINT(recording.first_lost_row, result.first_lost_row);
    TEST_ASSERT_EQUAL_UINT(recording.used, result.used);
    TEST_ASSERT_DOUBLE_WITHIN(fabs(recording.trend_per_sample) * same, recording.trend_per_sample,
                              result.trend_per_sample);
    periodic_free(&recording);
    assert_same_response(tolerance);
    frf_free(&expected);
    frf_free(&found);
}

static const struct made plain = {"velocity_rad_per_s", 0.01, 0.01, 0.0, 0.0};

static void test_online_is_method_mean_whatever_the_pieces_are(void)
{
    static const size_t leads[] = {2 * length, 7 * length + 31, rows};
    static const size_t pieces[] = {1, 61, 5 * length, rows};
    const struct periodic_options options = {.settle = periodic_settle_given, .settle_periods = 3};
    make(&plain, 1);
    for (size_t l = 0; l < sizeof leads / sizeof leads[0]; l++) {
        for (size_t p = 0; p < sizeof pieces / sizeof pieces[0]; p++) {
            assert_same(&options, leads[l], pieces[p], same);
        }
    }
}

static void test_online_leaves_out_more_periods_than_the_leading_part_has(void)
{
    make(&plain, 2);
    assert_same(&(struct periodic_options){.settle = periodic_settle_given, .settle_periods = 40}, 5 * length, 500,
                same);
    whole.settle_periods = 30;
    whole.has_settle_periods = true;
    whole.periods = 20;
    assert_same(&(struct periodic_options){.settle = periodic_settle_default}, 35 * length, 500, same);
    assert_same(&(struct periodic_options){.settle = periodic_settle_default}, 55 * length, 500, same);
    assert_same(&(struct periodic_options){.settle = periodic_settle_default}, 8 * length, 500, same);
}

/// The lag forgets 0.13 of its start in a period.
static void test_online_finds_the_settling_in_the_leading_part(void)
{
    const struct periodic_options options = {.settle = periodic_settle_default};
    const struct made slow = {"velocity_rad_per_s", 0.01, 0.001, 300.0, 0.0};
    make(&slow, 3);
    struct online_result result;
    struct periodic recording = estimate_whole(&options);
    TEST_ASSERT_GREATER_OR_EQUAL_UINT(3, recording.settle);
    TEST_ASSERT_EQUAL_INT(0, estimate_pieces(&options, 40 * length, 333, &result));
    TEST_ASSERT_EQUAL_UINT(recording.settle, result.settle);
    TEST_ASSERT_EQUAL_UINT(recording.transient.periods, result.transient.periods);
    TEST_ASSERT_TRUE(result.transient.settled);
    TEST_ASSERT_DOUBLE_WITHIN(same, recording.transient.decay_per_period, result.transient.decay_per_period);
    TEST_ASSERT_DOUBLE_WITHIN(recording.output_level[0] * same, recording.output_level[0], result.first_level);
    TEST_ASSERT_DOUBLE_WITHIN(recording.output_level[periods - 1] * same, recording.output_level[periods - 1],
                              result.last_level);
    const size_t settle = recording.settle;
    periodic_free(&recording);
    assert_same_response(same);
    frf_free(&found);
    /* Where the leading part is shorter than half, everything after it stands for settled periods. */
    TEST_ASSERT_EQUAL_INT(0, estimate_pieces(&options, 12 * length, 333, &result));
    TEST_ASSERT_TRUE(result.transient.settled);
    TEST_ASSERT_UINT_WITHIN(1, settle, result.settle);
    frf_free(&found);
    TEST_ASSERT_EQUAL_INT(0, estimate_pieces(&options, 2 * length, 333, &result));
    TEST_ASSERT_FALSE(result.transient.settled);
    TEST_ASSERT_EQUAL_UINT(2, result.settle);
}

static void test_online_leaves_out_periods_with_lost_samples(void)
{
    static const size_t lost_rows[] = {3 * length, 3 * length + 5, 9 * length - 1, 30 * length + 1, 59 * length};
    make(&plain, 4);
    double *valid = run_add_column(&whole, "valid");
    for (size_t n = 0; n < whole.rows; n++) {
        valid[n] = 1.0;
    }
    for (size_t i = 0; i < sizeof lost_rows / sizeof lost_rows[0]; i++) {
        valid[lost_rows[i]] = 0.0;
    }
    for (size_t settle = 2; settle <= 40; settle += 19) {
        const struct periodic_options options = {.settle = periodic_settle_given, .settle_periods = settle};
        assert_same(&options, 7 * length + 3, 123, same);
        assert_same(&options, 20 * length, 4000, same);
    }
}

static void test_online_takes_out_the_drift_of_a_position(void)
{
    const struct made drifting = {"position_rad", 0.01, 0.01, 0.0, 0.003};
    make(&drifting, 5);
    const struct periodic_options options = {.settle = periodic_settle_given, .settle_periods = 5};
    struct online_result result;
    struct periodic recording = estimate_whole(&options);
    TEST_ASSERT_DOUBLE_WITHIN(0.0003, 0.003, recording.trend_per_sample);
    TEST_ASSERT_EQUAL_INT(0, estimate_pieces(&options, 9 * length + 1, 100, &result));
    /* A slope through means of 55 periods, of numbers that have grown to 36. */
    TEST_ASSERT_DOUBLE_WITHIN(1e-9 * recording.trend_per_sample, recording.trend_per_sample, result.trend_per_sample);
    periodic_free(&recording);
    for (size_t line = 0; line < found.count; line++) {
        TEST_ASSERT_DOUBLE_WITHIN(
            1e-9, 0.0, hypot(expected.real[line] - found.real[line], expected.imag[line] - found.imag[line]));
        TEST_ASSERT_DOUBLE_WITHIN(expected.std[line] * 1e-9, expected.std[line], found.std[line]);
    }
}

/// A noisy input that the output follows almost exactly, as in a stiff loop: the response scatters 10^5 times less than
/// either signal.
static void test_online_keeps_the_digits_of_a_small_scatter(void)
{
    const struct made stiff = {"velocity_rad_per_s", 1e-6, 0.0, 0.0, 0.0};
    make(&stiff, 6);
    struct random random;
    random_seed(&random, 60);
    double *input = whole.columns[0].data;
    double *output = whole.columns[1].data;
    for (size_t p = 0; p < periods; p++) {
        /* Another size in every period, the same for both. */
        const double gain = 1.0 + 0.1 * random_normal(&random);
        for (size_t n = p * length; n < (p + 1) * length; n++) {
            input[n] *= gain;
            output[n] *= gain;
        }
    }
    assert_same(&(struct periodic_options){.settle = periodic_settle_given, .settle_periods = 20}, 30 * length, 999,
                same_after_cancellation);
}

static void test_online_refuses_what_leaves_fewer_than_two_periods(void)
{
    struct online_result result;
    make(&plain, 7);
    const struct periodic_options options = {.settle = periodic_settle_given, .settle_periods = periods - 1};
    TEST_ASSERT_EQUAL_INT(error_refused, estimate_pieces(&options, 5 * length, 500, &result));
    TEST_ASSERT_EQUAL_STRING("made: 1 of 60 periods count (59 left out for settling, 0 for lost samples): expected at "
                             "least 2, because the standard deviation comes from the differences between periods",
                             error.message);
    TEST_ASSERT_EQUAL_UINT(0, found.count);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_online_is_method_mean_whatever_the_pieces_are);
    RUN_TEST(test_online_leaves_out_more_periods_than_the_leading_part_has);
    RUN_TEST(test_online_finds_the_settling_in_the_leading_part);
    RUN_TEST(test_online_leaves_out_periods_with_lost_samples);
    RUN_TEST(test_online_takes_out_the_drift_of_a_position);
    RUN_TEST(test_online_keeps_the_digits_of_a_small_scatter);
    RUN_TEST(test_online_refuses_what_leaves_fewer_than_two_periods);
    return UNITY_END();
}
