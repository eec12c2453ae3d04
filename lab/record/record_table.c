/* SPDX-License-Identifier: MIT */
#define _XOPEN_SOURCE 700 /* open_memstream */
#include "lab/record/record_table.h"

#include "lab/record/number.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static int short_of_memory(const char *path, struct error *out_error)
{
    return error_set(out_error, error_refused, "%s: memory is short", path);
}

int record_table_start(struct text_table *out_table, const char *path, struct error *out_error)
{
    *out_table = (struct text_table){.path = strdup(path)};
    return out_table->path ? error_none : short_of_memory(path, out_error);
}

static bool number_rows(struct text_table *self, size_t rows)
{
    self->row_line = rows <= SIZE_MAX / sizeof *self->row_line ? malloc(rows * sizeof *self->row_line) : NULL;
    for (size_t n = 0; self->row_line && n < rows; n++)
        self->row_line[n] = n + 1;
    self->rows = rows;
    self->names_line = 1;
    return self->row_line != NULL;
}

int record_table_add_column(struct text_table *self, const char *name, double *data, size_t rows,
                            struct error *out_error)
{
    if (rows == 0 || (self->column_count > 0 && rows != self->rows)) {
        free(data);
        return error_set(out_error, error_refused, "%s: %s has %zu values, %s was expected", self->path, name, rows,
                         rows == 0 ? "at least one" : "as many as the others have");
    }
    for (size_t n = 0; n < rows; n++)
        data[n] = isfinite(data[n]) ? data[n] : NAN;
    struct run_column *columns = realloc(self->columns, (self->column_count + 1) * sizeof *columns);
    if (columns)
        self->columns = columns;
    char *copy = strdup(name);
    if (!columns || !copy || (!self->row_line && !number_rows(self, rows))) {
        free(copy);
        free(data);
        return short_of_memory(self->path, out_error);
    }
    columns[self->column_count++] = (struct run_column){copy, data};
    return error_none;
}

int record_table_add_key(struct text_table *self, const char *key, const char *value, struct error *out_error)
{
    struct run_key *keys = realloc(self->keys, (self->key_count + 1) * sizeof *keys);
    if (keys)
        self->keys = keys;
    size_t *lines = realloc(self->key_line, (self->key_count + 1) * sizeof *lines);
    if (lines)
        self->key_line = lines;
    struct run_key copy = {strdup(key), strdup(value)};
    if (!keys || !lines || !copy.key || !copy.value) {
        free(copy.key);
        free(copy.value);
        return short_of_memory(self->path, out_error);
    }
    // Text files have one line for each.
    for (char *c = copy.key; *c; c++)
        *c = *c == '\n' || *c == '\r' ? ' ' : *c;
    for (char *c = copy.value; *c; c++)
        *c = *c == '\n' || *c == '\r' ? ' ' : *c;
    lines[self->key_count] = self->key_count + 1;
    keys[self->key_count++] = copy;
    return error_none;
}

int record_table_add_number(struct text_table *self, const char *key, double value, struct error *out_error)
{
    char text[number_text_size];
    if (!isfinite(value))
        return error_set(out_error, error_refused, "%s: %s: is not a finite number", self->path, key);
    number_format(value, text);
    return record_table_add_key(self, key, text, out_error);
}

/* Splits "# key: value" lines in place, as text_table does. */
static bool split_lines(char *text, struct record_keys *out_keys)
{
    for (char *line = text; *line;) {
        char *end = line + strcspn(line, "\n"), *next = *end ? end + 1 : end;
        *end = '\0';
        char *colon = strchr(line, ':'), *value = colon ? colon + 1 : line + 1;
        char *key = colon ? line + 1 : line;
        key += strspn(key, " ");
        value += strspn(value, " ");
        if (colon)
            *colon = '\0';
        struct run_key *items = realloc(out_keys->items, (out_keys->count + 1) * sizeof *items);
        if (items)
            out_keys->items = items;
        struct run_key copy = {strdup(colon ? key : ""), strdup(value)};
        if (!items || !copy.key || !copy.value) {
            free(copy.key);
            free(copy.value);
            return false;
        }
        items[out_keys->count++] = copy;
        line = next;
    }
    return true;
}

int record_keys_list(const struct record *record, struct record_keys *out_keys, struct error *out_error)
{
    *out_keys = (struct record_keys){0};
    char *text = NULL;
    size_t size = 0;
    FILE *stream = open_memstream(&text, &size);
    if (stream && record->kind == record_run)
        run_write_keys(stream, &record->run);
    else if (stream)
        frf_write_keys(stream, &record->frf);
    bool good = stream && fclose(stream) == 0 && split_lines(text, out_keys);
    free(text);
    if (good)
        return error_none;
    record_keys_free(out_keys);
    return error_set(out_error, error_refused, "memory is short");
}

void record_keys_free(struct record_keys *self)
{
    for (size_t k = 0; k < self->count; k++) {
        free(self->items[k].key);
        free(self->items[k].value);
    }
    free(self->items);
    *self = (struct record_keys){0};
}

static const double *if_known(const double *values, size_t count)
{
    for (size_t k = 0; values && k < count; k++)
        if (frf_known(values[k]))
            return values;
    return NULL;
}

void record_frf_list(const struct frf *frf, const char *out_names[record_frf_columns],
                     const double *out_columns[record_frf_columns])
{
    static const char *const names[record_frf_columns] = {
        "frequency_hz", "real", "imag", "std", "noise_std", "odd_distortion", "even_distortion", "valid", "coherence"};
    const double *const columns[record_frf_columns] = {frf->frequency_hz,
                                                       frf->real,
                                                       frf->imag,
                                                       if_known(frf->std, frf->count),
                                                       if_known(frf->noise_std, frf->count),
                                                       if_known(frf->odd_distortion, frf->count),
                                                       if_known(frf->even_distortion, frf->count),
                                                       NULL,
                                                       if_known(frf->coherence, frf->count)};
    for (size_t i = 0; i < record_frf_columns; i++) {
        out_names[i] = names[i];
        out_columns[i] = columns[i];
    }
}
