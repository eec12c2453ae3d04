/* SPDX-License-Identifier: MIT */
/// Measurements around a constant speed and on a stroke, from the design to the response: what they move, where they
/// end, how they begin, and what dry friction is left in them.
#include "lab/design/offset.h"
#include "lab/estimate/frf_mean.h"
#include "lab/estimate/periodic.h"
#include "lab/estimate/spectra.h"
#include "lab/measure/measure.h"
#include "lab/measure/table_bytes.h"
#include "lab/record/table_file.h"
#include "sim/node/direct_drive.h"
#include "tests/support/can_bench.h"
#include "tests/support/scratch.h"
#include "unity.h"

#include <complex.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { length = 1000, lines = 40, settle = 2, periods = 4 };

static const double two_pi = 6.283185307179586476925;
static const double inertia_kgm2 = 0.00516;
static const double velocity_limit_rad_per_s = 6;
static const double bias_rad_per_s = 4; ///< the multisine gets what is left, 2 rad/s

static struct sim_model model;
static struct design_request request;
static struct design_result design;
static struct table_bytes table;
static struct error error;
static uint32_t bins[lines];
static struct run run;

void setUp(void)
{
    scratch_empty();
    sim_model_default(&model);
    model.coulomb_friction_Nm = 0.15;
    model.sensors = (struct sim_sensors){0};
    for (uint32_t k = 0; k < lines; k++) {
        bins[k] = 1 + 2 * k; // odd lines: even bins and odd ones above them show what is not linear
    }
    request = (struct design_request){
        .rate_num_hz = 1000,
        .rate_den = 1,
        .period_samples = length,
        .bin_count = lines,
        .bins = bins,
        .limits = {.velocity_rad_per_s = velocity_limit_rad_per_s, .torque_Nm = 0.5},
        .inertia_kgm2 = inertia_kgm2,
        .method = "schroeder",
    };
}

void tearDown(void)
{
    table_bytes_free(&table);
    design_result_free(&design);
    run_free(&run);
}

static void write_table(enum msgen_format format)
{
    struct table made;
    const uint32_t samples = (uint32_t)design.period_samples;
    TEST_ASSERT_EQUAL_INT(0, table_alloc(&made, samples, 3, lines, &error));
    made.rate_num_hz = 1000;
    made.rate_den = 1;
    made.format = format;
    made.start_index = (uint32_t)design.start_index;
    made.travel_per_period = design.travel_per_period_rad;
    memcpy(made.bins, design.bins, sizeof bins);
    memcpy(made.torque, design.torque_Nm, samples * sizeof(double));
    memcpy(made.velocity, design.velocity_rad_per_s, samples * sizeof(double));
    memcpy(made.position, design.position_rad, samples * sizeof(double));
    const char *path = scratch_path("table.mst");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, table_file_write_mst(path, &made, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, table_bytes_read(path, &table, &error), error.message);
    table_free(&made);
}

static void make_table(double bias, enum msgen_format format)
{
    const struct design_offset offset = {.bias_velocity_rad_per_s = bias};
    // The multisine is the same with and without the bias, so that only the bias makes the difference.
    const struct design_offset most = {.bias_velocity_rad_per_s = bias_rad_per_s};
    struct design_request reduced = request;
    TEST_ASSERT_EQUAL_INT(0, design_offset_reduce(&most, &request, &reduced.limits, &error));
    TEST_ASSERT_EQUAL_INT(0, design_run(&reduced, &design, &error));
    TEST_ASSERT_EQUAL_INT(0, design_offset_add(&offset, &request, &design, &error));
    write_table(format);
}

static void measure(const struct drive *drive)
{
    struct measure_report report;
    const struct measure_plan plan = {
        .table = &table.view,
        .mode = drive_mode_cascade,
        .settle_periods = settle,
        .periods = periods,
        .limits = GUARD_REAL_LIMITS_NONE,
    };
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, measure_run(drive, &plan, &run, &report, &error), error.message);
    TEST_ASSERT_EQUAL_UINT32(0, report.counters.samples_lost);
}

static void simulate(double bias, enum msgen_format format)
{
    struct direct_drive simulated;
    make_table(bias, format);
    struct drive drive = direct_drive_init(&simulated, &model);
    measure(&drive);
    const double travelled =
        design.travel_per_period_rad *
        (settle + periods + (double)measure_ramp_samples(&table.view, drive_mode_cascade) / length);
    /* At rest where it has got to: after the ramp the controllers still close what the friction left. */
    TEST_ASSERT_DOUBLE_WITHIN(0.05, travelled, simulated.drive.plant.position);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0, simulated.drive.plant.velocity);
}

/// Torque on bins that are not excited over torque on those that are, odd or even bins up to the highest line.
static double distortion(size_t first_bin)
{
    const double *torque = run_column(&run, "torque_Nm") + settle * length;
    double complex *spectrum = malloc((length / 2 + 1) * sizeof *spectrum);
    double excited = 0;
    double other = 0;
    TEST_ASSERT_TRUE(spectrum && spectra_transform_all(torque, length, 1, spectrum));
    for (size_t b = 1; b <= bins[lines - 1]; b += 2) {
        excited += pow(cabs(spectrum[b]), 2);
    }
    for (size_t b = first_bin; b < first_bin + 2 * lines; b += 2) {
        other += pow(cabs(spectrum[b]), 2);
    }
    free(spectrum);
    return sqrt(other / excited);
}

static void estimate(const char *output, struct frf *out_frf, double *out_trend)
{
    struct periodic recording;
    const struct periodic_options options = {.output = output};
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, periodic_cut(&run, &options, &recording, &error), error.message);
    TEST_ASSERT_EQUAL_INT(0, frf_mean_estimate(&recording, NULL, out_frf, &error));
    *out_trend = recording.trend_per_sample;
    periodic_free(&recording);
}

/// Root mean square over the lines of |G / truth - 1|; truth: torque held between samples on an inertia.
static double error_of_response(const char *output)
{
    struct frf frf;
    double trend;
    double sum = 0;
    estimate(output, &frf, &trend);
    for (size_t k = 0; k < lines; k++) {
        const double complex z = cexp(I * two_pi * frf.frequency_hz[k] / 1000);
        double complex truth = 1e-3 / inertia_kgm2 / (z - 1);
        if (strcmp(output, "position_rad") == 0) {
            truth *= 0.5e-3 * (z + 1) / (z - 1);
        }
        sum += pow(cabs((frf.real[k] + I * frf.imag[k]) / truth - 1), 2) / lines;
    }
    frf_free(&frf);
    return sqrt(sum);
}

static void expect_steady_travel(double tolerance_rad)
{
    const double *position = run_column(&run, "position_rad");
    const double *velocity = run_column(&run, "velocity_rad_per_s");
    double mean = 0;
    double slowest = INFINITY;
    for (size_t n = settle * length; n < run.rows; n++) {
        mean += velocity[n] / (periods * length);
        slowest = fmin(slowest, velocity[n]);
        TEST_ASSERT_DOUBLE_WITHIN(tolerance_rad, bias_rad_per_s, position[n] - position[n - length]);
    }
    TEST_ASSERT_DOUBLE_WITHIN(tolerance_rad, bias_rad_per_s, mean);
    /* Friction stays on one side. */
    TEST_ASSERT_TRUE(slowest > 0);
}

static void test_bias_velocity_moves_on_steadily_in_every_format(void)
{
    for (int format = msgen_format_i16; format <= msgen_format_f32; format++) {
        simulate(bias_rad_per_s, (enum msgen_format)format);
        expect_steady_travel(1e-5);
        tearDown();
    }
}

static void test_bias_velocity_takes_dry_friction_out_of_the_response(void)
{
    simulate(0, msgen_format_i32);
    const double odd = distortion(bins[lines - 1] + 2);
    const double even = distortion(2);
    const double response = error_of_response("velocity_rad_per_s");
    tearDown();
    simulate(bias_rad_per_s, msgen_format_i32);
    const double odd_biased = distortion(bins[lines - 1] + 2);
    const double even_biased = distortion(2);
    const double response_biased = error_of_response("velocity_rad_per_s");
    const double position_biased = error_of_response("position_rad");
    printf(
        "dry friction of %g Nm at rest on average: %.2g of the torque on odd bins above the lines, %.2g on even ones, "
        "response off by %.2g\n",
        model.coulomb_friction_Nm, odd, even, response);
    printf("at %g rad/s on average: %.2g, %.2g, response off by %.2g, torque to position by %.2g\n", bias_rad_per_s,
           odd_biased, even_biased, response_biased, position_biased);
    TEST_ASSERT_TRUE(odd > 1e-3 && response > 0.05); /* there is something to take out */
    TEST_ASSERT_TRUE(odd_biased < 1e-2 * odd);       /* what is left is the last of the start transient */
    TEST_ASSERT_TRUE(response_biased < 1e-3 * response);
    TEST_ASSERT_TRUE(position_biased < 1e-3 * response);
}

static void test_bias_velocity_is_the_trend_of_the_position(void)
{
    struct frf frf;
    double trend;
    simulate(bias_rad_per_s, msgen_format_i32);
    estimate("position_rad", &frf, &trend);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, bias_rad_per_s / 1000, trend);
    frf_free(&frf);
}

static void test_bias_velocity_over_the_bus(void)
{
    static struct can_bench bench;
    make_table(bias_rad_per_s, msgen_format_i32);
    can_bench_init(&bench, &model, 1000000);
    measure(&bench.drive);
    /* The bus has 0.5 mNm and 2^20 counts a turn. */
    expect_steady_travel(1e-3);
    TEST_ASSERT_TRUE(error_of_response("velocity_rad_per_s") < 0.01);
    TEST_ASSERT_EQUAL_UINT32(0, bench.node.objects.saturated);
    bench.drive.operations->close(bench.drive.self);
}

/// What the velocity on the excited lines is off from steady in the first period, as a share of it.
static double transient_of_stroke(bool from_its_end)
{
    const struct design_offset offset = {.stroke_rad = 1, .stroke_periods = 4};
    struct design_request reduced = request;
    struct design_request start = request;
    struct direct_drive simulated;
    double complex spectra[settle + periods][lines];
    double change = 0;
    double steady = 0;
    start.torque_mode = from_its_end;
    TEST_ASSERT_EQUAL_INT(0, design_offset_reduce(&offset, &request, &reduced.limits, &error));
    TEST_ASSERT_EQUAL_INT(0, design_run(&reduced, &design, &error));
    TEST_ASSERT_EQUAL_INT(0, design_offset_add(&offset, &start, &design, &error));
    write_table(msgen_format_i32);
    struct drive drive = direct_drive_init(&simulated, &model);
    measure(&drive);
    TEST_ASSERT_TRUE(spectra_transform_periods(run_column(&run, "velocity_rad_per_s"), design.period_samples,
                                               settle + periods, design.bins, lines, spectra[0]));
    for (size_t k = 0; k < lines; k++) {
        const double complex last = spectra[settle + periods - 1][k];
        change += pow(cabs(spectra[0][k] - last), 2);
        steady += pow(cabs(last), 2);
    }
    tearDown();
    return sqrt(change / steady);
}

static void test_stroke_from_its_middle_disturbs_the_cascade_less_than_from_its_end(void)
{
    const double middle = transient_of_stroke(false);
    const double end = transient_of_stroke(true);
    printf("stroke of 1 rad, first period off by %.2g of the velocity when it begins in its middle, %.2g at its end\n",
           middle, end);
    TEST_ASSERT_TRUE(middle < 0.2 * end);
}

int main(void)
{
    scratch_open();
    UNITY_BEGIN();
    RUN_TEST(test_bias_velocity_moves_on_steadily_in_every_format);
    RUN_TEST(test_bias_velocity_takes_dry_friction_out_of_the_response);
    RUN_TEST(test_bias_velocity_is_the_trend_of_the_position);
    RUN_TEST(test_bias_velocity_over_the_bus);
    RUN_TEST(test_stroke_from_its_middle_disturbs_the_cascade_less_than_from_its_end);
    int failures = UNITY_END();
    scratch_close();
    return failures;
}
