/* SPDX-License-Identifier: MIT */
/// A measurement without a fade in has the start transient that the designer states: tables with each start, through
/// the simulated drive, beside the default fade.
#include "lab/design/design.h"
#include "lab/design/start_phase.h"
#include "lab/measure/measure.h"
#include "lab/measure/table_bytes.h"
#include "lab/record/table_file.h"
#include "sim/node/direct_drive.h"
#include "tests/support/scratch.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { length = 2000, lines = 200, periods = 4, starts = 4, drives = 3 };

static const double two_pi = 6.283185307179586;
static const double inertia_kgm2 = 0.00516;

/// What is left of the approach after the dwell, up to 0.4 % here; and the simulated drive plays a lagged torque as its
/// mean over each quarter of a sample (tests/unit/test_design_start.c).
static const double relative_tolerance = 1e-2;

static const enum design_start start_kinds[starts] = {design_start_none, design_start_paper, design_start_bank,
                                                      design_start_model};
static const char *const start_names[starts] = {"none", "paper", "bank", "model"};

/// Drives that are not in the bank.
struct two_mass {
    double antiresonance_hz, load_share, damping_ratio, friction_time_s, lag_s;
};
static const struct two_mass two_masses[drives] = {
    {11, 0.55, 0.02, 1.0, 0}, {29, 0.65, 0.04, 0.3, 0.4e-3}, {67, 0.35, 0.015, 3.0, 0}};

static struct sim_model model;
static struct error error;

void setUp(void)
{
    scratch_empty();
}

void tearDown(void) {}

/// Without noise, quantisation and dry friction.
static void make_model(const struct two_mass *drive)
{
    const double omega = two_pi * drive->antiresonance_hz;
    sim_model_default(&model);
    model.structure = sim_structure_two_mass;
    model.load_inertia_kgm2 = drive->load_share * inertia_kgm2;
    model.motor_inertia_kgm2 = inertia_kgm2 - model.load_inertia_kgm2;
    model.belt_stiffness_Nm_per_rad = omega * omega * model.load_inertia_kgm2;
    model.belt_damping_Nms_per_rad = 2 * drive->damping_ratio * omega * model.load_inertia_kgm2;
    model.viscous_friction_Nms_per_rad = inertia_kgm2 / drive->friction_time_s;
    model.coulomb_friction_Nm = 0;
    model.torque_lag_s = drive->lag_s;
    model.dead_time_s = 0;
    model.process_noise_Nm = 0;
    model.sensors = (struct sim_sensors){0};
}

/// The testbed's 0.5 .. 100 Hz within 0.05 m/s and 1 Nm.
static void design(enum design_start kind, struct design_result *out_design)
{
    static uint32_t bins[lines];
    for (uint32_t k = 0; k < lines; k++) {
        bins[k] = k + 1;
    }
    const struct design_request request = {
        .rate_num_hz = 1000,
        .rate_den = 1,
        .period_samples = length,
        .bin_count = lines,
        .bins = bins,
        .limits = {.velocity_rad_per_s = 0.05 / 0.0159, .torque_Nm = 1},
        .inertia_kgm2 = inertia_kgm2,
        .method = "mca",
        .grid = design_grid_samples,
        .start = kind,
        .start_model = &model,
        .threads = 1,
    };
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, design_run(&request, out_design, &error), error.message);
}

static double expected_share(const struct design_result *result)
{
    const struct design_transient_table lines_of_it = {
        .rate_hz = 1000,
        .period_samples = length,
        .line_count = lines,
        .bins = result->bins,
        .amplitude_rad = result->amplitude_rad,
        .phase_rad = result->phase_rad,
        .inertia_kgm2 = inertia_kgm2,
    };
    double share = NAN;
    TEST_ASSERT_EQUAL_INT_MESSAGE(
        0, design_start_expect(&lines_of_it, &model, design_loop_cascade, result->start_index, &share, &error),
        error.message);
    return share;
}

static void make_table(const struct design_result *result, struct table_bytes *out_table)
{
    const char *path = scratch_path("table.mst");
    const size_t bytes = length * sizeof(double);
    struct table made;
    TEST_ASSERT_EQUAL_INT(0, table_alloc(&made, length, 3, lines, &error));
    TEST_ASSERT_EQUAL_INT(0, table_set_rate(&made, 1000, &error));
    memcpy(made.bins, result->bins, lines * sizeof *made.bins);
    memcpy(made.torque, result->torque_Nm, bytes);
    memcpy(made.velocity, result->velocity_rad_per_s, bytes);
    memcpy(made.position, result->position_rad, bytes);
    made.start_index = (uint32_t)result->start_index;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, table_file_write_mst(path, &made, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, table_bytes_read(path, out_table, &error), error.message);
    table_free(&made);
}

/// First period minus last one, in the motor's velocity, as a share of the last one's energy.
static double measured_share(const struct msgen_table *table, bool without_fade_in)
{
    struct direct_drive simulated;
    const struct drive drive = direct_drive_init(&simulated, &model);
    const struct measure_plan plan = {
        .table = table,
        .mode = drive_mode_cascade,
        .periods = periods,
        .without_fade_in = without_fade_in,
        .limits = GUARD_REAL_LIMITS_NONE,
    };
    struct measure_report report;
    struct run run;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, measure_run(&drive, &plan, &run, &report, &error), error.message);
    TEST_ASSERT_EQUAL_size_t(periods * length, run.rows);
    const double *velocity = run_column(&run, "velocity_rad_per_s");
    const double *settled = velocity + (periods - 1) * length;
    double transient = 0;
    double steady = 0;
    for (size_t n = 0; n < length; n++) {
        transient += (velocity[n] - settled[n]) * (velocity[n] - settled[n]);
        steady += settled[n] * settled[n];
    }
    run_free(&run);
    return transient / steady;
}

struct shares {
    double expected, measured, faded;
};

/// One drive with each start; the transient that the designer states, then those without and with the default fade in.
static void measure_starts(const struct two_mass *drive, struct shares out_shares[starts])
{
    make_model(drive);
    for (size_t s = 0; s < starts; s++) {
        struct design_result result;
        struct table_bytes table;
        design(start_kinds[s], &result);
        make_table(&result, &table);
        out_shares[s] = (struct shares){
            .expected = expected_share(&result),
            .measured = measured_share(&table.view, true),
            .faded = measured_share(&table.view, false),
        };
        printf("%10.0f Hz  %-5s at %4zu  %.3e  %.3e  %.3e\n", drive->antiresonance_hz, start_names[s],
               result.start_index, out_shares[s].expected, out_shares[s].measured, out_shares[s].faded);
        table_bytes_free(&table);
        design_result_free(&result);
    }
}

static void test_measure_without_fade_in_has_the_transient_that_the_designer_states(void)
{
    printf("antiresonance  start           expected  --fade 0   default fade\n");
    for (size_t d = 0; d < drives; d++) {
        struct shares shares[starts];
        measure_starts(&two_masses[d], shares);
        const double least = shares[starts - 1].measured;
        for (size_t s = 0; s < starts; s++) {
            TEST_ASSERT_DOUBLE_WITHIN(relative_tolerance * shares[s].expected, shares[s].expected, shares[s].measured);
            TEST_ASSERT_TRUE(least <= shares[s].measured && least < shares[s].faded);
        }
    }
}

int main(void)
{
    scratch_open();
    UNITY_BEGIN();
    RUN_TEST(test_measure_without_fade_in_has_the_transient_that_the_designer_states);
    int failures = UNITY_END();
    scratch_close();
    return failures;
}
