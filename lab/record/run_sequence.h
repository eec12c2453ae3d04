/* SPDX-License-Identifier: MIT */
/// The manifest of a measured sequence: which runs there are, and which table each of them played (docs/files.md,
/// "Sequence of runs"). One JSON object; it is written after its runs. `frf` takes it where it takes a run.
#ifndef SERVOSCOPE_RECORD_RUN_SEQUENCE_H
#define SERVOSCOPE_RECORD_RUN_SEQUENCE_H

#include "lab/record/error.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    run_sequence_segments_max = 4096,
};

struct run_sequence_segment {
    char *table; ///< the table's file name, for a person; its CRC says which it is; owned
    uint32_t table_crc32;
    char *run;                ///< relative to the manifest's folder; NULL: nothing was measured; owned
    uint64_t periods;         ///< counted periods that the run holds; 0 without a run
    uint64_t periods_planned; ///< fewer than that were measured if the measurement ended early
};

/// Zero-initialise, then run_sequence_alloc() or run_sequence_read(); run_sequence_free() in every case.
struct run_sequence {
    char *path;       ///< where it was read from; owned
    const char *kind; ///< "octaves", "dwell" or "multisine"
    char *stopped_by; ///< why it ended early; NULL: it did not; owned
    size_t segment_count;
    struct run_sequence_segment *segments; ///< in the order of playing; owned
};

/// Allocates segments without runs. Errors: error_refused if memory is short; *out_self is empty then.
int run_sequence_alloc(struct run_sequence *out_self, size_t segment_count, struct error *out_error);

/// Reads and checks a manifest; the runs themselves are not looked at.
/// Errors: error_refused with file, line, place, value and expectation; *out_self is empty then
/// Test:   tests/fault/test_sequence_file.c
int run_sequence_read(const char *path, struct run_sequence *out_self, struct error *out_error);

/// Writes a manifest, whole or not at all.
/// Errors: error_refused with the system's reason; `path` is as it was then
int run_sequence_write(const char *path, const struct run_sequence *self, struct error *out_error);

/// Whether every segment has all of its periods.
bool run_sequence_complete(const struct run_sequence *self);

void run_sequence_free(struct run_sequence *self);

#endif
