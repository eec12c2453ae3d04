/* SPDX-License-Identifier: MIT */
/// A run file read piece by piece, for recordings that memory does not hold. run_read is one piece that holds
/// everything, so that both make the same checks with the same messages.
#ifndef SERVOSCOPE_RECORD_RUN_STREAM_H
#define SERVOSCOPE_RECORD_RUN_STREAM_H

#include "lab/record/error.h"
#include "lab/record/run.h"

#include <stdbool.h>
#include <stddef.h>

struct run_stream;

/// Opens a .csv or .csv.gz file, or a pipe, and reads keys and names; --map and --rate of `options` (NULL: none).
/// Errors: error_refused or error_usage as run_read; *out_self is NULL then
int run_stream_open(const char *path, const struct run_options *options, struct run_stream **out_self,
                    struct error *out_error);

/// Reads on until `rows` rows are in memory, or the file ends, and checks them.
/// Memory: 8 bytes for each number, and 8 for each row
/// Test:   tests/unit/test_run_stream.c
int run_stream_fill(struct run_stream *self, size_t rows, struct error *out_error);

/// What is in memory: names, keys in front of the names, rows since the last run_stream_forget. `sample_rate_hz` is
/// that of the time stamps so far where no key and no option says it. Valid until the next call; belongs to the stream.
const struct run *run_stream_run(const struct run_stream *self);

/// Whether the file has no further rows.
bool run_stream_ended(const struct run_stream *self);

/// Rows read so far, forgotten ones included.
size_t run_stream_rows(const struct run_stream *self);

/// How much of the file has been read, 0 to 1; 0 of a pipe, whose length nobody knows.
double run_stream_share(const struct run_stream *self);

/// Gives up the rows in memory; their room is used again.
void run_stream_forget(struct run_stream *self);

/// Moves the rows in memory into a run of their own, with names and keys; the stream goes on with fresh room.
/// Errors: error_refused if memory is short; *out_run is empty then
int run_stream_split(struct run_stream *self, struct run *out_run, struct error *out_error);

/// After the end: the checks that need the whole file. run_stream_run then has the final rate.
/// Errors: error_refused: periods that do not fit the rows, a rate that contradicts the time stamps, and, once rows
///         have
///         been forgotten, a key behind the row of names that would have changed how they are understood
int run_stream_finish(struct run_stream *self, struct error *out_error);

/// run_stream_finish, and the run itself, if nothing was forgotten; the stream can only be closed afterwards.
int run_stream_take(struct run_stream *self, struct run *out_run, struct error *out_error);

/// NULL is allowed.
void run_stream_close(struct run_stream *self);

#endif
