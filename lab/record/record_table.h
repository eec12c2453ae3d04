/* SPDX-License-Identifier: MIT */
/// How a format that is not text comes to the same record as text does: its columns and keys become a text_table, which
/// then passes the one set of checks that runs and responses have. Internal to lab/record.
///
/// Messages of those checks name the place as FILE:NUMBER: the number of the sample or line, from 1.
#ifndef SERVOSCOPE_RECORD_RECORD_TABLE_H
#define SERVOSCOPE_RECORD_RECORD_TABLE_H

#include "lab/record/error.h"
#include "lab/record/format.h"
#include "lab/record/text_table.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

/// An empty table of a file.
/// Errors: error_refused if memory is short; *out_table is empty then.
int record_table_start(struct text_table *out_table, const char *path, struct error *out_error);

/// Adds a column. `data` (as many values as `rows` of the first column) belongs to the table from here on, also on
/// error. Values that are not finite become NaN.
int record_table_add_column(struct text_table *self, const char *name, double *data, size_t rows,
                            struct error *out_error);

/// Adds a key; "" is a comment.
int record_table_add_key(struct text_table *self, const char *key, const char *value, struct error *out_error);

/// Adds a key whose value is a number that reads back bit for bit.
int record_table_add_number(struct text_table *self, const char *key, double value, struct error *out_error);

/// Makes a run of a table, which is empty afterwards in every case: --map, then the checks of run_read.
int run_take_table(struct text_table *io_table, const struct run_options *options, struct run *out_run,
                   struct error *out_error);

/// Makes a response of a table, which is empty afterwards in every case.
int frf_take_table(struct text_table *io_table, struct frf *out_frf, struct error *out_error);

/// Writes every key of a run or a response as the lines that its text file has.
void run_write_keys(FILE *stream, const struct run *run);
void frf_write_keys(FILE *stream, const struct frf *frf);

struct record_keys {
    size_t count;
    struct run_key *items;
};

/// The same keys as a list, in that order.
/// Errors: error_refused if memory is short; *out_keys is empty then.
int record_keys_list(const struct record *record, struct record_keys *out_keys, struct error *out_error);
void record_keys_free(struct record_keys *self);

enum { record_frf_columns = 9 };

/// The columns of a response in the order of its text file: frequency_hz, real, imag, then magnitudes; `valid` is not
/// among them (its place is NULL), nor is one that no line knows.
void record_frf_list(const struct frf *frf, const char *out_names[record_frf_columns],
                     const double *out_columns[record_frf_columns]);

#endif
