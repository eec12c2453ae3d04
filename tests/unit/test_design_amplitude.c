/* SPDX-License-Identifier: MIT */
/// Amplitudes by --amplitude, and D-optimal power against closed forms. lab/design/amplitude.h, optimal_power.h.
#include "lab/design/amplitude.h"
#include "lab/design/optimal_power.h"
#include "lab/record/model_file.h"
#include "sim/linear.h"

#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586;
static const double rounding = 1e-12;

/// A design whose gap is closed to 0.1 %, looked at with sums of another order.
static const double gap = 1.001 * DESIGN_OPTIMAL_GAP;

enum { line_count = 60, grid_count = 2000, parameters_max = 5 };
static uint32_t bins[line_count];
static struct design_request request;
static struct sim_model model;
static struct error error;
static double *shape;

/// 1, 2, ..., 60 Hz; a belt drive with its antiresonance at 20 Hz.
void setUp(void)
{
    for (uint32_t k = 0; k < line_count; k++) {
        bins[k] = 2 * (k + 1);
    }
    request = (struct design_request){.rate_num_hz = 1000,
                                      .rate_den = 2,
                                      .period_samples = 1000,
                                      .bin_count = line_count,
                                      .bins = bins,
                                      .inertia_kgm2 = 0.005,
                                      .limits = {.velocity_rad_per_s = 3, .torque_Nm = 1},
                                      .method = "mca"};
    sim_model_default(&model);
    model.structure = sim_structure_two_mass;
    model.motor_inertia_kgm2 = 0.0035;
    model.load_inertia_kgm2 = 0.0015;
    model.belt_stiffness_Nm_per_rad = 0.0015 * (two_pi * 20) * (two_pi * 20);
    model.belt_damping_Nms_per_rad = 0.01;
    model.viscous_friction_Nms_per_rad = 0.02;
    error = (struct error){0};
    shape = NULL;
}

void tearDown(void)
{
    free(shape);
    shape = NULL;
}

static void read_shape(const char *specification)
{
    free(shape);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, design_amplitude_shape(specification, &request, &shape, &error), error.message);
}

static void assert_refused(int status, const char *specification, const char *message)
{
    free(shape);
    TEST_ASSERT_EQUAL_INT_MESSAGE(status, design_amplitude_shape(specification, &request, &shape, &error),
                                  specification);
    TEST_ASSERT_EQUAL_STRING(message, error.message);
    TEST_ASSERT_NULL(shape);
}

// ---- Words

static void test_amplitude_by_the_limits_is_no_shape(void)
{
    read_shape("constraint");
    TEST_ASSERT_NULL(shape);
}

static void test_amplitude_flat_is_the_same_for_all_lines(void)
{
    read_shape("flat");
    for (size_t k = 0; k < line_count; k++) {
        TEST_ASSERT_EQUAL_DOUBLE(shape[0], shape[k]);
    }
    TEST_ASSERT_TRUE(shape[0] > 0);
}

/// Power times frequency is constant; the octaves 5 .. 10 Hz and 20 .. 40 Hz then carry the same but for their edges.
static void test_amplitude_one_over_f_has_a_power_that_falls_with_frequency(void)
{
    read_shape("one-over-f");
    for (size_t k = 0; k < line_count; k++) {
        TEST_ASSERT_DOUBLE_WITHIN(rounding, shape[0] * shape[0], shape[k] * shape[k] * (double)(k + 1));
    }
}

/// Torque amplitudes of a finished design have the shape that was asked for, and the limits hold.
static void test_amplitude_shape_is_what_the_design_has(void)
{
    struct design_result result;
    read_shape("one-over-f");
    request.torque_shape = shape;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, design_run(&request, &result, &error), error.message);
    double first = result.amplitude_rad[0];
    for (size_t k = 0; k < line_count; k++) {
        double factor = (double)(k + 1) * (double)(k + 1) * sqrt((double)(k + 1));
        TEST_ASSERT_DOUBLE_WITHIN(rounding * first, first, result.amplitude_rad[k] * factor);
    }
    TEST_ASSERT_TRUE(result.peak_continuous.torque_Nm <= 1 && result.peak_continuous.velocity_rad_per_s <= 3);
    design_result_free(&result);
}

// ---- D-optimal power

/// Solves A x = b in place by elimination with pivoting: nothing of optimal_power.c.
static double solve_quadratic(size_t m, double A[parameters_max][parameters_max], const double *row, double *out_det)
{
    double a[parameters_max][parameters_max + 1];
    double quadratic = 0;
    *out_det = 1;
    for (size_t i = 0; i < m; i++) {
        memcpy(a[i], A[i], m * sizeof(double));
        a[i][m] = row[i];
    }
    for (size_t i = 0; i < m; i++) {
        size_t pivot = i;
        for (size_t r = i + 1; r < m; r++) {
            pivot = fabs(a[r][i]) > fabs(a[pivot][i]) ? r : pivot;
        }
        for (size_t c = 0; c <= m; c++) {
            double was = a[i][c];
            a[i][c] = a[pivot][c];
            a[pivot][c] = was;
        }
        *out_det *= pivot == i ? a[i][i] : -a[i][i];
        for (size_t r = 0; r < m; r++) {
            double factor = r == i ? 0 : a[r][i] / a[i][i];
            for (size_t c = 0; c <= m; c++) {
                a[r][c] -= factor * a[i][c];
            }
        }
    }
    for (size_t i = 0; i < m; i++) {
        quadratic += row[i] * a[i][m] / a[i][i];
    }
    return quadratic;
}

/// Information matrix of the given power.
static void inform(size_t lines, size_t m, const double complex *g, const double *power,
                   double out_M[parameters_max][parameters_max])
{
    for (size_t i = 0; i < m; i++) {
        for (size_t j = 0; j < m; j++) {
            out_M[i][j] = 0;
            for (size_t k = 0; k < lines; k++) {
                out_M[i][j] += power[k] * creal(g[k * m + i] * conj(g[k * m + j]));
            }
        }
    }
}

static double determinant(size_t m, double M[parameters_max][parameters_max])
{
    const double unit[parameters_max] = {1};
    double det = 0;
    solve_quadratic(m, M, unit, &det);
    return det;
}

/// trace(M^-1 M_k) of one line.
static double variance(size_t m, double M[parameters_max][parameters_max], const double complex *g)
{
    double row[2][parameters_max];
    double det = 0;
    for (size_t i = 0; i < m; i++) {
        row[0][i] = creal(g[i]);
        row[1][i] = cimag(g[i]);
    }
    return solve_quadratic(m, M, row[0], &det) + solve_quadratic(m, M, row[1], &det);
}

/// Kiefer and Wolfowitz: power is optimal if and only if no line has more than m, and lines with power have m.
static void check_equivalence(size_t lines, size_t m, const double complex *g, const double *power)
{
    double M[parameters_max][parameters_max];
    double sum = 0;
    double mean = 0;
    inform(lines, m, g, power, M);
    for (size_t k = 0; k < lines; k++) {
        double line_variance = variance(m, M, &g[k * m]);
        TEST_ASSERT_TRUE(line_variance <= (double)m * (1 + gap));
        TEST_ASSERT_TRUE(power[k] >= 0);
        sum += power[k];
        mean += power[k] * line_variance;
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1, sum);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, (double)m, mean); // an identity, whatever the power: the elimination is sound
}

static double complex grid_sensitivities[grid_count * parameters_max];
static double grid_power[grid_count];

/// Fourth paper, equations (3) and (4): 1 / (s^2 / w0^2 + 2 zeta s / w0 + 1) is estimated best, w0 and zeta, by one
/// sinusoid at w*. On a grid around it the power has to gather there and be as good as that sinusoid.
static void check_second_order(double zeta)
{
    const double w0 = 7;
    const double a = 1 - 2 * zeta * zeta;
    const double best = w0 * sqrt(a + sqrt(a * a + 15)) / sqrt(5);
    double mean = 0;
    double M[parameters_max][parameters_max];
    struct design_optimal_report report;
    enum { at_best = grid_count / 2 };
    for (size_t k = 0; k < grid_count; k++) {
        // The line in the middle is w* itself; the grid reaches from 0.5 to 1.5 times it.
        double w = best * (1 + ((double)k - at_best) / grid_count);
        double complex s = I * w / w0;
        double complex G = 1 / (s * s + 2 * zeta * s + 1);
        grid_sensitivities[2 * k] = G * G * (2 * s * s + 2 * zeta * s) / w0;
        grid_sensitivities[2 * k + 1] = -G * G * 2 * s;
    }
    TEST_ASSERT_EQUAL_INT(design_optimal_ok,
                          design_optimal_power(grid_count, 2, grid_sensitivities, grid_power, &report));
    check_equivalence(grid_count, 2, grid_sensitivities, grid_power);
    inform(grid_count, 2, grid_sensitivities, grid_power, M);
    double ours = determinant(2, M);
    const double all = 1;
    inform(1, 2, &grid_sensitivities[(size_t)2 * at_best], &all, M);
    double single = determinant(2, M);
    TEST_ASSERT_TRUE(ours <= single * (1 + 1e-9)); // nothing beats the published optimum
    TEST_ASSERT_TRUE(sqrt(ours / single) >= exp(-gap));
    for (size_t k = 0; k < grid_count; k++) {
        mean += grid_power[k] * (1 + ((double)k - at_best) / grid_count);
    }
    printf("zeta %.2f: w*/w0 %.5f, mean frequency of the power over w* %.5f, %zu steps, gap %.1e\n", zeta, best / w0,
           mean, report.steps, report.gap);
    // The power is still spread over some percent around w*, det M being flat there, and not quite evenly.
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 1, mean);
}

static void test_optimal_power_of_a_second_order_system_is_the_papers_sinusoid(void)
{
    const double zeta[] = {0.01, 0.05, 0.2, 0.4, 0.6};
    for (size_t i = 0; i < sizeof zeta / sizeof zeta[0]; i++) {
        check_second_order(zeta[i]);
    }
}

/// One mass with friction, 1 / (J s + B): one sinusoid at B / (J sqrt 3) is best (det M ~ w^2 / (J^2 w^2 + B^2)^4).
static void test_optimal_power_of_a_rigid_drive_is_one_sinusoid(void)
{
    double mean_hz = 0;
    double shapes[line_count];
    model.structure = sim_structure_rigid;
    model.viscous_friction_Nms_per_rad = 30 * two_pi * 0.005 * sqrt(3.0); // best at 30 Hz
    const double tiny = 1e-12;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, design_amplitude_optimal("model", &model, tiny, &request, shapes, &error),
                                  error.message);
    for (size_t k = 0; k < line_count; k++) {
        mean_hz += shapes[k] * shapes[k] * (double)(k + 1);
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.5, 30, mean_hz); // half the distance of the lines
}

static void fill_belt_drive(double complex *out)
{
    for (size_t k = 0; k < line_count; k++) {
        double omega = two_pi * (double)(k + 1);
        double complex line[sim_linear_parameters_max];
        sim_linear_sensitivities(&model, omega, line);
        for (size_t i = 0; i < sim_linear_parameters_max; i++) {
            out[k * sim_linear_parameters_max + i] = line[i] * sim_linear_actuator(&model, omega);
        }
    }
}

static void test_optimal_power_of_a_belt_drive_meets_the_equivalence_theorem(void)
{
    static double complex g[line_count * sim_linear_parameters_max];
    static double power[line_count];
    struct design_optimal_report report;
    model.torque_lag_s = 0.002;
    fill_belt_drive(g);
    // The check's elimination has no scaling of its own: parameters in units of their values.
    const double values[] = {model.motor_inertia_kgm2, model.viscous_friction_Nms_per_rad, model.load_inertia_kgm2,
                             model.belt_stiffness_Nm_per_rad, model.belt_damping_Nms_per_rad};
    for (size_t n = 0; n < line_count * sim_linear_parameters_max; n++) {
        g[n] *= values[n % sim_linear_parameters_max];
    }
    TEST_ASSERT_EQUAL_INT(design_optimal_ok,
                          design_optimal_power(line_count, sim_linear_parameters_max, g, power, &report));
    printf("belt drive: %zu steps, gap %.1e\n", report.steps, report.gap);
    check_equivalence(line_count, sim_linear_parameters_max, g, power);
}

static void test_optimal_power_does_not_depend_on_units(void)
{
    static double complex g[line_count * sim_linear_parameters_max];
    static double power[2][line_count];
    struct design_optimal_report report;
    fill_belt_drive(g);
    TEST_ASSERT_EQUAL_INT(design_optimal_ok,
                          design_optimal_power(line_count, sim_linear_parameters_max, g, power[0], &report));
    const double units[] = {1e-6, 1e3, 3, 1e-9, 1e5};
    for (size_t n = 0; n < line_count * sim_linear_parameters_max; n++) {
        g[n] *= units[n % sim_linear_parameters_max];
    }
    TEST_ASSERT_EQUAL_INT(design_optimal_ok,
                          design_optimal_power(line_count, sim_linear_parameters_max, g, power[1], &report));
    for (size_t k = 0; k < line_count; k++) {
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, power[0][k], power[1][k]);
    }
}

/// ALPHA is the share that is taken from the optimal power: what is left, p - ALPHA / K, is (1 - ALPHA) times the same.
static void test_amplitude_optimal_takes_the_share_alpha_and_spreads_it_evenly(void)
{
    double shapes[2][line_count];
    const double alphas[] = {0.3, 0.8};
    double sum = 0;
    for (size_t i = 0; i < 2; i++) {
        TEST_ASSERT_EQUAL_INT(0, design_amplitude_optimal("model", &model, alphas[i], &request, shapes[i], &error));
    }
    for (size_t k = 0; k < line_count; k++) {
        double left[2];
        for (size_t i = 0; i < 2; i++) {
            left[i] = (shapes[i][k] * shapes[i][k] - alphas[i] / line_count) / (1 - alphas[i]);
        }
        TEST_ASSERT_DOUBLE_WITHIN(rounding, left[0], left[1]);
        TEST_ASSERT_TRUE(shapes[0][k] * shapes[0][k] >= 0.3 / line_count * (1 - rounding));
        sum += left[0];
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1, sum);
    TEST_ASSERT_EQUAL_INT(0, design_amplitude_optimal("model", &model, 1, &request, shapes[0], &error));
    for (size_t k = 0; k < line_count; k++) {
        TEST_ASSERT_DOUBLE_WITHIN(rounding, shapes[0][0], shapes[0][k]);
    }
}

static void test_amplitude_optimal_reads_its_model(void)
{
    double expected[line_count];
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, model_file_write("belt,drive.json", &model, NULL, &error), error.message);
    read_shape("d-optimal:belt,drive.json,0.25"); // the last comma is the one that counts
    TEST_ASSERT_EQUAL_INT(0, design_amplitude_optimal("model", &model, 0.25, &request, expected, &error));
    TEST_ASSERT_EQUAL_DOUBLE_ARRAY(expected, shape, line_count);
}

static void test_amplitude_optimal_refuses_shares_that_make_no_sense(void)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, model_file_write("model.json", &model, NULL, &error), error.message);
    assert_refused(
        error_usage, "d-optimal:model.json,0",
        "amplitude 'd-optimal:model.json,0': ALPHA 0, expected above 0 and at most 1: the share of the power "
        "that is spread evenly; without it most lines would get none");
    assert_refused(error_usage, "d-optimal:model.json,1.5",
                   "amplitude 'd-optimal:model.json,1.5': ALPHA 1.5, expected above 0 and at most 1: the share of the "
                   "power that is spread evenly; without it most lines would get none");
    assert_refused(error_usage, "d-optimal:model.json,nan",
                   "amplitude 'd-optimal:model.json,nan': ALPHA 'nan' is not a number, expected above 0 and at most 1");
    assert_refused(error_usage, "d-optimal:model.json",
                   "amplitude 'd-optimal:model.json': expected d-optimal:MODEL.json,ALPHA");
    assert_refused(error_usage, "d-optimal:,1", "amplitude 'd-optimal:,1': expected d-optimal:MODEL.json,ALPHA");
    TEST_ASSERT_EQUAL_INT(error_refused, design_amplitude_shape("d-optimal:none.json,1", &request, &shape, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "none.json"), error.message);
}

static void test_amplitude_optimal_refuses_lines_that_do_not_tell_parameters_apart(void)
{
    double shapes[line_count];
    request.bin_count = 2; // four numbers for five parameters
    TEST_ASSERT_EQUAL_INT(error_refused, design_amplitude_optimal("m", &model, 0.5, &request, shapes, &error));
    TEST_ASSERT_EQUAL_STRING(
        "m: the 2 lines do not tell the model's parameters apart, expected more lines, some of them "
        "near its resonance",
        error.message);
    request.bin_count = 3;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, design_amplitude_optimal("m", &model, 0.5, &request, shapes, &error),
                                  error.message);
}

static void test_amplitude_optimal_refuses_an_undamped_resonance_on_a_line(void)
{
    double shapes[line_count];
    static const struct sim_model none;
    model = none;
    model.structure = sim_structure_two_mass;
    // Equal masses of 2 on a belt of w^2, w = that of 8 Hz: the determinant is exactly zero there.
    const double omega = two_pi * 8;
    model.motor_inertia_kgm2 = 2;
    model.load_inertia_kgm2 = 2;
    model.belt_stiffness_Nm_per_rad = omega * omega;
    TEST_ASSERT_EQUAL_INT(error_refused, design_amplitude_optimal("m", &model, 0.5, &request, shapes, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "8 Hz"), error.message);
}

// ---- File

static void write_file(const char *text)
{
    FILE *stream = fopen("amplitudes.csv", "w");
    TEST_ASSERT_NOT_NULL(stream);
    fputs(text, stream);
    fclose(stream);
}

static void assert_file_refused(const char *text, const char *message)
{
    write_file(text);
    assert_refused(error_refused, "amplitudes.csv", message);
}

static void test_amplitude_file_gives_each_line_its_own(void)
{
    request.bin_count = 4;
    write_file("# by hand\nfrequency_hz,amplitude\n3,0.5\n1 , 2 # strong\r\n\n2\t1.25\n 4  1e-3\n");
    read_shape("amplitudes.csv");
    const double expected[] = {2, 1.25, 0.5, 1e-3};
    TEST_ASSERT_EQUAL_DOUBLE_ARRAY(expected, shape, 4);
}

static void test_amplitude_file_has_to_cover_the_lines_and_nothing_else(void)
{
    request.bin_count = 3;
    assert_file_refused("1,1\n2,1\n", "amplitudes.csv:3: the file ends without an amplitude for 3 Hz, expected one for "
                                      "each of the 3 excited lines");
    assert_file_refused("",
                        "amplitudes.csv:1: the file ends without an amplitude for 1 Hz, expected one for each of the "
                        "3 excited lines");
    assert_file_refused("1,1\n2.5,1\n", "amplitudes.csv:2: 2.5 Hz is not an excited line, the nearest is 2 Hz");
    assert_file_refused("1,1\n4,1\n", "amplitudes.csv:2: 4 Hz is not an excited line, the nearest is 3 Hz");
    assert_file_refused("-1,1\n", "amplitudes.csv:1: -1 Hz is not an excited line, the nearest is 1 Hz");
    assert_file_refused("1,1\n1,1\n", "amplitudes.csv:2: 1 Hz is there twice");
}

static void test_amplitude_file_refuses_what_is_no_row_of_two_numbers(void)
{
    request.bin_count = 1;
    assert_file_refused("1\n", "amplitudes.csv:1: '1', expected two numbers: frequency_hz,amplitude");
    assert_file_refused("1,2,3\n", "amplitudes.csv:1: '1,2,3', expected two numbers: frequency_hz,amplitude");
    assert_file_refused("1,,2\n", "amplitudes.csv:1: '1,,2', expected two numbers: frequency_hz,amplitude");
    assert_file_refused("1,nan\n", "amplitudes.csv:1: amplitude: 'nan' is not a number");
    assert_file_refused("f,2\n", "amplitudes.csv:1: frequency_hz: 'f' is not a number");
    assert_file_refused("1,0\n", "amplitudes.csv:1: amplitude 0, expected a positive number");
    assert_file_refused("1,-2\n", "amplitudes.csv:1: amplitude -2, expected a positive number");
    assert_file_refused("1,2\nfrequency_hz,amplitude\n",
                        "amplitudes.csv:2: frequency_hz: 'frequency_hz' is not a number");
}

static void test_amplitude_refuses_a_word_it_does_not_know(void)
{
    assert_refused(error_refused, "white",
                   "amplitude 'white': cannot be opened: No such file or directory; expected constraint, flat, "
                   "one-over-f, d-optimal:MODEL.json,ALPHA or the name of a file");
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_amplitude_by_the_limits_is_no_shape);
    RUN_TEST(test_amplitude_flat_is_the_same_for_all_lines);
    RUN_TEST(test_amplitude_one_over_f_has_a_power_that_falls_with_frequency);
    RUN_TEST(test_amplitude_shape_is_what_the_design_has);
    RUN_TEST(test_optimal_power_of_a_second_order_system_is_the_papers_sinusoid);
    RUN_TEST(test_optimal_power_of_a_rigid_drive_is_one_sinusoid);
    RUN_TEST(test_optimal_power_of_a_belt_drive_meets_the_equivalence_theorem);
    RUN_TEST(test_optimal_power_does_not_depend_on_units);
    RUN_TEST(test_amplitude_optimal_takes_the_share_alpha_and_spreads_it_evenly);
    RUN_TEST(test_amplitude_optimal_reads_its_model);
    RUN_TEST(test_amplitude_optimal_refuses_shares_that_make_no_sense);
    RUN_TEST(test_amplitude_optimal_refuses_lines_that_do_not_tell_parameters_apart);
    RUN_TEST(test_amplitude_optimal_refuses_an_undamped_resonance_on_a_line);
    RUN_TEST(test_amplitude_file_gives_each_line_its_own);
    RUN_TEST(test_amplitude_file_has_to_cover_the_lines_and_nothing_else);
    RUN_TEST(test_amplitude_file_refuses_what_is_no_row_of_two_numbers);
    RUN_TEST(test_amplitude_refuses_a_word_it_does_not_know);
    return UNITY_END();
}
