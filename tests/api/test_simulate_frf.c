/* SPDX-License-Identifier: MIT */
/// Through public headers only: a table, the simulated drive, a measurement, its frequency response, and the truth.
#include "lab/estimate/circle.h"
#include "lab/estimate/method.h"
#include "lab/estimate/periodic.h"
#include "lab/measure/measure.h"
#include "lab/measure/table_bytes.h"
#include "sim/node/direct_drive.h"
#include "tests/support/rigid_table.h"
#include "tests/support/scratch.h"
#include "unity.h"

#include <complex.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;
static const double inertia_kgm2 = 0.00516;

enum { length = 500, lines = 80, periods = 10, seeds = 25 };

static struct table_bytes table;
static struct sim_model model;
static struct error error;

/// A rigid body without friction and without anything between command and torque; white noise on every sensor.
static void make_model(void)
{
    sim_model_default(&model);
    model.structure = sim_structure_rigid;
    model.motor_inertia_kgm2 = inertia_kgm2;
    model.load_inertia_kgm2 = 0.0;
    model.viscous_friction_Nms_per_rad = 0.0;
    model.coulomb_friction_Nm = 0.0;
    model.torque_lag_s = 0.0;
    model.dead_time_s = 0.0;
    model.sample_rate_hz = 1000.0;
    model.process_noise_Nm = 0.01;
    model.sensors.counts_per_rev = 0.0;
    model.sensors.velocity_filter_s = 0.0;
    model.sensors.position_noise_rad = 1e-5;
    model.sensors.velocity_noise_rad_per_s = 0.01;
    model.sensors.torque_noise_Nm = 0.01;
}

/// 0.02 Nm on each of the lines 2, 4, .. 160 Hz, and the motion of the rigid body under it.
static void make_table(void)
{
    const struct rigid_table plan = {1000.0, length, lines, 0.02, inertia_kgm2, 17};
    rigid_table_make(&plan, &table);
}

void setUp(void)
{
    scratch_empty();
    make_model();
    make_table();
}

void tearDown(void)
{
    table_bytes_free(&table);
}

static void simulate(enum drive_mode mode, struct run *out_run)
{
    struct direct_drive simulated;
    struct drive drive = direct_drive_init(&simulated, &model);
    struct measure_plan plan = {
        .table = &table.view,
        .mode = mode,
        .settle_periods = 2,
        .periods = periods,
        .limits = GUARD_REAL_LIMITS_NONE,
    };
    struct measure_report report;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, measure_run(&drive, &plan, out_run, &report, &error), error.message);
    TEST_ASSERT_EQUAL_size_t((2 + periods) * length, out_run->rows);
}

/// Torque held between samples on an inertia, both sampled: G = (T/J) / (z - 1).
static double complex truth(double frequency_hz)
{
    return 0.001 / inertia_kgm2 / (cexp(I * two_pi * frequency_hz * 0.001) - 1.0);
}

/// Share of the lines whose error lies within their own 95 % circle, over many seeds of the noise.
static double coverage(enum drive_mode mode, const char *method)
{
    double covered = 0.0;
    for (int seed = 1; seed <= seeds; seed++) {
        struct run run;
        struct periodic recording;
        struct frf frf;
        model.seed = (uint64_t)seed;
        simulate(mode, &run);
        TEST_ASSERT_EQUAL_INT(0, periodic_cut(&run, &(struct periodic_options){0}, &recording, &error));
        TEST_ASSERT_EQUAL_INT(0, estimate_method_find(method, &error)->estimate(&recording, NULL, &frf, &error));
        double factor = circle_confidence_factor(0.95, frf.degrees_of_freedom / 2.0);
        TEST_ASSERT_EQUAL_size_t(lines, frf.count);
        for (size_t line = 0; line < lines; line++) {
            double complex estimate = frf.real[line] + frf.imag[line] * I;
            TEST_ASSERT_TRUE(frf.valid[line]);
            covered += cabs(estimate - truth(frf.frequency_hz[line])) <= factor * frf.std[line];
        }
        frf_free(&frf);
        periodic_free(&recording);
        run_free(&run);
    }
    return covered / (seeds * lines);
}

static void test_simulate_frf_is_the_analytic_one_within_its_uncertainty(void)
{
    double share = coverage(drive_mode_cascade, "mean");
    printf("cascade, mean: %.2f %% of lines within their 95 %% circle\n", 100.0 * share);
    /* 2000 lines scatter by 0.5 %. */
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 0.95, share);
    share = coverage(drive_mode_cascade, "hann");
    printf("cascade, hann: %.2f %%\n", 100.0 * share);
    /* Its degrees of freedom are an approximation, and it assumes noise that is even over half a line's distance. */
    TEST_ASSERT_DOUBLE_WITHIN(0.04, 0.95, share);
}

static void test_simulate_frf_is_exact_without_noise(void)
{
    struct run run;
    struct periodic recording;
    struct frf frf;
    model.process_noise_Nm = 0.0;
    model.sensors.position_noise_rad = 0.0;
    model.sensors.velocity_noise_rad_per_s = 0.0;
    model.sensors.torque_noise_Nm = 0.0;
    simulate(drive_mode_cascade, &run);
    TEST_ASSERT_EQUAL_INT(0, periodic_cut(&run, &(struct periodic_options){0}, &recording, &error));
    TEST_ASSERT_EQUAL_INT(0, estimate_methods[0].estimate(&recording, NULL, &frf, &error));
    for (size_t line = 0; line < lines; line++) {
        double complex expected = truth(frf.frequency_hz[line]);
        double complex estimate = frf.real[line] + frf.imag[line] * I;
        /* What is left of the start transient after two periods, in a loop of 20 Hz and more. */
        TEST_ASSERT_TRUE(cabs(estimate - expected) <= 1e-4 * cabs(expected));
    }
    frf_free(&frf);
    periodic_free(&recording);
    run_free(&run);
}

static void test_simulate_gives_the_same_run_for_the_same_seed(void)
{
    struct run first;
    struct run second;
    model.seed = 4;
    simulate(drive_mode_cascade, &first);
    simulate(drive_mode_cascade, &second);
    TEST_ASSERT_EQUAL_size_t(first.column_count, second.column_count);
    for (size_t c = 0; c < first.column_count; c++) {
        TEST_ASSERT_EQUAL_MEMORY(first.columns[c].data, second.columns[c].data, first.rows * sizeof(double));
    }
    run_free(&second);
    model.seed = 5;
    simulate(drive_mode_cascade, &second);
    TEST_ASSERT_TRUE(
        memcmp(run_column(&first, "torque_Nm"), run_column(&second, "torque_Nm"), first.rows * sizeof(double)));
    run_free(&first);
    run_free(&second);
}

static void test_simulate_refuses_another_rate(void)
{
    struct direct_drive simulated;
    struct run run;
    struct measure_report report;
    model.sample_rate_hz = 2000.0;
    struct drive drive = direct_drive_init(&simulated, &model);
    struct measure_plan plan = {.table = &table.view, .periods = 1, .limits = GUARD_REAL_LIMITS_NONE};
    TEST_ASSERT_EQUAL_INT(error_refused, measure_run(&drive, &plan, &run, &report, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "the model's sample_rate_hz is 2000, the table's rate 1000 Hz"),
                                 error.message);
}

static void test_simulate_stops_at_an_end_stop_and_keeps_the_rows(void)
{
    struct direct_drive simulated;
    struct run run;
    struct measure_report report;
    model.has_end_stops = true;
    model.end_stops_rad[0] = -0.005;
    model.end_stops_rad[1] = 0.005;
    struct drive drive = direct_drive_init(&simulated, &model);
    struct measure_plan plan = {
        .table = &table.view, .periods = 2, .limits = GUARD_REAL_LIMITS_NONE, .fade_samples = 400};
    TEST_ASSERT_EQUAL_INT(error_refused, measure_run(&drive, &plan, &run, &report, &error));
    TEST_ASSERT_EQUAL_INT(measure_failed, report.end);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "end stop"), error.message);
    run_free(&run);
}

int main(void)
{
    scratch_open();
    UNITY_BEGIN();
    RUN_TEST(test_simulate_frf_is_the_analytic_one_within_its_uncertainty);
    RUN_TEST(test_simulate_frf_is_exact_without_noise);
    RUN_TEST(test_simulate_gives_the_same_run_for_the_same_seed);
    RUN_TEST(test_simulate_refuses_another_rate);
    RUN_TEST(test_simulate_stops_at_an_end_stop_and_keeps_the_rows);
    int failures = UNITY_END();
    scratch_close();
    return failures;
}
