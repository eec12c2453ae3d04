/* SPDX-License-Identifier: MIT */
/* The library in a drive: an interrupt at 8 kHz calls guard, player and DFT and closes the loop around a simulated belt
 * drive; the main loop makes the frequency response of what the interrupt leaves in its second bank and serves it on
 * CANopen and Modbus. Prints the response and checks it against what the host has come to (expected_values.h). */
#include "core/bytes.h"
#include "firmware/belt.h"
#include "firmware/board.h"
#include "firmware/can_door.h"
#include "firmware/expected.h"
#include "firmware/print.h"
#include "firmware/results.h"
#include "firmware/sample_path.h"

#include "excitation.h"
#include "measurement.h"

enum { rate_hz = 8000, sample_us = 125, periods = 6, settle_periods = 1 };

static struct sample_path path;
static struct belt belt;
static struct results results;
static struct can_door can_door;
static struct msgen_table table;
static float reference_scale[msgen_channels_max];
static int32_t storage[FRF_BLOCK_STORAGE_WORDS(MEASUREMENT_BIN_COUNT, sample_path_channels, 2u,
                                               MEASUREMENT_BLOCK_SAMPLES, MEASUREMENT_BLOCK_SAMPLES)];
static int16_t block_frames[FRF_BLOCK_FRAME_SAMPLES(sample_path_channels, MEASUREMENT_BLOCK_SAMPLES)];
static uint32_t longest_instructions, all_instructions;

/* What a drive's sampling interrupt does: measure, the library, control, the power stage. */
static void take_sample(void)
{
    struct belt_sample sample = belt_measure(&belt);
    struct sample_path_input input = {
        .guard = {.position = sample.position, .velocity = sample.velocity, .torque = sample.torque, .valid = true},
        .channels = {sample.torque, sample.velocity}};
    struct sample_path_output output;
    uint32_t begin = board_instructions();
    sample_path_step(&path, &input, &output);
    uint32_t instructions = board_instructions() - begin;
    all_instructions += instructions;
    longest_instructions = instructions > longest_instructions ? instructions : longest_instructions;
    float reference[msgen_channels_max];
    for (unsigned c = 0; c < msgen_channels_max; ++c) {
        reference[c] = (float)output.reference[c] * reference_scale[c];
    }
    float torque_Nm = belt_control(&belt, &sample, reference);
    int32_t counts = guard_clip_torque(&path.guard, (int32_t)(torque_Nm * BELT_TORQUE_COUNTS_PER_NM));
    belt_move(&belt, (float)counts * (1.0f / BELT_TORQUE_COUNTS_PER_NM));
    if (board_is_late()) {
        sample_path_mark_late(&path);
    }
}

static enum core_status set_up(void)
{
    static const struct guard_limits limits = {.position_min = -166886, /* a radian */
                                               .position_max = 166886,
                                               .velocity_max = 30000,
                                               .torque_max = 32000,
                                               .watchdog_samples = rate_hz / 10,
                                               .stuck_samples = rate_hz / 2,
                                               .stuck_torque = 8000};
    static const struct msgen_player_config player = {.periods = settle_periods + periods,
                                                      .fade_in_samples = rate_hz / 20,
                                                      .fade_out_samples = rate_hz / 20,
                                                      .abort_samples = rate_hz / 20};
    static const struct frf_block_config block = {.table = &measurement_block_table,
                                                  .channels = sample_path_channels,
                                                  .banks = 2,
                                                  .spread = true,
                                                  .storage = storage,
                                                  .storage_words = sizeof storage / sizeof *storage,
                                                  .frames = block_frames,
                                                  .frame_samples = sizeof block_frames / sizeof *block_frames};
    enum core_status status = msgen_table_open(excitation_mst, sizeof excitation_mst, &table);
    if (status == core_ok) {
        status = sample_path_init(&path, &limits, &table, &player, &block, settle_periods);
    }
    for (unsigned c = 0; c < msgen_channels_max && status == core_ok; ++c) {
        union core_float_bits scale = {.bits = table.scale_bits[c]};
        reference_scale[c] = scale.value;
    }
    return status == core_ok ? results_init(&results, MEASUREMENT_BIN_COUNT,
                                            BELT_TORQUE_COUNTS_PER_NM / BELT_VELOCITY_COUNTS_PER_RAD_PER_S)
                             : status;
}

/* Four decimals, rounded towards zero; |value| below 10^5. */
static void print_float(uint32_t bits)
{
    union core_float_bits number = {.bits = bits};
    float size = number.value < 0.0f ? -number.value : number.value;
    uint32_t whole = (uint32_t)size, rest = (uint32_t)((size - (float)whole) * 10000.0f);
    board_print(number.value < 0.0f ? " -" : " ");
    print_u32(whole);
    board_print(rest < 10u ? ".000" : rest < 100u ? ".00" : rest < 1000u ? ".0" : ".");
    print_u32(rest);
}

/* What the master has read over CAN is what is printed and compared. */
static void print_response(void)
{
    board_print("frequency_hz real imag std valid\n");
    for (uint32_t bin = 0; bin < MEASUREMENT_BIN_COUNT; ++bin) {
        const struct can_reading *reading = &can_door.readings[bin];
        print_u32(measurement_bins[bin] * rate_hz / MEASUREMENT_PERIOD_SAMPLES);
        print_float(reading->real);
        print_float(reading->imaginary);
        print_float(reading->std);
        board_print(reading->validity == frf_valid ? " 1\n" : " 0\n");
        expected_take(reading->real);
        expected_take(reading->imaginary);
        expected_take(reading->std);
        expected_take(reading->validity);
    }
}

static void print_counter(const char *name, uint32_t value)
{
    board_print(name);
    board_print(" ");
    print_u32(value);
    board_print("\n");
}

static void print_counters(void)
{
    print_counter("periods", results.statistics.periods);
    print_counter("invalid", results.invalid);
    print_counter("overwritten", results.overwritten);
    print_counter("late", path.late);
    print_counter("trips", path.guard.state.count.trips);
    print_counter("heartbeats", can_door.heartbeats);
    print_counter("sdo_answered", can_door.answered);
    print_counter("sdo_aborted", can_door.aborted);
    print_counter("path_longest_instructions", longest_instructions);
    print_counter("path_mean_instructions", all_instructions / (path.samples > 0 ? path.samples : 1u));
}

static void expect_counters(void)
{
    expected_take(results.checksum[0]);
    expected_take(results.checksum[1]);
    expected_take(results.statistics.periods);
    expected_take(results.invalid + results.overwritten);
    expected_take(path.late);
    expected_take(path.guard.state.count.trips);
    expected_take(can_door.answered);
    expected_take(can_door.aborted);
}

int main(void)
{
    enum core_status status = set_up();
    const struct guard_sample at_rest = {0, 0, 0, true};
    if (status != core_ok || guard_arm(&path.guard, &at_rest) != core_ok) {
        board_print(core_status_str(status));
        board_exit(1);
    }
    belt_init(&belt);
    can_door_init(&can_door, &results);
    board_start_counter();
    board_start_samples(rate_hz, take_sample);
    for (bool all_read = false; !all_read;) {
        board_wait();
        guard_alive(&path.guard.state);
        results_take(&results, &path.dft, sample_path_torque, sample_path_velocity);
        can_door_serve(&can_door, (uint64_t)path.samples * sample_us);
        if (path.done) {
            all_read = can_door_read_all(&can_door);
        }
    }
    print_response();
    print_counters();
    expect_counters();
    board_exit(expected_finish() && results.statistics.periods == periods ? 0 : 2);
}
