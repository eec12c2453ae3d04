/* SPDX-License-Identifier: MIT */
#include "lab/numeric/fft.h"

#include "unity.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/resource.h>

static const double two_pi = 6.283185307179586476925;

/// Relative to the largest value: rounding of a transform, which for a large prime is a sum of that many terms.
static const double rounding = 2e-13;

/// Relative to the root mean square of the lines, the defining sum in long double: some 3e-15 are measured by chirp.
static const double rounding_of_chirp = 1e-13;

enum { longest = 2500 };

static double in[2 * longest], out[2 * longest], back[2 * longest];
static struct fft_plan *plan;

void setUp(void) {}

void tearDown(void)
{
    if (plan)
        fft_plan_destroy(plan);
    plan = NULL;
}

static void plan_for(size_t length)
{
    tearDown();
    plan = fft_plan_create(length);
    TEST_ASSERT_NOT_NULL(plan);
}

/// Powers of two and other primes, primes themselves, and lengths as recordings have them.
static const size_t lengths[] = {1,  2,  3,  4,   5,   6,   7,   8,   11,  13,   16,   17,   25,   32,   36,   49,
                                 60, 64, 97, 128, 208, 210, 343, 499, 625, 1000, 1009, 1024, 1155, 2044, 2457, 2500};
enum { length_count = sizeof lengths / sizeof lengths[0] };

static void fill(size_t n)
{
    for (size_t i = 0; i < n; i++) {
        in[2 * i] = sin(1.3 * (double)i) + (double)(i % 3);
        in[2 * i + 1] = cos(0.7 * (double)(i * i % 101));
    }
}

static void test_fft_forward_is_the_defining_sum(void)
{
    for (size_t l = 0; l < length_count; l++) {
        size_t n = lengths[l];
        plan_for(n);
        fill(n);
        fft_forward(plan, in, out);
        size_t stride = n / 40 + 1; // every bin of short transforms, some forty of long ones
        for (size_t k = 0; k < n; k += stride) {
            double re = 0.0, im = 0.0;
            for (size_t i = 0; i < n; i++) {
                double angle = -two_pi * (double)(k * i % n) / (double)n;
                re += in[2 * i] * cos(angle) - in[2 * i + 1] * sin(angle);
                im += in[2 * i] * sin(angle) + in[2 * i + 1] * cos(angle);
            }
            double tolerance = rounding * 3.0 * (double)n;
            TEST_ASSERT_DOUBLE_WITHIN(tolerance, re, out[2 * k]);
            TEST_ASSERT_DOUBLE_WITHIN(tolerance, im, out[2 * k + 1]);
        }
    }
}

/// Largest error of some lines over the root mean square of all.
static double error_of_transform(size_t n, const double *x, const double *lines)
{
    const long double turn = 6.283185307179586476925286766559L;
    double error = 0.0, power = 0.0;
    for (size_t k = 0; k < 2 * n; k++)
        power += lines[k] * lines[k];
    for (size_t k = 0; k < n; k += n / 11 + 1) {
        long double re = 0.0L, im = 0.0L;
        for (size_t i = 0; i < n; i++) {
            long double angle = -turn * (long double)((uint64_t)k * i % n) / (long double)n;
            re += x[2 * i] * cosl(angle) - x[2 * i + 1] * sinl(angle);
            im += x[2 * i] * sinl(angle) + x[2 * i + 1] * cosl(angle);
        }
        error = fmax(error, hypot(lines[2 * k] - (double)re, lines[2 * k + 1] - (double)im));
    }
    return error / sqrt(power / (double)n);
}

/// Primes, and products of large ones with small ones, two of which have lanes.
static void test_fft_of_lengths_with_a_large_prime_factor_is_exact(void)
{
    static const size_t large[] = {2003, 10007, 4 * 2503, 2 * 5003, 64 * 251, 4 * 113 * 25, 3 * 3323, 97 * 101, 131071};
    for (size_t l = 0; l < sizeof large / sizeof large[0]; l++) {
        size_t n = large[l];
        double *x = malloc(4 * n * sizeof *x), *lines = x + 2 * n;
        TEST_ASSERT_NOT_NULL(x);
        for (size_t i = 0; i < 2 * n; i++)
            x[i] = sin(1.3 * (double)i) + (double)(i * i % 101) / 101.0 - 0.5;
        plan_for(n);
        fft_forward(plan, x, lines);
        double forward = error_of_transform(n, x, lines);
        double back_error = 0.0;
        double *again = malloc(2 * n * sizeof *again);
        TEST_ASSERT_NOT_NULL(again);
        fft_inverse(plan, lines, again);
        for (size_t i = 0; i < 2 * n; i++)
            back_error = fmax(back_error, fabs(again[i] / (double)n - x[i]));
        free(again);
        free(x);
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(rounding_of_chirp, 0.0, forward, "forward");
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(rounding_of_chirp, 0.0, back_error, "inverse");
    }
}

static void test_fft_plan_of_an_impossible_length_is_null(void)
{
    TEST_ASSERT_NULL(fft_plan_create((size_t)1 << (sizeof(size_t) > 4 ? 33 : 31)));
    TEST_ASSERT_NULL(fft_plan_create(SIZE_MAX));
}

#ifndef __SANITIZE_ADDRESS__ /* whose own memory would run short, too */
/// A smooth length with lanes, a prime and a smooth length without.
static void test_fft_plan_is_null_where_memory_is_short(void)
{
    static const size_t large[] = {1 << 20, 1000003, 531441};
    for (size_t l = 0; l < sizeof large / sizeof large[0]; l++) {
        struct rlimit before, none = {.rlim_cur = 1 << 20};
        TEST_ASSERT_EQUAL_INT(0, getrlimit(RLIMIT_AS, &before));
        none.rlim_max = before.rlim_max;
        TEST_ASSERT_EQUAL_INT(0, setrlimit(RLIMIT_AS, &none));
        struct fft_plan *refused = fft_plan_create(large[l]);
        TEST_ASSERT_EQUAL_INT(0, setrlimit(RLIMIT_AS, &before));
        TEST_ASSERT_NULL(refused);
    }
}
#endif

static void test_fft_inverse_of_forward_is_the_input_times_the_length(void)
{
    for (size_t l = 0; l < length_count; l++) {
        size_t n = lengths[l];
        plan_for(n);
        fill(n);
        fft_forward(plan, in, out);
        fft_inverse(plan, out, back);
        for (size_t i = 0; i < 2 * n; i++)
            TEST_ASSERT_DOUBLE_WITHIN(rounding * 4.0, in[i], back[i] / (double)n);
    }
}

static void test_fft_keeps_the_energy(void)
{
    for (size_t l = 0; l < length_count; l++) {
        size_t n = lengths[l];
        double time = 0.0, frequency = 0.0;
        plan_for(n);
        fill(n);
        fft_forward(plan, in, out);
        for (size_t i = 0; i < 2 * n; i++) {
            time += in[i] * in[i];
            frequency += out[i] * out[i] / (double)n;
        }
        TEST_ASSERT_DOUBLE_WITHIN(rounding * time, time, frequency);
    }
}

static void test_fft_of_a_late_pulse_turns_by_its_delay(void)
{
    const size_t n = 97, delay = 5;
    plan_for(n);
    for (size_t i = 0; i < 2 * n; i++)
        in[i] = i == 2 * delay ? 1.0 : 0.0;
    fft_forward(plan, in, out);
    for (size_t k = 0; k < n; k++) {
        double angle = -two_pi * (double)(k * delay % n) / (double)n;
        TEST_ASSERT_DOUBLE_WITHIN(rounding, cos(angle), out[2 * k]);
        TEST_ASSERT_DOUBLE_WITHIN(rounding, sin(angle), out[2 * k + 1]);
    }
}

static void test_fft_of_a_cosine_is_two_lines_of_half_its_height(void)
{
    const size_t n = 1000, line = 37;
    const double height = 3.0, phase = 0.4;
    plan_for(n);
    for (size_t i = 0; i < n; i++) {
        in[2 * i] = height * cos(two_pi * (double)(line * i % n) / (double)n + phase);
        in[2 * i + 1] = 0.0;
    }
    fft_forward(plan, in, out);
    for (size_t k = 0; k < n; k++) {
        double half = k == line || k == n - line ? 0.5 * height * (double)n : 0.0;
        double angle = k == line ? phase : -phase;
        TEST_ASSERT_DOUBLE_WITHIN(rounding * height * (double)n, half * cos(angle), out[2 * k]);
        TEST_ASSERT_DOUBLE_WITHIN(rounding * height * (double)n, half * sin(angle), out[2 * k + 1]);
    }
}

static void test_fft_of_a_pair_is_that_of_both_scaled_signals(void)
{
    for (size_t l = 0; l < length_count; l++) {
        size_t n = lengths[l];
        plan_for(n);
        fill(n);
        double *first = malloc(2 * n * sizeof *first), *second = first + n;
        TEST_ASSERT_NOT_NULL(first);
        for (size_t i = 0; i < n; i++) {
            first[i] = in[2 * i];
            second[i] = in[2 * i + 1];
            in[2 * i] *= 2.0;
            in[2 * i + 1] *= -0.5;
        }
        fft_forward(plan, in, out);
        fft_forward_pair(plan, first, 2.0, second, -0.5, back);
        TEST_ASSERT_EQUAL_MEMORY(out, back, 2 * n * sizeof out[0]);
        free(first);
    }
}

static void test_fft_leaves_its_input(void)
{
    plan_for(60);
    fill(60);
    for (size_t i = 0; i < 120; i++)
        back[i] = in[i];
    fft_forward(plan, in, out);
    fft_inverse(plan, in, out);
    TEST_ASSERT_EQUAL_MEMORY(back, in, 120 * sizeof in[0]);
}

/// The sanitizers do not look into the transform's inner loops, so the borders of its output are guarded here.
static void test_fft_writes_nothing_beside_its_output(void)
{
    enum { border = 64 };
    static double guarded[2 * longest + 2 * border];
    const double mark = -8.25e99;
    for (size_t l = 0; l < length_count; l++) {
        size_t n = lengths[l];
        plan_for(n);
        fill(n);
        for (size_t i = 0; i < 2 * n + 2 * border; i++) {
            guarded[i] = mark;
        }
        fft_forward(plan, in, guarded + border);
        fft_inverse(plan, in, guarded + border);
        for (size_t i = 0; i < border; i++) {
            TEST_ASSERT_TRUE(guarded[i] <= mark && guarded[i] >= mark);
            TEST_ASSERT_TRUE(guarded[border + 2 * n + i] <= mark && guarded[border + 2 * n + i] >= mark);
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_fft_forward_is_the_defining_sum);
    RUN_TEST(test_fft_of_lengths_with_a_large_prime_factor_is_exact);
    RUN_TEST(test_fft_plan_of_an_impossible_length_is_null);
#ifndef __SANITIZE_ADDRESS__
    RUN_TEST(test_fft_plan_is_null_where_memory_is_short);
#endif
    RUN_TEST(test_fft_inverse_of_forward_is_the_input_times_the_length);
    RUN_TEST(test_fft_keeps_the_energy);
    RUN_TEST(test_fft_of_a_late_pulse_turns_by_its_delay);
    RUN_TEST(test_fft_of_a_cosine_is_two_lines_of_half_its_height);
    RUN_TEST(test_fft_of_a_pair_is_that_of_both_scaled_signals);
    RUN_TEST(test_fft_leaves_its_input);
    RUN_TEST(test_fft_writes_nothing_beside_its_output);
    return UNITY_END();
}
