/* SPDX-License-Identifier: MIT */
/// What a CAN bus does to a frequency response: nothing but the rounding of its objects, and no delay that is not the
/// drive's. In memory, on a virtual clock.
#include "lab/estimate/method.h"
#include "lab/estimate/parametric_frf.h"
#include "lab/estimate/periodic.h"
#include "lab/measure/measure.h"
#include "lab/measure/table_bytes.h"
#include "ports/bus_watch.h"
#include "tests/support/can_bench.h"
#include "tests/support/rigid_table.h"
#include "tests/support/scratch.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { length = 500, lines = 80, settle = 1, periods = 5 };

static const double inertia_kgm2 = 0.00516;
static const double cycle_s = 1e-3;
/// What is promised for an estimated delay.
static const double delay_share = 0.1;

static struct can_bench bench;
static struct sim_model model;
static struct table_bytes table;
static struct error error;

/// 0.02 Nm on each of the lines 2, 4, .. 160 Hz, and the motion of the inertia under it.
static void make_table(void)
{
    const struct rigid_table plan = {1.0 / cycle_s, length, lines, 0.02, inertia_kgm2, 23};
    rigid_table_make(&plan, &table);
}

/// An inertia with viscous friction, its delay the only one, and noise on every sensor.
static void make_model(void)
{
    sim_model_default(&model);
    model.structure = sim_structure_rigid;
    model.motor_inertia_kgm2 = inertia_kgm2;
    model.load_inertia_kgm2 = 0.0;
    model.viscous_friction_Nms_per_rad = 0.05;
    model.coulomb_friction_Nm = 0.0;
    model.torque_lag_s = 0.0;
    model.dead_time_s = 0.0;
    model.sample_rate_hz = 1.0 / cycle_s;
    model.sensors.velocity_filter_s = 0.0;
    model.sensors.velocity_noise_rad_per_s = 0.003;
    model.sensors.torque_noise_Nm = 0.003;
    model.seed = 5;
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

static void measure(const struct drive *drive, enum drive_mode mode, struct run *out_run)
{
    const struct measure_plan plan = {
        .table = &table.view,
        .mode = mode,
        .settle_periods = settle,
        .periods = periods,
        .limits = GUARD_REAL_LIMITS_NONE,
    };
    struct measure_report report;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, measure_run(drive, &plan, out_run, &report, &error), error.message);
    TEST_ASSERT_EQUAL_size_t((settle + periods) * length, out_run->rows);
    TEST_ASSERT_EQUAL_size_t(0, report.rows_lost);
}

// ---- The same numbers as without a bus

/// The simulated drive called directly with the numbers that its objects hold, its answers rounded to theirs. The drive
/// on the bus runs beside it, to be armed.
struct direct {
    struct drive_operations operations;
    enum drive_mode mode;
    struct sim_belt_drive twin;
};

static struct direct direct;

static enum drive_status direct_arm(void *object)
{
    enum drive_status status = bench.drive.operations->arm(object);
    direct.twin = bench.node.drive;
    return status;
}

static enum drive_status direct_exchange(void *object, const struct drive_setpoint *setpoint,
                                         struct drive_sample *out_sample)
{
    const struct cia402_scaling *s = &bench.node.scaling;
    const bool cascade = direct.mode == drive_mode_cascade;
    const int32_t zero = bench.master.zero;
    uint32_t clipped = 0;
    const struct sim_command command = {
        .control = cascade ? sim_control_cascade : sim_control_torque,
        .position =
            (zero + cia402_to_units(setpoint->position_rad, s->position, INT32_MIN, INT32_MAX, &clipped)) * s->position,
        .velocity =
            cia402_to_units(setpoint->velocity_rad_per_s, s->velocity, INT32_MIN, INT32_MAX, &clipped) * s->velocity,
        .torque = cia402_to_units(setpoint->torque_Nm, s->torque, INT16_MIN, INT16_MAX, &clipped) * s->torque,
    };
    struct sim_sample sample;
    enum drive_status status = bench.drive.operations->exchange(object, setpoint, out_sample);
    sim_belt_drive_step(&direct.twin, &command, &sample);
    *out_sample = (struct drive_sample){
        .torque_ref_Nm = round(sample.torque_ref / s->torque) * s->torque,
        .torque_Nm = round(sample.torque / s->torque) * s->torque,
        .position_rad = (round(sample.position / s->position) - zero) * s->position,
        .velocity_rad_per_s = round(sample.velocity / s->velocity) * s->velocity,
        .valid = true,
    };
    TEST_ASSERT_EQUAL_UINT32(0, clipped);
    return status;
}

static void respond(const struct run *run, struct frf *out_frf)
{
    struct periodic recording;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, periodic_cut(run, &(struct periodic_options){0}, &recording, &error),
                                  error.message);
    TEST_ASSERT_EQUAL_INT(0, estimate_method_find("mean", &error)->estimate(&recording, NULL, out_frf, &error));
    TEST_ASSERT_EQUAL_size_t(lines, out_frf->count);
    periodic_free(&recording);
}

static void same_numbers(const double *expected, const double *seen, size_t count, const char *what)
{
    for (size_t i = 0; i < count; i++) {
        TEST_ASSERT_TRUE_MESSAGE(expected[i] == seen[i], what); // == and not the bits: -0 is 0
    }
}

static void bus_equals_direct_call(enum drive_mode mode)
{
    struct run over_bus, called;
    struct frf bus_frf, direct_frf;
    can_bench_init(&bench, &model, 1000000);
    measure(&bench.drive, mode, &over_bus);
    can_bench_init(&bench, &model, 1000000);
    direct = (struct direct){.operations = *bench.drive.operations, .mode = mode};
    direct.operations.arm = direct_arm;
    direct.operations.exchange = direct_exchange;
    measure(&(struct drive){.operations = &direct.operations, .self = bench.drive.self}, mode, &called);
    static const char *const columns[] = {"torque_ref_Nm", "torque_Nm", "position_rad", "velocity_rad_per_s"};
    for (size_t i = 0; i < sizeof columns / sizeof columns[0]; i++) {
        same_numbers(run_column(&called, columns[i]), run_column(&over_bus, columns[i]), called.rows, columns[i]);
    }
    respond(&over_bus, &bus_frf);
    respond(&called, &direct_frf);
    same_numbers(direct_frf.real, bus_frf.real, lines, "real");
    same_numbers(direct_frf.imag, bus_frf.imag, lines, "imag");
    same_numbers(direct_frf.std, bus_frf.std, lines, "std");
    TEST_ASSERT_TRUE(bus_frf.std[0] > 0.0 && fabs(bus_frf.real[0]) > 0.0);
    frf_free(&bus_frf);
    frf_free(&direct_frf);
    run_free(&over_bus);
    run_free(&called);
}

static void test_can_response_equals_direct_call_in_cascade_mode(void)
{
    bus_equals_direct_call(drive_mode_cascade);
}

static void test_can_response_equals_direct_call_in_torque_mode(void)
{
    bus_equals_direct_call(drive_mode_torque);
}

// ---- Delays

/// Somebody else on the bus, who looks at it.
static struct bus_watch watch;

static void overhear(void *owner, const struct can_frame *frame, uint64_t now_us)
{
    bus_watch_frame(owner, frame, now_us);
}

static void advance_nothing(void *owner, uint64_t now_us)
{
    (void)owner;
    (void)now_us;
}

static uint64_t never(const void *owner)
{
    (void)owner;
    return CAN_NEVER_US;
}

/// Delay of the drive behind the hold, from torque reference to speed, by the model that the response is given.
static double estimate_delay_s(const struct run *run)
{
    const struct parametric_request request = {.domain = parametric_discrete};
    struct parametric_spectra spectra;
    struct parametric_outcome outcome;
    struct periodic recording;
    const struct periodic_options options = {.input = "torque_ref_Nm"};
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, periodic_cut(run, &options, &recording, &error), error.message);
    TEST_ASSERT_EQUAL_INT(0, parametric_spectra_from_periodic(&recording, 0, recording.used, &spectra, &error));
    const struct parametric_weights weights = parametric_spectra_weights(&spectra);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, parametric_identify(&spectra.data, &weights, &request, &outcome, &error),
                                  error.message);
    TEST_ASSERT_TRUE_MESSAGE(outcome.has_plant, "no drive behind the hold");
    parametric_spectra_free(&spectra);
    periodic_free(&recording);
    return outcome.plant.delay_s;
}

struct delays {
    uint32_t latch_us, reply_us;
};

/// Measures with these delays in the drive and shows its dead time and the time to its answers.
static void estimates_delays(struct delays delays, double dead_time_s, enum drive_mode mode)
{
    struct can_port unused;
    struct run run;
    char what[120];
    model.dead_time_s = dead_time_s;
    can_bench_init(&bench, &model, 1000000);
    simulated_drive_set_delays(&bench.node, delays.latch_us, delays.reply_us);
    const struct can_participant listener = {&watch, overhear, advance_nothing, never};
    inproc_bus_bind(&bench.bus, inproc_bus_add_participant(&bench.bus, &unused), &listener);
    memset(&watch, 0, sizeof watch);
    bus_watch_start(&watch, (uint32_t)lround(1e6 * cycle_s), (uint16_t)(0x280 + bench.master.options.node_id));
    measure(&bench.drive, mode, &run);
    double delay_s = estimate_delay_s(&run);
    // Between SYNC and the end of the second answer: the drive's delays, and two frames on the wire.
    double wire_s = 2.0 * can_frame_bits_worst(8) / 1e6;
    double reply_s = 1e-6 * bus_histogram_mean_us(&watch.reply) - wire_s;
    snprintf(what, sizeof what,
             "mode %d, SYNC to sample %u us, to answer %u us more, dead time %g us: %.1f us, %.1f us", (int)mode,
             (unsigned)delays.latch_us, (unsigned)delays.reply_us, 1e6 * dead_time_s, 1e6 * delay_s, 1e6 * reply_s);
    puts(what);
    TEST_ASSERT_TRUE_MESSAGE(fabs(delay_s - dead_time_s) <= delay_share * cycle_s, what);
    TEST_ASSERT_TRUE_MESSAGE(fabs(reply_s - 1e-6 * (delays.latch_us + delays.reply_us)) <= delay_share * cycle_s, what);
    TEST_ASSERT_TRUE(watch.reply.count >= run.rows);
    run_free(&run);
}

/// Set-point and sample are taken at one instant, so a constant time from SYNC to it is no part of the response; a
/// sample given to the wrong SYNC would be a whole cycle of delay.
static void test_can_response_delay_is_the_drives_and_the_answers_time_is_told(void)
{
    static const struct delays all[] = {{0, 0}, {120, 0}, {0, 180}, {100, 130}};
    static const double dead_times_s[] = {0.0, 0.35e-3, 1.4e-3};
    for (size_t i = 0; i < sizeof all / sizeof all[0]; i++) {
        for (size_t k = 0; k < sizeof dead_times_s / sizeof dead_times_s[0]; k++) {
            estimates_delays(all[i], dead_times_s[k], drive_mode_cascade);
            estimates_delays(all[i], dead_times_s[k], drive_mode_torque);
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_can_response_equals_direct_call_in_cascade_mode);
    RUN_TEST(test_can_response_equals_direct_call_in_torque_mode);
    RUN_TEST(test_can_response_delay_is_the_drives_and_the_answers_time_is_told);
    return UNITY_END();
}
