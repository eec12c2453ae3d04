/* SPDX-License-Identifier: MIT */
/// The parts of a loop that are known exactly: controller terms, filter, reference; in time against in frequency.
#include "lab/tune/controller.h"
#include "lab/tune/reference.h"
#include "unity.h"

#include <math.h>
#include <string.h>

static const double two_pi = 6.283185307179586;
static const double rate_hz = 2000.0;
static const double rounding = 1e-12;

void setUp(void) {}

void tearDown(void) {}

static double complex delay_at(double frequency_hz)
{
    return cexp(-I * two_pi * frequency_hz / rate_hz);
}

static struct tune_controller controller_of(const char *name)
{
    struct error error;
    return (struct tune_controller){.structure = tune_structure_find(name, &error), .rate_hz = rate_hz};
}

static void equal(double complex expected, double complex actual)
{
    TEST_ASSERT_DOUBLE_WITHIN(rounding * (1.0 + cabs(expected)), creal(expected), creal(actual));
    TEST_ASSERT_DOUBLE_WITHIN(rounding * (1.0 + cabs(expected)), cimag(expected), cimag(actual));
}

/// Response of e[n] = cos(w n Ts) through a difference equation, as a complex number, after it has settled.
static void test_tune_controller_pid_is_its_difference_equation(void)
{
    enum { settle = 4000, period = 40 };
    struct tune_controller pid = controller_of("pid");
    const double f = rate_hz / period, a = exp(-two_pi * 300.0 / rate_hz);
    double complex seen = 0.0;
    double derivative = 0.0, before = 1.0, sum = 0.0, mean = 0.0;
    pid.corner_hz = 300.0;
    pid.gain[0] = 2.0;
    pid.gain[1] = 50.0;
    pid.gain[2] = 0.003;
    for (int n = 0; n < settle + period; n++) {
        const double e = cos(two_pi * n / period);
        sum += e;
        derivative = a * derivative + (1.0 - a) * (e - before) * rate_hz;
        before = e;
        const double u = pid.gain[0] * e + pid.gain[1] * sum / rate_hz + pid.gain[2] * derivative;
        if (n >= settle) {
            seen += 2.0 / period * u * cexp(-I * two_pi * n / period);
            mean += u / period; // what the integral keeps of its start
        }
    }
    TEST_ASSERT_TRUE(fabs(mean) < 10.0);
    const double complex expected = tune_controller_at(&pid, delay_at(f));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9 * cabs(expected), 0.0, cabs(seen - expected));
}

static void test_tune_controller_lists_its_structures(void)
{
    static const char *const names[] = {"p", "pi", "pid", "lead", "pi+notch", "pi+biquad"};
    struct error error = {0};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        TEST_ASSERT_NOT_NULL_MESSAGE(tune_structure_find(names[i], &error), names[i]);
    TEST_ASSERT_NULL(tune_structure_find("pd", &error));
    TEST_ASSERT_EQUAL_INT(error_usage, error.status);
    TEST_ASSERT_NOT_NULL(strstr(error.message, "p, pi, pid, lead, pi+notch, pi+biquad"));
}

static void test_tune_filter_is_the_analog_one_at_its_frequencies(void)
{
    struct tune_filter notch = {.zero_hz = 150.0, .zero_damping = 0.02, .pole_hz = 150.0, .pole_damping = 0.4};
    TEST_ASSERT_TRUE(tune_filter_make(&notch, rate_hz));
    equal(1.0, tune_filter_at(&notch, delay_at(0.0)));
    equal(0.02 / 0.4, tune_filter_at(&notch, delay_at(150.0)));
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 1.0, notch.a[0]);

    struct tune_filter biquad = {.zero_hz = 150.0, .zero_damping = 0.02, .pole_hz = 90.0, .pole_damping = 0.3};
    TEST_ASSERT_TRUE(tune_filter_make(&biquad, rate_hz));
    // At the zeros' frequency the numerator is exactly 2 j damping; over the denominator warped by its own frequency.
    const double warped = tan(0.5 * two_pi * 150.0 / rate_hz) / tan(0.5 * two_pi * 90.0 / rate_hz);
    equal(2.0 * I * 0.02 / (1.0 - warped * warped + 2.0 * I * 0.3 * warped), tune_filter_at(&biquad, delay_at(150.0)));
}

static void test_tune_filter_refuses_what_cannot_be(void)
{
    const struct tune_filter good = {.zero_hz = 150.0, .zero_damping = 0.02, .pole_hz = 90.0, .pole_damping = 0.3};
    const double bad_hz[] = {0.0, -1.0, 1000.0, NAN, INFINITY}, bad_damping[] = {0.0, -0.1, NAN, INFINITY};
    for (size_t i = 0; i < sizeof bad_hz / sizeof *bad_hz; i++) {
        struct tune_filter zero = good, pole = good;
        zero.zero_hz = pole.pole_hz = bad_hz[i];
        TEST_ASSERT_FALSE(tune_filter_make(&zero, rate_hz) || tune_filter_make(&pole, rate_hz));
        TEST_ASSERT_FALSE(zero.on || pole.on);
    }
    for (size_t i = 0; i < sizeof bad_damping / sizeof *bad_damping; i++) {
        struct tune_filter zero = good, pole = good;
        zero.zero_damping = pole.pole_damping = bad_damping[i];
        TEST_ASSERT_FALSE(tune_filter_make(&zero, rate_hz) || tune_filter_make(&pole, rate_hz));
    }
}

/// M's step response, sampled: its transform is M(z)/(1 - q). Integrated here by many small steps, for each damping.
static void test_tune_reference_is_the_sampled_system(void)
{
    enum { substeps = 200, samples = 3000 };
    static const double dampings[] = {0.3, 0.9, 1.0, 1.7};
    const double integration = 1e-5; // of the midpoint rule with 200 steps a sample
    for (size_t d = 0; d < sizeof dampings / sizeof *dampings; d++) {
        const struct tune_reference reference = {30.0, dampings[d], 1.0, rate_hz};
        const double w = two_pi * reference.bandwidth_hz, f = 45.0, h = 1.0 / rate_hz / substeps;
        const double complex q = delay_at(f);
        double complex sum = 0.0, power = 1.0;
        double x = 0.0, v = 0.0; // x'' + 2 d w x' + w^2 x = 1, y = 2 d w x' + w^2 x
        for (int n = 0; n < samples; n++) {
            sum += power * (2.0 * dampings[d] * w * v + w * w * x - 1.0);
            power *= q;
            for (int s = 0; s < substeps; s++) {
                const double middle_x = x + 0.5 * h * v;
                const double middle_v = v + 0.5 * h * (1.0 - 2.0 * dampings[d] * w * v - w * w * x);
                x += h * middle_v;
                v += h * (1.0 - 2.0 * dampings[d] * w * middle_v - w * w * middle_x);
            }
        }
        const double complex expected = q * ((1.0 - q) * sum + 1.0);
        const double complex actual = tune_reference_at(&reference, f);
        TEST_ASSERT_DOUBLE_WITHIN(integration, 0.0, cabs(actual - expected));
        equal(1.0, tune_reference_at(&reference, 0.0));
    }
}

static void test_tune_reference_finds_its_cutoff(void)
{
    const struct tune_reference slow = {30.0, 0.9, 1.0, 20000.0}, fast = {450.0, 0.9, 0.0, 2000.0};
    const double cutoff_hz = tune_reference_cutoff_hz(&slow);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, sqrt(0.5), cabs(tune_reference_at(&slow, cutoff_hz)));
    // Of the continuous system: |M|^2 = 1/2 is a quadratic in (f/f0)^2. The hold takes off a little.
    const double b = 4.0 * 0.81 + 2.0, exact_hz = 30.0 * sqrt(0.5 * (b + sqrt(b * b + 4.0)));
    TEST_ASSERT_DOUBLE_WITHIN(0.01 * exact_hz, exact_hz, cutoff_hz);
    TEST_ASSERT_TRUE(isnan(tune_reference_cutoff_hz(&fast)));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_tune_controller_pid_is_its_difference_equation);
    RUN_TEST(test_tune_controller_lists_its_structures);
    RUN_TEST(test_tune_filter_is_the_analog_one_at_its_frequencies);
    RUN_TEST(test_tune_filter_refuses_what_cannot_be);
    RUN_TEST(test_tune_reference_is_the_sampled_system);
    RUN_TEST(test_tune_reference_finds_its_cutoff);
    return UNITY_END();
}
