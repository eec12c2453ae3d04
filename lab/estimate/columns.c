/* SPDX-License-Identifier: MIT */
#include "lab/estimate/columns.h"

#include "lab/numeric/clones.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const usual_inputs[] = {"torque_Nm", "force_N", "current_A", "voltage_V", NULL};
static const char *const usual_outputs[] = {"velocity_rad_per_s", "velocity_m_per_s", "position_rad", "position_m",
                                            NULL};
static const char *const usual_references[] = {"velocity_ref_rad_per_s", "velocity_ref_m_per_s", "position_ref_rad",
                                               "position_ref_m",         "torque_ref_Nm",        "force_ref_N",
                                               "current_ref_A",          "voltage_ref_V",        NULL};

static const char *own_name(const struct run *run, const char *name)
{
    for (size_t c = 0; c < run->column_count; c++) {
        if (strcmp(run->columns[c].name, name) == 0) {
            return run->columns[c].name;
        }
    }
    return NULL;
}

static bool is_lost(const double *valid, size_t row)
{
    return valid && !(valid[row] > 0.5);
}

static bool changes(const struct run *run, const char *name)
{
    const double *values = run_column(run, name);
    const double *valid = run_column(run, "valid");
    size_t first = 0;
    while (first < run->rows && is_lost(valid, first)) {
        first++;
    }
    for (size_t n = first + 1; n < run->rows; n++) {
        if (values[n] != values[first] && !is_lost(valid, n)) {
            return true;
        }
    }
    return false;
}

/// The same numbers wherever nothing was lost, not all of them one number.
static bool are_equal(const struct run *run, const char *one, const char *other)
{
    const double *a = run_column(run, one);
    const double *b = run_column(run, other);
    const double *valid = run_column(run, "valid");
    size_t n = 0;
    while (n < run->rows && (a[n] == b[n] || is_lost(valid, n))) {
        n++;
    }
    return n == run->rows && changes(run, one);
}

enum { names_size = 400 };

/// The columns there are: "t_s, iq_A, ...", as many as there is room for.
static void list_columns(const struct run *run, char out_text[names_size])
{
    size_t used = 0;
    out_text[0] = '\0';
    for (size_t c = 0; c < run->column_count; c++) {
        const char *name = run->columns[c].name;
        const char *comma = c > 0 ? ", " : "";
        if (used + strlen(comma) + strlen(name) + sizeof ", ..." > names_size) {
            snprintf(out_text + used, names_size - used, ", ...");
            return;
        }
        used += (size_t)snprintf(out_text + used, names_size - used, "%s%s", comma, name);
    }
}

static int choose_column(const struct run *run, const char *what, const char *wanted, const char *const *usual,
                         const char **out_name, struct error *out_error)
{
    *out_name = wanted ? own_name(run, wanted) : NULL;
    for (size_t i = 0; !wanted && !*out_name && usual[i]; i++) {
        *out_name = own_name(run, usual[i]);
    }
    if (*out_name) {
        return 0;
    }
    char names[names_size];
    list_columns(run, names);
    if (wanted) {
        return error_set(out_error, error_refused, "%s: no column '%s' to take as the %s, only: %s", run->path, wanted,
                         what, names);
    }
    return error_set(out_error, error_refused, "%s: no %s column among: %s: expected %s, %s, %s or %s, or --%s COLUMN",
                     run->path, what, names, usual[0], usual[1], usual[2], usual[3], what);
}

/// x - x is 0 for every finite number; four sums, because one would wait for its own last addition.
CLONED_FOR_AVX2 static bool all_finite(const double *x, size_t count)
{
    double sums[4] = {0.0};
    size_t n = 0;
    for (; n + 4 <= count; n += 4) {
        sums[0] += x[n] - x[n];
        sums[1] += x[n + 1] - x[n + 1];
        sums[2] += x[n + 2] - x[n + 2];
        sums[3] += x[n + 3] - x[n + 3];
    }
    for (; n < count; n++) {
        sums[0] += x[n] - x[n];
    }
    return sums[0] + sums[1] + sums[2] + sums[3] == 0.0;
}

static bool finite_column(const struct run *run, const char *name, struct error *out_error)
{
    const double *values = run_column(run, name);
    size_t n = 0;
    if (all_finite(values, run->rows)) {
        return true;
    }
    while (isfinite(values[n])) {
        n++;
    }
    error_set(out_error, error_refused, "%s: row %zu of %s is not a finite number", run->path, n + 1, name);
    return false;
}

static const char *default_reference(const struct run *run)
{
    for (size_t i = 0; usual_references[i]; i++) {
        const char *name = own_name(run, usual_references[i]);
        if (name && changes(run, name)) {
            return name;
        }
    }
    return NULL;
}

static int choose_reference(const struct run *run, const char *wanted, struct columns *io_columns,
                            struct error *out_error)
{
    io_columns->reference = wanted ? own_name(run, wanted) : default_reference(run);
    if (wanted && !io_columns->reference) {
        char names[names_size];
        list_columns(run, names);
        return error_set(out_error, error_refused, "%s: no column '%s' to take as the reference, only: %s", run->path,
                         wanted, names);
    }
    if (wanted && !changes(run, wanted)) {
        return error_set(out_error, error_refused,
                         "%s: %s does not change: expected the signal that excites the loop, see --reference",
                         run->path, wanted);
    }
    return !io_columns->reference || finite_column(run, io_columns->reference, out_error) ? 0 : error_refused;
}

/// A constant has no power on any line, and what rounding makes of it would pass for some.
static int check_motion(const struct run *run, const struct columns *columns, struct error *out_error)
{
    if (strcmp(columns->input, columns->output) == 0) {
        return error_set(out_error, error_refused,
                         "%s: input and output are both %s: expected two signals, see --input, --output", run->path,
                         columns->input);
    }
    if (are_equal(run, columns->input, columns->output)) {
        return error_set(out_error, error_refused,
                         "%s: %s and %s hold the same numbers in all %zu rows, their response is 1: expected two "
                         "signals, see --input, --output",
                         run->path, columns->input, columns->output, run->rows);
    }
    if (!changes(run, columns->input)) {
        return error_set(out_error, error_refused,
                         "%s: %s is %.9g in all %zu rows, it has no power on any line: expected a signal that excites "
                         "the drive, see --input",
                         run->path, columns->input, run_column(run, columns->input)[0] + 0.0, run->rows);
    }
    if (!changes(run, columns->output)) {
        return error_set(out_error, error_refused,
                         "%s: %s does not change, it is %.9g in all %zu rows: expected an axis that moves, see "
                         "--output",
                         run->path, columns->output, run_column(run, columns->output)[0] + 0.0, run->rows);
    }
    return 0;
}

int columns_choose(const struct run *run, const struct columns *wanted, struct columns *out_columns,
                   struct error *out_error)
{
    *out_columns = (struct columns){0};
    int status = choose_column(run, "input", wanted->input, usual_inputs, &out_columns->input, out_error);
    status =
        status ? status : choose_column(run, "output", wanted->output, usual_outputs, &out_columns->output, out_error);
    status = status ? status : choose_reference(run, wanted->reference, out_columns, out_error);
    if (status) {
        return status;
    }
    if (!finite_column(run, out_columns->input, out_error) || !finite_column(run, out_columns->output, out_error)) {
        return error_refused;
    }
    return check_motion(run, out_columns, out_error);
}

bool columns_closed_loop(const struct columns *self)
{
    return self->reference && (strncmp(self->reference, "velocity_ref_", strlen("velocity_ref_")) == 0 ||
                               strncmp(self->reference, "position_ref_", strlen("position_ref_")) == 0);
}

bool columns_is_position(const char *name)
{
    static const char *const ends[] = {"_rad", "_m"};
    size_t length = strlen(name);
    for (size_t i = 0; i < sizeof ends / sizeof *ends; i++) {
        size_t end = strlen(ends[i]);
        if (length >= end && strcmp(name + length - end, ends[i]) == 0) {
            return true;
        }
    }
    return false;
}

size_t columns_first_lost_row(const struct run *run, size_t first, size_t rows)
{
    const double *valid = run_column(run, "valid");
    for (size_t row = first; valid && row < first + rows; row++) {
        if (is_lost(valid, row)) {
            return row + 1;
        }
    }
    return 0;
}

/// Straight line over the rows `first` to `end` - 1 from the one before to the one behind, if they are there.
static void fill_gap(double *values, size_t first, size_t end, size_t rows)
{
    const double low = first > 0 ? values[first - 1] : end < rows ? values[end] : 0.0;
    const double high = end < rows ? values[end] : low;
    const double width = (double)(end - first) + 1.0;
    for (size_t n = first; n < end; n++) {
        values[n] = low + (high - low) * ((double)(n - first) + 1.0) / width;
    }
}

const double *columns_filled(const struct run *run, const char *name, double **out_owned)
{
    const double *valid = run_column(run, "valid");
    const double *values = run_column(run, name);
    *out_owned = NULL;
    if (columns_first_lost_row(run, 0, run->rows) == 0) {
        return values;
    }
    double *filled = malloc(run->rows * sizeof *filled);
    if (!filled) {
        return NULL;
    }
    memcpy(filled, values, run->rows * sizeof *filled);
    for (size_t row = 0; row < run->rows; row++) {
        const size_t first = row;
        while (row < run->rows && is_lost(valid, row)) {
            row++;
        }
        if (row > first) {
            fill_gap(filled, first, row, run->rows);
        }
    }
    *out_owned = filled;
    return filled;
}
