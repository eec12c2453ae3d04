/* SPDX-License-Identifier: MIT */
/// Runs and responses as universal files (docs/files.md, "Universal files"). Internal to lab/record.
#ifndef SERVOSCOPE_RECORD_UFF_WRITE_H
#define SERVOSCOPE_RECORD_UFF_WRITE_H

#include "lab/record/format.h"

/// Identification lines of a function that hold a key each, by index.
enum { uff_key_lines = 3 };
extern const int uff_key_line[uff_key_lines];

/// What begins a line that goes on with the key of the line before, and the name of a function that only holds keys.
extern const char uff_more_mark[], uff_more_keys[];

/// What dataset 151 says of a file of ours, before the number of its functions.
extern const char uff_program[], uff_holds_run[], uff_holds_frf[];

/// Writes a record, in text or as 58b.
/// Errors: error_refused; `path` is as it was then.
int uff_write_record(const char *path, const struct record *record, bool binary, struct format_notes *io_notes,
                     struct error *out_error);

#endif
