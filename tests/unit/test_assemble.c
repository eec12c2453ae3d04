/* SPDX-License-Identifier: MIT */
/// Responses of a sequence's segments put together: lab/estimate/assemble.h.
#include "lab/estimate/assemble.h"
#include "lab/estimate/circle.h"
#include "lab/estimate/method.h"

#include "unity.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/// confidence_95_factor is written with six digits.
static const double six_digits = 1e-5;

static struct frf segments[3];
static struct frf whole;
static struct error error;

void setUp(void)
{
    memset(segments, 0, sizeof segments);
    whole = (struct frf){0};
    error = (struct error){0};
}

void tearDown(void)
{
    for (size_t s = 0; s < 3; s++) {
        frf_free(&segments[s]);
    }
    frf_free(&whole);
}

/// A segment with `count` lines from `first_hz` on, 1 Hz apart; every number says which line it belongs to.
static void make_segment(size_t s, double first_hz, size_t count, size_t periods)
{
    struct frf *frf = &segments[s];
    TEST_ASSERT_EQUAL_INT(0, frf_alloc(frf, count, &error));
    frf_set_text(&frf->input, "torque_Nm");
    frf_set_text(&frf->output, "velocity_rad_per_s");
    frf_set_text(&frf->units, "rad_per_s/Nm");
    frf_set_text(&frf->method, "mean");
    frf->periods = periods;
    frf->degrees_of_freedom = 2.0 * (double)(periods - 1);
    estimate_set_key(frf, "sample_rate_hz", "1000");
    estimate_set_key(frf, "settle_periods", "%zu", s);
    for (size_t k = 0; k < count; k++) {
        double frequency = first_hz + (double)k;
        frf->frequency_hz[k] = frequency;
        estimate_set_line(frf, k, frequency - 2 * frequency * I, 0.01 * frequency);
        frf->odd_distortion[k] = 0.001 * frequency;
    }
}

static const char *key(const char *name)
{
    for (size_t i = 0; i < whole.key_count; i++) {
        if (strcmp(whole.keys[i].key, name) == 0) {
            return whole.keys[i].value;
        }
    }
    return NULL;
}

static void test_assemble_orders_lines_by_frequency(void)
{
    make_segment(0, 4, 3, 6);
    make_segment(1, 1, 1, 2);
    make_segment(2, 2, 2, 4);
    segments[0].valid[1] = false;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, estimate_assemble(segments, 3, &whole, &error), error.message);
    TEST_ASSERT_EQUAL_size_t(6, whole.count);
    for (size_t k = 0; k < 6; k++) {
        double frequency = (double)(k + 1);
        TEST_ASSERT_EQUAL_DOUBLE(frequency, whole.frequency_hz[k]);
        TEST_ASSERT_EQUAL_DOUBLE(frequency, whole.real[k]);
        TEST_ASSERT_EQUAL_DOUBLE(-2 * frequency, whole.imag[k]);
        TEST_ASSERT_EQUAL_DOUBLE(0.01 * frequency, whole.std[k]);
        TEST_ASSERT_EQUAL_DOUBLE(0.01 * frequency, whole.noise_std[k]);
        TEST_ASSERT_EQUAL_DOUBLE(0.001 * frequency, whole.odd_distortion[k]);
        TEST_ASSERT_EQUAL_DOUBLE(FRF_UNKNOWN, whole.even_distortion[k]);
        TEST_ASSERT_EQUAL(k != 4, whole.valid[k]);
    }
    TEST_ASSERT_EQUAL_STRING("torque_Nm", whole.input);
    TEST_ASSERT_EQUAL_STRING("rad_per_s/Nm", whole.units);
    TEST_ASSERT_EQUAL_STRING("mean", whole.method);
}

static void test_assemble_takes_the_fewest_periods_and_names_the_segments(void)
{
    make_segment(0, 1, 1, 6);
    make_segment(1, 2, 2, 3);
    make_segment(2, 4, 4, 24);
    estimate_set_key(&segments[0], "lost_periods", "2");
    estimate_set_key(&segments[2], "lost_periods", "1");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, estimate_assemble(segments, 3, &whole, &error), error.message);
    TEST_ASSERT_EQUAL_size_t(3, whole.periods);
    TEST_ASSERT_EQUAL_DOUBLE(4, whole.degrees_of_freedom);
    TEST_ASSERT_DOUBLE_WITHIN(six_digits, circle_confidence_factor(0.95, 2), atof(key("confidence_95_factor")));
    TEST_ASSERT_EQUAL_STRING("3", key("segments"));
    TEST_ASSERT_EQUAL_STRING("[1, 2, 4]", key("segment_first_hz"));
    TEST_ASSERT_EQUAL_STRING("[6, 3, 24]", key("segment_periods"));
    TEST_ASSERT_EQUAL_STRING("[10, 4, 46]", key("segment_degrees_of_freedom"));
    TEST_ASSERT_EQUAL_STRING("1000", key("sample_rate_hz"));
    TEST_ASSERT_NULL(key("settle_periods"));
    TEST_ASSERT_EQUAL_STRING("3", key("lost_periods"));
}

static void test_assemble_lists_many_segments_in_full(void)
{
    enum { many = 1000 };
    struct frf *all = calloc(many, sizeof *all);
    for (size_t s = 0; s < many; s++) {
        make_segment(0, 1.0625 * (double)(s + 1), 1, 2);
        all[s] = segments[0];
        segments[0] = (struct frf){0};
    }
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, estimate_assemble(all, many, &whole, &error), error.message);
    const char *end = strrchr(key("segment_first_hz"), ' ');
    TEST_ASSERT_EQUAL_STRING(" 1062.5]", end);
    for (size_t s = 0; s < many; s++) {
        frf_free(&all[s]);
    }
    free(all);
}

static void test_assemble_refuses_what_does_not_belong_together(void)
{
    make_segment(0, 1, 2, 2);
    make_segment(1, 2, 2, 2);
    TEST_ASSERT_EQUAL_INT(error_refused, estimate_assemble(segments, 2, &whole, &error));
    TEST_ASSERT_EQUAL_STRING("segments 1 and 2 both have a line at 2 Hz: expected each line once", error.message);
    segments[1].frequency_hz[0] = 2.5;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, estimate_assemble(segments, 2, &whole, &error), error.message);
    frf_free(&whole);
    frf_set_text(&segments[1].output, "position_rad");
    TEST_ASSERT_EQUAL_INT(error_refused, estimate_assemble(segments, 2, &whole, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "segment 2 has torque_Nm to position_rad"), error.message);
    TEST_ASSERT_EQUAL_size_t(0, whole.count);
    TEST_ASSERT_EQUAL_INT(error_refused, estimate_assemble(segments, 0, &whole, &error));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_assemble_orders_lines_by_frequency);
    RUN_TEST(test_assemble_takes_the_fewest_periods_and_names_the_segments);
    RUN_TEST(test_assemble_lists_many_segments_in_full);
    RUN_TEST(test_assemble_refuses_what_does_not_belong_together);
    return UNITY_END();
}
