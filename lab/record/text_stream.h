/* SPDX-License-Identifier: MIT */
/// The text form of text_table.h read piece by piece: keys and names first, then as many rows at a time as the caller
/// has room for. text_table_read is one piece that holds everything, so that there is one reader.
#ifndef SERVOSCOPE_RECORD_TEXT_STREAM_H
#define SERVOSCOPE_RECORD_TEXT_STREAM_H

#include "lab/record/text_table.h"

#include <stdbool.h>
#include <stddef.h>

struct line_reader;

/// What is public is read-only, but for `table`: names may be changed, columns added behind those of the file, and
/// `rows` set back to 0 (text_stream_forget_rows).
struct text_stream {
    struct text_table table; ///< keys and names so far, and the rows that were not forgotten
    bool ended;              ///< there is no further row
    size_t cell_count;       ///< columns of the file
    size_t row_total;        ///< rows read, forgotten ones included
    char **cell_names;       ///< as the file spells them, for messages
    enum text_cell *kinds;
    size_t capacity;          ///< rows that the columns have room for
    size_t columns_with_room; ///< columns that have that room
    struct line_reader *lines;
};

/// Opens a file and reads up to the row of names.
/// Errors: error_refused with file, line, value and expectation; *out_self is empty then
int text_stream_open(const char *path, text_table_judge judge, void *context, struct text_stream *out_self,
                     struct error *out_error);

/// Reads rows until table.rows is `rows`, or to the end of the file. Columns behind cell_count get room, not values.
/// Errors: error_refused with file, line, column, value and expectation; a file without any row too
/// Test:   tests/unit/test_run_stream.c
int text_stream_fill(struct text_stream *self, size_t rows, struct error *out_error);

/// Makes room for other rows.
void text_stream_forget_rows(struct text_stream *self);

/// The values of a column, which belong to the caller from here on; forget the rows once all wanted ones are given.
double *text_stream_give_column(struct text_stream *self, size_t column);

/// How much of the file has been read (line_reader_share).
double text_stream_share(const struct text_stream *self);

void text_stream_close(struct text_stream *self);

#endif
