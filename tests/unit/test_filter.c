/* SPDX-License-Identifier: MIT */
#include "lab/numeric/filter.h"

#include "unity.h"

#include <complex.h>
#include <math.h>
#include <string.h>

static const double pi = 3.14159265358979324;
/// Of the gain: rounding of up to eight sections whose poles lie within a twentieth of the unit circle.
static const double gain_tolerance = 1e-10;

enum { samples = 4000, edge = 1200 };

static double signal[samples];

void setUp(void) {}

void tearDown(void) {}

/// Response of the sections to exp(j pi f n), f in units of half the sample rate.
static double complex response(const struct filter *filter, double f)
{
    double complex delay = cexp(-I * pi * f), product = 1.0;
    for (size_t i = 0; i < filter->sections; i++) {
        const double *b = filter->b[i], *a = filter->a[i];
        product *= (b[0] + b[1] * delay + b[2] * delay * delay) / (1.0 + a[0] * delay + a[1] * delay * delay);
    }
    return product;
}

/// Frequency of the analogue prototype, pass band edge at 1, that the bilinear transform maps to f.
static double warped(double f, double cutoff)
{
    return tan(pi * f / 2.0) / tan(pi * cutoff / 2.0);
}

static double butterworth_power(size_t order, double f, double cutoff)
{
    return 1.0 / (1.0 + pow(warped(f, cutoff), 2.0 * (double)order));
}

static double chebyshev_power(size_t order, double ripple_db, double f, double cutoff)
{
    double x = warped(f, cutoff), n = (double)order;
    double polynomial = x <= 1.0 ? cos(n * acos(x)) : cosh(n * acosh(x));
    return 1.0 / (1.0 + (pow(10.0, ripple_db / 10.0) - 1.0) * polynomial * polynomial);
}

static void test_filter_butterworth_has_the_analytic_magnitude(void)
{
    static const double cutoffs[] = {0.01, 0.2, 0.5, 0.9};
    for (size_t order = 2; order <= 16; order += 2)
        for (size_t c = 0; c < sizeof cutoffs / sizeof cutoffs[0]; c++) {
            if (order > 8 && cutoffs[c] < 0.1)
                continue; // poles of 16th order at a hundredth of the band lose more digits than the tolerance has
            struct filter filter = filter_butterworth(order, cutoffs[c]);
            TEST_ASSERT_EQUAL_UINT(order / 2, filter.sections);
            for (double f = 0.0; f < 0.99; f += 0.0123) {
                double expected = sqrt(butterworth_power(order, f, cutoffs[c]));
                TEST_ASSERT_DOUBLE_WITHIN(gain_tolerance, expected, cabs(response(&filter, f)));
            }
            TEST_ASSERT_DOUBLE_WITHIN(gain_tolerance, sqrt(0.5), cabs(response(&filter, cutoffs[c])));
        }
}

static void test_filter_chebyshev_has_the_analytic_magnitude(void)
{
    static const double ripples_db[] = {0.05, 1.0, 3.0};
    for (size_t order = 2; order <= 12; order += 2)
        for (size_t r = 0; r < sizeof ripples_db / sizeof ripples_db[0]; r++) {
            struct filter filter = filter_chebyshev(order, ripples_db[r], 0.3);
            for (double f = 0.0; f < 0.99; f += 0.0077) {
                double expected = sqrt(chebyshev_power(order, ripples_db[r], f, 0.3));
                TEST_ASSERT_DOUBLE_WITHIN(gain_tolerance, expected, cabs(response(&filter, f)));
            }
            double at_dc = pow(10.0, -ripples_db[r] / 20.0);
            TEST_ASSERT_DOUBLE_WITHIN(gain_tolerance, at_dc, cabs(response(&filter, 0.0)));
            TEST_ASSERT_DOUBLE_WITHIN(gain_tolerance, at_dc, cabs(response(&filter, 0.3)));
        }
}

static void test_filter_sections_are_stable(void)
{
    // Inside the stability triangle, for the cut-offs that are used and extremes of them.
    for (double cutoff = 1e-3; cutoff < 0.999; cutoff += 0.0471) {
        struct filter filters[] = {filter_butterworth(16, cutoff), filter_chebyshev(16, 0.05, cutoff)};
        for (size_t k = 0; k < 2; k++)
            for (size_t i = 0; i < filters[k].sections; i++) {
                const double *a = filters[k].a[i];
                TEST_ASSERT_TRUE(fabs(a[1]) < 1.0);
                TEST_ASSERT_TRUE(fabs(a[0]) < 1.0 + a[1]);
            }
    }
}

/// Away from the ends a sinusoid comes out with the power gain and the phase it went in with.
static void assert_zero_phase(const struct filter *filter, double f, double power)
{
    // What the sections remember of the start has decayed to nothing after `edge` samples.
    const double forgotten = 1e-9;
    const double phase = 0.7;
    for (size_t n = 0; n < samples; n++)
        signal[n] = cos(pi * f * (double)n + phase);
    TEST_ASSERT_TRUE(filter_zero_phase(filter, samples, signal));
    for (size_t n = edge; n < samples - edge; n++)
        TEST_ASSERT_DOUBLE_WITHIN(forgotten, power * cos(pi * f * (double)n + phase), signal[n]);
}

static void test_filter_zero_phase_squares_the_gain_and_shifts_nothing(void)
{
    struct filter butterworth = filter_butterworth(4, 0.2), chebyshev = filter_chebyshev(8, 0.05, 0.08);
    static const double frequencies[] = {0.003, 0.02, 0.05, 0.079, 0.1, 0.2, 0.35, 0.8};
    for (size_t i = 0; i < sizeof frequencies / sizeof frequencies[0]; i++) {
        double f = frequencies[i];
        assert_zero_phase(&butterworth, f, butterworth_power(4, f, 0.2));
        assert_zero_phase(&chebyshev, f, chebyshev_power(8, 0.05, f, 0.08));
    }
}

static void test_filter_zero_phase_keeps_a_constant_from_the_first_sample_on(void)
{
    struct filter butterworth = filter_butterworth(6, 0.1), chebyshev = filter_chebyshev(8, 1.0, 0.1);
    for (size_t n = 0; n < samples; n++)
        signal[n] = -3.25;
    TEST_ASSERT_TRUE(filter_zero_phase(&butterworth, samples, signal));
    for (size_t n = 0; n < samples; n++)
        TEST_ASSERT_DOUBLE_WITHIN(gain_tolerance, -3.25, signal[n]);
    TEST_ASSERT_TRUE(filter_zero_phase(&chebyshev, samples, signal));
    for (size_t n = 0; n < samples; n++)
        TEST_ASSERT_DOUBLE_WITHIN(gain_tolerance, -3.25 * pow(10.0, -0.1), signal[n]);
}

/// Plain filtering of the extended signal, written the slow way: the difference equation of each section.
static void reference_zero_phase(const struct filter *filter, size_t n, size_t pad, const double *x, double *out)
{
    static double wide[2][256];
    size_t length = n + 2 * pad;
    for (size_t i = 0; i < length; i++)
        wide[0][i] = i < pad        ? 2.0 * x[0] - x[pad - i]
                     : i >= pad + n ? 2.0 * x[n - 1] - x[2 * n + pad - 2 - i]
                                    : x[i - pad];
    for (size_t pass = 0; pass < 2 * filter->sections; pass++) {
        const double *b = filter->b[pass % filter->sections], *a = filter->a[pass % filter->sections];
        bool backward = pass >= filter->sections;
        double first = wide[0][backward ? length - 1 : 0];
        double steady = first * (b[0] + b[1] + b[2]) / (1.0 + a[0] + a[1]);
        double x1 = first, x2 = first, y1 = steady, y2 = steady;
        for (size_t i = 0; i < length; i++) {
            size_t at = backward ? length - 1 - i : i;
            double y = b[0] * wide[0][at] + b[1] * x1 + b[2] * x2 - a[0] * y1 - a[1] * y2;
            x2 = x1;
            x1 = wide[0][at];
            y2 = y1;
            y1 = y;
            wide[1][at] = y;
        }
        memcpy(wide[0], wide[1], sizeof wide[0]);
    }
    memcpy(out, wide[0] + pad, n * sizeof *out);
}

static void test_filter_zero_phase_treats_the_ends_like_the_difference_equation_of_the_extended_signal(void)
{
    enum { length = 60 };
    double x[length], expected[length];
    struct filter filter = filter_butterworth(4, 0.2);
    for (size_t i = 0; i < length; i++)
        x[i] = sin(0.3 * (double)i) + 0.02 * (double)(i * i % 17);
    reference_zero_phase(&filter, length, 12, x, expected);
    TEST_ASSERT_TRUE(filter_zero_phase(&filter, length, x));
    for (size_t i = 0; i < length; i++)
        TEST_ASSERT_DOUBLE_WITHIN(gain_tolerance, expected[i], x[i]);
}

static void test_filter_zero_phase_refuses_signals_shorter_than_its_reach_and_leaves_them(void)
{
    struct filter filter = filter_butterworth(4, 0.2);
    double x[13];
    for (size_t i = 0; i < 13; i++)
        x[i] = (double)(i * i);
    for (size_t n = 0; n <= 12; n++) {
        TEST_ASSERT_FALSE(filter_zero_phase(&filter, n, x));
        for (size_t i = 0; i < 13; i++)
            TEST_ASSERT_EQUAL_DOUBLE((double)(i * i), x[i]);
    }
    TEST_ASSERT_TRUE(filter_zero_phase(&filter, 13, x));
    TEST_ASSERT_TRUE(x[12] != 144.0 || x[6] != 36.0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_filter_butterworth_has_the_analytic_magnitude);
    RUN_TEST(test_filter_chebyshev_has_the_analytic_magnitude);
    RUN_TEST(test_filter_sections_are_stable);
    RUN_TEST(test_filter_zero_phase_squares_the_gain_and_shifts_nothing);
    RUN_TEST(test_filter_zero_phase_keeps_a_constant_from_the_first_sample_on);
    RUN_TEST(test_filter_zero_phase_treats_the_ends_like_the_difference_equation_of_the_extended_signal);
    RUN_TEST(test_filter_zero_phase_refuses_signals_shorter_than_its_reach_and_leaves_them);
    return UNITY_END();
}
