/* SPDX-License-Identifier: MIT */
/// Margins of loops whose margins are known in closed form.
#include "lab/tune/margins.h"
#include "unity.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

enum { lines = 4000 };

static const double two_pi = 6.283185307179586;
/// Lines are .1 % apart; between them log |L| and phase are taken as straight.
static const double tolerance = 1e-3;

static double frequency_hz[lines];
static double complex loop[lines];
static struct margins margins;

void setUp(void) {}

void tearDown(void) {}

/// An integrator with unity gain at 20 Hz, raised to a power, and a delay.
static void take(double gain, double power, double delay_s)
{
    for (size_t k = 0; k < lines; k++) {
        frequency_hz[k] = 5.0 * pow(1.001, (double)k);
        loop[k] = gain * cpow(20.0 / (I * frequency_hz[k]), power) * cexp(-I * two_pi * frequency_hz[k] * delay_s);
    }
    margins_find(lines, frequency_hz, loop, &margins);
}

static void near(double expected, double actual)
{
    TEST_ASSERT_DOUBLE_WITHIN(tolerance * fabs(expected), expected, actual);
}

/// L = w/s exp(-s T): phase margin 90 degrees - w T, -180 degrees at f = 1/(4 T).
static void test_tune_margins_of_an_integrator_with_delay(void)
{
    const double delay_s = 0.004;
    take(1.0, 1.0, delay_s);
    near(20.0, margins.crossover_hz);
    near(20.0, margins.phase_hz);
    near(90.0 - 360.0 * 20.0 * delay_s, margins.phase_deg);
    near(margins.phase_deg / 360.0 / 20.0, margins.delay_s);
    near(0.25 / delay_s, margins.gain_hz);
    near(20.0 * log10(0.25 / delay_s / 20.0), margins.gain_db);
    TEST_ASSERT_TRUE(isnan(margins.gain_reduction_db));
    double worst = 0.0;
    for (size_t k = 0; k < lines; k++)
        worst = fmax(worst, 1.0 / cabs(1.0 + loop[k]));
    TEST_ASSERT_EQUAL_DOUBLE(worst, margins.modulus);
}

/// Without delay T = 1/(1 + j f/20): -3 dB at 20 Hz, no gain margin, |S| never above 1.
static void test_tune_margins_of_an_integrator(void)
{
    take(1.0, 1.0, 0.0);
    near(20.0, margins.cutoff_hz);
    near(20.0, margins.last_cutoff_hz);
    near(90.0, margins.phase_deg);
    TEST_ASSERT_TRUE(isnan(margins.gain_db) && isnan(margins.gain_hz));
    TEST_ASSERT_TRUE(margins.modulus <= 1.0);
}

/// L = (1 + j f/10)^2 (10/(j f))^3: below 10 Hz beyond -180 degrees, so that less gain makes it unstable.
static void test_tune_margins_of_a_loop_that_needs_its_gain(void)
{
    for (size_t k = 0; k < lines; k++) {
        frequency_hz[k] = 1.0 * pow(1.001, (double)k);
        loop[k] = 4.0 * cpow(1.0 + I * frequency_hz[k] / 10.0, 2.0) * cpow(10.0 / (I * frequency_hz[k]), 3.0);
    }
    margins_find(lines, frequency_hz, loop, &margins);
    // arg L = -270 + 2 atan(f/10): -180 degrees at 10 Hz, where |L| = 4 * 2.
    near(10.0, margins.gain_reduction_hz);
    near(-20.0 * log10(8.0), margins.gain_reduction_db);
    TEST_ASSERT_TRUE(isnan(margins.gain_db));
}

/// L = 20 Hz/(j f) exp(-j w T) crosses 1 at 20 Hz and -180 degrees at 62.5 Hz: where lines are missing there, nothing
/// is drawn across.
static void test_tune_margins_are_not_interpolated_across_a_gap(void)
{
    static const struct {
        double low_hz, high_hz;
        bool crossover, gain;
    } cases[] = {{15.0, 25.0, false, true}, {16.0, 24.0, true, true}, {50.0, 90.0, true, false}};
    const double delay_s = 0.004;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        size_t count = 0;
        for (double f = 5.0; f < 150.0; f *= 1.01) {
            if (f > cases[i].low_hz && f < cases[i].high_hz)
                continue;
            frequency_hz[count] = f;
            loop[count++] = 20.0 / (I * f) * cexp(-I * two_pi * f * delay_s);
        }
        margins_find(count, frequency_hz, loop, &margins);
        TEST_ASSERT_EQUAL(cases[i].crossover, !isnan(margins.crossover_hz));
        TEST_ASSERT_EQUAL(cases[i].crossover, !isnan(margins.phase_deg));
        TEST_ASSERT_EQUAL(cases[i].gain, !isnan(margins.gain_db));
    }
}

/// Nothing crosses on these lines: numbers that are not there are not made up.
static void test_tune_margins_are_unknown_where_lines_do_not_show_them(void)
{
    take(1e-3, 1.0, 0.0);
    TEST_ASSERT_TRUE(isnan(margins.phase_deg) && isnan(margins.crossover_hz) && isnan(margins.cutoff_hz));
    TEST_ASSERT_TRUE(isnan(margins.delay_s) && isnan(margins.gain_db));
    TEST_ASSERT_TRUE(margins.modulus > 0.99);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_tune_margins_of_an_integrator_with_delay);
    RUN_TEST(test_tune_margins_of_an_integrator);
    RUN_TEST(test_tune_margins_of_a_loop_that_needs_its_gain);
    RUN_TEST(test_tune_margins_are_not_interpolated_across_a_gap);
    RUN_TEST(test_tune_margins_are_unknown_where_lines_do_not_show_them);
    return UNITY_END();
}
