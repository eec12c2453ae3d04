/* SPDX-License-Identifier: MIT */
/// The predicted deviation against the scatter of simulated measurements, for each structure and mode.
#include "lab/design/predict.h"

#include "lab/design/offset.h"
#include "lab/estimate/frf_mean.h"
#include "lab/estimate/periodic.h"
#include "lab/measure/measure.h"
#include "lab/measure/table_bytes.h"
#include "lab/record/table_file.h"
#include "sim/node/direct_drive.h"
#include "tests/support/scratch.h"
#include "unity.h"

#include <complex.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { length = 400, lines = 60, periods = 8, settle = 3, seeds = 30 };

/// 30 seeds of 7 complex degrees of freedom: a line's deviation is known to 3.5 %, the median of 60 lines to 0.6 %.
static const double median_tolerance = 0.05;
/// A line is off by more than four times that once in 15 000; the lowest ones are correlated from period to period.
static const double line_tolerance = 0.2;

static struct sim_model model;
static struct design_request request;
static struct design_result design;
static struct table_bytes table;
static struct error error;
static uint32_t bins[lines];

static void make_table(void)
{
    struct table made;
    TEST_ASSERT_EQUAL_INT_MESSAGE(
        0, table_alloc(&made, (uint32_t)design.period_samples, 3, (uint32_t)design.bin_count, &error), error.message);
    made.rate_num_hz = request.rate_num_hz;
    made.rate_den = request.rate_den;
    made.start_index = (uint32_t)design.start_index;
    made.travel_per_period = design.travel_per_period_rad;
    memcpy(made.bins, design.bins, design.bin_count * sizeof *made.bins);
    memcpy(made.torque, design.torque_Nm, design.period_samples * sizeof(double));
    memcpy(made.velocity, design.velocity_rad_per_s, design.period_samples * sizeof(double));
    memcpy(made.position, design.position_rad, design.period_samples * sizeof(double));
    const char *path = scratch_path("table.mst");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, table_file_write_mst(path, &made, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, table_bytes_read(path, &table, &error), error.message);
    table_free(&made);
}

void setUp(void)
{
    scratch_empty();
    sim_model_default(&model);
    model.process_noise_Nm = 0.02;
    for (uint32_t k = 0; k < lines; k++) {
        bins[k] = 1 + 2 * k;
    }
    request = (struct design_request){
        .rate_num_hz = 1000,
        .rate_den = 1,
        .period_samples = length,
        .bin_count = lines,
        .bins = bins,
        .limits = {.velocity_rad_per_s = 5, .torque_Nm = 1},
        .inertia_kgm2 = 0.00516,
        .method = "schroeder",
    };
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, design_run(&request, &design, &error), error.message);
    make_table();
}

void tearDown(void)
{
    table_bytes_free(&table);
    design_result_free(&design);
}

static void make_two_mass(void)
{
    model.structure = sim_structure_two_mass;
    model.motor_inertia_kgm2 = 0.001;
    model.load_inertia_kgm2 = 0.00416;
    model.belt_stiffness_Nm_per_rad = 80;
    model.belt_damping_Nms_per_rad = 0.05;
}

/// What `frf --method mean` says of simulated measurements: the root of the mean variance over the seeds, line by line;
/// and the scatter of the responses themselves.
struct measured {
    double variance[lines];
    double complex mean[lines];
    double square[lines];
};

static void measure(enum drive_mode mode, uint64_t seed, struct measured *io_measured)
{
    struct direct_drive simulated;
    model.seed = seed;
    struct drive drive = direct_drive_init(&simulated, &model);
    struct measure_plan plan = {
        .table = &table.view,
        .mode = mode,
        .settle_periods = settle,
        .periods = periods,
        .limits = GUARD_REAL_LIMITS_NONE,
    };
    struct measure_report report;
    struct run run;
    struct periodic recording;
    struct frf frf;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, measure_run(&drive, &plan, &run, &report, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, periodic_cut(&run, &(struct periodic_options){0}, &recording, &error),
                                  error.message);
    TEST_ASSERT_EQUAL_INT(0, frf_mean_estimate(&recording, NULL, &frf, &error));
    for (size_t k = 0; k < lines; k++) {
        TEST_ASSERT_TRUE(frf.valid[k]);
        double complex response = frf.real[k] + I * frf.imag[k];
        io_measured->variance[k] += frf.std[k] * frf.std[k] / seeds;
        io_measured->mean[k] += response / seeds;
        io_measured->square[k] += creal(response * conj(response)) / seeds;
    }
    frf_free(&frf);
    periodic_free(&recording);
    run_free(&run);
}

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a;
    const double y = *(const double *)b;
    return (x > y) - (x < y);
}

struct comparison {
    double median;       ///< of predicted over measured deviation
    double least, most;  ///< over the lines
    double error_median; ///< of predicted deviation over the scatter of the responses
};

static struct comparison compare(enum drive_mode mode)
{
    double predicted[lines];
    double ratio[lines];
    double error_ratio[lines];
    struct measured measured = {{0}, {0}, {0}};
    const struct design_predict_plan plan = {.periods = periods, .torque_mode = mode == drive_mode_torque};
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, design_predict_std(&model, &request, &design, &plan, predicted, &error),
                                  error.message);
    for (uint64_t seed = 1; seed <= seeds; seed++) {
        measure(mode, seed, &measured);
    }
    for (size_t k = 0; k < lines; k++) {
        const double scatter = measured.square[k] - creal(measured.mean[k] * conj(measured.mean[k]));
        ratio[k] = predicted[k] / sqrt(measured.variance[k]);
        error_ratio[k] = predicted[k] / sqrt(scatter * seeds / (seeds - 1));
    }
    qsort(ratio, lines, sizeof *ratio, ascending);
    qsort(error_ratio, lines, sizeof *error_ratio, ascending);
    return (struct comparison){ratio[lines / 2], ratio[0], ratio[lines - 1], error_ratio[lines / 2]};
}

static void expect_agreement(const char *what, enum drive_mode mode)
{
    const struct comparison got = compare(mode);
    printf("%s, %s: predicted over measured deviation %.3f (median), %.3f to %.3f; over the scatter of the responses "
           "%.3f\n",
           what, mode == drive_mode_cascade ? "cascade" : "torque mode", got.median, got.least, got.most,
           got.error_median);
    TEST_ASSERT_DOUBLE_WITHIN(median_tolerance, 1, got.median);
    TEST_ASSERT_DOUBLE_WITHIN(line_tolerance, 1, got.least);
    TEST_ASSERT_DOUBLE_WITHIN(line_tolerance, 1, got.most);
}

static void test_design_predict_rigid(void)
{
    expect_agreement("rigid", drive_mode_cascade);
    expect_agreement("rigid", drive_mode_torque);
}

static void test_design_predict_two_mass(void)
{
    make_two_mass();
    model.viscous_friction_Nms_per_rad = 0.01;
    expect_agreement("two masses", drive_mode_cascade);
    expect_agreement("two masses", drive_mode_torque);
}

static void test_design_predict_each_noise_alone(void)
{
    const struct sim_sensors quiet = {0};
    make_two_mass();
    model.process_noise_Nm = 0;
    model.sensors = quiet;
    model.sensors.velocity_noise_rad_per_s = 0.01;
    model.sensors.velocity_filter_s = 0.002;
    expect_agreement("filtered velocity noise", drive_mode_cascade);
    model.sensors = quiet;
    model.sensors.torque_noise_Nm = 0.01;
    expect_agreement("torque noise", drive_mode_cascade);
    model.sensors = quiet;
    model.sensors.position_noise_rad = 3e-4; // without it a coarse encoder errs in the same way in every period
    model.sensors.counts_per_rev = 16384;
    expect_agreement("position noise and a coarse encoder", drive_mode_cascade);
    model.sensors = quiet;
    model.process_noise_Nm = 0.02;
    model.torque_lag_s = 0.0015;
    model.dead_time_s = 0.0007;
    model.controller = (struct sim_controller){10, 0.15, 0.5, 1, 1}; // the usual ones are near unstable behind this lag
    expect_agreement("torque on the motor behind lag and dead time", drive_mode_cascade);
}

static void test_design_predict_with_dry_friction(void)
{
    model.coulomb_friction_Nm = 0.05;
    model.viscous_friction_Nms_per_rad = 0.005;
    expect_agreement("dry friction", drive_mode_cascade);
}

static void test_design_predict_under_a_bias_velocity(void)
{
    const struct design_offset offset = {.bias_velocity_rad_per_s = 8};
    model.coulomb_friction_Nm = 0.1;
    TEST_ASSERT_EQUAL_INT(0, design_offset_add(&offset, &request, &design, &error));
    table_bytes_free(&table);
    make_table();
    expect_agreement("dry friction under a bias velocity", drive_mode_cascade);
}

static void test_design_predict_scales_with_noise_and_periods(void)
{
    double few[lines];
    double many[lines];
    struct design_predict_plan plan = {.periods = 100};
    TEST_ASSERT_EQUAL_INT(0, design_predict_std(&model, &request, &design, &plan, few, &error));
    plan.periods = 400;
    TEST_ASSERT_EQUAL_INT(0, design_predict_std(&model, &request, &design, &plan, many, &error));
    for (size_t k = 0; k < lines; k++) {
        /* What neighbouring periods have in common is at most half, and counts as one over the number of periods. */
        TEST_ASSERT_DOUBLE_WITHIN(0.005 * few[k], 2 * many[k], few[k]);
    }
    model.process_noise_Nm = 0;
    model.sensors = (struct sim_sensors){0};
    TEST_ASSERT_EQUAL_INT(0, design_predict_std(&model, &request, &design, &plan, many, &error));
    for (size_t k = 0; k < lines; k++) {
        TEST_ASSERT_EQUAL_DOUBLE(0, many[k]);
    }
}

/// Velocity noise alone in open loop: var G = s_v^2 N / (P |U|^2), with U known from the design.
static void test_design_predict_is_the_formula_where_there_is_one(void)
{
    double predicted[lines];
    const struct design_predict_plan plan = {.periods = periods, .torque_mode = true};
    model.process_noise_Nm = 0;
    model.sensors = (struct sim_sensors){.velocity_noise_rad_per_s = 0.02};
    TEST_ASSERT_EQUAL_INT(0, design_predict_std(&model, &request, &design, &plan, predicted, &error));
    for (size_t k = 0; k < lines; k++) {
        const double omega = 6.283185307179586 * bins[k] * 1000 / length;
        const double input = 0.5 * length * request.inertia_kgm2 * omega * omega * design.amplitude_rad[k];
        const double expected = 0.02 * sqrt((double)length / periods) / input;
        TEST_ASSERT_DOUBLE_WITHIN(1e-6 * expected, expected, predicted[k]);
    }
}

static void test_design_predict_refuses_models_that_do_not_fit(void)
{
    double predicted[lines];
    struct design_predict_plan plan = {0};
    TEST_ASSERT_EQUAL_INT(error_usage, design_predict_std(&model, &request, &design, &plan, predicted, &error));
    plan.periods = 2;
    model.sample_rate_hz = 999;
    TEST_ASSERT_EQUAL_INT(error_refused, design_predict_std(&model, &request, &design, &plan, predicted, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "sample_rate_hz is 999, the table's rate 1000"), error.message);
    model.sample_rate_hz = 1000;
    model.linear = true;
    TEST_ASSERT_EQUAL_INT(error_refused, design_predict_std(&model, &request, &design, &plan, predicted, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "of a linear axis"), error.message);
    model.linear = false;
    model.process_noise_Nm = NAN;
    TEST_ASSERT_EQUAL_INT(error_refused, design_predict_std(&model, &request, &design, &plan, predicted, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "process_noise_Nm: nan"), error.message);
    model.process_noise_Nm = 0;
    model.has_end_stops = true;
    model.end_stops_rad[0] = -1e-3;
    model.end_stops_rad[1] = 1e-3;
    TEST_ASSERT_EQUAL_INT(error_refused, design_predict_std(&model, &request, &design, &plan, predicted, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "end stop"), error.message);
}

int main(void)
{
    scratch_open();
    UNITY_BEGIN();
    RUN_TEST(test_design_predict_rigid);
    RUN_TEST(test_design_predict_two_mass);
    RUN_TEST(test_design_predict_each_noise_alone);
    RUN_TEST(test_design_predict_with_dry_friction);
    RUN_TEST(test_design_predict_under_a_bias_velocity);
    RUN_TEST(test_design_predict_scales_with_noise_and_periods);
    RUN_TEST(test_design_predict_is_the_formula_where_there_is_one);
    RUN_TEST(test_design_predict_refuses_models_that_do_not_fit);
    int failures = UNITY_END();
    scratch_close();
    return failures;
}
