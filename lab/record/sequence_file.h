/* SPDX-License-Identifier: MIT */
/// The manifest of a sequence: which tables are played one after the other, and for how long (docs/files.md,
/// "Sequence"). One JSON object; it is written after its tables, so that a manifest that is there is whole.
#ifndef SERVOSCOPE_RECORD_SEQUENCE_FILE_H
#define SERVOSCOPE_RECORD_SEQUENCE_FILE_H

#include "lab/record/error.h"
#include "lab/record/table_file.h"

#include <stddef.h>
#include <stdint.h>

enum {
    sequence_inputs_max = 16,
    sequence_segments_max = 4096,
};

/// What one input plays during a segment.
struct sequence_table {
    char *file; ///< relative to the manifest's folder; owned
    uint32_t table_crc32;
    size_t bin_count;
    uint32_t *bins; ///< excited bins, ascending, 1 .. (period - 1) / 2; owned
};

struct sequence_segment {
    uint64_t periods;              ///< N_i: counted periods at averaging factor 1 and one input
    struct sequence_table *tables; ///< one for each input; owned
};

/// Zero-initialise, or sequence_file_read(); sequence_file_free() in every case.
struct sequence_file {
    char *path;       ///< where it was read from; owned
    const char *kind; ///< "octaves", "dwell" or "multisine"
    double sample_rate_hz;
    size_t period_samples;
    size_t inputs;
    uint64_t periods; ///< averaging factor for which test_time_s holds
    double settle_s;  ///< to let a segment settle before its counted periods
    double test_time_s;
    size_t segment_count;
    struct sequence_segment *segments; ///< in the order of playing; owned
};

/// Allocates segment_count segments of `inputs` tables each, and sets both; the rest is zero.
/// Errors: error_refused if memory is short; *out_self is empty then.
int sequence_file_alloc(struct sequence_file *out_self, size_t segment_count, size_t inputs, struct error *out_error);

/// Reads and checks a manifest; the tables themselves are not looked at.
/// Errors: error_refused with file, line, place (segments[2].tables[0].file), value and expectation; *out_self is empty
///         then
/// Test:   tests/fault/test_sequence_file.c
int sequence_file_read(const char *path, struct sequence_file *out_self, struct error *out_error);

/// Writes a manifest, whole or not at all.
/// Errors: error_refused with the system's reason; `path` is as it was then
int sequence_file_write(const char *path, const struct sequence_file *self, struct error *out_error);

/// Whether `table`, read from `path`, is the one that the manifest means: CRC, rate and period.
/// Errors: error_refused with what differs
int sequence_file_check_table(const struct sequence_file *self, size_t segment, size_t input, const char *path,
                              uint32_t crc32, double rate_hz, size_t period_samples, struct error *out_error);

void sequence_file_free(struct sequence_file *self);

#endif
