/* SPDX-License-Identifier: MIT */
/// Which columns a run file knows, and how foreign columns take their names (--map).
/// Internal to lab/record, except run_name_axis.
#ifndef SERVOSCOPE_RECORD_RUN_NAMES_H
#define SERVOSCOPE_RECORD_RUN_NAMES_H

#include "lab/record/error.h"
#include "lab/record/text_table.h"

#include <stdbool.h>
#include <stddef.h>

enum run_axis {
    run_axis_unknown, ///< not a name that a run knows
    run_axis_any,     ///< time_s, current_A, valid
    run_axis_rotary,  ///< in Nm and rad
    run_axis_linear,  ///< in N and m
};

/// What a column name stands for; torque_Nm as well as torque_2_Nm.
enum run_axis run_name_axis(const char *name);

struct run_map_entry {
    char *name;   ///< a name that a run knows
    char *source; ///< the column's name in the file
    double scale;
    bool scaled; ///< a factor was given, 1 if need be: then the unit in the column's name is not asked
};

/// A parsed --map.
struct run_map {
    size_t count;
    struct run_map_entry *entries;
};

/// Parses "torque_Nm=COLUMN[*SCALE],..."; NULL or "" is a map without entries.
/// Errors: error_usage with the part that is wrong; *out_map is empty then.
int run_map_parse(struct run_map *out_map, const char *text, struct error *out_error);

/// A text_table_judge whose context is a struct run_map: numbers are expected in known and in mapped columns.
enum text_cell run_map_judge(void *context, const char *name);

/// What a map does to the rows of a table.
struct run_map_plan {
    size_t own_count; ///< columns of the file itself
    size_t *sources;  ///< of each column behind them: the one that it repeats
    double *scales;   ///< of each column
};

/// Renames columns, and adds one for each that stands for two. A column whose name was given to another becomes
/// unmapped_NAME. Rows are left to run_map_fill.
/// Errors: error_refused if a mapped column is missing; *out_plan is empty then
int run_map_rename(const struct run_map *map, struct text_table *io_table, struct run_map_plan *out_plan,
                   struct error *out_error);

/// Copies and scales the rows from first_row on.
/// Errors: error_refused if a number leaves the range
int run_map_fill(const struct run_map_plan *plan, struct text_table *io_table, size_t first_row,
                 struct error *out_error);

void run_map_plan_free(struct run_map_plan *self);

void run_map_free(struct run_map *self);

#endif
