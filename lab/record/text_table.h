/* SPDX-License-Identifier: MIT */
/// The text form that runs and frequency responses share: `# key: value` lines of any length, one row of names, rows
/// of numbers; comma-separated, UTF-8 with or without byte order mark, LF or CRLF, plain or gzipped (told apart by
/// content).
#ifndef SERVOSCOPE_RECORD_TEXT_TABLE_H
#define SERVOSCOPE_RECORD_TEXT_TABLE_H

#include "lab/record/error.h"
#include "lab/record/run.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

/// What the cells of a column have to be.
enum text_cell {
    text_cell_free,            ///< anything; what is no finite number is read as NaN
    text_cell_number,          ///< a finite number
    text_cell_number_or_empty, ///< the same, or nothing: NaN
};

/// Judges a column by its name while a file is read.
typedef enum text_cell (*text_table_judge)(void *context, const char *name);

struct text_table {
    char *path;
    size_t rows;
    size_t column_count;
    struct run_column *columns;
    size_t *row_line;  ///< line number of each row
    size_t names_line; ///< line number of the row of names
    size_t key_count;
    struct run_key *keys;
    size_t *key_line; ///< line number of each key
};

/// Reads a table; at least one row.
/// Errors: error_refused with file, line, column, value and expectation; *out_table is empty then.
int text_table_read(const char *path, text_table_judge judge, void *context, struct text_table *out_table,
                    struct error *out_error);

/// Frees what has not been moved out (moved members are set to NULL and their counts to 0).
void text_table_free(struct text_table *self);

/// The value of a key that may be there once, NULL if it is not; *out_line is its line.
/// Errors: error_refused if it is there twice, with both lines.
int text_table_key(const struct text_table *self, const char *key, const char **out_value, size_t *out_line,
                   struct error *out_error);

/// Writes one `# key: value` line; a key that is "" is a comment.
void text_write_key(FILE *stream, const struct run_key *key);

/// Writes one number; a NaN is nothing.
void text_write_number(FILE *stream, double value);

/// Writes the row of names and all rows; a NaN is an empty cell.
void text_write_columns(FILE *stream, const struct run_column *columns, size_t column_count, size_t rows);

#endif
