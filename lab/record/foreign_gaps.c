/* SPDX-License-Identifier: MIT */
/// Empty cells of a recording as samples that were lost.
#include "lab/record/foreign_text.h"

#include "lab/record/record_table.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool is_whole(const struct text_table *table, const bool *used, size_t row)
{
    for (size_t c = 0; c < table->column_count; c++)
        if (used[c] && isnan(table->columns[c].data[row]))
            return false;
    return true;
}

static const char *first_missing(const struct text_table *table, const bool *used, size_t row)
{
    for (size_t c = 0; c < table->column_count; c++)
        if (used[c] && isnan(table->columns[c].data[row]))
            return table->columns[c].name;
    return "";
}

static int cut_end(struct text_table *io_table, const bool *used, struct format_notes *io_notes,
                   struct error *out_error)
{
    size_t rows = io_table->rows;
    while (rows > 0 && !is_whole(io_table, used, rows - 1))
        rows--;
    if (rows == 0)
        return error_set(out_error, error_refused, "%s: no row has a value in every column that is used",
                         io_table->path);
    if (rows < io_table->rows)
        format_notes_add(io_notes, format_lost, "the last %zu row%s, from row %zu on: %s has no value in them",
                         io_table->rows - rows, io_table->rows - rows == 1 ? "" : "s", rows + 1,
                         first_missing(io_table, used, rows));
    io_table->rows = rows;
    return 0;
}

/// Empty cells repeat the value before; in front of the first there is only the one behind.
static void fill(double *data, size_t rows)
{
    size_t first = 0;
    while (first < rows && isnan(data[first]))
        first++;
    for (size_t n = 0; first < rows && n < rows; n++)
        if (isnan(data[n]))
            data[n] = n > first ? data[n - 1] : data[first];
}

/// The column of the file that says which samples are valid, or a new one.
static double *find_valid(struct text_table *io_table, const char *name, struct error *out_error)
{
    for (size_t c = 0; c < io_table->column_count; c++)
        if (strcmp(io_table->columns[c].name, name) == 0)
            return io_table->columns[c].data;
    double *valid = malloc(io_table->rows * sizeof *valid);
    for (size_t n = 0; valid && n < io_table->rows; n++)
        valid[n] = 1.0;
    if (!valid) {
        error_set(out_error, error_refused, "%s: memory is short", io_table->path);
        return NULL;
    }
    const int status = record_table_add_column(io_table, "valid", valid, io_table->rows, out_error);
    return status ? NULL : valid;
}

static size_t count_lost(const struct text_table *table, const bool *used, size_t *out_first)
{
    size_t count = 0;
    for (size_t n = 0; n < table->rows; n++)
        if (!is_whole(table, used, n) && count++ == 0)
            *out_first = n;
    return count;
}

/// The rows of a Scope's channels stand in different lines: their number and time say where.
static void note_lost(const struct text_table *table, const bool *used, size_t count, size_t first,
                      struct format_notes *io_notes)
{
    char when[40] = "";
    for (size_t c = 0; c < table->column_count; c++)
        if (strcmp(table->columns[c].name, "time_s") == 0 && !isnan(table->columns[c].data[first]))
            snprintf(when, sizeof when, " at %.9g s", table->columns[c].data[first]);
    format_notes_add(io_notes, format_kept,
                     "%zu row%s with an empty cell, the first is row %zu%s (%s): marked as lost with valid 0", count,
                     count == 1 ? "" : "s", first + 1, when, first_missing(table, used, first));
}

int foreign_mark_gaps(struct text_table *io_table, const bool *used, const char *valid_name,
                      struct format_notes *io_notes, struct error *out_error)
{
    int status = cut_end(io_table, used, io_notes, out_error);
    const size_t columns = io_table->column_count;
    size_t first = 0;
    const size_t marked = status ? 0 : count_lost(io_table, used, &first);
    if (marked == 0)
        return status;
    note_lost(io_table, used, marked, first, io_notes);
    bool *lost = malloc(io_table->rows * sizeof *lost);
    if (!lost)
        return error_set(out_error, error_refused, "%s: memory is short", io_table->path);
    for (size_t n = 0; n < io_table->rows; n++)
        lost[n] = !is_whole(io_table, used, n);
    for (size_t c = 0; c < columns; c++)
        if (used[c])
            fill(io_table->columns[c].data, io_table->rows);
    double *valid = find_valid(io_table, valid_name, out_error);
    for (size_t n = 0; valid && n < io_table->rows; n++)
        valid[n] = lost[n] ? 0.0 : valid[n];
    free(lost);
    return valid ? 0 : error_refused;
}
