/* SPDX-License-Identifier: MIT */
/// Run files: what a measurement recorded (docs/files.md, "Run").
/// Text, UTF-8, comma-separated, `# key: value` lines, one row of names whose ends are the units, then numbers.
#ifndef SERVOSCOPE_RECORD_RUN_H
#define SERVOSCOPE_RECORD_RUN_H

#include "lab/record/error.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct run_column {
    char *name;   ///< unit included: torque_Nm
    double *data; ///< `rows` values; NaN only in columns that the reader does not know
};

struct run {
    char *path;            ///< where it was read from, for messages; owned
    double sample_rate_hz; ///< > 0 once read
    size_t rows;
    size_t period_samples;   ///< 0: not periodic, or not said
    size_t periods;          ///< counted periods after the settling ones; 0: not said
    size_t settle_periods;   ///< leading periods to leave out
    bool has_settle_periods; ///< whether the file said so
    size_t bin_count;
    uint32_t *bins; ///< excited bins of one period, ascending; NULL: not said
    bool has_table_crc32;
    uint32_t table_crc32;
    bool linear; ///< recorded in m and N instead of rad and Nm
    size_t column_count;
    struct run_column *columns;
    size_t key_count; ///< every `# key: value` line, known or not, in order, so that nothing is lost
    struct run_key {
        char *key;
        char *value;
    } * keys;
};

struct run_options {
    const char *map; ///< "torque_Nm=COLUMN[*SCALE],..." or NULL
    double rate_hz;  ///< 0: from the file
    /// Without a map, name foreign columns by the units in their names. What was named so is the run's key
    /// `columns_named`, in the form of a map.
    bool guess;
    const char *keep[3]; ///< with guess: columns that keep their names; entries may be NULL
};

/// Reads a run from a .csv or .csv.gz file (recognised by content, not by name).
/// Checks: finite numbers in known columns, equal row lengths, strictly increasing time, rate consistent with time (the
/// rate is the option's, and time is not judged then, else the key's, else the inverse of the mean time step; a gap
/// is refused), periods that fit the rows, bins below half the period.
/// Errors: error_refused with file, line, column, value and expectation; *out_run is empty then.
int run_read(const char *path, const struct run_options *options, struct run *out_run, struct error *out_error);

/// Writes a run: to a temporary name beside `path`, flushed, then renamed, so that `path` is whole or as it was.
int run_write(const char *path, const struct run *run, struct error *out_error);

/// The values of a column, or NULL if the run has none of that name.
const double *run_column(const struct run *run, const char *name);

/// Adds a column of run->rows zeros and returns its values, NULL if memory is short.
double *run_add_column(struct run *run, const char *name);

/// Sets a key (replaces an equal one); `value` without newline. Returns false if memory is short.
bool run_set_key(struct run *run, const char *key, const char *value);
const char *run_key(const struct run *run, const char *key);

void run_free(struct run *run);

#endif
