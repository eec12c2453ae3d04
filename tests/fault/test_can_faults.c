/* SPDX-License-Identifier: MIT */
/// One fault at a time at every frame of a short run, from opening the drive to stopping it. Whatever is hit: a sample
/// that says it is valid is the one the drive took at this exchange's SYNC with this exchange's set-point, to the last
/// bit; what was lost is counted; the call ends in bounded time with a status; the drive ends without torque.
/// A failing case is printed as kind, frame and byte; case_replay() with these runs it alone.
#include "tests/support/can_bench.h"

#include "unity.h"

#include <math.h>
#include <stdio.h>

enum { exchanges = 10 };

static struct can_bench bench;
static struct sim_model model;
static char where[160];

void setUp(void)
{
    sim_model_default(&model);
    can_bench_init(&bench, &model, 1000000);
}

void tearDown(void) {}

static struct drive_setpoint setpoint_at(int n)
{
    const double w = 2.0 * 3.14159265358979 * 20.0, a = 0.01;
    double t = n / 1000.0;
    return (struct drive_setpoint){a * (1.0 - cos(w * t)), a * w * sin(w * t), 0.00516 * a * w * w * cos(w * t)};
}

struct outcome {
    enum drive_status open, arm, run, stop;
    int invalid;          ///< samples returned as not valid
    uint32_t first_frame; ///< on the bus before the first exchange
    uint32_t last_frame;  ///< and after the last one
};

/// What a valid sample promises.
static void check_valid_sample(const struct drive_setpoint *setpoint)
{
    const struct simulated_drive_objects *o = &bench.node.objects;
    const struct cia402_cycle *c = &bench.master.last;
    const struct cia402_scaling *s = &bench.node.scaling;
    uint32_t clipped = 0;
    bool same_sample = bench.node.node.sync.counter == bench.master.bus.sync.counter &&
                       c->position == o->position_actual && c->velocity == o->velocity_actual &&
                       c->torque == o->torque_actual && c->torque_demand == o->torque_demand &&
                       c->status_word == o->status_word;
    TEST_ASSERT_TRUE_MESSAGE(same_sample, where);
    bool same_units = bench.master.scaling.position == s->position && bench.master.scaling.velocity == s->velocity &&
                      bench.master.scaling.torque == s->torque;
    TEST_ASSERT_TRUE_MESSAGE(same_units, where);
    TEST_ASSERT_EQUAL_UINT16_MESSAGE(2.0 / s->torque, o->max_torque, where); // what the configuration asked for
    int32_t position =
        bench.master.zero + cia402_to_units(setpoint->position_rad, s->position, INT32_MIN, INT32_MAX, &clipped);
    int32_t velocity = cia402_to_units(setpoint->velocity_rad_per_s, s->velocity, INT32_MIN, INT32_MAX, &clipped);
    int32_t torque = cia402_to_units(setpoint->torque_Nm, s->torque, INT16_MIN, INT16_MAX, &clipped);
    bool same_target =
        bench.node.command.control == sim_control_cascade && bench.node.command.position == position * s->position &&
        bench.node.command.velocity == velocity * s->velocity && bench.node.command.torque == torque * s->torque;
    TEST_ASSERT_TRUE_MESSAGE(same_target, where);
}

static bool listening;
static void listen(void *self, const struct can_frame *frame, uint64_t now_us);

static struct outcome run_once(const struct inproc_fault *fault)
{
    struct outcome out = {drive_ok, drive_ok, drive_ok, drive_ok, 0, 0, 0};
    const struct drive_configuration configuration = can_bench_configuration(drive_mode_cascade);
    const struct drive_operations *door = bench.drive.operations;
    can_bench_init(&bench, &model, 1000000);
    inproc_bus_set_faults(&bench.bus, fault, fault ? 1 : 0);
    if (listening) {
        struct can_port unused;
        const struct can_participant ear = {.self = NULL, .receive = listen, .advance = NULL, .deadline_us = NULL};
        inproc_bus_bind(&bench.bus, inproc_bus_add_participant(&bench.bus, &unused), &ear);
    }
    out.open = door->open(bench.drive.self, &configuration);
    out.arm = out.open == drive_ok ? door->arm(bench.drive.self) : out.open;
    out.run = out.arm;
    out.first_frame = bench.bus.counters.frames;
    for (int n = 0; n < exchanges && out.run == drive_ok; n++) {
        struct drive_setpoint setpoint = setpoint_at(n);
        struct drive_sample sample;
        uint32_t taken = bench.node.samples;
        out.run = door->exchange(bench.drive.self, &setpoint, &sample);
        out.invalid += !sample.valid;
        if (!sample.valid)
            continue;
        check_valid_sample(&setpoint);
        TEST_ASSERT_EQUAL_UINT32_MESSAGE(taken + 1, bench.node.samples, where);
    }
    out.last_frame = bench.bus.counters.frames;
    out.stop = door->stop(bench.drive.self);
    door->close(bench.drive.self);
    return out;
}

/// What holds after every run.
static void check_end(const struct outcome *out)
{
    const uint64_t longest_us = 4000000; // three SDO time-outs in a row, arming, stopping, with reserve
    const uint64_t settled_us = 400000;  // heartbeat time-out and ramp
    TEST_ASSERT_TRUE_MESSAGE(bench.bus.now_ns / 1000 <= longest_us, where);
    inproc_bus_run(&bench.bus, bench.bus.now_ns / 1000 + settled_us);
    TEST_ASSERT_FALSE_MESSAGE(cia402_machine_is_powered(&bench.node.machine), where);
    TEST_ASSERT_TRUE_MESSAGE(bench.node.samples == 0 || bench.node.sample.torque_ref == 0.0, where);
    TEST_ASSERT_FALSE_MESSAGE(bench.master.armed || bench.master.cycling, where);
    if (out->arm == drive_ok)
        TEST_ASSERT_EQUAL_UINT32_MESSAGE(out->invalid, bench.master.counters.samples_lost, where);
    if (out->run != drive_ok)
        TEST_ASSERT_NOT_EQUAL_MESSAGE('\0', bench.drive.operations->detail(bench.drive.self)[0], where);
}

static uint32_t clean_frames, clean_first, clean_last;
static uint16_t clean_ids[4096]; ///< COB-ID of frame number n of the clean run; a run is the same up to its fault

static void listen(void *self, const struct can_frame *frame, uint64_t now_us)
{
    (void)self, (void)now_us;
    clean_frames++;
    TEST_ASSERT_TRUE(clean_frames < sizeof clean_ids / sizeof clean_ids[0]);
    clean_ids[clean_frames] = frame->id;
}

static void test_can_faults_none_is_clean(void)
{
    snprintf(where, sizeof where, "clean run");
    clean_frames = 0;
    listening = true;
    struct outcome out = run_once(NULL);
    listening = false;
    TEST_ASSERT_EQUAL(drive_ok, out.run);
    TEST_ASSERT_EQUAL(drive_ok, out.stop);
    TEST_ASSERT_EQUAL(0, out.invalid);
    TEST_ASSERT_EQUAL_UINT32(0, bench.master.counters.frames_unexpected);
    TEST_ASSERT_EQUAL_UINT32(clean_frames, bench.bus.counters.frames);
    check_end(&out);
    clean_first = out.first_frame;
    clean_last = out.last_frame;
    printf("clean run: %lu frames, exchanges from %lu to %lu\n", (unsigned long)clean_frames,
           (unsigned long)clean_first + 1, (unsigned long)clean_last);
}

static struct outcome case_replay(enum inproc_fault_kind kind, uint32_t nth, uint32_t delay_us, uint8_t byte,
                                  uint8_t mask, uint8_t endpoint)
{
    static struct inproc_fault fault;
    fault = (struct inproc_fault){kind, inproc_any, nth, delay_us, byte, mask, endpoint};
    snprintf(where, sizeof where, "case_replay(%d, %lu, %lu, %u, 0x%02X, %u)", (int)kind, (unsigned long)nth,
             (unsigned long)delay_us, byte, mask, endpoint);
    struct outcome out = run_once(&fault);
    check_end(&out);
    return out;
}

enum frame_class { frame_other, frame_sync, frame_target, frame_sample };

static enum frame_class class_of(uint32_t nth)
{
    switch (clean_ids[nth]) {
    case 0x080:
        return frame_sync;
    case 0x205:
    case 0x305:
        return frame_target;
    case 0x185:
    case 0x285:
        return frame_sample;
    default:
        return frame_other;
    }
}

static bool in_exchanges(uint32_t nth)
{
    return nth > clean_first && nth <= clean_last;
}

/// A fault in the exchanges that costs `least` to `most` samples when it hits process data, and none when it hits
/// others.
static void costs(const struct outcome *out, uint32_t nth, int least, int most)
{
    enum frame_class class = class_of(nth);
    if (!in_exchanges(nth) || class == frame_sync)
        return;
    TEST_ASSERT_EQUAL_MESSAGE(drive_ok, out->run, where);
    TEST_ASSERT_EQUAL_MESSAGE(drive_ok, out->stop, where);
    bool process_data = class == frame_target || class == frame_sample;
    TEST_ASSERT_TRUE_MESSAGE(out->invalid >= (process_data ? least : 0) && out->invalid <= (process_data ? most : 0),
                             where);
}

static void injected_once(enum inproc_fault_kind kind)
{
    TEST_ASSERT_EQUAL_UINT32_MESSAGE(1, bench.bus.counters.injected[kind], where);
}

static void drive_noticed_lost_sync(const struct outcome *out)
{
    TEST_ASSERT_EQUAL_MESSAGE(drive_err_fault, out->run, where);
    TEST_ASSERT_EQUAL_UINT16_MESSAGE(emcy_sync_lost, bench.master.counters.last_emergency_code, where);
}

static void test_can_faults_drop_costs_one_sample(void)
{
    for (uint32_t nth = 1; nth <= clean_frames; nth++) {
        struct outcome out = case_replay(inproc_drop, nth, 0, 0, 0, 0);
        injected_once(inproc_drop);
        costs(&out, nth, 1, 1);
        if (in_exchanges(nth) && class_of(nth) == frame_sync && nth + 5 < clean_last)
            drive_noticed_lost_sync(&out);
        if (in_exchanges(nth) && class_of(nth) == frame_target)
            TEST_ASSERT_EQUAL_UINT32_MESSAGE(1, bench.node.node.errors.targets_lost, where);
    }
}

static void test_can_faults_duplicate_costs_nothing(void)
{
    for (uint32_t nth = 1; nth <= clean_frames; nth++) {
        struct outcome out = case_replay(inproc_duplicate, nth, 0, 0, 0, 0);
        injected_once(inproc_duplicate);
        TEST_ASSERT_EQUAL_MESSAGE(drive_ok, out.run, where);
        TEST_ASSERT_EQUAL_MESSAGE(0, out.invalid, where);
        if (in_exchanges(nth) && class_of(nth) == frame_sync)
            TEST_ASSERT_EQUAL_UINT32_MESSAGE(1, bench.node.node.sync.repeated, where);
        if (in_exchanges(nth) && class_of(nth) == frame_sample)
            TEST_ASSERT_EQUAL_UINT32_MESSAGE(1, bench.master.counters.frames_unexpected, where);
    }
}

static void test_can_faults_delay_is_late_or_harmless(void)
{
    for (uint32_t delay_us = 300; delay_us <= 6000; delay_us += 200)
        for (uint32_t nth = 1; nth <= clean_frames; nth++) {
            if (nth <= clean_first && delay_us % 2000 != 300)
                continue; // setting up does not hang on fractions of a period
            struct outcome out = case_replay(inproc_delay, nth, delay_us, 0, 0, 0);
            injected_once(inproc_delay);
            costs(&out, nth, 0, 2);
            // A sample that comes after its cycle and before the next SYNC is known to be late; behind that SYNC TPDO2
            // is, by its counter.
            bool late =
                class_of(nth) == frame_sample && (delay_us == 500 || (delay_us == 700 && clean_ids[nth] == 0x285));
            if (in_exchanges(nth) && late && nth + 5 < clean_last) {
                TEST_ASSERT_EQUAL_MESSAGE(1, out.invalid, where);
                TEST_ASSERT_EQUAL_UINT32_MESSAGE(1, bench.master.counters.samples_late, where);
            }
        }
}

static void test_can_faults_swap_is_told(void)
{
    for (uint32_t nth = 1; nth <= clean_frames; nth++) {
        struct outcome out = case_replay(inproc_swap, nth, 0, 0, 0, 0);
        injected_once(inproc_swap);
        costs(&out, nth, 0, 2);
    }
}

static void test_can_faults_corrupt_byte_never_passes(void)
{
    for (uint32_t nth = 1; nth <= clean_frames; nth++)
        for (uint8_t byte = 0; byte < 8; byte++) {
            uint8_t mask = (uint8_t)(1u << ((nth + byte) % 8));
            struct outcome out = case_replay(inproc_corrupt, nth, 0, byte, mask, 0);
            if (bench.bus.counters.injected[inproc_corrupt] == 0)
                break; // the frame is shorter than that
            costs(&out, nth, 1, 1);
        }
}

static void test_can_faults_shorter_frame_is_not_used(void)
{
    for (uint32_t nth = 1; nth <= clean_frames; nth++) {
        struct outcome out = case_replay(inproc_shorten, nth, 0, 0, 0, 0);
        injected_once(inproc_shorten);
        costs(&out, nth, 1, 1);
    }
}

static void test_can_faults_bus_error_is_repaired_by_retransmission(void)
{
    for (uint32_t nth = 1; nth <= clean_frames; nth++) {
        struct outcome out = case_replay(inproc_bus_error, nth, 0, 0, 0, 0);
        injected_once(inproc_bus_error);
        TEST_ASSERT_EQUAL_MESSAGE(drive_ok, out.run, where);
        TEST_ASSERT_EQUAL_MESSAGE(0, out.invalid, where);
    }
}

static void test_can_faults_drive_off_the_bus_is_noticed(void)
{
    for (uint32_t nth = 1; nth <= clean_last - 6; nth++) {
        struct outcome out = case_replay(inproc_bus_off, nth, 0, 0, 0, bench_node_endpoint);
        injected_once(inproc_bus_off);
        TEST_ASSERT_TRUE_MESSAGE(out.run == drive_err_timeout || out.run == drive_err_fault || out.invalid > 0, where);
        TEST_ASSERT_NOT_EQUAL_MESSAGE(drive_ok, out.run == drive_ok ? out.stop : out.run, where);
    }
}

static void test_can_faults_drive_back_on_the_bus_reports_it(void)
{
    const uint32_t away_us = 3000;
    for (uint32_t nth = 1; nth <= clean_last - 6; nth++) {
        struct outcome out = case_replay(inproc_bus_off, nth, away_us, 0, 0, bench_node_endpoint);
        injected_once(inproc_bus_off);
        TEST_ASSERT_EQUAL_UINT32_MESSAGE(1, bench.bus.counters.recovered, where);
        if (in_exchanges(nth))
            TEST_ASSERT_TRUE_MESSAGE(out.invalid > 0, where);
    }
}

static void test_can_faults_master_off_the_bus_ends_the_run(void)
{
    for (uint32_t nth = 1; nth <= clean_last - 6; nth++) {
        struct outcome out = case_replay(inproc_bus_off, nth, 0, 0, 0, bench_master_endpoint);
        injected_once(inproc_bus_off);
        TEST_ASSERT_EQUAL_MESSAGE(drive_err_bus, out.run, where);
    }
}

// ---- A master that falls silent, a node that restarts

static void move(int count)
{
    const struct drive_configuration configuration = can_bench_configuration(drive_mode_cascade);
    TEST_ASSERT_EQUAL(drive_ok, bench.drive.operations->open(bench.drive.self, &configuration));
    TEST_ASSERT_EQUAL(drive_ok, bench.drive.operations->arm(bench.drive.self));
    for (int n = 0; n < count; n++) {
        struct drive_setpoint setpoint = setpoint_at(n);
        struct drive_sample sample;
        TEST_ASSERT_EQUAL(drive_ok, bench.drive.operations->exchange(bench.drive.self, &setpoint, &sample));
        TEST_ASSERT_TRUE(sample.valid);
    }
}

static void test_can_faults_silent_master_stops_the_drive(void)
{
    move(13); // at about full speed
    double velocity = bench.node.drive.plant.velocity;
    uint64_t sync_us = bench.node.node.sync.last_us, ramp_us = 0, off_us = 0;
    for (uint64_t t_us = sync_us; t_us < sync_us + 300000; t_us += 10) {
        inproc_bus_run(&bench.bus, t_us);
        if (ramp_us == 0 && bench.node.command.control == sim_control_stop)
            ramp_us = t_us - sync_us;
        if (ramp_us > 0 && off_us == 0 && !cia402_machine_is_powered(&bench.node.machine) &&
            bench.node.sample.torque_ref == 0.0)
            off_us = t_us - sync_us;
    }
    printf("silent master at %.2f rad/s: ramp begins after %.2f periods, without torque after %.1f ms\n", velocity,
           (double)ramp_us / 1000.0, (double)off_us / 1000.0);
    TEST_ASSERT_TRUE(fabs(velocity) > 1.0);
    TEST_ASSERT_TRUE(ramp_us > 1000 && ramp_us <= 1500 + 10);
    uint64_t slope_us = (uint64_t)(fabs(velocity) / 50.0 * 1e6);
    const uint64_t follows_us = 100000 + 2000; // the motor's time to follow the ramp, at most
    TEST_ASSERT_TRUE(off_us > 0 && off_us <= 1500 + slope_us + follows_us);
    TEST_ASSERT_TRUE(fabs(bench.node.drive.plant.velocity) < 0.05);
    TEST_ASSERT_EQUAL(cia402_fault, bench.node.machine.state);
    TEST_ASSERT_EQUAL_UINT16(emcy_sync_lost, bench.node.objects.error_code);
    uint32_t samples = bench.node.samples;
    inproc_bus_run(&bench.bus, bench.bus.now_ns / 1000 + 100000);
    TEST_ASSERT_EQUAL_UINT32(samples, bench.node.samples); // no further motion
}

static uint16_t heard_code; ///< of the last emergency on the bus

static void hear_emergency(void *self, const struct can_frame *frame, uint64_t now_us)
{
    (void)self, (void)now_us;
    struct emcy_message message;
    if (emcy_parse(frame, 5, &message) && message.code != emcy_no_error)
        heard_code = message.code;
}

/// kill -9 after any exchange: nothing but the drive itself is left to stop it.
static void test_can_faults_master_that_dies_at_any_sample_leaves_no_motion(void)
{
    const double quick_stop = 50.0; // rad/s2, object 6085
    double longest_ms = 0.0;
    for (int count = 1; count <= 50; count++) {
        setUp();
        snprintf(where, sizeof where, "master dies after exchange %d", count);
        struct can_port unused;
        const struct can_participant ear = {.receive = hear_emergency};
        inproc_bus_bind(&bench.bus, inproc_bus_add_participant(&bench.bus, &unused), &ear);
        heard_code = 0;
        move(count);
        double speed = fabs(bench.node.drive.plant.velocity);
        uint64_t sync_us = bench.node.node.sync.last_us;
        inproc_bus_run(&bench.bus, sync_us + 1499);
        TEST_ASSERT_EQUAL_MESSAGE(cia402_operation_enabled, bench.node.machine.state, where);
        inproc_bus_run(&bench.bus, sync_us + 1510);
        TEST_ASSERT_EQUAL_MESSAGE(cia402_fault_reaction_active, bench.node.machine.state, where);
        TEST_ASSERT_EQUAL_MESSAGE(sim_control_stop, bench.node.command.control, where);
        uint64_t t_us = sync_us + 1510;
        while (bench.node.command.control != sim_control_off && t_us < sync_us + 1000000)
            inproc_bus_run(&bench.bus, t_us += 100);
        const double follows_ms = 102.0; // the motor's time to follow the ramp, at most, and the sample that ends it
        double bound_ms = 1.5 + speed / quick_stop * 1e3 + follows_ms, took_ms = (double)(t_us - sync_us) / 1e3;
        TEST_ASSERT_TRUE_MESSAGE(took_ms <= bound_ms, where);
        longest_ms = fmax(longest_ms, took_ms);
        inproc_bus_run(&bench.bus, t_us + 500000);
        double position = bench.node.drive.plant.position;
        inproc_bus_run(&bench.bus, t_us + 1500000);
        TEST_ASSERT_TRUE_MESSAGE(!(fabs(bench.node.drive.plant.position - position) > 0.0), where);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(emcy_sync_lost, heard_code, where);
        TEST_ASSERT_EQUAL_MESSAGE(cia402_fault, bench.node.machine.state, where);
    }
    printf("a master that dies: without torque after %.1f ms at most, 1.5 periods included\n", longest_ms);
}

static void test_can_faults_lost_heartbeat_of_master_stops_the_drive(void)
{
    move(5);
    bench.master.bus.producer.period_us = 0; // SYNC and set-points go on
    enum drive_status status = drive_ok;
    int n = 5;
    for (; n < 400 && status == drive_ok; n++) {
        struct drive_setpoint setpoint = setpoint_at(n);
        struct drive_sample sample;
        status = bench.drive.operations->exchange(bench.drive.self, &setpoint, &sample);
    }
    TEST_ASSERT_EQUAL(drive_err_fault, status);
    TEST_ASSERT_TRUE(n <= 305 + 5); // three heartbeats of 100 ms
    TEST_ASSERT_EQUAL_UINT16(emcy_heartbeat, bench.master.counters.last_emergency_code);
    TEST_ASSERT_EQUAL(drive_ok, bench.drive.operations->stop(bench.drive.self));
    TEST_ASSERT_EQUAL(cia402_fault, bench.node.machine.state);
}

// ---- A second master that streams

static struct can_frame rogue_frame(int kind, int n)
{
    static const uint16_t ids[] = {0x205, 0x305, 0x080};
    static const uint8_t lengths[] = {6, 8, 1};
    struct can_frame frame = can_frame_make(ids[kind], lengths[kind]);
    for (uint8_t i = 0; i < frame.length; i++)
        frame.data[i] = (uint8_t)(37 * n + 11 * i);
    if (kind == 0) { // a command to go on, to somewhere else
        can_put(frame.data, 2, cia402_control_enable_operation);
        can_put(&frame.data[2], 4, 100000);
    }
    return frame;
}

/// Set-points and SYNCs of somebody else among ours, at any time of a cycle: either this exchange's own set-point is in
/// force, or the sample is not valid and counted.
static void test_can_faults_second_streaming_master_is_not_obeyed(void)
{
    int rejected = 0;
    for (int kind = 0; kind < 3; kind++)
        for (uint64_t after_us = 0; after_us < 1000; after_us += 90) {
            struct can_port rogue;
            setUp();
            snprintf(where, sizeof where, "rogue %d, %u us into the cycle", kind, (unsigned)after_us);
            inproc_bus_add_port(&bench.bus, &rogue);
            move(3);
            enum drive_status status = drive_ok;
            int lost = 0;
            for (int n = 3; n < 20 && status == drive_ok; n++) {
                struct drive_setpoint setpoint = setpoint_at(n);
                struct drive_sample sample;
                struct can_frame frame = rogue_frame(kind, n);
                inproc_bus_run(&bench.bus, bench.bus.now_ns / 1000 + after_us % 500);
                TEST_ASSERT_EQUAL(can_ok, rogue.operations->send(rogue.self, &frame));
                status = bench.drive.operations->exchange(bench.drive.self, &setpoint, &sample);
                lost += !sample.valid;
                if (sample.valid)
                    check_valid_sample(&setpoint);
            }
            TEST_ASSERT_EQUAL_UINT32_MESSAGE(lost, bench.master.counters.samples_lost, where);
            rejected += lost;
            bench.drive.operations->stop(bench.drive.self);
            inproc_bus_run(&bench.bus, bench.bus.now_ns / 1000 + 400000);
            TEST_ASSERT_FALSE_MESSAGE(cia402_machine_is_powered(&bench.node.machine), where);
        }
    printf("a second streaming master: %d samples not valid\n", rejected);
    TEST_ASSERT_TRUE(rejected > 0);
}

static enum drive_status after_nmt(enum nmt_command command)
{
    struct can_port rogue;
    inproc_bus_add_port(&bench.bus, &rogue);
    move(5);
    struct can_frame frame = nmt_command_frame(command, 5);
    TEST_ASSERT_EQUAL(can_ok, rogue.operations->send(rogue.self, &frame));
    enum drive_status status = drive_ok;
    for (int n = 5; n < 400 && status == drive_ok; n++) {
        struct drive_setpoint setpoint = setpoint_at(n);
        struct drive_sample sample;
        status = bench.drive.operations->exchange(bench.drive.self, &setpoint, &sample);
        TEST_ASSERT_FALSE(status == drive_ok && sample.valid && n > 6);
    }
    bench.drive.operations->stop(bench.drive.self);
    inproc_bus_run(&bench.bus, bench.bus.now_ns / 1000 + 400000);
    TEST_ASSERT_FALSE(cia402_machine_is_powered(&bench.node.machine));
    return status;
}

static void test_can_faults_node_reset_ends_the_run(void)
{
    TEST_ASSERT_EQUAL(drive_err_fault, after_nmt(nmt_reset_node));
}

static void test_can_faults_node_stopped_by_nmt_ends_the_run(void)
{
    TEST_ASSERT_EQUAL(drive_err_fault, after_nmt(nmt_enter_pre_operational));
    TEST_ASSERT_EQUAL_UINT16(emcy_communication, bench.master.counters.last_emergency_code);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_can_faults_none_is_clean);
    RUN_TEST(test_can_faults_drop_costs_one_sample);
    RUN_TEST(test_can_faults_duplicate_costs_nothing);
    RUN_TEST(test_can_faults_delay_is_late_or_harmless);
    RUN_TEST(test_can_faults_swap_is_told);
    RUN_TEST(test_can_faults_corrupt_byte_never_passes);
    RUN_TEST(test_can_faults_shorter_frame_is_not_used);
    RUN_TEST(test_can_faults_bus_error_is_repaired_by_retransmission);
    RUN_TEST(test_can_faults_drive_off_the_bus_is_noticed);
    RUN_TEST(test_can_faults_drive_back_on_the_bus_reports_it);
    RUN_TEST(test_can_faults_master_off_the_bus_ends_the_run);
    RUN_TEST(test_can_faults_silent_master_stops_the_drive);
    RUN_TEST(test_can_faults_master_that_dies_at_any_sample_leaves_no_motion);
    RUN_TEST(test_can_faults_lost_heartbeat_of_master_stops_the_drive);
    RUN_TEST(test_can_faults_second_streaming_master_is_not_obeyed);
    RUN_TEST(test_can_faults_node_reset_ends_the_run);
    RUN_TEST(test_can_faults_node_stopped_by_nmt_ends_the_run);
    return UNITY_END();
}
