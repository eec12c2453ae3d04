/* SPDX-License-Identifier: MIT */
#include "core/status.h"

static const struct {
    enum core_status status;
    const char *text;
} texts[] = {
    {core_ok, "ok"},
    {core_err_argument, "argument missing or impossible"},
    {core_err_storage, "storage too small"},
    {core_err_table_truncated, "table is cut short"},
    {core_err_table_trailing, "bytes after the end of the table"},
    {core_err_table_magic, "not a table: it does not start with 'MST' 0x1A"},
    {core_err_table_version, "table version is unknown"},
    {core_err_table_header_crc, "CRC-32 of the table's header is wrong"},
    {core_err_table_data_crc, "CRC-32 of the table's data is wrong"},
    {core_err_table_rate, "sample rate is zero or divided by zero"},
    {core_err_table_samples, "period is too short or too long"},
    {core_err_table_channels, "number of channels is not 1, 2 or 3"},
    {core_err_table_format, "number format is not i16, i32 or f32"},
    {core_err_table_unit, "unit is neither rotary nor linear"},
    {core_err_table_reserved, "a field that must be zero is not"},
    {core_err_table_scale, "scale is not a positive normal number"},
    {core_err_table_size, "length of the data does not follow from period, channels, format and bins"},
    {core_err_table_bin_count, "number of excited bins is zero or does not fit below half the period"},
    {core_err_table_bin_order, "excited bins are not strictly ascending from 1"},
    {core_err_table_bin_range, "excited bin is not below half the period"},
    {core_err_table_start, "start index is not below the period"},
    {core_err_table_sample, "sample is not a finite number"},
    {core_err_table_travel, "travel per period is none, or too long, or there is no position channel"},
    {core_err_player_format, "table has the number format of the other player (integer, float)"},
    {core_err_player_fade, "a ramp is too long, the abort ramp has no length, or there are a fade in and an approach"},
    {core_err_player_periods, "number of periods is zero"},
    {core_err_player_limit, "output limit is negative"},
    {core_err_player_travel, "travel of all periods together does not fit the output"},
    {core_err_frf_period, "period is out of range or not that of the twiddle table"},
    {core_err_frf_bins, "bins are none, too many, not ascending, or not below half the period"},
    {core_err_frf_channels, "number of channels is out of range"},
    {core_err_frf_rails, "lower saturation threshold is not below the upper one, or one is wider than the samples"},
    {core_err_frf_block, "no such block length, or too few basis functions for the lines"},
    {core_err_guard_travel, "lower travel limit is not below the upper one"},
    {core_err_guard_velocity, "speed limit is not positive"},
    {core_err_guard_torque, "torque limit is not positive"},
    {core_err_guard_stuck, "torque threshold of the stuck check is not positive"},
    {core_err_guard_outside, "outside the limits now, or the sensor is invalid"},
};

const char *core_status_str(enum core_status status)
{
    for (unsigned i = 0; i < sizeof texts / sizeof texts[0]; ++i) {
        if (texts[i].status == status) {
            return texts[i].text;
        }
    }
    return "unknown status";
}
