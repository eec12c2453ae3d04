/* SPDX-License-Identifier: MIT */
#include "lab/estimate/lpm_window.h"

#include "unity.h"

#include <math.h>

/// Rounding of sums of a dozen numbers of size 1.
static const double rounding = 1e-13;

void setUp(void) {}

void tearDown(void) {}

/// Distances of two periods: every second line is excited.
static void odd_distances(struct lpm_window *window)
{
    for (size_t i = 0; i < window->lines; i++) {
        long step = (long)(i / 2);
        window->offsets[i] = i % 2 ? -(2 * step + 1) : 2 * step + 1;
    }
}

static void test_lpm_window_has_the_leverage_of_the_third_paper(void)
{
    struct lpm_window window;
    TEST_ASSERT_TRUE(lpm_window_alloc(12, 2, &window));
    odd_distances(&window);
    TEST_ASSERT_TRUE(lpm_window_prepare(&window));
    /* 1 + [(K^H K)^-1]_00 = 1.18973 for R = 2, n = 6, P = 2: 1/12 of a constant, the rest from the parabola. */
    TEST_ASSERT_DOUBLE_WITHIN(5e-6, 0.18973, window.leverage);
    lpm_window_free(&window);
}

static void test_lpm_window_passes_every_polynomial_of_its_order(void)
{
    struct lpm_window window;
    TEST_ASSERT_TRUE(lpm_window_alloc(14, 4, &window));
    odd_distances(&window);
    TEST_ASSERT_TRUE(lpm_window_prepare(&window));
    double complex spectrum[31];
    double complex residual[14];
    for (long r = -15; r <= 15; r++) {
        double x = (double)r / 15.0;
        spectrum[15 + r] = (0.7 - 0.2 * I) + (1.0 + 2.0 * I) * x - 3.0 * x * x + I * x * x * x + 0.5 * pow(x, 4.0);
    }
    /* The line itself is left out: whatever is there must not count. */
    spectrum[15] = 1e6;
    double complex value = lpm_window_fit(&window, spectrum + 15, residual);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 0.7, creal(value));
    TEST_ASSERT_DOUBLE_WITHIN(rounding, -0.2, cimag(value));
    for (size_t i = 0; i < 14; i++) {
        TEST_ASSERT_TRUE(cabs(residual[i]) < rounding);
    }
    lpm_window_free(&window);
}

/// What the fit leaves is orthogonal to every power of the distance.
static void test_lpm_window_residual_holds_no_polynomial(void)
{
    struct lpm_window window;
    TEST_ASSERT_TRUE(lpm_window_alloc(10, 2, &window));
    odd_distances(&window);
    TEST_ASSERT_TRUE(lpm_window_prepare(&window));
    double complex spectrum[19];
    double complex residual[10];
    for (int i = 0; i < 19; i++) {
        spectrum[i] = cexp(I * 0.37 * i * i);
    }
    (void)lpm_window_fit(&window, spectrum + 9, residual);
    for (int s = 0; s <= 2; s++) {
        double complex product = 0.0;
        for (size_t i = 0; i < 10; i++) {
            product += residual[i] * pow((double)window.offsets[i] / 9.0, s);
        }
        TEST_ASSERT_TRUE(cabs(product) < rounding);
    }
    lpm_window_free(&window);
}

static void test_lpm_window_refuses_lines_that_do_not_determine_it(void)
{
    struct lpm_window window;
    TEST_ASSERT_TRUE(lpm_window_alloc(4, 2, &window));
    const long distances[] = {1, -1, 1, -1};
    for (size_t i = 0; i < 4; i++) {
        window.offsets[i] = distances[i];
    }
    TEST_ASSERT_FALSE(lpm_window_prepare(&window));
    lpm_window_free(&window);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_lpm_window_has_the_leverage_of_the_third_paper);
    RUN_TEST(test_lpm_window_passes_every_polynomial_of_its_order);
    RUN_TEST(test_lpm_window_residual_holds_no_polynomial);
    RUN_TEST(test_lpm_window_refuses_lines_that_do_not_determine_it);
    return UNITY_END();
}
