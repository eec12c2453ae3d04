/* SPDX-License-Identifier: MIT */
/// The player in the drive stops: limits, a silent host, an end stop, commands, a table that is not whole.
#include "tests/support/modbus_bench.h"

static struct modbus_host host;
static struct modbus_host_state state;

void setUp(void)
{
    bench_begin();
}

void tearDown(void)
{
    bench_end();
}

/// Runs until the drive ends by itself, silent: nothing is written.
static uint32_t run_silently(uint32_t most)
{
    for (uint32_t n = 1; n <= most; n++) {
        modbus_drive_step(bench_drive);
        if (bench_drive->player.state == modbus_state_fault || bench_drive->player.state == modbus_state_done)
            return n;
    }
    return 0;
}

static void test_modbus_player_stops_without_its_host(void)
{
    const uint32_t timeout_ms = 300;
    struct modbus_host_setup setup = bench_setup(0, 100);
    setup.run.host_timeout_ms = timeout_ms;
    bench_start(&host, &setup);
    uint32_t took = run_silently(bench_rate * 10);
    // Silence, the ramp, standstill before the torque goes off; a sample each for START, trip and the two ends.
    uint32_t silence = timeout_ms * bench_rate / 1000, rest = (uint32_t)(table_player_rest_s * bench_rate);
    TEST_ASSERT_UINT32_WITHIN(5, silence + setup.run.abort_samples + rest, took);
    TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_read_state(&host, &state));
    TEST_ASSERT_EQUAL_INT(modbus_state_fault, state.state);
    TEST_ASSERT_EQUAL_UINT32(modbus_fault_watchdog, state.faults);
    TEST_ASSERT_EQUAL_INT(modbus_host_refused, modbus_host_command(&host, modbus_command_start));
    TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_command(&host, modbus_command_reset_fault));
    TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_read_state(&host, &state));
    TEST_ASSERT_EQUAL_INT(modbus_state_uploading, state.state);
}

/// A state that is read is written to, too (NONCE); a plain read must not keep a drive running.
static void test_modbus_player_is_not_kept_alive_by_reads(void)
{
    struct modbus_host_setup setup = bench_setup(0, 100);
    setup.run.host_timeout_ms = 300;
    bench_start(&host, &setup);
    for (int i = 0; i < 100; i++) {
        uint16_t words[16];
        bench_read(NULL, 0x20, 16, words);
        bench_wait(NULL, 20);
    }
    TEST_ASSERT_EQUAL_INT(modbus_state_fault, bench_drive->player.state);
}

static void test_modbus_player_trips_at_its_limits(void)
{
    static const struct {
        float position, velocity, following;
        uint32_t fault;
    } cases[] = {
        {1e-4f, 0.0f, 0.0f, modbus_fault_travel},
        {0.0f, 0.05f, 0.0f, modbus_fault_velocity},
        {0.0f, 0.0f, 1e-6f, modbus_fault_following},
    };
    for (unsigned i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct modbus_host_setup setup = bench_setup(0, 100);
        setup.run.position_min = -cases[i].position;
        setup.run.position_max = cases[i].position;
        setup.run.velocity_limit = cases[i].velocity;
        setup.run.following_error = cases[i].following;
        bench_start(&host, &setup);
        bench_follow(&host, &state);
        TEST_ASSERT_EQUAL_INT(modbus_state_fault, state.state);
        TEST_ASSERT_EQUAL_UINT32(cases[i].fault, state.faults);
        TEST_ASSERT_TRUE(state.trip_value != 0.0f);
        TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_command(&host, modbus_command_reset_fault));
    }
}

static void test_modbus_player_stops_and_aborts_on_command(void)
{
    static const struct {
        enum modbus_command command;
        enum modbus_end end;
    } cases[] = {{modbus_command_stop, modbus_end_stopped}, {modbus_command_abort, modbus_end_aborted}};
    for (unsigned i = 0; i < 2; i++) {
        const struct modbus_host_setup setup = bench_setup(0, 100);
        bench_start(&host, &setup);
        bench_wait(NULL, 1000);
        TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_command(&host, cases[i].command));
        bench_follow(&host, &state);
        TEST_ASSERT_EQUAL_INT(modbus_state_done, state.state);
        TEST_ASSERT_EQUAL_INT(cases[i].end, state.end);
        // 1000 ms less the fade are seven periods and a part, which counts for nothing.
        TEST_ASSERT_EQUAL_UINT32((bench_rate - setup.run.fade_samples) / bench_samples, state.periods_valid);
        TEST_ASSERT_TRUE(fabs(bench_drive->drive.plant.velocity) < 0.05);
    }
}

static void test_modbus_player_faults_at_an_end_stop(void)
{
    bench_model.has_end_stops = true;
    bench_model.end_stops_rad[0] = -2e-4;
    bench_model.end_stops_rad[1] = 2e-4;
    TEST_ASSERT_EQUAL_INT(core_ok, modbus_drive_init(bench_drive, &bench_model));
    modbus_drive_step(bench_drive);
    const struct modbus_host_setup setup = bench_setup(0, 100);
    bench_start(&host, &setup);
    bench_follow(&host, &state);
    TEST_ASSERT_EQUAL_INT(modbus_state_fault, state.state);
    TEST_ASSERT_EQUAL_UINT32(modbus_fault_drive, state.faults);
}

static void test_modbus_player_refuses_to_arm_outside_its_limits(void)
{
    struct modbus_host_setup setup = bench_setup(0, 10);
    setup.run.velocity_limit = 1e-9f; // the noise of the speed is outside
    TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_open(&host, &bench_link, 1));
    TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_upload(&host, bench_table, &setup, NULL, NULL));
    TEST_ASSERT_EQUAL_INT(modbus_host_refused, modbus_host_command(&host, modbus_command_arm));
    TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_read_state(&host, &state));
    TEST_ASSERT_EQUAL_UINT32(modbus_result_drive, state.result);
    TEST_ASSERT_EQUAL_INT(modbus_state_verified, state.state);
}

/// A table that was damaged on the way is not played; sent again, it is.
static void test_modbus_player_plays_no_damaged_table(void)
{
    const struct modbus_host_setup setup = bench_setup(0, 10);
    static uint8_t damaged[bench_bytes];
    for (unsigned at = 0; at < bench_bytes; at += 97) {
        memcpy(damaged, bench_table, sizeof damaged);
        damaged[at] ^= 0x10u;
        TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_open(&host, &bench_link, 1));
        TEST_ASSERT_EQUAL_INT(modbus_host_refused, modbus_host_upload(&host, damaged, &setup, NULL, NULL));
        TEST_ASSERT_EQUAL_INT(modbus_host_refused, modbus_host_command(&host, modbus_command_arm));
    }
    TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_upload(&host, bench_table, &setup, NULL, NULL));
}

static void test_modbus_player_clips_the_torque(void)
{
    struct modbus_host_setup setup = bench_setup(0, 2);
    setup.run.mode = 1;
    setup.run.torque_limit = 0.05f; // the table goes beyond
    bench_start(&host, &setup);
    for (int n = 0; n < 3 * bench_samples && bench_drive->player.state != modbus_state_done; n++) {
        modbus_drive_step(bench_drive);
        TEST_ASSERT_TRUE(fabs(bench_drive->player.setpoint.torque) <= (double)setup.run.torque_limit);
    }
    TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_read_state(&host, &state));
    TEST_ASSERT_TRUE(state.torque_clipped > 0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_modbus_player_stops_without_its_host);
    RUN_TEST(test_modbus_player_is_not_kept_alive_by_reads);
    RUN_TEST(test_modbus_player_trips_at_its_limits);
    RUN_TEST(test_modbus_player_stops_and_aborts_on_command);
    RUN_TEST(test_modbus_player_faults_at_an_end_stop);
    RUN_TEST(test_modbus_player_refuses_to_arm_outside_its_limits);
    RUN_TEST(test_modbus_player_plays_no_damaged_table);
    RUN_TEST(test_modbus_player_clips_the_torque);
    return UNITY_END();
}
