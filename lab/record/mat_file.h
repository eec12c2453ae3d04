/* SPDX-License-Identifier: MIT */
/// Runs and responses as MATLAB files (docs/files.md, "MATLAB files"), through the library matio, which is loaded when
/// the first such file is asked for: it brings three dozen other libraries, which no other subcommand should wait for.
/// Without matio at build time the same functions say how to get it. Internal to lab/record, except mat_built_in.
#ifndef SERVOSCOPE_RECORD_MAT_FILE_H
#define SERVOSCOPE_RECORD_MAT_FILE_H

#include "lab/record/format.h"

#include <stdbool.h>

enum mat_version {
    mat_version_5,  ///< read by MATLAB since 1996; 2 GiB for each variable
    mat_version_73, ///< HDF5; needs a matio that has it
};

/// Whether matio was there when this program was built.
bool mat_built_in(void);

/// Reads what servoscope wrote, or the signals of another file (format_options).
/// Errors: error_refused with file, variable and expectation; *out_record is empty then.
/// Test:   tests/unit/test_mat.c, tests/fault/test_convert_files.c
int mat_read_record(const char *path, const struct format_options *options, struct record *out_record,
                    struct format_notes *io_notes, struct error *out_error);

/// Writes a record, reads it back and compares it bit for bit before it is put in place.
/// Errors: error_refused; `path` is as it was then.
int mat_write_record(const char *path, const struct record *record, enum mat_version version,
                     struct format_notes *io_notes, struct error *out_error);

#endif
