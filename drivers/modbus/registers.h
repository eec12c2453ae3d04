/* SPDX-License-Identifier: MIT */
/// The register map of a drive that plays a table and measures by itself: addresses, kinds, access. docs/modbus.md says
/// how it is used and holds the same list, which a test compares.
/// Addresses are those on the wire (PDU, counted from 0); holding registers, mirrored as input registers. A 32-bit
/// number has its high word first, a float is IEEE-754 in the same order. Bytes of a table go in file order, the first
/// of each two in the high byte.
#ifndef SERVOSCOPE_DRIVERS_MODBUS_REGISTERS_H
#define SERVOSCOPE_DRIVERS_MODBUS_REGISTERS_H

#include <stdbool.h>
#include <stdint.h>

enum {
    modbus_identity = 0x4D53,
    modbus_map_version = 0x0100,
    modbus_order_probe = 0x01020304,
    modbus_float_probe = 0x3F800000, ///< 1.0f
    modbus_key = 0xA5A5,             ///< what ARM and START need in the same write

    modbus_read_words_max = 125,
    modbus_write_words_max = 123,         ///< of function 16
    modbus_write_in_read_write_max = 121, ///< of function 23
    modbus_chunk_words = 120,             ///< of a table in one write, behind its offset
    modbus_bin_window = 120,              ///< bins in one read
    modbus_spectrum_head_words = 8,       ///< of the spectrum's window
    modbus_mean_words = 16,               ///< of one bin: means, variances, covariance
    modbus_period_words = 8,              ///< of one bin: one period
    modbus_mean_bins = 7,                 ///< in one window
    modbus_period_bins = 14,              ///< in one window
    modbus_spectrum_words = 8 + 7 * 16,   ///< of the window
};

/// Value of READ_PERIOD for means over all valid periods.
#define MODBUS_MEAN 0xFFFFFFFFu

enum modbus_kind { modbus_u16, modbus_u32, modbus_f32, modbus_window };

enum modbus_access {
    modbus_read_only,
    modbus_setup, ///< written at rest only; the table has to be verified again afterwards
    modbus_write, ///< written in any state
    modbus_data,  ///< table data: while uploading
};

/// Fields in the order of their addresses.
enum modbus_field_id {
    modbus_field_identity,
    modbus_field_version,
    modbus_field_order_probe,
    modbus_field_float_probe,
    modbus_field_chunk_words,
    modbus_field_bins_max,
    modbus_field_table_bytes_max,
    modbus_field_samples_max,
    modbus_field_periods_kept,
    modbus_field_mean_bins,
    modbus_field_period_bins,
    modbus_field_axis,
    modbus_field_command,
    modbus_field_key,
    modbus_field_sequence,
    modbus_field_nonce,
    modbus_field_state,
    modbus_field_acknowledged,
    modbus_field_result,
    modbus_field_end,
    modbus_field_faults,
    modbus_field_periods_done,
    modbus_field_periods_valid,
    modbus_field_samples_played,
    modbus_field_torque_clipped,
    modbus_field_cycles_max,
    modbus_field_torque,
    modbus_field_position,
    modbus_field_velocity,
    modbus_field_trip_value,
    modbus_field_table_name,
    modbus_field_table_samples,
    modbus_field_table_bins,
    modbus_field_rate_hz,
    modbus_field_table_bytes,
    modbus_field_table_crc32,
    modbus_field_mode,
    modbus_field_input,
    modbus_field_output,
    modbus_field_approach,
    modbus_field_settle_periods,
    modbus_field_measure_periods,
    modbus_field_fade_samples,
    modbus_field_abort_samples,
    modbus_field_torque_limit,
    modbus_field_velocity_limit,
    modbus_field_position_min,
    modbus_field_position_max,
    modbus_field_following_error,
    modbus_field_dwell_samples,
    modbus_field_host_timeout_ms,
    modbus_field_bin_first,
    modbus_field_bin_data,
    modbus_field_upload_offset,
    modbus_field_upload_data,
    modbus_field_read_period,
    modbus_field_read_first,
    modbus_field_read_sequence,
    modbus_field_spectrum,
    modbus_field_count
};

struct modbus_field {
    uint16_t address;
    uint8_t words;
    uint8_t kind;   ///< enum modbus_kind
    uint8_t access; ///< enum modbus_access
    const char *name;
    uint32_t least, most; ///< u16 and u32: accepted values; f32: most != 0: not negative
};

extern const struct modbus_field modbus_fields[modbus_field_count];

enum modbus_command {
    modbus_command_open_upload = 1,
    modbus_command_verify = 2,
    modbus_command_arm = 3,
    modbus_command_start = 4,
    modbus_command_stop = 5,  ///< ramp down, then without torque
    modbus_command_abort = 6, ///< quick stop of the drive, then without torque
    modbus_command_reset_fault = 7,
};

enum modbus_state {
    modbus_state_idle = 0,
    modbus_state_uploading = 1,
    modbus_state_verified = 2,
    modbus_state_armed = 3,
    modbus_state_settling = 4, ///< fade in or approach, and the settling periods
    modbus_state_running = 5,
    modbus_state_done = 6,
    modbus_state_stopping = 7,
    modbus_state_fault = 15,
};

/// RESULT of a command that was refused; negative ones are enum core_status.
enum modbus_result {
    modbus_result_ok = 0,
    modbus_result_unknown = 1, ///< no such command
    modbus_result_state = 2,   ///< not in this state
    modbus_result_key = 3,     ///< ARM or START without the key
    modbus_result_size = 4,    ///< TABLE_BYTES is 0 or above TABLE_BYTES_MAX
    modbus_result_name = 5,    ///< the table is whole, but its name is not TABLE_CRC32
    modbus_result_setup = 6,   ///< fields of the setup do not go together, or with the table
    modbus_result_drive = 7,   ///< the drive cannot be armed now
};

enum modbus_end {
    modbus_end_none = 0,
    modbus_end_complete = 1,
    modbus_end_stopped = 2,
    modbus_end_aborted = 3,
    modbus_end_fault = 4,
};

/// Bits of FAULTS.
enum modbus_fault {
    modbus_fault_sensor = 1,
    modbus_fault_travel = 2,
    modbus_fault_velocity = 4,
    modbus_fault_watchdog = 8, ///< nothing was written for HOST_TIMEOUT_MS
    modbus_fault_stuck = 16,
    modbus_fault_following = 32,
    modbus_fault_drive = 64, ///< the drive's own
    modbus_fault_late = 128, ///< the sample path missed a sample
};

/// What the window holds where it holds no spectrum.
enum modbus_validity {
    modbus_spectrum_valid = 0,
    modbus_spectrum_not_yet = 1,      ///< this period has not ended, or no period was valid yet
    modbus_spectrum_not_kept = 2,     ///< later periods have taken its place
    modbus_spectrum_nothing = 3,      ///< nothing was latched
    modbus_spectrum_left_out = 0x100, ///< plus bits of enum frf_reason: the period does not count
};

/// Channels for INPUT and OUTPUT.
enum modbus_channel {
    modbus_channel_torque_ref = 0,
    modbus_channel_torque = 1,
    modbus_channel_position = 2,
    modbus_channel_velocity = 3,
};

enum modbus_exception {
    modbus_exception_none = 0,
    modbus_exception_function = 1, ///< no such function
    modbus_exception_address = 2,  ///< not mapped, or not to be written
    modbus_exception_value = 3,    ///< value out of range, half a 32-bit number, count, or not in this state
    modbus_exception_device = 4,   ///< the drive failed to do it; RESULT says why
    modbus_exception_busy = 6,     ///< another client commands
};

#endif
