/* SPDX-License-Identifier: MIT */
/// Lines of a text file, plain or gzipped (told apart by content), of any length up to 64 MiB.
/// Internal to lab/record.
#ifndef SERVOSCOPE_RECORD_LINE_READER_H
#define SERVOSCOPE_RECORD_LINE_READER_H

#include "lab/record/error.h"

#include <stddef.h>

enum line_status { line_end, line_ok, line_failed };

/// A line of the file, without its end; not terminated, and valid until the next one is asked for.
struct line {
    const char *text;
    size_t length;
    size_t number; ///< from 1
};

struct line_reader;

/// Opens a file; `path` has to outlive the reader.
/// Errors: NULL with error_refused
struct line_reader *line_reader_open(const char *path, struct error *out_error);

/// Reads the next line; LF and CRLF end one, a byte order mark at the beginning is no part of the first.
/// Errors: line_failed with error_refused and the line: binary zeros, a damaged gzip file, more than 64 MiB
enum line_status line_reader_next(struct line_reader *self, struct line *out_line, struct error *out_error);

/// Number of the line that was last read; 0 before the first.
size_t line_reader_number(const struct line_reader *self);

/// How much of the file has been read, packed or not, 0 to 1; 0 if it is none with a length.
double line_reader_share(const struct line_reader *self);

void line_reader_close(struct line_reader *self);

#endif
