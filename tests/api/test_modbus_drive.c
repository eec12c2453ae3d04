/* SPDX-License-Identifier: MIT */
/// Through the host's side of the registers: a table goes into the simulated drive, which measures by itself; its
/// response against the streamed measurement of the same model, limits, stops, and what is kept.
#include "lab/estimate/frf_mean.h"
#include "lab/estimate/periodic.h"
#include "lab/measure/measure.h"
#include "sim/node/direct_drive.h"
#include "tests/support/modbus_bench.h"

#include <complex.h>
#include <stdio.h>

enum { periods = 10, settle = 1 };
/// The drive transforms in single precision: 125 dB at this length (lib/frf/dft.h); here against means of its own.
static const double float_share = 2e-6;

static struct modbus_host host;
static struct modbus_host_state state;
static struct modbus_record records[bench_lines], mean[bench_lines];
static struct modbus_host_spectrum spectrum;

void setUp(void)
{
    bench_begin();
}

void tearDown(void)
{
    bench_end();
}

/// Waits, with a sign of life, until the drive is neither settling nor running nor stopping.
static void follow(void)
{
    for (int i = 0; i < 1000; i++) {
        TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_read_state(&host, &state));
        if (state.state == modbus_state_done || state.state == modbus_state_fault)
            return;
        bench_wait(NULL, 20);
    }
    TEST_FAIL_MESSAGE("the run does not end");
}

static double complex number(const float pair[2])
{
    return (double)pair[0] + I * (double)pair[1];
}

static void stream(struct frf *out_frf)
{
    static struct direct_drive direct;
    const struct drive drive = direct_drive_init(&direct, &bench_model);
    const struct measure_plan plan = {
        .table = &bench_view, .settle_periods = settle, .periods = periods, .limits = GUARD_REAL_LIMITS_NONE};
    const struct periodic_options options = {.settle = periodic_settle_default};
    struct measure_report report;
    struct run run;
    struct periodic recording;
    struct error error = {0, ""};
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, measure_run(&drive, &plan, &run, &report, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, periodic_cut(&run, &options, &recording, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, frf_mean_estimate(&recording, NULL, out_frf, &error), error.message);
    periodic_free(&recording);
    run_free(&run);
}

static void test_modbus_drive_measures_the_streamed_response(void)
{
    const struct modbus_host_setup setup = bench_setup(settle, periods);
    struct frf streamed;
    bench_start(&host, &setup);
    follow();
    TEST_ASSERT_EQUAL_INT(modbus_end_complete, state.end);
    TEST_ASSERT_EQUAL_UINT32(periods, state.periods_valid);
    TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_read_spectrum(&host, MODBUS_MEAN, bench_lines, mean, &spectrum));
    TEST_ASSERT_EQUAL_UINT32(periods, spectrum.count);
    stream(&streamed);
    unsigned close = 0;
    for (unsigned b = 0; b < bench_lines; b++) {
        double complex input = number(mean[b].input), response = number(mean[b].output) / input;
        double gain = cabs(response);
        double variance = ((double)mean[b].output_variance + gain * gain * (double)mean[b].input_variance -
                           2.0 * creal(conj(response) * number(mean[b].covariance))) /
                          (periods * creal(input * conj(input)));
        double off = cabs(response - (streamed.real[b] + I * streamed.imag[b]));
        close += off <= 2.0 * sqrt(variance + streamed.std[b] * streamed.std[b]);
    }
    printf("in the drive and streamed: %u of %d lines within 2 sigma\n", close, bench_lines);
    TEST_ASSERT_GREATER_OR_EQUAL_UINT(0.95 * bench_lines, close);
    frf_free(&streamed);
}

static void test_modbus_drive_means_are_those_of_its_periods(void)
{
    const struct modbus_host_setup setup = bench_setup(settle, periods);
    double complex input[bench_lines] = {0}, output[bench_lines] = {0}, cross[bench_lines] = {0};
    static struct modbus_record single[periods][bench_lines];
    bench_start(&host, &setup);
    follow();
    TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_read_spectrum(&host, MODBUS_MEAN, bench_lines, mean, &spectrum));
    for (uint32_t p = 0; p < periods; p++) {
        TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_read_spectrum(&host, p, bench_lines, single[p], &spectrum));
        TEST_ASSERT_EQUAL_UINT32(modbus_spectrum_valid, spectrum.validity);
        for (unsigned b = 0; b < bench_lines; b++) {
            input[b] += number(single[p][b].input) / periods;
            output[b] += number(single[p][b].output) / periods;
        }
    }
    for (unsigned b = 0; b < bench_lines; b++) {
        double variance = 0.0;
        for (uint32_t p = 0; p < periods; p++) {
            double complex u = number(single[p][b].input) - input[b], y = number(single[p][b].output) - output[b];
            variance += creal(y * conj(y)) / (periods - 1);
            cross[b] += y * conj(u) / (periods - 1);
        }
        TEST_ASSERT_DOUBLE_WITHIN(float_share * cabs(input[b]), 0.0, cabs(input[b] - number(mean[b].input)));
        TEST_ASSERT_DOUBLE_WITHIN(float_share * cabs(output[b]), 0.0, cabs(output[b] - number(mean[b].output)));
        // The deviations are hundreds of times smaller than what they deviate from, and so have fewer digits.
        TEST_ASSERT_DOUBLE_WITHIN(1e-3 * variance, variance, (double)mean[b].output_variance);
        TEST_ASSERT_DOUBLE_WITHIN(1e-3 * sqrt(variance * (double)mean[b].input_variance), 0.0,
                                  cabs(cross[b] - number(mean[b].covariance)));
    }
}

static void test_modbus_drive_keeps_the_last_periods(void)
{
    const struct modbus_host_setup setup = bench_setup(0, modbus_drive_periods_kept + 5);
    bench_start(&host, &setup);
    TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_read_spectrum(&host, 0, bench_lines, records, &spectrum));
    TEST_ASSERT_EQUAL_UINT32(modbus_spectrum_not_yet, spectrum.validity);
    follow();
    TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_read_spectrum(&host, 4, bench_lines, records, &spectrum));
    TEST_ASSERT_EQUAL_UINT32(modbus_spectrum_not_kept, spectrum.validity);
    TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_read_spectrum(&host, 5, bench_lines, records, &spectrum));
    TEST_ASSERT_EQUAL_UINT32(modbus_spectrum_valid, spectrum.validity);
    TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_read_spectrum(&host, MODBUS_MEAN, bench_lines, mean, &spectrum));
    TEST_ASSERT_EQUAL_UINT32(modbus_drive_periods_kept + 5, spectrum.count);
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

static void test_modbus_drive_stops_without_its_host(void)
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
static void test_modbus_drive_is_not_kept_alive_by_reads(void)
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

static void test_modbus_drive_trips_at_its_limits(void)
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
        follow();
        TEST_ASSERT_EQUAL_INT(modbus_state_fault, state.state);
        TEST_ASSERT_EQUAL_UINT32(cases[i].fault, state.faults);
        TEST_ASSERT_TRUE(state.trip_value != 0.0f);
        TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_command(&host, modbus_command_reset_fault));
    }
}

static void test_modbus_drive_stops_and_aborts_on_command(void)
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
        follow();
        TEST_ASSERT_EQUAL_INT(modbus_state_done, state.state);
        TEST_ASSERT_EQUAL_INT(cases[i].end, state.end);
        // 1000 ms less the fade are seven periods and a part, which counts for nothing.
        TEST_ASSERT_EQUAL_UINT32((bench_rate - setup.run.fade_samples) / bench_samples, state.periods_valid);
        TEST_ASSERT_TRUE(fabs(bench_drive->drive.plant.velocity) < 0.05);
    }
}

static void test_modbus_drive_faults_at_an_end_stop(void)
{
    bench_model.has_end_stops = true;
    bench_model.end_stops_rad[0] = -2e-4;
    bench_model.end_stops_rad[1] = 2e-4;
    TEST_ASSERT_EQUAL_INT(core_ok, modbus_drive_init(bench_drive, &bench_model));
    modbus_drive_step(bench_drive);
    const struct modbus_host_setup setup = bench_setup(0, 100);
    bench_start(&host, &setup);
    follow();
    TEST_ASSERT_EQUAL_INT(modbus_state_fault, state.state);
    TEST_ASSERT_EQUAL_UINT32(modbus_fault_drive, state.faults);
}

static void test_modbus_drive_refuses_to_arm_outside_its_limits(void)
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
static void test_modbus_drive_plays_no_damaged_table(void)
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

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_modbus_drive_measures_the_streamed_response);
    RUN_TEST(test_modbus_drive_means_are_those_of_its_periods);
    RUN_TEST(test_modbus_drive_keeps_the_last_periods);
    RUN_TEST(test_modbus_drive_stops_without_its_host);
    RUN_TEST(test_modbus_drive_is_not_kept_alive_by_reads);
    RUN_TEST(test_modbus_drive_trips_at_its_limits);
    RUN_TEST(test_modbus_drive_stops_and_aborts_on_command);
    RUN_TEST(test_modbus_drive_faults_at_an_end_stop);
    RUN_TEST(test_modbus_drive_refuses_to_arm_outside_its_limits);
    RUN_TEST(test_modbus_drive_plays_no_damaged_table);
    return UNITY_END();
}
