/* SPDX-License-Identifier: MIT */
#include "lab/design/offset.h"

#include "unity.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { length = 500, lines = 20 };
static const double two_pi = 6.283185307179586476925;
static const double rate_hz = 1000;
/// Sums of doubles of magnitude 1 to 100.
static const double rounding = 1e-12;

static uint32_t bins[lines];
static struct design_request request;
static struct design_result design;
static struct design_limits left;
static struct error error;

void setUp(void)
{
    for (uint32_t k = 0; k < lines; k++) {
        bins[k] = 1 + k;
    }
    request = (struct design_request){
        .rate_num_hz = 1000,
        .rate_den = 1,
        .period_samples = length,
        .bin_count = lines,
        .bins = bins,
        .limits = {.position_rad = 2, .velocity_rad_per_s = 10, .acceleration_rad_per_s2 = 300, .torque_Nm = 1},
        .inertia_kgm2 = 0.005,
        .method = "mca",
        .iterations = 50,
    };
}

void tearDown(void)
{
    design_result_free(&design);
}

static void reduce(const struct design_offset *offset)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, design_offset_reduce(offset, &request, &left, &error), error.message);
}

/// The whole way: reduced limits, design, sum.
static void make(const struct design_offset *offset)
{
    struct design_request reduced = request;
    reduce(offset);
    reduced.limits = left;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, design_run(&reduced, &design, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, design_offset_add(offset, &request, &design, &error), error.message);
}

static void expect_refusal(const struct design_offset *offset, int status, const char *says)
{
    const struct design_limits before = left;
    TEST_ASSERT_EQUAL_INT(status, design_offset_reduce(offset, &request, &left, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, says), error.message);
    TEST_ASSERT_EQUAL_MEMORY(&before, &left, sizeof left);
}

static void test_offset_of_nothing_changes_nothing(void)
{
    const struct design_offset none = {0};
    reduce(&none);
    TEST_ASSERT_EQUAL_MEMORY(&request.limits, &left, sizeof left);
    TEST_ASSERT_EQUAL_INT(0, design_run(&request, &design, &error));
    const struct design_peaks fine = design.peak_continuous;
    const double first = design.position_rad[0];
    TEST_ASSERT_EQUAL_INT(0, design_offset_add(&none, &request, &design, &error));
    TEST_ASSERT_EQUAL_size_t(length, design.period_samples);
    TEST_ASSERT_EQUAL_UINT32(lines, design.bins[lines - 1]);
    TEST_ASSERT_EQUAL_DOUBLE(first, design.position_rad[0]);
    TEST_ASSERT_EQUAL_DOUBLE(fine.velocity_rad_per_s, design.peak_continuous.velocity_rad_per_s);
    TEST_ASSERT_EQUAL_DOUBLE(0, design.travel_per_period_rad);
}

static void test_offset_takes_its_share_of_each_limit(void)
{
    const struct design_offset offset = {
        .stroke_rad = 0.5, .stroke_periods = 4, .bias_velocity_rad_per_s = -0.05, .played_periods = 6};
    const double omega = two_pi / 2; /* 4 periods of 0.5 s */
    reduce(&offset);
    /* 6 times 2 s, and 0.75 s of fades: 0.375 periods of the lowest line, which is the stroke's. */
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 2 - 0.5 - 0.05 * (6 * 2 + 0.75), left.position_rad);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 10 - 0.5 * omega - 0.05, left.velocity_rad_per_s);
    TEST_ASSERT_DOUBLE_WITHIN(1e-10, 300 - 0.5 * omega * omega, left.acceleration_rad_per_s2);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 1 - 0.005 * 0.5 * omega * omega, left.torque_Nm);
}

static void test_offset_leaves_absent_limits_absent(void)
{
    const struct design_offset offset = {.stroke_rad = 0.5, .stroke_periods = 4, .bias_velocity_rad_per_s = 1};
    request.limits = (struct design_limits){.torque_Nm = 1};
    reduce(&offset);
    TEST_ASSERT_EQUAL_DOUBLE(0, left.position_rad);
    TEST_ASSERT_EQUAL_DOUBLE(0, left.velocity_rad_per_s);
    TEST_ASSERT_EQUAL_DOUBLE(0, left.acceleration_rad_per_s2);
    TEST_ASSERT_TRUE(left.torque_Nm > 0.9 && left.torque_Nm < 1);
}

static void test_offset_refuses_with_what_would_be_accepted(void)
{
    struct design_offset offset = {.stroke_rad = 2, .stroke_periods = 4};
    expect_refusal(&offset, error_refused,
                   "position limit of 2 rad: the stroke takes 2 of it, which leaves nothing "
                   "for the multisine; expected a stroke below 2 rad");
    offset = (struct design_offset){.bias_velocity_rad_per_s = -0.2, .played_periods = 20};
    /* 20 times 0.5 s and 0.1875 s of fades at 0.2 rad/s */
    expect_refusal(
        &offset, error_refused,
        "the bias velocity takes 2.038 of it in 20 periods and the fades, which leaves nothing for the multisine; "
        "expected a bias velocity below 0.1963 rad/s");
    offset.stroke_rad = 0.5;
    offset.stroke_periods = 2;
    offset.bias_velocity_rad_per_s = 0.1;
    expect_refusal(&offset, error_refused, "expected a bias velocity below 0.0");
    offset = (struct design_offset){.stroke_rad = 1.5, .stroke_periods = 2, .bias_velocity_rad_per_s = 1};
    request.limits.position_rad = 0;
    expect_refusal(
        &offset, error_refused,
        "velocity limit of 10 rad/s: the stroke takes 9.425 of it and the bias velocity takes 1 of it, which leaves "
        "nothing for the multisine; expected a stroke below 1.432 rad, or a bias velocity below 0.5752 rad/s");
    offset = (struct design_offset){.stroke_rad = 9, .stroke_periods = 2, .bias_velocity_rad_per_s = 20};
    expect_refusal(&offset, error_refused, "expected both to be smaller");
    request.limits = (struct design_limits){.torque_Nm = 0.1};
    offset = (struct design_offset){.stroke_rad = 1, .stroke_periods = 2};
    expect_refusal(&offset, error_refused, "torque limit of 0.1 Nm: the stroke takes 0.1974");
}

/// What is refused says what is accepted: a little less than that is, a little more is not.
static void test_offset_accepts_what_it_says_it_would(void)
{
    struct design_offset offset = {.stroke_rad = 1.432, .stroke_periods = 2, .bias_velocity_rad_per_s = 1};
    request.limits.position_rad = 0;
    reduce(&offset);
    offset.stroke_rad = 1.433;
    TEST_ASSERT_EQUAL_INT(error_refused, design_offset_reduce(&offset, &request, &left, &error));
    offset = (struct design_offset){.stroke_rad = 1.5, .stroke_periods = 2, .bias_velocity_rad_per_s = -0.5752};
    reduce(&offset);
    offset.bias_velocity_rad_per_s = -0.5753;
    TEST_ASSERT_EQUAL_INT(error_refused, design_offset_reduce(&offset, &request, &left, &error));
}

static void test_offset_refuses_values_that_make_no_sense(void)
{
    struct design_offset offset = {.stroke_rad = -1, .stroke_periods = 4};
    expect_refusal(&offset, error_usage, "stroke: -1 rad, expected a positive number");
    offset.stroke_rad = NAN;
    expect_refusal(&offset, error_usage, "stroke: nan rad");
    offset = (struct design_offset){.stroke_rad = 1, .stroke_periods = 1};
    expect_refusal(&offset, error_usage, "stroke: 1 periods of the multisine, expected 2 to 2097");
    offset.stroke_periods = 2098;
    expect_refusal(&offset, error_usage, "expected 2 to 2097 (a table has at most 1048576 samples)");
    offset = (struct design_offset){.bias_velocity_rad_per_s = NAN};
    expect_refusal(&offset, error_usage, "bias velocity: nan rad/s, expected a finite number");
    offset.bias_velocity_rad_per_s = 1;
    expect_refusal(&offset, error_usage, "expected the number of periods that will be played");
    request.torque_mode = true;
    expect_refusal(&offset, error_usage, "expected none in torque mode");
    request.linear = true;
    expect_refusal(&offset, error_usage, "bias velocity: 1 m/s");
}

static double rms(const double *values, size_t count)
{
    double sum = 0;
    for (size_t n = 0; n < count; n++) {
        sum += values[n] * values[n];
    }
    return sqrt(sum / (double)count);
}

static void expect_within_limits(const struct design_peaks *peak)
{
    const double whole = 1 + 1e-12;
    TEST_ASSERT_TRUE(peak->position_rad <= request.limits.position_rad * whole);
    TEST_ASSERT_TRUE(peak->velocity_rad_per_s <= request.limits.velocity_rad_per_s * whole);
    TEST_ASSERT_TRUE(peak->acceleration_rad_per_s2 <= request.limits.acceleration_rad_per_s2 * whole);
    TEST_ASSERT_TRUE(peak->torque_Nm <= request.limits.torque_Nm * whole);
}

/// Each series over the table's own lines and the stroke's: everything that is in it.
static double amplitude_on(const double *series, size_t period, uint32_t bin)
{
    double c = 0, s = 0;
    for (size_t n = 0; n < period; n++) {
        c += series[n] * cos(two_pi * (double)n * bin / (double)period);
        s += series[n] * sin(two_pi * (double)n * bin / (double)period);
    }
    return 2 * hypot(c, s) / (double)period;
}

static void test_offset_stroke_is_the_table_it_says(void)
{
    const struct design_offset offset = {.stroke_rad = 1.2, .stroke_periods = 6};
    make(&offset);
    const size_t period = 6 * (size_t)length;
    const double omega = two_pi * rate_hz / (double)period;
    TEST_ASSERT_EQUAL_size_t(period, design.period_samples);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1.2, amplitude_on(design.position_rad, period, 1));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1.2 * omega, amplitude_on(design.velocity_rad_per_s, period, 1));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.005 * 1.2 * omega * omega, amplitude_on(design.torque_Nm, period, 1));
    for (size_t k = 0; k < lines; k++) {
        TEST_ASSERT_EQUAL_UINT32(6 * bins[k], design.bins[k]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, design.amplitude_rad[k],
                                  amplitude_on(design.position_rad, period, design.bins[k]));
    }
    expect_within_limits(&design.peak);
    expect_within_limits(&design.peak_continuous);
    TEST_ASSERT_TRUE(design.peak.position_rad <= design.peak_continuous.position_rad);
    TEST_ASSERT_EQUAL_DOUBLE(0, design.travel_per_period_rad);
    /* The effective torque is the multisine's: together with the stroke's they are all there is. */
    const double stroke_rms = 0.005 * 1.2 * omega * omega / sqrt(2);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, hypot(design.effective_torque_Nm, stroke_rms), rms(design.torque_Nm, period));
}

static void test_offset_stroke_begins_in_the_middle_in_cascade_and_at_its_end_in_torque_mode(void)
{
    struct design_offset offset = {.stroke_rad = 1.2, .stroke_periods = 6};
    const double omega = two_pi * rate_hz / (6.0 * length);
    for (int mode = 0; mode < 4; mode++) {
        request.torque_mode = mode == 1;
        offset.bias_velocity_rad_per_s = mode == 2 ? 0.01 : mode == 3 ? -0.01 : 0;
        offset.played_periods = 1;
        struct design_request reduced = request;
        reduce(&offset);
        reduced.limits = left;
        TEST_ASSERT_EQUAL_INT(0, design_run(&reduced, &design, &error));
        const size_t start = design.start_index;
        const double position = design.position_rad[start];
        const double velocity = design.velocity_rad_per_s[start];
        const double acceleration = design.acceleration_rad_per_s2[start];
        TEST_ASSERT_EQUAL_INT(0, design_offset_add(&offset, &request, &design, &error));
        TEST_ASSERT_EQUAL_size_t(start, design.start_index);
        const double added_position = design.position_rad[start] - position;
        const double added_velocity = design.velocity_rad_per_s[start] - velocity - offset.bias_velocity_rad_per_s;
        if (request.torque_mode) {
            TEST_ASSERT_DOUBLE_WITHIN(rounding, 1.2, fabs(added_position));
            TEST_ASSERT_DOUBLE_WITHIN(rounding, 0, added_velocity);
            TEST_ASSERT_TRUE(fabs(design.acceleration_rad_per_s2[start]) < fabs(acceleration) + omega * omega * 1.2);
            TEST_ASSERT_TRUE(added_position * acceleration > 0);
        } else {
            TEST_ASSERT_DOUBLE_WITHIN(rounding, 0, added_position);
            TEST_ASSERT_DOUBLE_WITHIN(rounding, mode == 3 ? -1.2 * omega : 1.2 * omega, added_velocity);
        }
        design_result_free(&design);
    }
}

static void test_offset_bias_velocity_is_in_the_velocity_and_in_the_travel(void)
{
    const struct design_offset offset = {.bias_velocity_rad_per_s = -0.3, .played_periods = 5};
    make(&offset);
    double mean = 0;
    for (size_t n = 0; n < length; n++) {
        mean += design.velocity_rad_per_s[n] / length;
    }
    TEST_ASSERT_EQUAL_size_t(length, design.period_samples);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, -0.3, mean);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, -0.3 * length / rate_hz, design.travel_per_period_rad);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, design.effective_torque_Nm, rms(design.torque_Nm, length));
    expect_within_limits(&design.peak);
    expect_within_limits(&design.peak_continuous);
    /* With everything that will be travelled, ramps of 0.1 s included. */
    const double travelled = fabs(design.travel_per_period_rad) * 5 + 0.3 * 0.1;
    TEST_ASSERT_TRUE(design.peak_continuous.position_rad + travelled <= request.limits.position_rad);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_offset_of_nothing_changes_nothing);
    RUN_TEST(test_offset_takes_its_share_of_each_limit);
    RUN_TEST(test_offset_leaves_absent_limits_absent);
    RUN_TEST(test_offset_refuses_with_what_would_be_accepted);
    RUN_TEST(test_offset_accepts_what_it_says_it_would);
    RUN_TEST(test_offset_refuses_values_that_make_no_sense);
    RUN_TEST(test_offset_stroke_is_the_table_it_says);
    RUN_TEST(test_offset_stroke_begins_in_the_middle_in_cascade_and_at_its_end_in_torque_mode);
    RUN_TEST(test_offset_bias_velocity_is_in_the_velocity_and_in_the_travel);
    return UNITY_END();
}
