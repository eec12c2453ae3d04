/* SPDX-License-Identifier: MIT */
/// The status of every set-up function in lib/: one list, so that a drive can report any of them as one number on a
/// bus. 0 is success, all others are negative and keep their number. A function that returns one has changed nothing
/// unless its doc block says so. The sample-rate path has no status: it saturates, counts and marks.
#ifndef SERVOSCOPE_CORE_STATUS_H
#define SERVOSCOPE_CORE_STATUS_H

#ifdef __cplusplus
extern "C" {
#endif

enum core_status {
    core_ok = 0,
    core_err_argument = -1, ///< a null pointer, or a value that only a programming error can produce
    core_err_storage = -2,  ///< the storage passed in is too small

    core_err_table_truncated = -10, ///< fewer bytes than the header says, or than a header has
    core_err_table_trailing = -11,  ///< more bytes than the header says
    core_err_table_magic = -12,     ///< not a table
    core_err_table_version = -13,   ///< a version this program does not know
    core_err_table_header_crc = -14,
    core_err_table_data_crc = -15,
    core_err_table_rate = -16,      ///< sample rate with numerator or denominator 0
    core_err_table_samples = -17,   ///< N outside 4 .. SERVOSCOPE_TABLE_SAMPLES_MAX
    core_err_table_channels = -18,  ///< not 1 .. 3
    core_err_table_format = -19,    ///< not i16, i32 or f32
    core_err_table_unit = -20,      ///< neither rotary nor linear
    core_err_table_reserved = -21,  ///< a field that has to be 0 is not
    core_err_table_scale = -22,     ///< scale of a channel not a positive normal number
    core_err_table_size = -23,      ///< length of the data does not follow from N, channels, format and bins
    core_err_table_bin_count = -24, ///< no bins, or more than fit below N/2
    core_err_table_bin_order = -25, ///< bins not strictly ascending from 1
    core_err_table_bin_range = -26, ///< bin at or above N/2
    core_err_table_start = -27,     ///< start index at or above N
    core_err_table_sample = -28,    ///< a float sample that is not finite
    core_err_table_travel = -29,    ///< travel of none, of more than 2^31 counts, or of a table without position

    core_err_player_format = -40,  ///< table in the number format of the other path (integer, float)
    core_err_player_fade = -41,    ///< ramp too long, abort ramp of no length, or fade in and approach
    core_err_player_periods = -42, ///< no periods
    core_err_player_limit = -43,   ///< output limit negative
    core_err_player_travel = -44,  ///< the travel of all periods does not fit the output

    core_err_frf_period = -50,   ///< N outside 4 .. SERVOSCOPE_FRF_PERIOD_MAX, or not that of the twiddle table
    core_err_frf_bins = -51,     ///< no bins, too many, not strictly ascending from 1, or at or above N/2
    core_err_frf_channels = -52, ///< not 1 .. SERVOSCOPE_FRF_CHANNELS_MAX
    core_err_frf_rails = -53,    ///< saturation thresholds in the wrong order, or beyond the samples' width
    core_err_frf_block = -54,    ///< no such block length, or too few basis functions for the lines

    core_err_guard_travel = -60,   ///< lower travel limit not below the upper one, or not a number
    core_err_guard_velocity = -61, ///< speed limit not positive
    core_err_guard_torque = -62,   ///< torque limit not positive
    core_err_guard_stuck = -63,    ///< torque threshold of the stuck check not positive though it is on, or negative
    core_err_guard_outside = -64,  ///< cannot be armed: the axis is outside its limits now, or its sensor is invalid
};

/// One line for a person, without full stop; never NULL, also for numbers that are not in the list.
const char *core_status_str(enum core_status status);

#ifdef __cplusplus
}
#endif

#endif
