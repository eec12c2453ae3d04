/* SPDX-License-Identifier: MIT */
/// What a run has to be, whatever file it comes from and in however many pieces: names, keys, time stamps, sizes.
/// Internal to lab/record.
#ifndef SERVOSCOPE_RECORD_RUN_CHECKS_H
#define SERVOSCOPE_RECORD_RUN_CHECKS_H

#include "lab/record/error.h"
#include "lab/record/run.h"
#include "lab/record/text_table.h"

#include <stdbool.h>
#include <stddef.h>

struct run_checks {
    bool judges_time;
    size_t time_column;
    double step_s;     ///< 0: not known yet
    bool judges_steps; ///< false where the key's rate is so far off that it is the rate that is refused in the end
    double first_s, last_s;
    size_t rows; ///< judged so far
};

/// Lets a run see a table's columns and keys, which stay the table's.
void run_view_table(const struct text_table *table, struct run *io_run);

/// Moves columns, keys and path of a table into a run, which then owns them.
void run_move_table(struct text_table *io_table, struct run *io_run);

/// --rate of the options: 0 or a rate. Errors: error_usage
int run_check_options(const struct run_options *options, struct error *out_error);

/// One column per known name, one kind of axis; sets run->linear.
int run_check_names(const struct text_table *table, struct run *io_run, struct error *out_error);

/// Reads the keys that have a field of their own; run->bins has to be NULL or malloc'd.
int run_read_keys(const struct text_table *table, struct run *io_run, struct error *out_error);

/// Whether a key has a field of its own in struct run.
bool run_is_field_key(const char *key);

/// Begins to judge rows; run->columns and the keys are there.
void run_checks_begin(struct run_checks *self, const struct run *run, const struct run_options *options);

/// Judges the table's rows from first_row on, which follow those judged before: sizes, `valid`, time stamps. What a
/// step of time should be is the median of the first 65536.
int run_checks_rows(struct run_checks *self, const struct text_table *table, const struct run *run, size_t first_row,
                    struct error *out_error);

/// The rate as far as it is known: of the options, the key, or the time stamps judged so far; 0 if nothing says it.
double run_checks_rate(const struct run_checks *self, const struct run *run, const struct run_options *options);

/// After the last row: do the periods fit the rows, does the rate fit the time stamps? Sets run->sample_rate_hz.
int run_checks_end(const struct run_checks *self, const struct text_table *table, struct run *io_run,
                   const struct run_options *options, struct error *out_error);

#endif
