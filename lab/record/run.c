/* SPDX-License-Identifier: MIT */
#include "lab/record/run.h"

#include "lab/record/atomic_file.h"
#include "lab/record/record_table.h"
#include "lab/record/run_checks.h"
#include "lab/record/run_names.h"
#include "lab/record/run_stream.h"
#include "lab/record/text_table.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double rate_min_hz = 1e-3, rate_max_hz = 1e9;

int run_take_table(struct text_table *io_table, const struct run_options *options, struct run *out_run,
                   struct error *out_error)
{
    struct run_map map = {0};
    struct run_map_plan plan = {0};
    struct run_checks checks;
    *out_run = (struct run){0};
    int status = run_check_options(options, out_error);
    if (!status)
        status = run_map_parse(&map, options->map, out_error);
    if (!status)
        status = run_map_rename(&map, io_table, &plan, out_error);
    if (!status)
        status = run_map_fill(&plan, io_table, 0, out_error);
    if (!status)
        status = run_check_names(io_table, out_run, out_error);
    if (!status)
        status = run_read_keys(io_table, out_run, out_error);
    run_view_table(io_table, out_run);
    if (!status) {
        run_checks_begin(&checks, out_run, options);
        status = run_checks_rows(&checks, io_table, out_run, 0, out_error);
    }
    if (!status)
        status = run_checks_end(&checks, io_table, out_run, options, out_error);
    run_map_plan_free(&plan);
    run_map_free(&map);
    run_move_table(io_table, out_run);
    text_table_free(io_table);
    if (status)
        run_free(out_run);
    return status;
}

int run_read(const char *path, const struct run_options *options, struct run *out_run, struct error *out_error)
{
    *out_run = (struct run){0};
    struct run_stream *stream;
    int status = run_stream_open(path, options, &stream, out_error);
    if (!status)
        status = run_stream_fill(stream, SIZE_MAX, out_error);
    if (!status)
        status = run_stream_take(stream, out_run, out_error);
    run_stream_close(stream);
    return status;
}

void run_view_table(const struct text_table *table, struct run *io_run)
{
    io_run->rows = table->rows;
    io_run->column_count = table->column_count;
    io_run->columns = table->columns;
    io_run->key_count = table->key_count;
    io_run->keys = table->keys;
    io_run->path = table->path;
}

void run_move_table(struct text_table *io_table, struct run *io_run)
{
    run_view_table(io_table, io_run);
    io_table->path = NULL;
    io_table->columns = NULL;
    io_table->keys = NULL;
    io_table->column_count = io_table->key_count = 0;
}

void run_write_keys(FILE *stream, const struct run *run)
{
    fputs("# sample_rate_hz: ", stream);
    text_write_number(stream, run->sample_rate_hz);
    fputc('\n', stream);
    if (run->period_samples > 0)
        fprintf(stream, "# period_samples: %zu\n", run->period_samples);
    if (run->periods > 0)
        fprintf(stream, "# periods: %zu\n", run->periods);
    if (run->has_settle_periods)
        fprintf(stream, "# settle_periods: %zu\n", run->settle_periods);
    if (run->bin_count > 0) {
        for (size_t k = 0; k < run->bin_count; k++)
            fprintf(stream, "%s%" PRIu32, k ? ", " : "# excited_bins: [", run->bins[k]);
        fputs("]\n", stream);
    }
    if (run->has_table_crc32)
        fprintf(stream, "# table_crc32: 0x%08" PRIx32 "\n", run->table_crc32);
    for (size_t k = 0; k < run->key_count; k++)
        if (!run_is_field_key(run->keys[k].key))
            text_write_key(stream, &run->keys[k]);
}

static int check_finite(const char *path, const struct run *run, struct error *out_error)
{
    if (!(run->sample_rate_hz >= rate_min_hz && run->sample_rate_hz <= rate_max_hz))
        return error_set(out_error, error_refused, "%s: not written: sample_rate_hz is %g", path, run->sample_rate_hz);
    for (size_t c = 0; c < run->column_count; c++) {
        bool known = run_name_axis(run->columns[c].name) != run_axis_unknown;
        for (size_t n = 0; n < run->rows; n++) {
            double value = run->columns[c].data[n];
            if (isinf(value) || (known && isnan(value)))
                return error_set(out_error, error_refused, "%s: not written: %s of sample %zu is not finite", path,
                                 run->columns[c].name, n);
        }
    }
    return error_none;
}

int run_write(const char *path, const struct run *run, struct error *out_error)
{
    if (run->column_count == 0 || run->rows == 0)
        return error_set(out_error, error_refused, "%s: not written: the run has no samples", path);
    int status = check_finite(path, run, out_error);
    if (status)
        return status;
    struct atomic_file file;
    FILE *stream = atomic_file_open(&file, path, out_error);
    if (!stream)
        return error_refused;
    run_write_keys(stream, run);
    text_write_columns(stream, run->columns, run->column_count, run->rows);
    return atomic_file_commit(&file, out_error);
}

const double *run_column(const struct run *run, const char *name)
{
    for (size_t c = 0; c < run->column_count; c++)
        if (strcmp(run->columns[c].name, name) == 0)
            return run->columns[c].data;
    return NULL;
}

double *run_add_column(struct run *run, const char *name)
{
    struct run_column *columns = realloc(run->columns, (run->column_count + 1) * sizeof *columns);
    if (!columns)
        return NULL;
    run->columns = columns;
    struct run_column column = {.name = strdup(name), .data = calloc(run->rows ? run->rows : 1, sizeof(double))};
    if (!column.name || !column.data) {
        free(column.name);
        free(column.data);
        return NULL;
    }
    columns[run->column_count++] = column;
    return column.data;
}

bool run_set_key(struct run *run, const char *key, const char *value)
{
    char *value_copy = strdup(value);
    if (!value_copy)
        return false;
    for (size_t k = 0; k < run->key_count; k++) {
        if (strcmp(run->keys[k].key, key) == 0) {
            free(run->keys[k].value);
            run->keys[k].value = value_copy;
            return true;
        }
    }
    char *key_copy = strdup(key);
    struct run_key *keys = realloc(run->keys, (run->key_count + 1) * sizeof *keys);
    if (keys)
        run->keys = keys;
    if (!keys || !key_copy) {
        free(value_copy);
        free(key_copy);
        return false;
    }
    keys[run->key_count++] = (struct run_key){key_copy, value_copy};
    return true;
}

const char *run_key(const struct run *run, const char *key)
{
    for (size_t k = 0; k < run->key_count; k++)
        if (strcmp(run->keys[k].key, key) == 0)
            return run->keys[k].value;
    return NULL;
}

void run_free(struct run *run)
{
    for (size_t c = 0; c < run->column_count; c++) {
        free(run->columns[c].name);
        free(run->columns[c].data);
    }
    for (size_t k = 0; k < run->key_count; k++) {
        free(run->keys[k].key);
        free(run->keys[k].value);
    }
    free(run->columns);
    free(run->keys);
    free(run->bins);
    free(run->path);
    *run = (struct run){0};
}
