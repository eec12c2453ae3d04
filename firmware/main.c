/* SPDX-License-Identifier: MIT */
/* The library in a drive: an interrupt at 8 kHz calls guard, player and DFT and closes the loop around a simulated belt
 * drive; the main loop makes the frequency response of what the interrupt leaves in its second bank and serves it on
 * CANopen and Modbus. Prints the response and checks it against what the host has come to (expected_values.h). */
#include "core/bytes.h"
#include "firmware/axis.h"
#include "firmware/board.h"
#include "firmware/can_door.h"
#include "firmware/expected.h"
#include "firmware/modbus_door.h"
#include "firmware/print.h"

#include "excitation-dft.h"
#include "excitation.h"

static struct can_door can_door;
static struct modbus_door modbus_door;

/* Six decimals, rounded towards zero; |value| below 4000. */
static void print_float(uint32_t bits)
{
    union core_float_bits number = {.bits = bits};
    float size = number.value < 0.0f ? -number.value : number.value;
    uint32_t millionths = (uint32_t)(size * 1000000.0f);
    board_print(number.value < 0.0f ? " -" : " ");
    print_u32(millionths / 1000000u);
    board_print(".");
    for (uint32_t rest = millionths % 1000000u, power = 100000u; power > 0; power /= 10u) {
        print_u32(rest / power % 10u);
    }
}

/* What the master has read over CAN is what is printed and compared. */
static void print_response(void)
{
    board_print("frequency_hz real imag std valid\n");
    for (uint32_t bin = 0; bin < EXCITATION_DFT_BIN_COUNT; ++bin) {
        const struct can_reading *reading = &can_door.readings[bin];
        print_u32(excitation_dft_bins[bin] * axis_rate_hz / EXCITATION_DFT_PERIOD_SAMPLES);
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

/* Both buses have to say the same: largest difference of the two responses, relative, in millionths. */
static uint32_t compare_buses(void)
{
    float most = 0.0f;
    for (uint32_t bin = 0; bin < EXCITATION_DFT_BIN_COUNT; ++bin) {
        const struct modbus_record *record = &modbus_door.readings[bin];
        union core_float_bits real = {.bits = can_door.readings[bin].real},
                              imaginary = {.bits = can_door.readings[bin].imaginary};
        float in_real = record->input[0], in_imaginary = record->input[1];
        float error_real = record->output[0] - (real.value * in_real - imaginary.value * in_imaginary);
        float error_imaginary = record->output[1] - (real.value * in_imaginary + imaginary.value * in_real);
        float size = record->output[0] * record->output[0] + record->output[1] * record->output[1];
        float error = (error_real * error_real + error_imaginary * error_imaginary) / size;
        most = error > most || size <= 0.0f ? error : most;
    }
    return (uint32_t)(most * 1e12f); /* of the squares */
}

static void print_counters(uint32_t difference)
{
    print_counter("periods", axis.results.statistics.periods);
    print_counter("invalid", axis.results.invalid);
    print_counter("overwritten", axis.results.overwritten);
    print_counter("late", axis.path.late);
    print_counter("trips", axis.path.guard.state.count.trips);
    print_counter("heartbeats", can_door.heartbeats);
    print_counter("sdo_answered", can_door.answered);
    print_counter("sdo_aborted", can_door.aborted);
    print_counter("modbus_requests", modbus_door.requests);
    print_counter("modbus_refused", modbus_door.refused);
    print_counter("modbus_bins_read", modbus_door.bins_read);
    print_counter("buses_differ_square_ppm", difference);
    print_counter("path_longest_instructions", axis.longest_instructions);
    print_counter("path_mean_instructions", axis.all_instructions / (axis.path.samples > 0 ? axis.path.samples : 1u));
}

static void expect_counters(void)
{
    expected_take(axis.results.checksum[0]);
    expected_take(axis.results.checksum[1]);
    expected_take(axis.results.statistics.periods);
    expected_take(axis.results.invalid + axis.results.overwritten);
    expected_take(axis.path.late);
    expected_take(axis.path.guard.state.count.trips);
    expected_take(can_door.answered);
    expected_take(can_door.aborted);
    expected_take(modbus_door.refused);
    expected_take(modbus_door.read_count);
}

/* Single precision: each of the two responses is good to some 1e-6. */
enum { buses_differ_most = 100 };

int main(void)
{
    enum core_status status = modbus_door_init(&modbus_door);
    if (status != core_ok) {
        board_print(core_status_str(status));
        board_exit(1);
    }
    can_door_init(&can_door, &axis.results);
    axis_power_on();
    for (bool measured = false, all_read = false; !all_read;) {
        board_wait();
        axis_collect();
        modbus_door_serve(&modbus_door, axis_time_us());
        can_door_serve(&can_door, axis_time_us());
        if (!measured) {
            measured = modbus_door_measure(&modbus_door, excitation_mst, sizeof excitation_mst, axis_time_us());
        } else {
            all_read = can_door_read_all(&can_door);
        }
    }
    uint32_t difference = compare_buses();
    print_response();
    print_counters(difference);
    expect_counters();
    bool all_there = modbus_door.bins_read == EXCITATION_DFT_BIN_COUNT && axis.results.statistics.periods > 1u;
    board_exit(expected_finish() && all_there && difference <= buses_differ_most ? 0 : 2);
}
