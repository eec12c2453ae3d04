/* SPDX-License-Identifier: MIT */
/// Value, gradient and second derivatives of the p-norm, and the two descents on it: lab/design/{norm,newton,polish}.h.
#include "lab/design/newton.h"
#include "lab/design/norm.h"
#include "lab/design/phases.h"
#include "lab/design/polish.h"

#include "sim/random.h"
#include "unity.h"

#include <math.h>
#include <stdlib.h>

/// Central differences of 1e-6 of a function whose third derivatives are about 10.
static const double of_differences = 1e-8;
static const double difference = 1e-6;
static const double rounding = 1e-12;

enum { lines = 14, period = 120, variables_max = 2 * lines };

static const uint32_t bins[lines] = {1, 2, 3, 5, 6, 8, 9, 12, 13, 17, 18, 19, 25, 31};
static struct design_request request;
static struct design_spectrum spectrum;
static struct design_search search;
static double x[variables_max];

void setUp(void)
{
    request = (struct design_request){.rate_num_hz = 1000,
                                      .rate_den = 1,
                                      .period_samples = period,
                                      .bin_count = lines,
                                      .bins = bins,
                                      .inertia_kgm2 = 0.005,
                                      .limits = {.position_rad = 0.02, .velocity_rad_per_s = 1.5, .torque_Nm = 1}};
}

static void create(double tolerance_db, size_t fold)
{
    uint64_t state[4];
    request.amplitude_tolerance_db = tolerance_db;
    TEST_ASSERT_TRUE(design_spectrum_create(&request, &spectrum));
    TEST_ASSERT_TRUE(design_search_create_on(&request, &spectrum, period, fold, &search));
    TEST_ASSERT_EQUAL_size_t(3, search.waveform.signal_count);
    sim_random_seed(state, 5);
    for (size_t i = 0; i < variables_max; i++) {
        x[i] = sim_random_normal(state);
    }
}

static void destroy(void)
{
    design_search_free(&search);
    design_spectrum_free(&spectrum);
}

void tearDown(void) {}

static void assert_derivatives(double tolerance_db, size_t fold)
{
    struct design_norm norm;
    double gradient[variables_max];
    double above[variables_max];
    double below[variables_max];
    double matrix[variables_max * variables_max];
    create(tolerance_db, fold);
    TEST_ASSERT_TRUE(design_norm_create(&search, true, &norm));
    norm.exponent = 4;
    design_norm_evaluate(&norm, x, gradient);
    design_norm_find_curvature(&norm, x, gradient, matrix);
    for (size_t i = 0; i < norm.variables; i++) {
        double here = x[i];
        x[i] = here + difference;
        double value_above = design_norm_evaluate(&norm, x, above);
        x[i] = here - difference;
        double value_below = design_norm_evaluate(&norm, x, below);
        x[i] = here;
        TEST_ASSERT_DOUBLE_WITHIN(of_differences, (value_above - value_below) / (2 * difference), gradient[i]);
        for (size_t k = i; k < norm.variables; k++) {
            TEST_ASSERT_DOUBLE_WITHIN(of_differences, (above[k] - below[k]) / (2 * difference),
                                      matrix[i * norm.variables + k]);
        }
    }
    design_norm_free(&norm);
    destroy();
}

static void test_norm_derivatives_by_phases_are_those_of_the_value(void)
{
    assert_derivatives(0, 1);
    assert_derivatives(0, 4); // four interleaved series of each signal
}

static void test_norm_derivatives_by_amplitudes_are_those_of_the_value(void)
{
    assert_derivatives(1.5, 1);
    assert_derivatives(1.5, 4);
}

/// From the definition: sums over the signals of the waveform, for p = 8, at the power of the amplitudes at hand.
static void test_norm_value_is_the_p_norm_at_unit_power(void)
{
    struct design_norm norm;
    double gradient[variables_max];
    double c[2 * lines];
    create(2, 1);
    TEST_ASSERT_TRUE(design_norm_create(&search, false, &norm));
    norm.exponent = 3;
    double value = design_norm_evaluate(&norm, x, gradient);
    design_norm_get_directions(&norm, x, c);
    design_waveform_synthesise(&search.waveform, c, search.packed);
    double sum = 0;
    for (size_t i = 0; i < search.waveform.packed_length; i++) {
        sum += pow(search.packed[i], 8);
    }
    double power = 0;
    double prescribed = 0;
    for (size_t k = 0; k < lines; k++) {
        double amplitude = design_spectrum_amplitude(&spectrum, design_acceleration, k);
        prescribed += amplitude * amplitude;
        power += amplitude * amplitude * (c[2 * k] * c[2 * k] + c[2 * k + 1] * c[2 * k + 1]);
    }
    TEST_ASSERT_DOUBLE_WITHIN(rounding, log(sum) / 8 - log(power / prescribed) / 2, value);
    design_norm_free(&norm);
    destroy();
}

static void test_norm_variables_keep_the_tolerance_and_come_back(void)
{
    struct design_norm norm;
    double c[2 * lines];
    double back[variables_max];
    const double longest = pow(10, 1.5 / 20);
    create(1.5, 1);
    TEST_ASSERT_TRUE(design_norm_create(&search, false, &norm));
    design_norm_get_directions(&norm, x, c);
    for (size_t k = 0; k < lines; k++) {
        double length = hypot(c[2 * k], c[2 * k + 1]);
        TEST_ASSERT_TRUE(length <= longest * (1 + rounding) && length >= (1 - rounding) / longest);
        c[2 * k] *= 0.98 / length; // well inside, where nothing is moved in from the edge
        c[2 * k + 1] *= 0.98 / length;
    }
    design_norm_get_variables(&norm, c, back);
    double again[2 * lines];
    design_norm_get_directions(&norm, back, again);
    for (size_t i = 0; i < 2 * lines; i++) {
        TEST_ASSERT_DOUBLE_WITHIN(rounding, c[i], again[i]);
    }
    design_norm_free(&norm);
    destroy();
}

/// The gradient of a minimum is 0, and Newton's steps get there where 60 of the gradient descent have not.
static void test_newton_finds_a_stationary_point(void)
{
    const struct design_newton_plan plan = {.first_exponent = 4, .last_exponent = 6, .steps = 60};
    struct design_norm norm;
    double c[2 * lines];
    double gradient[variables_max];
    create(0, 1);
    design_phases_newman(lines, c);
    TEST_ASSERT_TRUE(design_newton_run(&search, &plan, c));
    TEST_ASSERT_TRUE(design_norm_create(&search, false, &norm));
    norm.exponent = 6;
    design_norm_get_variables(&norm, c, x);
    design_norm_evaluate(&norm, x, gradient);
    for (size_t i = 0; i < lines; i++) {
        // The method ends where a step gains less than a thousandth of log(points) / p = 0.09.
        TEST_ASSERT_DOUBLE_WITHIN(0.01, 0, gradient[i]);
    }
    design_norm_free(&norm);
    destroy();
}

static void assert_descent_lowers_the_peak(double tolerance_db)
{
    const struct design_newton_plan newton = {.first_exponent = 3, .last_exponent = 10, .steps = 10};
    const struct design_polish_plan gradient = {.first_exponent = 3, .last_exponent = 10, .iterations = 40};
    double c[2 * lines];
    double scores[2];
    create(tolerance_db, 1);
    design_phases_newman(lines, c);
    design_waveform_synthesise(&search.waveform, c, search.packed);
    double before = design_waveform_peak_all(&search.waveform, search.packed);
    TEST_ASSERT_TRUE(design_newton_run(&search, &newton, c));
    scores[0] = search.best_score;
    search.best_score = INFINITY;
    design_phases_newman(lines, c);
    TEST_ASSERT_TRUE(design_polish_run(&search, &gradient, c));
    scores[1] = search.best_score;
    for (int i = 0; i < 2; i++) {
        TEST_ASSERT_TRUE(scores[i] < 0.95 * before); // Newman's phases are 10 percent and more from any optimum
    }
    destroy();
}

static void test_descents_lower_the_peak(void)
{
    assert_descent_lowers_the_peak(0);
    assert_descent_lowers_the_peak(2);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_norm_derivatives_by_phases_are_those_of_the_value);
    RUN_TEST(test_norm_derivatives_by_amplitudes_are_those_of_the_value);
    RUN_TEST(test_norm_value_is_the_p_norm_at_unit_power);
    RUN_TEST(test_norm_variables_keep_the_tolerance_and_come_back);
    RUN_TEST(test_newton_finds_a_stationary_point);
    RUN_TEST(test_descents_lower_the_peak);
    return UNITY_END();
}
