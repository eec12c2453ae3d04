/* SPDX-License-Identifier: MIT */
/// Multisine tables: the bytes of an .mst file, in flash or in RAM, and every check on them.
///
/// Little-endian, no alignment assumed:
///
///     offset size
///          0    4  magic: 'M' 'S' 'T' 0x1A
///          4    2  version: 1, or 2 for a table whose position travels
///          6    1  channels: 1 torque; 2 torque, velocity; 3 torque, velocity, position
///          7    1  number format: 1 i16, 2 i32, 3 f32
///          8    4  sample rate, numerator, Hz
///         12    4  sample rate, denominator
///         16    4  N, samples in the period: 4 .. 2^20
///         20    4  K, number of excited bins: 1 .. below N/2
///         24    4  start index: 0 .. N-1
///         28    4  unit: 0 rotary (Nm, rad/s, rad), 1 linear (N, m/s, m)
///         32   12  scale of each channel, float bits, SI per count; 0 for channels that are not there
///         44    4  length of the data in bytes: 4 K + N * channels * bytes per number
///         48    4  CRC-32 of the data
///         52    4  version 1: CRC-32 of the 52 bytes before: as it covers the data's CRC, it names the table
///         52    8  version 2: travel per period, i64, in 2^-30 counts of the position channel: not 0, at most 2^61
///         60    4  version 2: CRC-32 of the 60 bytes before, the table's name
///         56 or 64 excited bins, 4 K bytes, u32, strictly ascending from 1, below N/2
///          .    .  N frames of `channels` numbers: torque, velocity, position
///
/// Version 2 is for an excitation around a constant speed (msgen/player.h, travel): the velocity's samples hold that
/// speed, the position's samples hold what is periodic of the position, and the travel is what it gains in each period.
/// A table without travel is version 1, so that every table has one encoding.
///
/// No float instruction is needed to check or to play an integer table.
#ifndef SERVOSCOPE_MSGEN_TABLE_H
#define SERVOSCOPE_MSGEN_TABLE_H

#include "core/config.h"
#include "core/status.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
    msgen_channels_max = 3,
    msgen_header_bytes = 56,        ///< of version 1
    msgen_header_travel_bytes = 64, ///< of version 2
    msgen_table_version = 1,
    msgen_table_version_travel = 2,
};

/// Order of the channels in a frame.
enum msgen_channel {
    msgen_channel_torque = 0,
    msgen_channel_velocity = 1,
    msgen_channel_position = 2,
};

enum msgen_format {
    msgen_format_i16 = 1,
    msgen_format_i32 = 2,
    msgen_format_f32 = 3,
};

/// A checked view of a table; read-only for the application. The bytes must outlive it and not change.
struct msgen_table {
    const uint8_t *bins;    ///< 4 * bin_count bytes; read with msgen_table_bin()
    const uint8_t *samples; ///< period_samples frames; read with msgen_table_count() or msgen_table_float_bits()
    uint32_t rate_num_hz, rate_den;
    uint32_t period_samples;                 ///< N
    uint32_t bin_count;                      ///< K
    uint32_t start_index;                    ///< sample at which the first counted period begins
    uint32_t scale_bits[msgen_channels_max]; ///< float bits, SI per count
    uint32_t data_crc32;
    uint32_t header_crc32; ///< names the table: `table_crc32` of every file
    uint32_t channels;
    enum msgen_format format;
    int64_t travel_q30;    ///< counts of the position channel per period, times 2^30; 0: none, which is version 1
    bool linear;           ///< N, m/s, m instead of Nm, rad/s, rad
    uint32_t fault_offset; ///< after a refusal: offset of the first byte of what was refused
};

/// Checks a whole table and opens it for reading, without copying.
/// Range:    any bytes at all; reads only bytes[0 .. size-1]
/// Errors:   core_err_table_*, the first that applies in the order of the format; out_table is then unusable but for
///           fault_offset. core_err_argument on a null pointer.
/// Cost:     one CRC pass over the bytes, one pass over the bins, one over float samples; not for an interrupt
/// Lifetime: bytes must outlive out_table
/// Test:     tests/unit/test_msgen_table.c, tests/fault/test_table_file.c
enum core_status msgen_table_open(const uint8_t *bytes, size_t size, struct msgen_table *out_table);

/// Writes the header that belongs to a table whose fields are filled in (all but bins, samples, header_crc32).
/// data_crc32 is the CRC-32 of the bins and frames that will follow. The last four bytes written are the table's name.
/// Shapes:   out_bytes: msgen_table_header_bytes(self)
/// Errors:   as msgen_table_open() for every field of the header; out_bytes is untouched then
enum core_status msgen_table_encode_header(const struct msgen_table *self, uint8_t *out_bytes);

/// Length of the header: 56 bytes, 64 with travel.
uint32_t msgen_table_header_bytes(const struct msgen_table *self);

/// Bytes of one number: 2 or 4, 0 for a format that does not exist.
uint32_t msgen_format_bytes(enum msgen_format format);

/// Length of the data behind the header, in bytes; below 2^24 + 2^21 for fields in range.
uint32_t msgen_table_data_bytes(const struct msgen_table *self);

/// Excited bin number `index`, 0 <= index < bin_count.
uint32_t msgen_table_bin(const struct msgen_table *self, uint32_t index);

/// Sample in counts, integer formats only; n < period_samples, channel < channels. Interrupt-safe.
int32_t msgen_table_count(const struct msgen_table *self, uint32_t n, uint32_t channel);

/// Bits of a sample, f32 only; n < period_samples, channel < channels. Interrupt-safe.
uint32_t msgen_table_float_bits(const struct msgen_table *self, uint32_t n, uint32_t channel);

#ifdef __cplusplus
}
#endif

#endif
