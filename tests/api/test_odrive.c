/* SPDX-License-Identifier: MIT */
/// A second protocol behind drivers/drive.h: the same measurement over CiA 402 and over ODrive's CAN Simple is the same
/// frequency response; what the door promises under faults; the node's watchdog; every message at every length.
#include "drivers/can/odrive_master.h"
#include "lab/estimate/circle.h"
#include "lab/estimate/method.h"
#include "lab/estimate/periodic.h"
#include "lab/measure/measure.h"
#include "lab/measure/table_bytes.h"
#include "sim/node/odrive_node.h"
#include "tests/support/can_bench.h"
#include "tests/support/rigid_table.h"
#include "tests/support/scratch.h"

#include "unity.h"

#include <complex.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;
static const double torque_limit_Nm = 2.0;

enum { length = 500, lines = 60, periods = 8, node_endpoint = 1 };

static struct inproc_bus bus;
static struct odrive_node node;
static struct odrive_node_options node_options;
static struct odrive_master master;
static struct odrive_master_options options;
static struct drive drive;
static struct can_bench canopen;
static struct sim_model model;
static struct table_bytes table;
static struct error error;

static void make_bench(uint32_t bitrate)
{
    struct can_port master_port, node_port;
    inproc_bus_init(&bus, bitrate, inproc_stuffing_worst);
    inproc_bus_add_port(&bus, &master_port);
    int endpoint = inproc_bus_add_participant(&bus, &node_port);
    TEST_ASSERT_EQUAL(node_endpoint, endpoint);
    TEST_ASSERT_TRUE(odrive_node_init(&node, &model, &node_options, &node_port));
    struct can_participant participant = odrive_node_participant(&node);
    inproc_bus_bind(&bus, endpoint, &participant);
    options.bitrate = bitrate;
    odrive_master_init(&master, &master_port, &options);
    drive = odrive_master_drive(&master);
}

void setUp(void)
{
    sim_model_default(&model);
    model.coulomb_friction_Nm = 0.0;
    model.sensors.position_noise_rad = 1e-5;
    model.sensors.velocity_noise_rad_per_s = 0.01;
    model.sensors.torque_noise_Nm = 0.005;
    node_options = odrive_node_defaults();
    node_options.node_id = 3;
    options = odrive_master_defaults();
    options.node_id = 3;
    options.torque_constant_Nm_per_A = node_options.torque_constant_Nm_per_A;
    make_bench(1000000);
    scratch_empty();
}

void tearDown(void) {}

static struct drive_configuration configuration(enum drive_mode mode)
{
    return (struct drive_configuration){.mode = mode, .sample_rate_hz = 1000.0, .torque_limit_Nm = torque_limit_Nm};
}

static void ok(enum drive_status status)
{
    TEST_ASSERT_EQUAL_MESSAGE(drive_ok, status, drive.operations->detail(drive.self));
}

static void open_and_arm(enum drive_mode mode)
{
    struct drive_configuration c = configuration(mode);
    ok(drive.operations->open(drive.self, &c));
    ok(drive.operations->arm(drive.self));
    TEST_ASSERT_EQUAL(odrive_closed_loop, node.status.state);
}

// ---- The same measurement through two doors

static void make_table(void)
{
    const struct rigid_table plan = {1000.0, length, lines, 0.03, model.motor_inertia_kgm2 + model.load_inertia_kgm2,
                                     29};
    rigid_table_make(&plan, &table);
}

static void measure(const struct drive *door, enum drive_mode mode, struct frf *out_frf)
{
    struct measure_plan plan = {
        .table = &table.view,
        .mode = mode,
        .settle_periods = 2,
        .periods = periods,
        .limits = GUARD_REAL_LIMITS_NONE,
    };
    plan.limits.torque_max_Nm = torque_limit_Nm;
    struct measure_report report;
    struct run run;
    struct periodic recording;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, measure_run(door, &plan, &run, &report, &error), error.message);
    TEST_ASSERT_EQUAL_UINT32(0, report.counters.samples_lost);
    TEST_ASSERT_EQUAL_size_t((2 + periods) * length, run.rows);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, periodic_cut(&run, &(struct periodic_options){0}, &recording, &error),
                                  error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, estimate_method_find("mean", &error)->estimate(&recording, NULL, out_frf, &error),
                                  error.message);
    door->operations->close(door->self);
    periodic_free(&recording);
    run_free(&run);
}

/// Share of lines at which two independent estimates differ by less than the 95 % circle of their difference.
static double agreement(const struct frf *a, const struct frf *b)
{
    double factor = circle_confidence_factor(0.95, a->degrees_of_freedom / 2.0), agreeing = 0.0;
    TEST_ASSERT_EQUAL_size_t(a->count, b->count);
    for (size_t i = 0; i < a->count; i++) {
        double complex difference = (a->real[i] - b->real[i]) + (a->imag[i] - b->imag[i]) * I;
        TEST_ASSERT_TRUE(a->valid[i] && b->valid[i]);
        agreeing += cabs(difference) <= factor * hypot(a->std[i], b->std[i]);
    }
    return agreeing / (double)a->count;
}

static void is_the_same_response(enum drive_mode mode, bool cyclic)
{
    struct frf over_canopen, over_odrive;
    make_table();
    model.seed = 1;
    can_bench_init(&canopen, &model, 1000000);
    measure(&canopen.drive, mode, &over_canopen);
    model.seed = 2; // noise of its own: agreement is then more than equality of the same numbers
    node_options.cyclic = cyclic;
    make_bench(1000000);
    measure(&drive, mode, &over_odrive);
    double share = agreement(&over_canopen, &over_odrive);
    printf("%s, %s: %.1f %% of %d lines agree within the 95 %% circle\n",
           mode == drive_mode_torque ? "torque" : "cascade", cyclic ? "cyclic" : "polled", 100.0 * share, lines);
    // 60 lines at 95 % scatter by 2.8 %: three of these below
    TEST_ASSERT_TRUE(share >= 0.95 - 3 * 0.028);
    frf_free(&over_canopen);
    frf_free(&over_odrive);
    table_bytes_free(&table);
}

static void test_odrive_measures_the_response_that_canopen_measures_in_torque_mode(void)
{
    is_the_same_response(drive_mode_torque, true);
}

static void test_odrive_measures_the_response_that_canopen_measures_in_cascade_mode(void)
{
    is_the_same_response(drive_mode_cascade, true);
}

static void test_odrive_measures_the_same_when_it_is_polled(void)
{
    is_the_same_response(drive_mode_torque, false);
}

static void test_odrive_reports_what_the_drive_does(void)
{
    model.sensors.position_noise_rad = model.sensors.velocity_noise_rad_per_s = model.sensors.torque_noise_Nm = 0.0;
    make_bench(1000000);
    open_and_arm(drive_mode_torque);
    struct sim_belt_drive twin = node.drive;
    for (int n = 0; n < 100; n++) {
        struct drive_setpoint setpoint = {.torque_Nm = 0.2 * sin(0.1 * n)};
        struct drive_sample sample;
        ok(drive.operations->exchange(drive.self, &setpoint, &sample));
        struct sim_command command = {.control = sim_control_torque, .torque = (float)setpoint.torque_Nm};
        struct sim_sample direct;
        sim_belt_drive_step(&twin, &command, &direct);
        TEST_ASSERT_TRUE(sample.valid);
        TEST_ASSERT_TRUE((float)direct.torque_ref == sample.torque_ref_Nm);
        TEST_ASSERT_TRUE((float)direct.torque == sample.torque_Nm);
        TEST_ASSERT_EQUAL_DOUBLE((double)(float)(direct.velocity / two_pi) * two_pi, sample.velocity_rad_per_s);
    }
    ok(drive.operations->stop(drive.self));
    TEST_ASSERT_EQUAL(odrive_idle, node.status.state);
    const double standstill_rad_per_s = 0.02; // velocity control has settled
    TEST_ASSERT_DOUBLE_WITHIN(standstill_rad_per_s, 0.0, node.sample.velocity);
}

static void test_odrive_uses_currents_where_firmware_has_no_torques(void)
{
    node_options.has_torques = false;
    make_bench(1000000);
    open_and_arm(drive_mode_torque);
    struct drive_setpoint setpoint = {.torque_Nm = 0.25};
    struct drive_sample sample;
    ok(drive.operations->exchange(drive.self, &setpoint, &sample));
    TEST_ASSERT_FLOAT_WITHIN(1e-6f, 0.25f, (float)sample.torque_ref_Nm);
    options.torque_constant_Nm_per_A = 0.0;
    make_bench(1000000);
    struct drive_configuration c = configuration(drive_mode_torque);
    TEST_ASSERT_EQUAL(drive_err_identity, drive.operations->open(drive.self, &c));
    TEST_ASSERT_NOT_NULL(strstr(drive.operations->detail(drive.self), "torque constant"));
}

// ---- Limits and refusals

static void refused(enum drive_status expected, const struct drive_configuration *c, const char *says)
{
    TEST_ASSERT_EQUAL(expected, drive.operations->open(drive.self, c));
    const char *detail = drive.operations->detail(drive.self);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(detail, says), detail);
    TEST_ASSERT_EQUAL(drive_err_argument, drive.operations->arm(drive.self));
}

static void test_odrive_open_refuses_what_cannot_be(void)
{
    struct drive_configuration c = configuration(drive_mode_torque);
    c.torque_limit_Nm = NAN;
    refused(drive_err_argument, &c, "torque limit");
    c = configuration(drive_mode_torque);
    c.sample_rate_hz = 500.0; // its messages come at 1 kHz
    refused(drive_err_refused, &c, "message rates");
    make_bench(250000);
    c = configuration(drive_mode_torque);
    refused(drive_err_argument, &c, "bus load: 365 bits per cycle x 1000 Hz / 250000 bit/s = 146 %");
    options.torque_constant_Nm_per_A = 0.0;
    make_bench(1000000);
    c = configuration(drive_mode_cascade);
    refused(drive_err_argument, &c, "torque constant");
    options.node_id = 4;
    make_bench(1000000);
    c = configuration(drive_mode_torque);
    refused(drive_err_timeout, &c, "no heartbeat");
    node_options.clock_ratio = 1.1;
    options.node_id = 3;
    make_bench(1000000);
    refused(drive_err_refused, &c, "message rates");
}

static void test_odrive_torque_limit_clips_in_master_and_drive(void)
{
    open_and_arm(drive_mode_torque);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, torque_limit_Nm, node.drive.torque_limit);
    struct drive_setpoint push = {.torque_Nm = 5.0};
    struct drive_sample sample;
    ok(drive.operations->exchange(drive.self, &push, &sample));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, torque_limit_Nm, sample.torque_ref_Nm);
    TEST_ASSERT_EQUAL_UINT32(1, master.saturated);
    push.torque_Nm = NAN;
    TEST_ASSERT_EQUAL(drive_err_argument, drive.operations->exchange(drive.self, &push, &sample));
}

// ---- Faults

enum { exchanges = 40 };

struct outcome {
    enum drive_status status;
    int invalid;
};

static struct outcome run_exchanges(void)
{
    struct outcome out = {drive_ok, 0};
    for (int n = 0; n < exchanges && out.status == drive_ok; n++) {
        struct drive_setpoint setpoint = {.torque_Nm = 0.1 * sin(0.3 * n)};
        struct drive_sample sample;
        uint32_t ticks = node.ticks;
        out.status = drive.operations->exchange(drive.self, &setpoint, &sample);
        out.invalid += !sample.valid;
        if (!sample.valid)
            continue;
        TEST_ASSERT_EQUAL_UINT32(ticks + 1, node.ticks);
        TEST_ASSERT_EQUAL_DOUBLE((double)(float)node.sample.torque_ref, sample.torque_ref_Nm);
        TEST_ASSERT_EQUAL_DOUBLE((double)(float)(node.sample.velocity / two_pi) * two_pi, sample.velocity_rad_per_s);
        TEST_ASSERT_EQUAL_DOUBLE((double)(float)node.sample.torque, sample.torque_Nm);
    }
    return out;
}

/// One fault at one frame of the exchanges: no wrong sample is valid (run_exchanges), the count is the door's.
static void costs(struct inproc_fault fault, uint8_t command, uint32_t n, int least, int most)
{
    setUp();
    open_and_arm(drive_mode_torque);
    fault.cob_id = (uint16_t)(3u << 5 | command);
    fault.nth = bus.seen[fault.cob_id] + n;
    inproc_bus_set_faults(&bus, &fault, 1);
    struct outcome out = run_exchanges();
    char text[80];
    snprintf(text, sizeof text, "fault %d, %lu us, command %02X, frame %lu: %d lost", (int)fault.kind,
             (unsigned long)fault.delay_us, command, (unsigned long)n, out.invalid);
    TEST_ASSERT_EQUAL_MESSAGE(drive_ok, out.status, text);
    TEST_ASSERT_TRUE_MESSAGE(out.invalid >= least && out.invalid <= most, text);
    TEST_ASSERT_EQUAL_UINT32(out.invalid, master.counters.samples_lost);
    TEST_ASSERT_EQUAL_UINT32(1, bus.counters.injected[fault.kind]);
    ok(drive.operations->stop(drive.self));
    inproc_bus_set_faults(&bus, NULL, 0);
}

static const uint8_t replies[] = {odrive_get_encoder_estimates, odrive_get_torques};

static void test_odrive_lost_frame_costs_one_sample_or_none(void)
{
    for (uint32_t n = 1; n <= exchanges; n++) {
        for (size_t which = 0; which < sizeof replies; which++)
            costs((struct inproc_fault){.kind = inproc_drop}, replies[which], n, 1, 1);
        // A lost set-point loses nothing: the sample says which target the drive followed.
        costs((struct inproc_fault){.kind = inproc_drop}, odrive_set_input_torque, n, 0, 0);
    }
}

static void test_odrive_repeated_frame_costs_nothing(void)
{
    for (uint32_t n = 1; n <= exchanges; n++)
        for (size_t which = 0; which < sizeof replies; which++)
            costs((struct inproc_fault){.kind = inproc_duplicate}, replies[which], n, 0, 0);
}

/// A late reply costs its sample, unless it is hardly late, and may cost the one that it comes in between.
static void test_odrive_late_or_swapped_frame_is_told(void)
{
    static const uint32_t delays_us[] = {50,   200,  400,  700,  800,  850,  900,  950,
                                         1000, 1050, 1200, 1500, 1900, 2000, 2100, 3000};
    for (uint32_t n = 1; n + 3 <= exchanges; n += 3)
        for (size_t which = 0; which < sizeof replies; which++) {
            for (size_t i = 0; i < sizeof delays_us / sizeof delays_us[0]; i++) {
                const struct inproc_fault late = {.kind = inproc_delay, .delay_us = delays_us[i]};
                costs(late, replies[which], n, delays_us[i] < 600 ? 0 : 1, 2);
            }
            costs((struct inproc_fault){.kind = inproc_swap}, replies[which], n, 0, 2);
        }
}

static void test_odrive_silent_master_trips_the_watchdog(void)
{
    open_and_arm(drive_mode_torque);
    run_exchanges();
    uint64_t from_us = bus.now_ns / 1000;
    inproc_bus_run(&bus, from_us + odrive_node_watchdog_us - 2000);
    TEST_ASSERT_EQUAL(odrive_closed_loop, node.status.state);
    inproc_bus_run(&bus, from_us + odrive_node_watchdog_us + 2000);
    TEST_ASSERT_EQUAL(odrive_idle, node.status.state);
    TEST_ASSERT_EQUAL_HEX32(odrive_error_watchdog, node.status.error);
    TEST_ASSERT_TRUE(node.sample.torque_ref == 0.0);
    struct drive_setpoint setpoint = {0};
    struct drive_sample sample;
    TEST_ASSERT_EQUAL(drive_err_fault, drive.operations->exchange(drive.self, &setpoint, &sample));
    TEST_ASSERT_FALSE(sample.valid);
    TEST_ASSERT_NOT_NULL(strstr(drive.operations->detail(drive.self), "watchdog"));
    ok(drive.operations->stop(drive.self));
    open_and_arm(drive_mode_torque); // open clears the error
    ok(drive.operations->stop(drive.self));
}

static void test_odrive_emergency_stop_and_bad_estimates_end_the_measurement(void)
{
    for (int kind = 0; kind < 2; kind++) {
        setUp();
        open_and_arm(drive_mode_torque);
        if (kind == 0) {
            struct can_frame frame = odrive_words_frame(3, odrive_estop, 0, 0, 0);
            TEST_ASSERT_EQUAL(can_ok, master.port.operations->send(master.port.self, &frame));
        } else {
            node.drive.encoder = sim_encoder_dead;
        }
        TEST_ASSERT_EQUAL(drive_err_fault, run_exchanges().status);
        TEST_ASSERT_EQUAL_HEX32(kind == 0 ? odrive_error_estop : odrive_error_missing_estimate, node.status.error);
        TEST_ASSERT_EQUAL(odrive_idle, node.status.state);
    }
}

static void test_odrive_that_leaves_the_bus_is_noticed(void)
{
    open_and_arm(drive_mode_torque);
    const uint16_t id = 3u << 5 | odrive_get_encoder_estimates;
    struct inproc_fault fault = {
        .kind = inproc_bus_off, .cob_id = id, .nth = bus.seen[id] + 5, .endpoint = node_endpoint};
    inproc_bus_set_faults(&bus, &fault, 1);
    struct outcome out = run_exchanges();
    TEST_ASSERT_EQUAL(drive_err_timeout, out.status);
    TEST_ASSERT_EQUAL(options.lost_in_a_row + 1, out.invalid);
    TEST_ASSERT_EQUAL(drive_err_timeout, drive.operations->stop(drive.self));
    inproc_bus_set_faults(&bus, NULL, 0);
}

// ---- Messages

static void test_odrive_messages_have_their_documented_bytes(void)
{
    struct can_frame frame = odrive_float_frame(3, odrive_set_input_torque, 1.0);
    const uint8_t one[4] = {0x00, 0x00, 0x80, 0x3F};
    TEST_ASSERT_EQUAL_HEX16(0x06E, frame.id);
    TEST_ASSERT_EQUAL(4, frame.length);
    TEST_ASSERT_EQUAL_MEMORY(one, frame.data, 4);
    TEST_ASSERT_FALSE(odrive_input_pos_frame(3, -2.0, 1.5, -0.25, &frame));
    const uint8_t position[8] = {0x00, 0x00, 0x00, 0xC0, 0xDC, 0x05, 0x06, 0xFF}; // 1500, -250
    TEST_ASSERT_EQUAL_MEMORY(position, frame.data, 8);
    TEST_ASSERT_TRUE(odrive_input_pos_frame(3, 0.0, 33.0, 0.0, &frame));
    TEST_ASSERT_EQUAL_HEX16(0x7FFF, can_get(&frame.data[4], 2));
    TEST_ASSERT_TRUE(odrive_input_pos_frame(3, 0.0, NAN, 0.0, &frame));
    TEST_ASSERT_EQUAL_HEX16(0, can_get(&frame.data[4], 2));
    frame = odrive_request_frame(3, odrive_get_encoder_estimates);
    TEST_ASSERT_EQUAL_HEX16(0x069, frame.id);
    TEST_ASSERT_TRUE(frame.remote && frame.length == 0);
}

/// Whatever arrives, at every length: only whole messages move anything.
static void test_odrive_node_takes_whole_messages_only(void)
{
    struct can_participant participant = odrive_node_participant(&node);
    for (unsigned command = 0; command < 32; command++)
        for (uint8_t bytes = 0; bytes <= 8; bytes++)
            for (unsigned fill = 0; fill < 256; fill += 51) {
                make_bench(1000000);
                participant = odrive_node_participant(&node);
                struct can_frame frame = can_frame_make((uint16_t)(3u << 5 | command), bytes);
                memset(frame.data, (int)fill, bytes);
                participant.receive(participant.self, &frame, 0);
                bool whole = bytes >= (command == odrive_set_input_torque || command == odrive_set_axis_state ? 4 : 8);
                if (!whole) {
                    TEST_ASSERT_TRUE(node.input_torque_Nm == 0.0 && node.input_position_rev == 0.0);
                    TEST_ASSERT_EQUAL(odrive_control_position, node.control_mode);
                }
                TEST_ASSERT_TRUE(isfinite(node.input_torque_Nm) && isfinite(node.input_position_rev));
                TEST_ASSERT_EQUAL(odrive_idle, node.status.state); // no filling spells "closed loop"
            }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_odrive_messages_have_their_documented_bytes);
    RUN_TEST(test_odrive_node_takes_whole_messages_only);
    RUN_TEST(test_odrive_reports_what_the_drive_does);
    RUN_TEST(test_odrive_uses_currents_where_firmware_has_no_torques);
    RUN_TEST(test_odrive_open_refuses_what_cannot_be);
    RUN_TEST(test_odrive_torque_limit_clips_in_master_and_drive);
    RUN_TEST(test_odrive_lost_frame_costs_one_sample_or_none);
    RUN_TEST(test_odrive_repeated_frame_costs_nothing);
    RUN_TEST(test_odrive_late_or_swapped_frame_is_told);
    RUN_TEST(test_odrive_silent_master_trips_the_watchdog);
    RUN_TEST(test_odrive_emergency_stop_and_bad_estimates_end_the_measurement);
    RUN_TEST(test_odrive_that_leaves_the_bus_is_noticed);
    RUN_TEST(test_odrive_measures_the_response_that_canopen_measures_in_torque_mode);
    RUN_TEST(test_odrive_measures_the_response_that_canopen_measures_in_cascade_mode);
    RUN_TEST(test_odrive_measures_the_same_when_it_is_polled);
    return UNITY_END();
}
