/* SPDX-License-Identifier: MIT */
/// Multisine tables on the host: one period of torque, velocity, position and acceleration in SI units, and the three
/// files that `design` writes of it. The bytes of an .mst file are defined in lib/msgen/table.h.
///
/// All three files of a table carry the same CRC-32 (`table_crc32`, the one of the .mst header, which covers
/// everything), and so does every run made with it.
#ifndef SERVOSCOPE_RECORD_TABLE_FILE_H
#define SERVOSCOPE_RECORD_TABLE_FILE_H

#include "lab/record/error.h"
#include "msgen/table.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// Zero-initialise, then table_alloc() or table_file_read(); table_free() in every case.
struct table {
    uint32_t rate_num_hz, rate_den; ///< sample rate as a fraction; see table_set_rate()
    uint32_t samples;               ///< N, one period
    uint32_t channels;              ///< of the .mst file: 1 torque; 2 and velocity; 3 and position
    double *torque;                 ///< N values each, Nm, rad/s, rad, rad/s^2 (linear: N, m/s, m, m/s^2); owned
    double *velocity;               ///< NULL below 2 channels
    double *position;               ///< NULL below 3 channels
    double *acceleration;           ///< goes into the CSV only; may be NULL
    uint32_t bin_count;
    uint32_t *bins;                  ///< excited bins, strictly ascending from 1, below N/2; owned
    uint32_t start_index;            ///< sample at which playing begins
    enum msgen_format format;        ///< 0: i32
    float scale[msgen_channels_max]; ///< SI per count; 0: chosen when written, so that the peak fills the format
    /// What the position gains in each period beside `position`, rad (linear: m): the table plays around a constant
    /// speed, which is in `velocity` (msgen/player.h, travel). 0: none. Needs 3 channels.
    double travel_per_period;
    bool linear;
    uint32_t crc32; ///< set by reading and by every write
};

/// Allocates zeroed arrays for `channels` channels and the acceleration, and sets the sizes; other fields are zero.
/// Errors: error_refused for sizes out of the format's range or when memory is short; *out_table is empty then.
int table_alloc(struct table *out_table, uint32_t samples, uint32_t channels, uint32_t bin_count,
                struct error *out_error);

/// Sets the rate as the fraction with the smallest denominator that equals rate_hz to 1e-12 (1000, 8000/3, 44100/1001).
/// Errors: error_refused if rate_hz is not a number from 1e-6 to 4e9 Hz
int table_set_rate(struct table *self, double rate_hz, struct error *out_error);

double table_rate_hz(const struct table *self);

/// Reads and checks an .mst file; acceleration stays NULL.
/// Errors: error_refused with path, byte, value and expectation; *out_table is empty then.
/// Test:   tests/fault/test_table_file.c
int table_file_read(const char *path, struct table *out_table, struct error *out_error);

/// Writes an .mst file, and sets scale[] where it was 0, format where it was 0, and crc32.
/// Quantisation: x = scale * count, rounded to nearest. A chosen scale puts the largest |x| of a channel on the largest
///               count of the format, so values written are off by at most peak / 65534 (i16) or peak / 4.3e9 (i32).
///               The position of an i32 table that travels gets a scale at which the peak and 1024 periods of travel
///               fill the format, because the player's output has 32 bits. Travel is written in 2^-30 counts.
/// Errors: error_refused, nothing written: a value that is not finite, does not fit its format at the given scale, or
/// leaves
///         a channel with fewer than 127 counts; sizes, rate, bins, start index out of range
int table_file_write_mst(const char *path, struct table *self, struct error *out_error);

/// Writes the table as text: `n,torque_Nm,position_rad,velocity_rad_per_s,acceleration_rad_per_s2` (what is there of
/// it; the linear twins if self->linear), keys sample_rate_hz, period_samples, excited_bins, start_index,
/// travel_per_period_rad (_m; only with travel), table_crc32 before. The values are exact, as before quantisation.
/// Errors and effects on *self as table_file_write_mst().
int table_file_write_csv(const char *path, struct table *self, struct error *out_error);

/// Writes the bytes of the .mst file as a const C array for a firmware's flash, to be opened with msgen_table_open().
/// C99 and C++; names are made of the file's name. Errors and effects on *self as table_file_write_mst().
int table_file_write_header(const char *path, struct table *self, struct error *out_error);

/// The bytes of the .mst file, to be freed by the caller; `name` is for messages. Errors and effects on *self as
/// table_file_write_mst().
int table_file_encode(const char *name, struct table *self, uint8_t **out_bytes, size_t *out_size,
                      struct error *out_error);

/// Length of the .mst file that this table is or will be, in bytes.
size_t table_file_bytes(const struct table *self);

/// Frees all arrays and empties *self; harmless on an empty one.
void table_free(struct table *self);

#endif
