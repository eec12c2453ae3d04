/* SPDX-License-Identifier: MIT */
/// The simulated drive by itself, frame by frame on a clock of the test's own: modes, ramps, limits to one count,
/// status bits, faults, and who may command it. What goes over a bus is in tests/api and tests/fault.
#include "sim/node/simulated_drive.h"

#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { node_id = 5, period_us = 1000, sent_max = 64 };

static struct simulated_drive drive;
static struct can_participant part;
static struct sim_model model;
static uint64_t now_us;
static uint8_t sync_counter;
static struct {
    struct can_frame frame;
    uint64_t time_us;
} sent[sent_max];
static size_t sent_count;

static enum can_status keep(void *self, const struct can_frame *frame)
{
    (void)self;
    if (sent_count < sent_max) {
        sent[sent_count].frame = *frame;
        sent[sent_count++].time_us = now_us;
    }
    return can_ok;
}

static const struct can_port_operations operations = {.send = keep};

static void give(const struct can_frame *frame)
{
    part.receive(part.self, frame, now_us);
}

static void let_pass(uint64_t until_us)
{
    while (part.deadline_us(part.self) <= until_us) {
        uint64_t due_us = part.deadline_us(part.self);
        now_us = due_us > now_us ? due_us : now_us;
        part.advance(part.self, now_us);
    }
    now_us = until_us;
}

static void start(void)
{
    const struct can_port port = {.operations = &operations, .self = NULL};
    now_us = 0;
    sync_counter = 0;
    sent_count = 0;
    simulated_drive_init(&drive, &model, node_id, &port);
    part = simulated_drive_participant(&drive);
    let_pass(10);
    struct can_frame frame = nmt_command_frame(nmt_start, node_id);
    give(&frame);
}

void setUp(void)
{
    sim_model_default(&model);
    memset(model.effect_on, 0, sizeof model.effect_on);
    memset(&model.sensors, 0, sizeof model.sensors);
    model.coulomb_friction_Nm = 0.02;
    model.viscous_friction_Nms_per_rad = 0.001;
    start();
}

void tearDown(void) {}

static uint32_t write_object(uint16_t index, uint8_t subindex, int64_t value)
{
    struct od_place place;
    uint32_t abort_code = od_locate(&drive.node.dictionary, index, subindex, &place);
    return abort_code == od_abort_none ? od_write(&place, value) : abort_code;
}

static void put(uint16_t index, uint8_t subindex, int64_t value)
{
    TEST_ASSERT_EQUAL_HEX32(od_abort_none, write_object(index, subindex, value));
}

static void command(uint16_t control_word)
{
    put(cia402_control_word, 0, control_word);
}

static void cycles(unsigned count)
{
    for (unsigned i = 0; i < count; i++) {
        let_pass(now_us + period_us);
        struct can_frame frame = can_frame_make(sync_cob_id, drive.node.sync.overflow ? 1 : 0);
        sync_counter = (uint8_t)(sync_counter % 240 + 1);
        frame.data[0] = sync_counter;
        give(&frame);
    }
}

static void ask_for_operation(enum cia402_mode mode)
{
    put(cia402_modes_of_operation, 0, mode);
    command(cia402_control_shutdown);
    command(cia402_control_switch_on);
    command(cia402_control_enable_operation);
}

static void enable(enum cia402_mode mode)
{
    ask_for_operation(mode);
    TEST_ASSERT_EQUAL(cia402_operation_enabled, drive.machine.state);
}

static uint16_t status(void)
{
    return drive.objects.status_word;
}

static uint16_t last_emergency(void)
{
    for (size_t i = sent_count; i-- > 0;)
        if (sent[i].frame.id == emcy_cob_id + node_id && can_get(sent[i].frame.data, 2) != 0)
            return (uint16_t)can_get(sent[i].frame.data, 2);
    return 0;
}

/// In CSV at this speed in rad/s, settled.
static void turn(double speed)
{
    enable(cia402_mode_csv);
    put(cia402_target_velocity, 0, (int64_t)lround(speed / drive.scaling.velocity));
    cycles(300);
    const double settled = 0.02; // rad/s, of friction under the integral part
    TEST_ASSERT_DOUBLE_WITHIN(settled, speed, drive.sample.velocity);
}

// ---- Modes

static void test_simulated_drive_offers_cyclic_modes_and_profile_torque_but_no_homing(void)
{
    TEST_ASSERT_EQUAL_HEX32(0x00000388, drive.objects.supported_modes);
    static const int8_t refused[] = {-1, 1, 2, 3, 5, 6, 7, 11, 33, 127};
    for (size_t i = 0; i < sizeof refused; i++)
        TEST_ASSERT_EQUAL_HEX32(od_abort_value, write_object(cia402_modes_of_operation, 0, refused[i]));
    static const int8_t offered[] = {4, 8, 9, 10, 0};
    for (size_t i = 0; i < sizeof offered; i++) {
        put(cia402_modes_of_operation, 0, offered[i]);
        TEST_ASSERT_EQUAL_INT8(offered[i], drive.objects.mode_display);
    }
    enable(cia402_mode_cst);
    TEST_ASSERT_EQUAL_HEX32(od_abort_state, write_object(cia402_modes_of_operation, 0, cia402_mode_csp));
}

static void test_simulated_drive_changes_its_mode_in_operation_only_at_rest(void)
{
    turn(2.0);
    command(cia402_control_enable_operation | cia402_control_halt);
    cycles(1);
    TEST_ASSERT_EQUAL_HEX32(od_abort_state, write_object(cia402_modes_of_operation, 0, cia402_mode_csp));
    cycles(500);
    put(cia402_target_position, 0, 123456);
    put(cia402_modes_of_operation, 0, cia402_mode_csp);
    command(cia402_control_enable_operation);
    int32_t before = drive.objects.position_actual;
    cycles(50);
    TEST_ASSERT_INT32_WITHIN(200, before, drive.objects.position_actual);
}

static void test_simulated_drive_csv_follows_60ff_plus_60b1_within_607f(void)
{
    turn(5.0);
    put(cia402_velocity_offset, 0, 1000000);
    cycles(300);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 6.0, drive.sample.velocity);
    put(cia402_max_velocity, 0, 6000000);
    cycles(1);
    TEST_ASSERT_FALSE(status() & cia402_status_limited); // equal is inside
    put(cia402_max_velocity, 0, 5999999);
    cycles(1);
    TEST_ASSERT_TRUE(status() & cia402_status_limited);
    TEST_ASSERT_TRUE(drive.command.velocity == 5999999 * drive.scaling.velocity);
}

static void test_simulated_drive_profile_torque_moves_on_its_slope(void)
{
    put(cia402_torque_slope, 0, 2000); // permille/s: 2 per sample
    put(cia402_target_torque, 0, 500);
    enable(cia402_mode_profile_torque);
    cycles(1);
    TEST_ASSERT_EQUAL_INT16(0, drive.objects.torque_demand); // what was set before is forgotten
    put(cia402_target_torque, 0, 101);
    for (int16_t n = 1; n <= 50; n++) {
        cycles(1);
        TEST_ASSERT_EQUAL_INT16(2 * n, drive.objects.torque_demand);
        TEST_ASSERT_FALSE(status() & cia402_status_target_reached);
    }
    cycles(1);
    TEST_ASSERT_EQUAL_INT16(101, drive.objects.torque_demand);
    TEST_ASSERT_TRUE(status() & cia402_status_target_reached);
    put(cia402_target_torque, 0, -3);
    cycles(1);
    TEST_ASSERT_EQUAL_INT16(99, drive.objects.torque_demand);
    TEST_ASSERT_EQUAL_HEX32(od_abort_value, write_object(cia402_torque_slope, 0, 0));
}

static void test_simulated_drive_cst_adds_offset_and_clips_to_6072(void)
{
    enable(cia402_mode_cst);
    put(cia402_target_torque, 0, 100);
    put(cia402_torque_offset, 0, 23);
    cycles(1);
    TEST_ASSERT_EQUAL_INT16(123, drive.objects.torque_demand);
    put(cia402_max_torque, 0, 124);
    cycles(1);
    TEST_ASSERT_FALSE(status() & cia402_status_limited);
    put(cia402_max_torque, 0, 122);
    cycles(1);
    TEST_ASSERT_EQUAL_INT16(122, drive.objects.torque_demand);
    TEST_ASSERT_TRUE(status() & cia402_status_limited);
    put(cia402_target_torque, 0, -1000);
    cycles(1);
    TEST_ASSERT_EQUAL_INT16(-122, drive.objects.torque_demand);
}

static void test_simulated_drive_begins_where_it_stands_whatever_was_written_before(void)
{
    put(cia402_target_position, 0, 1000000);
    put(cia402_torque_offset, 0, 900);
    enable(cia402_mode_csp);
    cycles(50);
    TEST_ASSERT_EQUAL_INT32(0, drive.objects.position_actual);
    put(cia402_target_position, 0, 100);
    cycles(300);
    const int32_t friction_counts = 200; // 20 mNm over 24 Nm/rad is 0.8 mrad = 139 counts of 6 urad
    TEST_ASSERT_INT32_WITHIN(friction_counts, 100, drive.objects.position_actual);
}

// ---- Stops

/// Samples until standstill, and the speed one sample after the start of the ramp.
static unsigned samples_to_state(enum cia402_state state, double *out_first_step)
{
    double before = drive.drive.stop_velocity;
    unsigned n = 0;
    for (; n < 2000 && drive.machine.state != state; n++) {
        cycles(1);
        if (n == 0)
            *out_first_step = before - drive.drive.stop_velocity;
    }
    TEST_ASSERT_EQUAL(state, drive.machine.state);
    return n;
}

/// From 4 rad/s with this word and option; the ramp in rad/s2 that it must use, 0: coast.
static void stop_by(uint16_t option_index, int16_t option, uint16_t word, enum cia402_state ends, double ramp)
{
    start();
    put(option_index, 0, option);
    put(cia402_profile_deceleration, 0, 8000);
    put(cia402_quick_stop_deceleration, 0, 40000);
    turn(4.0);
    double first_step = 0.0;
    command(word);
    char text[64];
    snprintf(text, sizeof text, "%04X = %d", option_index, option);
    if (ramp == 0.0) {
        TEST_ASSERT_EQUAL_MESSAGE(ends, drive.machine.state, text);
        cycles(1);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(0, drive.objects.torque_demand, text);
        return;
    }
    unsigned samples = samples_to_state(ends, &first_step);
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-9, ramp / 1000.0, first_step, text);
    unsigned least = (unsigned)(4.0 / ramp * 1000.0) - 10, most = least + 130; // the motor follows within 0.1 s
    TEST_ASSERT_TRUE_MESSAGE(samples >= least && samples <= most, text);
    cycles(1);
    TEST_ASSERT_EQUAL_INT16_MESSAGE(0, drive.objects.torque_demand, text);
}

static void test_simulated_drive_stops_as_its_option_codes_say(void)
{
    const double slow = 8.0, quick = 40.0;
    stop_by(0x605A, 0, cia402_control_quick_stop, cia402_switch_on_disabled, 0.0);
    stop_by(0x605A, 1, cia402_control_quick_stop, cia402_switch_on_disabled, slow);
    stop_by(0x605A, 2, cia402_control_quick_stop, cia402_switch_on_disabled, quick);
    stop_by(0x605B, 0, cia402_control_shutdown, cia402_ready, 0.0);
    stop_by(0x605B, 1, cia402_control_shutdown, cia402_ready, slow);
    stop_by(0x605C, 0, cia402_control_switch_on, cia402_switched_on, 0.0);
    stop_by(0x605C, 1, cia402_control_switch_on, cia402_switched_on, slow);
    stop_by(0x605A, 2, cia402_control_disable_voltage, cia402_switch_on_disabled, 0.0); // always coasts
}

/// Ramps that end in the state they are in: quick stop 5 and 6, halt.
static void stay_by(uint16_t option_index, int16_t option, uint16_t word, enum cia402_state state, double ramp)
{
    start();
    put(option_index, 0, option);
    put(cia402_profile_deceleration, 0, 8000);
    put(cia402_quick_stop_deceleration, 0, 40000);
    turn(4.0);
    command(word);
    cycles(1);
    TEST_ASSERT_DOUBLE_WITHIN(ramp / 1000.0 + 0.02, 4.0, drive.drive.stop_velocity);
    TEST_ASSERT_FALSE(status() & cia402_status_target_reached);
    cycles(700);
    TEST_ASSERT_EQUAL(state, drive.machine.state);
    TEST_ASSERT_TRUE(status() & cia402_status_target_reached);
    TEST_ASSERT_DOUBLE_WITHIN(2e-2, 0.0, drive.sample.velocity);
    TEST_ASSERT_FALSE(status() & cia402_status_follows);
    command(cia402_control_enable_operation); // transition 16, or the halt's end
    cycles(300);
    TEST_ASSERT_EQUAL(cia402_operation_enabled, drive.machine.state);
    TEST_ASSERT_TRUE(status() & cia402_status_follows);
}

static void test_simulated_drive_halt_and_quick_stop_may_stay(void)
{
    stay_by(0x605A, 5, cia402_control_quick_stop, cia402_quick_stop_active, 8.0);
    stay_by(0x605A, 6, cia402_control_quick_stop, cia402_quick_stop_active, 40.0);
    stay_by(0x605D, 1, 0x010F, cia402_operation_enabled, 8.0);
    stay_by(0x605D, 2, 0x010F, cia402_operation_enabled, 40.0);
}

/// A fault at 4 rad/s: the speed limit 6080 below it.
static void fault_by(int16_t option, double ramp)
{
    start();
    put(cia402_fault_reaction_option, 0, option);
    put(cia402_profile_deceleration, 0, 8000);
    put(cia402_quick_stop_deceleration, 0, 40000);
    turn(4.0);
    put(cia402_max_motor_speed, 0, 30); // rpm: 3.14 rad/s
    cycles(1);
    TEST_ASSERT_EQUAL_UINT16(emcy_speed, drive.objects.error_code);
    TEST_ASSERT_EQUAL_UINT16(emcy_speed, last_emergency());
    TEST_ASSERT_EQUAL(ramp == 0.0 ? cia402_fault : cia402_fault_reaction_active, drive.machine.state);
    double first_step = ramp / 1000.0;
    if (ramp > 0.0)
        samples_to_state(cia402_fault, &first_step);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, ramp / 1000.0, first_step);
    cycles(1);
    TEST_ASSERT_EQUAL_INT16(0, drive.objects.torque_demand);
}

static void test_simulated_drive_fault_reaction_is_605e(void)
{
    fault_by(0, 0.0);
    fault_by(1, 8.0);
    fault_by(2, 40.0);
}

static void test_simulated_drive_fault_is_latched_until_reset_by_edge(void)
{
    fault_by(2, 40.0);
    put(cia402_max_motor_speed, 0, UINT32_MAX);
    static const uint16_t words[] = {0x0006, 0x0007, 0x000F, 0x0000, 0x0002, 0x010F};
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++) {
        command(words[i]);
        cycles(2);
        TEST_ASSERT_EQUAL(cia402_fault, drive.machine.state);
        TEST_ASSERT_EQUAL_UINT16(emcy_speed, drive.objects.error_code);
    }
    command(cia402_control_fault_reset);
    TEST_ASSERT_EQUAL(cia402_switch_on_disabled, drive.machine.state);
    TEST_ASSERT_EQUAL_UINT16(0, drive.objects.error_code);
}

static void lose_connection(int16_t option, enum cia402_state at_once, enum cia402_state at_last)
{
    start();
    put(cia402_abort_connection_option, 0, option);
    put(0x1006, 0, period_us);
    turn(4.0);
    uint32_t samples = drive.samples;
    let_pass(now_us + 1400);
    TEST_ASSERT_EQUAL(cia402_operation_enabled, drive.machine.state);
    TEST_ASSERT_EQUAL_UINT32(samples, drive.samples);
    let_pass(now_us + 110);
    TEST_ASSERT_EQUAL(at_once, drive.machine.state);
    TEST_ASSERT_EQUAL_UINT16(emcy_sync_lost, last_emergency());
    let_pass(now_us + 30000000);
    TEST_ASSERT_EQUAL(at_last, drive.machine.state);
    if (at_last == cia402_operation_enabled)
        return;
    TEST_ASSERT_TRUE(fabs(drive.drive.plant.velocity) <= 2e-2);
    samples = drive.samples;
    let_pass(now_us + 1000000);
    TEST_ASSERT_EQUAL_UINT32(samples, drive.samples); // no further motion
}

static void test_simulated_drive_lost_connection_is_6007(void)
{
    lose_connection(0, cia402_operation_enabled, cia402_operation_enabled);
    lose_connection(1, cia402_fault_reaction_active, cia402_fault);
    lose_connection(2, cia402_switch_on_disabled, cia402_switch_on_disabled);
    lose_connection(3, cia402_quick_stop_active, cia402_switch_on_disabled);
}

// ---- Limits, to one count

static void test_simulated_drive_software_limits_clip_csp_set_points(void)
{
    put(cia402_position_limit, 1, -500);
    put(cia402_position_limit, 2, 700);
    TEST_ASSERT_EQUAL_HEX32(od_abort_value, write_object(cia402_position_limit, 1, 700));
    TEST_ASSERT_EQUAL_HEX32(od_abort_value, write_object(cia402_position_limit, 2, -500));
    enable(cia402_mode_csp);
    static const struct {
        int32_t target, followed;
        bool limited;
    } rows[] = {{700, 700, false}, {701, 700, true}, {-500, -500, false}, {-501, -500, true}, {INT32_MIN, -500, true}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        put(cia402_target_position, 0, rows[i].target);
        cycles(1);
        TEST_ASSERT_EQUAL_INT32(rows[i].followed, drive.followed_position);
        TEST_ASSERT_EQUAL(rows[i].limited, (status() & cia402_status_limited) != 0);
    }
}

/// Outwards over a limit in a mode without position set-points.
static void test_simulated_drive_software_limits_stop_velocity_and_torque_modes(void)
{
    static const int8_t modes[] = {cia402_mode_csv, cia402_mode_cst, cia402_mode_profile_torque};
    for (size_t m = 0; m < sizeof modes; m++) {
        start();
        put(cia402_position_limit, 2, 20000);
        enable((enum cia402_mode)modes[m]);
        put(cia402_target_velocity, 0, 3000000);
        put(cia402_target_torque, 0, 120);
        for (unsigned n = 0; n < 2000 && drive.machine.state == cia402_operation_enabled; n++) {
            TEST_ASSERT_TRUE(drive.objects.position_actual <= 20000);
            cycles(1);
        }
        TEST_ASSERT_EQUAL(cia402_fault_reaction_active, drive.machine.state);
        TEST_ASSERT_TRUE(drive.objects.position_actual > 20000);
        TEST_ASSERT_EQUAL_UINT16(emcy_travel, last_emergency());
    }
    // Back inwards is allowed.
    cycles(300);
    put(cia402_target_torque, 0, 0);
    command(cia402_control_fault_reset);
    enable(cia402_mode_cst);
    put(cia402_target_torque, 0, -120);
    cycles(200);
    TEST_ASSERT_EQUAL(cia402_operation_enabled, drive.machine.state);
    TEST_ASSERT_TRUE(drive.objects.position_actual < 20000);
}

static void test_simulated_drive_software_limits_hold_backwards_too(void)
{
    put(cia402_position_limit, 1, -20000);
    enable(cia402_mode_csv);
    put(cia402_target_velocity, 0, -3000000);
    cycles(300);
    TEST_ASSERT_EQUAL_UINT16(emcy_travel, last_emergency());
    cycles(300);
    TEST_ASSERT_EQUAL(cia402_fault, drive.machine.state);
}

static bool faults_with_window(uint32_t window, int32_t error, uint16_t timeout_ms, unsigned samples)
{
    start();
    put(cia402_following_error_window, 0, window);
    put(cia402_following_error_timeout, 0, timeout_ms);
    put(cia402_max_torque, 0, 1); // less than the friction: the motor stays where it is
    enable(cia402_mode_csp);
    put(cia402_target_position, 0, error);
    cycles(samples);
    TEST_ASSERT_EQUAL_INT32(0, drive.objects.position_actual);
    return drive.objects.error_code == emcy_following_error;
}

static void test_simulated_drive_following_error_holds_to_one_count_and_one_sample(void)
{
    TEST_ASSERT_FALSE(faults_with_window(1000, 1000, 0, 50));
    TEST_ASSERT_FALSE(faults_with_window(1000, -1000, 0, 50));
    TEST_ASSERT_TRUE(faults_with_window(1000, 1001, 0, 1));
    TEST_ASSERT_TRUE(faults_with_window(1000, -1001, 0, 1));
    TEST_ASSERT_FALSE(faults_with_window(1000, 1001, 10, 10)); // 10 ms of 1 ms each
    TEST_ASSERT_TRUE(status() & cia402_status_following_error);
    TEST_ASSERT_TRUE(faults_with_window(1000, 1001, 10, 11));
    TEST_ASSERT_FALSE(faults_with_window(0, 2000000, 0, 19)); // watches nothing
    TEST_ASSERT_FALSE(faults_with_window(UINT32_MAX, INT32_MAX, 0, 19));
}

static void test_simulated_drive_speed_limit_holds_to_the_last_bit(void)
{
    const double rpm_30 = 30 * (6.283185307179586 / 60.0);
    for (int beyond = 0; beyond <= 1; beyond++) {
        start();
        enable(cia402_mode_cst);
        put(cia402_max_motor_speed, 0, 30);
        drive.drive.plant.velocity = beyond ? nextafter(-rpm_30, -9.0) : -rpm_30;
        cycles(1);
        TEST_ASSERT_EQUAL(beyond ? cia402_fault_reaction_active : cia402_operation_enabled, drive.machine.state);
    }
}

// ---- Sensors that fail

static void with_fault(enum simulated_fault_kind kind)
{
    static struct simulated_fault fault;
    fault = (struct simulated_fault){kind, drive.operating_syncs + 1, 0};
    simulated_drive_set_faults(&drive, &fault, 1);
}

static void test_simulated_drive_dead_encoder_takes_the_torque_off_at_once(void)
{
    turn(4.0);
    int32_t position = drive.objects.position_actual;
    with_fault(simulated_fault_encoder_dead);
    cycles(1);
    TEST_ASSERT_EQUAL_UINT32(1, drive.injected[simulated_fault_encoder_dead]);
    TEST_ASSERT_EQUAL(cia402_fault, drive.machine.state);
    TEST_ASSERT_EQUAL_UINT16(emcy_encoder, last_emergency());
    TEST_ASSERT_EQUAL_INT16(0, drive.objects.torque_demand);
    TEST_ASSERT_EQUAL_INT32(position, drive.objects.position_actual); // the last good one
    TEST_ASSERT_FALSE(status() & cia402_status_follows);
    cycles(3);
    TEST_ASSERT_TRUE(isfinite(drive.drive.plant.velocity));
    // and a reset does not help as long as it is dead
    command(cia402_control_fault_reset);
    cycles(1);
    TEST_ASSERT_EQUAL(cia402_fault, drive.machine.state);
}

static void test_simulated_drive_reversed_encoder_ends_without_torque(void)
{
    turn(2.0);
    put(cia402_max_motor_speed, 0, 60);
    with_fault(simulated_fault_encoder_reversed);
    cycles(200);
    TEST_ASSERT_EQUAL(cia402_fault, drive.machine.state);
    TEST_ASSERT_EQUAL_UINT16(emcy_speed, last_emergency());
    TEST_ASSERT_EQUAL_INT16(0, drive.objects.torque_demand);
}

static void test_simulated_drive_stuck_encoder_is_seen_as_torque_without_motion(void)
{
    turn(2.0);
    with_fault(simulated_fault_encoder_stuck);
    cycles(300);
    TEST_ASSERT_EQUAL(cia402_fault, drive.machine.state);
    TEST_ASSERT_EQUAL_UINT16(emcy_motor_blocked, last_emergency());
    TEST_ASSERT_EQUAL_INT16(0, drive.objects.torque_demand);
}

static bool is_blocked(int16_t torque, unsigned samples)
{
    model.coulomb_friction_Nm = 2.0; // holds the motor
    start();
    put(0x2004, 1, 600);
    put(0x2004, 2, 20);
    enable(cia402_mode_cst);
    put(cia402_target_torque, 0, torque);
    cycles(1 + samples); // the first is compared with the one before the torque
    return drive.objects.error_code == emcy_motor_blocked;
}

static void test_simulated_drive_blocked_needs_torque_and_time(void)
{
    TEST_ASSERT_FALSE(is_blocked(599, 100));
    TEST_ASSERT_FALSE(is_blocked(-599, 100));
    TEST_ASSERT_FALSE(is_blocked(600, 19));
    TEST_ASSERT_TRUE(is_blocked(600, 20));
    TEST_ASSERT_TRUE(is_blocked(-600, 20));
}

static void test_simulated_drive_end_stop_is_a_fault(void)
{
    model.has_end_stops = true;
    model.end_stops_rad[0] = -0.1;
    model.end_stops_rad[1] = 0.1;
    start();
    enable(cia402_mode_csv);
    put(cia402_target_velocity, 0, 3000000);
    cycles(400);
    TEST_ASSERT_EQUAL_UINT16(emcy_travel, drive.objects.error_code);
    TEST_ASSERT_EQUAL(cia402_fault, drive.machine.state);
    TEST_ASSERT_EQUAL_INT16(0, drive.objects.torque_demand);
}

// ---- Time

static enum cia402_state after_syncs_of(uint32_t real_us, double tolerance, double drift_ppm)
{
    start();
    simulated_drive_set_drift(&drive, drift_ppm);
    drive.period_tolerance = tolerance;
    enable(cia402_mode_csp);
    for (unsigned i = 0; i < 40; i++) {
        let_pass(now_us + real_us);
        struct can_frame frame = can_frame_make(sync_cob_id, 0);
        give(&frame);
    }
    return drive.machine.state;
}

static void test_simulated_drive_checks_60c2_against_the_real_period(void)
{
    TEST_ASSERT_EQUAL(cia402_operation_enabled, after_syncs_of(1000, 0.25, 0.0));
    TEST_ASSERT_EQUAL(cia402_operation_enabled, after_syncs_of(1250, 0.25, 0.0));
    TEST_ASSERT_EQUAL(cia402_fault, after_syncs_of(1251, 0.25, 0.0));
    TEST_ASSERT_EQUAL_UINT16(emcy_parameter, last_emergency());
    TEST_ASSERT_EQUAL(cia402_operation_enabled, after_syncs_of(750, 0.25, 0.0));
    TEST_ASSERT_EQUAL(cia402_fault, after_syncs_of(749, 0.25, 0.0));
    TEST_ASSERT_EQUAL(cia402_operation_enabled, after_syncs_of(10000, INFINITY, 0.0));
}

static void test_simulated_drive_clock_that_drifts_is_noticed_when_it_matters(void)
{
    for (int ppm = -300000; ppm <= 300000; ppm += 100000)
        TEST_ASSERT_EQUAL(abs(ppm) < 250000, after_syncs_of(1000, 0.25, ppm) == cia402_operation_enabled);
}

static void test_simulated_drive_refuses_operation_with_another_1006_than_60c2(void)
{
    put(0x1006, 0, 2 * period_us);
    ask_for_operation(cia402_mode_csp);
    TEST_ASSERT_EQUAL(cia402_fault, drive.machine.state);
    TEST_ASSERT_EQUAL_UINT16(emcy_parameter, last_emergency());
}

static void test_simulated_drive_sync_time_out_is_configurable(void)
{
    put(0x2003, 1, 50000);
    put(0x1006, 0, period_us);
    enable(cia402_mode_csp);
    cycles(3);
    let_pass(now_us + 49999);
    TEST_ASSERT_EQUAL(cia402_operation_enabled, drive.machine.state);
    let_pass(now_us + 2);
    TEST_ASSERT_EQUAL_UINT16(emcy_sync_lost, last_emergency());
}

/// Maps one object to a PDO; `parameters` is 1400, 1401, .. or 1800, ...
static void map_one(uint16_t parameters, uint32_t cob_id, uint8_t type, uint32_t entry)
{
    uint16_t mapping = (uint16_t)(parameters + 0x200);
    put(parameters, 1, 0x80000000u | cob_id);
    put(parameters, 2, type);
    put(mapping, 0, 0);
    put(mapping, 1, entry);
    put(mapping, 0, 1);
    put(parameters, 1, cob_id);
}

static void test_simulated_drive_delays_from_sync_to_sample_and_reply(void)
{
    map_one(0x1800, 0x180 + node_id, 1, 0x60410010);
    simulated_drive_set_delays(&drive, 70, 180);
    uint32_t samples = drive.samples;
    let_pass(now_us + period_us);
    uint64_t sync_us = now_us;
    struct can_frame frame = can_frame_make(sync_cob_id, 0);
    sent_count = 0;
    give(&frame);
    let_pass(sync_us + 69);
    TEST_ASSERT_EQUAL_UINT32(samples, drive.samples);
    let_pass(sync_us + 70);
    TEST_ASSERT_EQUAL_UINT32(samples + 1, drive.samples);
    TEST_ASSERT_EQUAL_size_t(0, sent_count);
    let_pass(sync_us + 300);
    TEST_ASSERT_EQUAL_size_t(1, sent_count);
    TEST_ASSERT_EQUAL_UINT64(sync_us + 250, sent[0].time_us);
}

static void test_simulated_drive_runs_on_its_own_when_nobody_sends_sync(void)
{
    enable(cia402_mode_csv);
    put(cia402_target_velocity, 0, 2000000);
    let_pass(now_us + 300000);
    TEST_ASSERT_UINT32_WITHIN(2, 299, drive.samples);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 2.0, drive.sample.velocity);
    command(cia402_control_quick_stop);
    let_pass(now_us + 400000);
    TEST_ASSERT_EQUAL(cia402_switch_on_disabled, drive.machine.state);
    TEST_ASSERT_EQUAL_HEX16(0x40, status() & 0x4F);
}

/// Without the check of 2002 each synchronous RPDO stands for itself, but a sample says if one was missing.
static void test_simulated_drive_takes_an_incomplete_set_without_a_check_and_says_so(void)
{
    map_one(0x1400, 0x200 + node_id, 1, 0x60400010);
    map_one(0x1401, 0x300 + node_id, 1, 0x60710010);
    enable(cia402_mode_cst);
    struct can_frame word = can_frame_make(0x200 + node_id, 2), torque = can_frame_make(0x300 + node_id, 2);
    can_put(word.data, 2, cia402_control_enable_operation);
    can_put(torque.data, 2, 77);
    give(&word);
    give(&torque);
    cycles(1);
    TEST_ASSERT_EQUAL_INT16(77, drive.objects.torque_demand);
    TEST_ASSERT_TRUE(status() & cia402_status_follows);
    can_put(torque.data, 2, 78);
    give(&torque);
    cycles(1);
    TEST_ASSERT_EQUAL_INT16(78, drive.objects.torque_demand);
    TEST_ASSERT_FALSE(status() & cia402_status_follows);
}

// ---- One commander

static struct can_frame download(uint16_t index, uint8_t subindex, uint8_t size, uint32_t value)
{
    struct can_frame frame = can_frame_make((uint16_t)(0x600 + node_id), 8);
    frame.data[0] = (uint8_t)(0x23 | (4u - size) << 2);
    can_put(&frame.data[1], 2, index);
    frame.data[3] = subindex;
    can_put(&frame.data[4], 4, value);
    return frame;
}

static uint32_t abort_after(struct can_frame frame)
{
    sent_count = 0;
    give(&frame);
    for (size_t i = 0; i < sent_count; i++)
        if (sent[i].frame.id == 0x580 + node_id && sent[i].frame.data[0] == 0x80)
            return can_get(&sent[i].frame.data[4], 4);
    return 0;
}

static void test_simulated_drive_second_commander_is_refused_but_may_stop(void)
{
    enable(cia402_mode_cst); // as long as nobody streams, SDO commands
    TEST_ASSERT_EQUAL_HEX32(0, abort_after(download(0x6071, 0, 2, 100)));
    TEST_ASSERT_EQUAL_INT16(100, drive.objects.target_torque);
    start();
    map_one(0x1400, 0x200 + node_id, 255, 0x60400010);
    enable(cia402_mode_cst);
    static const struct {
        uint16_t index;
        uint8_t subindex, size;
        uint32_t value;
    } refused[] = {
        {0x6040, 0, 2, 0x000F},     {0x6040, 0, 2, 0x010F}, {0x6040, 0, 2, 0x0006}, {0x6071, 0, 2, 100},
        {0x6072, 0, 2, 9999},       {0x607F, 0, 4, 0},      {0x1006, 0, 4, 0},      {0x1016, 1, 4, 0},
        {0x1400, 1, 4, 0x80000205}, {0x60B2, 0, 2, 5},      {0x605A, 0, 2, 0},
    };
    for (size_t i = 0; i < sizeof refused / sizeof refused[0]; i++) {
        TEST_ASSERT_EQUAL_HEX32(od_abort_state, abort_after(download(refused[i].index, refused[i].subindex,
                                                                     refused[i].size, refused[i].value)));
        TEST_ASSERT_EQUAL_UINT32(i + 1, drive.commands_refused);
    }
    TEST_ASSERT_EQUAL_INT16(0, drive.objects.target_torque);
    TEST_ASSERT_EQUAL(cia402_operation_enabled, drive.machine.state);
    struct can_frame upload = can_frame_make((uint16_t)(0x600 + node_id), 8);
    upload.data[0] = 0x40;
    can_put(&upload.data[1], 2, 0x6041);
    TEST_ASSERT_EQUAL_HEX32(0, abort_after(upload)); // looking is free
    TEST_ASSERT_EQUAL_HEX32(0, abort_after(download(0x6040, 0, 2, cia402_control_quick_stop)));
    TEST_ASSERT_EQUAL(cia402_quick_stop_active, drive.machine.state);
    TEST_ASSERT_EQUAL_HEX32(0, abort_after(download(0x6040, 0, 2, cia402_control_disable_voltage)));
    TEST_ASSERT_EQUAL(cia402_switch_on_disabled, drive.machine.state);
    TEST_ASSERT_EQUAL_HEX32(0, abort_after(download(0x6072, 0, 2, 500))); // without torque anybody may set it up
    TEST_ASSERT_EQUAL_UINT16(500, drive.objects.max_torque);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_simulated_drive_offers_cyclic_modes_and_profile_torque_but_no_homing);
    RUN_TEST(test_simulated_drive_changes_its_mode_in_operation_only_at_rest);
    RUN_TEST(test_simulated_drive_csv_follows_60ff_plus_60b1_within_607f);
    RUN_TEST(test_simulated_drive_profile_torque_moves_on_its_slope);
    RUN_TEST(test_simulated_drive_cst_adds_offset_and_clips_to_6072);
    RUN_TEST(test_simulated_drive_begins_where_it_stands_whatever_was_written_before);
    RUN_TEST(test_simulated_drive_stops_as_its_option_codes_say);
    RUN_TEST(test_simulated_drive_halt_and_quick_stop_may_stay);
    RUN_TEST(test_simulated_drive_fault_reaction_is_605e);
    RUN_TEST(test_simulated_drive_fault_is_latched_until_reset_by_edge);
    RUN_TEST(test_simulated_drive_lost_connection_is_6007);
    RUN_TEST(test_simulated_drive_software_limits_clip_csp_set_points);
    RUN_TEST(test_simulated_drive_software_limits_stop_velocity_and_torque_modes);
    RUN_TEST(test_simulated_drive_software_limits_hold_backwards_too);
    RUN_TEST(test_simulated_drive_following_error_holds_to_one_count_and_one_sample);
    RUN_TEST(test_simulated_drive_speed_limit_holds_to_the_last_bit);
    RUN_TEST(test_simulated_drive_dead_encoder_takes_the_torque_off_at_once);
    RUN_TEST(test_simulated_drive_reversed_encoder_ends_without_torque);
    RUN_TEST(test_simulated_drive_stuck_encoder_is_seen_as_torque_without_motion);
    RUN_TEST(test_simulated_drive_blocked_needs_torque_and_time);
    RUN_TEST(test_simulated_drive_end_stop_is_a_fault);
    RUN_TEST(test_simulated_drive_checks_60c2_against_the_real_period);
    RUN_TEST(test_simulated_drive_clock_that_drifts_is_noticed_when_it_matters);
    RUN_TEST(test_simulated_drive_refuses_operation_with_another_1006_than_60c2);
    RUN_TEST(test_simulated_drive_sync_time_out_is_configurable);
    RUN_TEST(test_simulated_drive_delays_from_sync_to_sample_and_reply);
    RUN_TEST(test_simulated_drive_runs_on_its_own_when_nobody_sends_sync);
    RUN_TEST(test_simulated_drive_takes_an_incomplete_set_without_a_check_and_says_so);
    RUN_TEST(test_simulated_drive_second_commander_is_refused_but_may_stop);
    return UNITY_END();
}
