/* SPDX-License-Identifier: MIT */
/// Spectrum by the limits, the transforms and their adjoint: lab/design/{spectrum,waveform}.h.
#include "lab/design/waveform.h"

#include "sim/random.h"
#include "unity.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/// Rounding of some hundred double additions of numbers near 1.
static const double rounding = 1e-11;
static const double two_pi = 6.283185307179586;

static const uint32_t bins[] = {1, 2, 5, 11, 30};
enum { lines = 5, grid = 96 };

static struct design_request request;
static struct design_spectrum spectrum;

void setUp(void)
{
    request = (struct design_request){
        .rate_num_hz = grid,
        .rate_den = 1,
        .period_samples = grid,
        .bin_count = lines,
        .bins = bins,
        .inertia_kgm2 = 0.01,
        .limits = {.position_rad = 0.5, .velocity_rad_per_s = 6, .torque_Nm = 2, .acceleration_rad_per_s2 = 1000}};
    TEST_ASSERT_TRUE(design_spectrum_create(&request, &spectrum));
}

void tearDown(void)
{
    design_spectrum_free(&spectrum);
}

static void test_spectrum_each_line_alone_just_reaches_one_limit(void)
{
    const double limits[] = {0.5, 6, 200};
    for (size_t k = 0; k < lines; k++) {
        double w = two_pi * bins[k];
        double a = spectrum.amplitude_rad[k];
        double largest = fmax(a / limits[0], fmax(a * w / limits[1], a * w * w / limits[2]));
        TEST_ASSERT_DOUBLE_WITHIN(rounding, 1, largest);
    }
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 200, spectrum.limit[design_acceleration]); // 2 Nm / 0.01 kgm2, below 1000
}

/// One line: |u|max is its amplitude, and the bound says just that: B^2 / 2 (1 + 1).
static void test_bound_is_tight_for_one_line(void)
{
    struct design_spectrum one;
    request.bin_count = 1;
    TEST_ASSERT_TRUE(design_spectrum_create(&request, &one));
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 1, design_spectrum_scale_bound(&one, 0));
    TEST_ASSERT_TRUE(design_spectrum_scale_bound(&one, grid) > 1);
    design_spectrum_free(&one);
}

/// The published problem: 0.858 Nm for every t, 0.902 Nm for limits at 2000 samples (reference/design.md, section 3).
static void test_bound_of_the_testbed(void)
{
    uint32_t all[200];
    struct design_spectrum testbed;
    for (uint32_t k = 0; k < 200; k++) {
        all[k] = k + 1;
    }
    request = (struct design_request){.rate_num_hz = 1000,
                                      .rate_den = 1,
                                      .period_samples = 2000,
                                      .bin_count = 200,
                                      .bins = all,
                                      .inertia_kgm2 = 0.00516,
                                      .limits = {.velocity_rad_per_s = 0.05 / 0.0159, .torque_Nm = 1}};
    TEST_ASSERT_TRUE(design_spectrum_create(&request, &testbed));
    double rms_Nm = 0.00516 * design_spectrum_rms(&testbed, design_acceleration);
    TEST_ASSERT_DOUBLE_WITHIN(0.0005, 0.858, rms_Nm * design_spectrum_scale_bound(&testbed, 0));
    TEST_ASSERT_DOUBLE_WITHIN(0.0005, 0.902, rms_Nm * design_spectrum_scale_bound(&testbed, 2000));
    design_spectrum_free(&testbed);
}

static void fill_random(double *values, size_t count, uint64_t seed)
{
    uint64_t state[4];
    sim_random_seed(state, seed);
    for (size_t i = 0; i < count; i++) {
        values[i] = sim_random_normal(state);
    }
}

/// Independent of the packing: the sum of cosines, differentiated by hand.
static void test_synthesise_equals_the_sum_of_cosines_and_its_derivatives(void)
{
    struct design_waveform waveform;
    double phase[lines];
    double c[2 * lines];
    TEST_ASSERT_TRUE(design_waveform_create(&spectrum, design_waveform_physical, grid, &waveform));
    double *packed = calloc(waveform.packed_length, sizeof *packed);
    fill_random(phase, lines, 3);
    for (size_t k = 0; k < lines; k++) {
        c[2 * k] = cos(phase[k]);
        c[2 * k + 1] = sin(phase[k]);
    }
    design_waveform_synthesise(&waveform, c, packed);
    for (size_t n = 0; n < grid; n++) {
        double q = 0;
        double v = 0;
        double a = 0;
        for (size_t k = 0; k < lines; k++) {
            double w = two_pi * bins[k];
            double angle = w * (double)n / grid + phase[k];
            q += spectrum.amplitude_rad[k] * cos(angle);
            v -= spectrum.amplitude_rad[k] * w * sin(angle);
            a -= spectrum.amplitude_rad[k] * w * w * cos(angle);
        }
        TEST_ASSERT_DOUBLE_WITHIN(rounding, q, packed[2 * n]);
        TEST_ASSERT_DOUBLE_WITHIN(100 * rounding, v, packed[2 * n + 1]);
        TEST_ASSERT_DOUBLE_WITHIN(1e4 * rounding, a, packed[2 * grid + 2 * n]);
        TEST_ASSERT_DOUBLE_WITHIN(1e4 * rounding, 0, packed[2 * grid + 2 * n + 1]);
    }
    free(packed);
    design_waveform_free(&waveform);
}

/// <x, G c> = Re <G' x, c> for any x and c: gather is the adjoint, which the descent's gradient rests on.
static void test_gather_is_the_adjoint_of_synthesise(void)
{
    struct design_waveform waveform;
    double c[2 * lines];
    double y[2 * lines];
    TEST_ASSERT_TRUE(design_waveform_create(&spectrum, design_waveform_physical, grid, &waveform));
    double *x = calloc(waveform.packed_length, sizeof *x);
    double *u = calloc(waveform.packed_length, sizeof *u);
    fill_random(x, waveform.packed_length, 4);
    fill_random(c, sizeof c / sizeof c[0], 5);
    design_waveform_synthesise(&waveform, c, u);
    design_waveform_gather(&waveform, x, y);
    double in_time = 0;
    double in_lines = 0;
    for (size_t i = 0; i < waveform.packed_length; i++) {
        in_time += x[i] * u[i];
    }
    for (size_t k = 0; k < sizeof c / sizeof c[0]; k++) {
        in_lines += y[k] * c[k];
    }
    TEST_ASSERT_DOUBLE_WITHIN(rounding * fabs(in_time), in_time, in_lines);
    free(x);
    free(u);
    design_waveform_free(&waveform);
}

/// Interleaved series are the same signals in another order, also where transforms are so short that lines fall onto
/// each other.
static void test_folded_waveform_is_the_same_in_another_order(void)
{
    struct design_waveform plain;
    double c[2 * lines];
    double y[2 * lines];
    double y_folded[2 * lines];
    TEST_ASSERT_TRUE(design_waveform_create(&spectrum, design_waveform_physical, grid, &plain));
    double *u = calloc(plain.packed_length, sizeof *u);
    fill_random(c, 2 * lines, 6);
    design_waveform_synthesise(&plain, c, u);
    design_waveform_gather(&plain, u, y);
    for (size_t fold = 2; fold <= 4; fold++) {
        struct design_waveform folded;
        TEST_ASSERT_TRUE(design_waveform_create_folded(&spectrum, design_waveform_physical, grid, fold, &folded));
        double *u_folded = calloc(folded.packed_length, sizeof *u_folded);
        design_waveform_synthesise(&folded, c, u_folded);
        for (size_t i = 0; i < 3 * fold; i++) {
            for (size_t n = 0; n < grid / fold; n++) {
                double expected = u[2 * grid * (i % 3 / 2) + 2 * (n * fold + i / 3) + i % 3 % 2];
                double got = u_folded[2 * (grid / fold) * (i / 2) + 2 * n + i % 2];
                TEST_ASSERT_DOUBLE_WITHIN(1e5 * rounding, expected, got);
            }
        }
        for (size_t signal = 0; signal < 3; signal++) {
            TEST_ASSERT_DOUBLE_WITHIN(1e5 * rounding, design_waveform_peak(&plain, u, signal),
                                      design_waveform_peak(&folded, u_folded, signal));
        }
        design_waveform_gather(&folded, u_folded, y_folded);
        for (size_t i = 0; i < 2 * lines; i++) {
            TEST_ASSERT_DOUBLE_WITHIN(rounding * fabs(y[i]) + rounding, y[i], y_folded[i]);
        }
        free(u_folded);
        design_waveform_free(&folded);
    }
    free(u);
    design_waveform_free(&plain);
}

/// From the definition, at bins beyond the lines too, and for one that is 0 and one beyond half the grid.
static void test_transform_is_that_of_each_signal(void)
{
    enum { bin_count = 70 };
    struct design_waveform folded;
    static double transform[3 * 2 * bin_count];
    TEST_ASSERT_TRUE(design_waveform_create_folded(&spectrum, design_waveform_physical, grid, 3, &folded));
    double *x = calloc(folded.packed_length, sizeof *x);
    fill_random(x, folded.packed_length, 7);
    design_waveform_transform(&folded, x, bin_count, transform);
    for (size_t signal = 0; signal < 3; signal++) {
        for (size_t b = 0; b < bin_count; b++) {
            double re = 0;
            double im = 0;
            for (size_t n = 0; n < grid; n++) {
                size_t i = n % 3 * 3 + signal;
                double value = x[2 * (grid / 3) * (i / 2) + 2 * (n / 3) + i % 2];
                re += value * cos(two_pi * (double)(b * n) / grid);
                im -= value * sin(two_pi * (double)(b * n) / grid);
            }
            TEST_ASSERT_DOUBLE_WITHIN(rounding, re, transform[2 * (signal * bin_count + b)]);
            TEST_ASSERT_DOUBLE_WITHIN(rounding, im, transform[2 * (signal * bin_count + b) + 1]);
        }
    }
    free(x);
    design_waveform_free(&folded);
}

static void test_waveform_leaves_out_a_signal_that_cannot_reach_its_limit(void)
{
    struct design_spectrum loose;
    struct design_waveform waveform;
    request.limits = (struct design_limits){.position_rad = 1000, .velocity_rad_per_s = 6, .torque_Nm = 2};
    TEST_ASSERT_TRUE(design_spectrum_create(&request, &loose));
    TEST_ASSERT_TRUE(design_waveform_create(&loose, design_waveform_limited, grid, &waveform));
    TEST_ASSERT_EQUAL_size_t(2, waveform.signal_count);
    TEST_ASSERT_EQUAL_INT(design_velocity, waveform.signals[0]);
    TEST_ASSERT_EQUAL_INT(design_acceleration, waveform.signals[1]);
    design_waveform_free(&waveform);
    design_spectrum_free(&loose);
}

static bool is_smooth(size_t length)
{
    const size_t primes[] = {2, 3, 5};
    for (size_t i = 0; i < 3; i++) {
        while (length % primes[i] == 0) {
            length /= primes[i];
        }
    }
    return length == 1;
}

static void test_smooth_length_is_the_least_one(void)
{
    for (size_t least = 1; least <= 5000; least++) {
        size_t expected = least;
        while (!is_smooth(expected)) {
            expected++;
        }
        TEST_ASSERT_EQUAL_size_t(expected, design_waveform_smooth_length(least));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_spectrum_each_line_alone_just_reaches_one_limit);
    RUN_TEST(test_bound_is_tight_for_one_line);
    RUN_TEST(test_bound_of_the_testbed);
    RUN_TEST(test_synthesise_equals_the_sum_of_cosines_and_its_derivatives);
    RUN_TEST(test_gather_is_the_adjoint_of_synthesise);
    RUN_TEST(test_folded_waveform_is_the_same_in_another_order);
    RUN_TEST(test_transform_is_that_of_each_signal);
    RUN_TEST(test_waveform_leaves_out_a_signal_that_cannot_reach_its_limit);
    RUN_TEST(test_smooth_length_is_the_least_one);
    return UNITY_END();
}
