/* SPDX-License-Identifier: MIT */
/// A table file as the bytes that the player wants.
#ifndef SERVOSCOPE_MEASURE_TABLE_BYTES_H
#define SERVOSCOPE_MEASURE_TABLE_BYTES_H

#include "lab/record/error.h"
#include "msgen/table.h"

#include <stdint.h>

struct table_bytes {
    uint8_t *bytes;          ///< owned
    struct msgen_table view; ///< of these bytes
};

/// Reads and checks an .mst file (all of table_file_read's checks).
/// Errors: error_refused with path, place, value and expectation; *out_table is empty then.
int table_bytes_read(const char *path, struct table_bytes *out_table, struct error *out_error);

/// Frees the bytes and empties the struct; harmless on an empty one.
void table_bytes_free(struct table_bytes *self);

#endif
