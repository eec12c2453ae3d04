/* SPDX-License-Identifier: MIT */
#include "lab/estimate/columns.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

static const char *const usual_inputs[] = {"torque_Nm", "force_N", "current_A", "voltage_V", NULL};
static const char *const usual_outputs[] = {"velocity_rad_per_s", "velocity_m_per_s", "position_rad", "position_m",
                                            NULL};
static const char *const usual_references[] = {"velocity_ref_rad_per_s",
                                               "velocity_ref_m_per_s",
                                               "position_ref_rad",
                                               "position_ref_m",
                                               "torque_ref_Nm",
                                               "force_ref_N",
                                               NULL};

static const char *own_name(const struct run *run, const char *name)
{
    for (size_t c = 0; c < run->column_count; c++) {
        if (strcmp(run->columns[c].name, name) == 0) {
            return run->columns[c].name;
        }
    }
    return NULL;
}

static bool changes(const struct run *run, const char *name)
{
    const double *values = run_column(run, name);
    for (size_t n = 1; n < run->rows; n++) {
        if (values[n] != values[0]) {
            return true;
        }
    }
    return false;
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
    if (wanted) {
        return error_set(out_error, error_refused, "%s: no column '%s' to take as the %s", run->path, wanted, what);
    }
    return error_set(out_error, error_refused, "%s: no %s column: expected %s, %s, %s or %s, or --%s COLUMN", run->path,
                     what, usual[0], usual[1], usual[2], usual[3], what);
}

/// x - x is 0 for every finite number; four sums, because one would wait for its own last addition.
static bool all_finite(const double *x, size_t count)
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
        return error_set(out_error, error_refused, "%s: no column '%s' to take as the reference", run->path, wanted);
    }
    if (wanted && !changes(run, wanted)) {
        return error_set(out_error, error_refused,
                         "%s: %s does not change: expected the signal that excites the loop, see --reference",
                         run->path, wanted);
    }
    return !io_columns->reference || finite_column(run, io_columns->reference, out_error) ? 0 : error_refused;
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
    if (!changes(run, out_columns->output)) {
        return error_set(out_error, error_refused, "%s: %s does not change: expected an axis that moves, see --output",
                         run->path, out_columns->output);
    }
    return 0;
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
        if (!(valid[row] > 0.5)) {
            return row + 1;
        }
    }
    return 0;
}
