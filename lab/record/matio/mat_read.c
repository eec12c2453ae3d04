/* SPDX-License-Identifier: MIT */
#include "lab/record/mat_file.h"
#include "lab/record/matio/mat_layout.h"
#include "lab/record/matio/mat_library.h"
#include "lab/record/matio/mat_names.h"
#include "lab/record/matio/mat_sources.h"
#include "lab/record/record_table.h"
#include "lab/record/run_names.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct input {
    const struct mat_library *library;
    mat_t *file;
    const char *path;
    struct format_notes *notes;
    struct error *out_error;
};

static int short_of_memory(const struct input *self)
{
    return error_set(self->out_error, error_refused, "%s: memory is short", self->path);
}

static int refuse(const struct input *self, const char *variable, const char *expectation)
{
    const char *said = mat_library_said();
    return error_set(self->out_error, error_refused, "%s: %s: %s%s%s%s", self->path, variable, expectation,
                     said[0] ? " (" : "", said, said[0] ? ")" : "");
}

/* A numeric variable's values as a new column of the table. */
static int take_numbers(const struct input *self, const matvar_t *variable, const char *name, struct text_table *table)
{
    if (!variable || !mat_is_numeric(variable))
        return refuse(self, name, "real numbers were expected");
    size_t count = mat_value_count(variable);
    double *data = malloc((count ? count : 1) * sizeof *data);
    if (!data)
        return short_of_memory(self);
    for (size_t n = 0; n < count; n++)
        data[n] = mat_value(variable, n);
    return record_table_add_column(table, name, data, count, self->out_error);
}

/* A row of whole numbers as the text that a run file has. */
static int take_list(const struct input *self, const char *key, const matvar_t *value, struct text_table *table)
{
    size_t count = mat_value_count(value);
    char *text = malloc(count * 24 + 3), *at = text;
    if (!text)
        return short_of_memory(self);
    *at++ = '[';
    for (size_t k = 0; k < count; k++)
        at += snprintf(at, 24, "%s%.15g", k ? ", " : "", mat_value(value, k));
    strcpy(at, "]");
    int status = record_table_add_key(table, key, text, self->out_error);
    free(text);
    return status;
}

/* A field of the structure as a key: text, a number, or a list where the key has one. */
static int take_key(const struct input *self, matvar_t *structure, enum record_kind holds, const char *key,
                    struct text_table *table)
{
    matvar_t *value = self->library->var_field(structure, key, 0);
    if (!value)
        return error_none;
    if (mat_is_numeric(value) && mat_key_kind(holds, key) == mat_key_list)
        return take_list(self, key, value, table);
    if (mat_is_numeric(value) && mat_value_count(value) == 1)
        return record_table_add_number(table, key, mat_value(value, 0), self->out_error);
    char *text = mat_text(value);
    if (!text)
        return refuse(self, key, "one number or text was expected");
    int status = record_table_add_key(table, key, text, self->out_error);
    free(text);
    return status;
}

/* The texts of a cell array of two columns; `take` gets each pair. */
typedef int (*pair_taker)(const struct input *self, const char *first, const char *second, struct text_table *table);

static int take_pairs(const struct input *self, matvar_t *structure, const char *field, pair_taker take,
                      struct text_table *table)
{
    matvar_t *cells = self->library->var_field(structure, field, 0);
    if (!cells)
        return error_none;
    if (cells->class_type != MAT_C_CELL || cells->rank != 2 || cells->dims[1] != 2 || !cells->data ||
        cells->nbytes < mat_value_count(cells) * sizeof(matvar_t *))
        return refuse(self, field, "a cell array of two columns was expected");
    matvar_t **items = cells->data;
    size_t count = cells->dims[0];
    int status = error_none;
    for (size_t k = 0; k < count && !status; k++) {
        char *first = items[k] ? mat_text(items[k]) : NULL;
        char *second = items[count + k] ? mat_text(items[count + k]) : NULL;
        status = first && second ? take(self, first, second, table) : refuse(self, field, "texts were expected");
        free(first);
        free(second);
    }
    return status;
}

static int take_other_key(const struct input *self, const char *key, const char *value, struct text_table *table)
{
    return record_table_add_key(table, key, value, self->out_error);
}

static int take_keys(const struct input *self, matvar_t *structure, enum record_kind holds, struct text_table *table)
{
    int status = error_none;
    for (size_t i = 0; mat_key_name(holds, i) && !status; i++)
        status = take_key(self, structure, holds, mat_key_name(holds, i), table);
    return status ? status : take_pairs(self, structure, "keys", take_other_key, table);
}

static int take_column(const struct input *self, const char *variable_name, const char *column,
                       struct text_table *table)
{
    matvar_t *variable = self->library->var_read(self->file, variable_name);
    if (!variable)
        return refuse(self, variable_name, "this variable, which servoscope.columns names, was expected");
    int status = take_numbers(self, variable, column, table);
    self->library->var_free(variable);
    return status;
}

static int read_own_run(const struct input *self, matvar_t *structure, const struct format_options *options,
                        struct run *out_run)
{
    struct text_table table;
    int status = record_table_start(&table, self->path, self->out_error);
    if (!status)
        status = take_keys(self, structure, record_run, &table);
    if (!status)
        status = take_pairs(self, structure, "columns", take_column, &table);
    if (!status && table.column_count == 0)
        status = refuse(self, "servoscope.columns", "at least one column was expected");
    if (status) {
        text_table_free(&table);
        return status;
    }
    return run_take_table(&table, &options->run, out_run, self->out_error);
}

static int take_part(const struct input *self, const matvar_t *variable, const void *part, const char *name,
                     struct text_table *table)
{
    matvar_t real = *variable;
    real.isComplex = 0;
    real.data = (void *)part;
    return take_numbers(self, &real, name, table);
}

/* Complex in MATLAB, two columns in a table. */
static int take_response(const struct input *self, matvar_t *frf, struct text_table *table)
{
    const matvar_t *response = self->library->var_field(frf, "response", 0);
    if (!response || !response->isComplex || !response->data)
        return refuse(self, "frf.response", "complex numbers were expected");
    const struct mat_complex_split_t *parts = response->data;
    int status = take_part(self, response, parts->Re, "real", table);
    return status ? status : take_part(self, response, parts->Im, "imag", table);
}

static int take_frf_fields(const struct input *self, matvar_t *frf, struct text_table *table)
{
    static const char *const names[] = {"frequency_hz",    "std",   "noise_std", "odd_distortion",
                                        "even_distortion", "valid", "coherence"};
    int status = error_none;
    for (size_t i = 0; i < sizeof names / sizeof names[0] && !status; i++) {
        const matvar_t *field = self->library->var_field(frf, names[i], 0);
        if (field || i == 0)
            status = take_numbers(self, field, names[i], table);
    }
    return status ? status : take_response(self, frf, table);
}

static int read_own_frf(const struct input *self, matvar_t *structure, struct frf *out_frf)
{
    struct text_table table;
    int status = record_table_start(&table, self->path, self->out_error);
    matvar_t *frf = self->library->var_read(self->file, "frf");
    if (!status)
        status = take_keys(self, structure, record_frf, &table);
    if (!status)
        status = frf && frf->class_type == MAT_C_STRUCT && mat_value_count(frf) == 1
                     ? take_frf_fields(self, frf, &table)
                     : refuse(self, "frf", "a structure was expected");
    if (frf)
        self->library->var_free(frf);
    if (status) {
        text_table_free(&table);
        return status;
    }
    return frf_take_table(&table, out_frf, self->out_error);
}

static int check_length(const struct input *self, const struct mat_source *source, size_t *io_count)
{
    if (*io_count == 0 || source->count == *io_count) {
        *io_count = source->count;
        return error_none;
    }
    return error_set(self->out_error, error_refused,
                     "%s: %s has %zu values, the signals before it %zu: as many were expected", self->path,
                     source->name, source->count, *io_count);
}

static int no_signal(const struct input *self, const struct mat_sources *sources, const char *wrong, const char *name)
{
    if (sources->count == 0)
        return error_set(self->out_error, error_refused,
                         "%s: holds no variable that can be read: it is empty, cut off or damaged", self->path);
    char list[700];
    mat_sources_list(sources, sizeof list, list);
    return error_set(self->out_error, error_refused, "%s: %s%s; it holds: %s", self->path, wrong, name, list);
}

/* The length of the signals that --map names or, without it, of those with a name that a run knows. */
static int find_length(const struct input *self, const struct mat_sources *sources, const struct run_map *map,
                       size_t *out_count)
{
    int status = error_none;
    *out_count = 0;
    for (size_t i = 0; i < map->count && !status; i++) {
        const struct mat_source *source = mat_sources_find(sources, map->entries[i].source);
        status = source ? check_length(self, source, out_count)
                        : no_signal(self, sources, "--map: no variable of two values or more is called ",
                                    map->entries[i].source);
    }
    for (size_t i = 0; map->count == 0 && i < sources->count && !status; i++) {
        const struct mat_source *source = &sources->items[i];
        bool known = run_name_axis(source->name) != run_axis_unknown || strcmp(source->name, "t_s") == 0;
        if (source->data && known)
            status = check_length(self, source, out_count);
    }
    if (!status && *out_count == 0)
        status = no_signal(self, sources,
                           "no variable has a name that a run knows: --map torque_Nm=VARIABLE,... was expected", "");
    return status;
}

/* All signals of that length become columns; what else there is, is said. */
static int take_sources(const struct input *self, struct mat_sources *sources, size_t count, struct text_table *table)
{
    int status = error_none;
    for (size_t i = 0; i < sources->count && !status; i++) {
        struct mat_source *source = &sources->items[i];
        if (!source->data || source->count != count) {
            format_notes_add(self->notes, format_lost, "variable %s (%s)", source->name, source->shape);
            continue;
        }
        double *data = source->data;
        source->data = NULL;
        status = record_table_add_column(table, source->name, data, count, self->out_error);
        format_notes_add(self->notes, format_assumed, "variable %s (%s) is a signal", source->name, source->shape);
    }
    return status;
}

static int read_foreign(const struct input *self, const struct format_options *options, struct run *out_run)
{
    struct mat_sources sources = {0};
    struct text_table table = {0};
    struct run_map map = {0};
    size_t count = 0;
    bool good = true;
    for (matvar_t *variable; good && (variable = self->library->var_read_next(self->file)) != NULL;) {
        good = mat_sources_add(&sources, self->library, variable);
        self->library->var_free(variable);
    }
    int status = good ? run_map_parse(&map, options->run.map, self->out_error) : short_of_memory(self);
    if (!status)
        status = find_length(self, &sources, &map, &count);
    if (!status)
        status = record_table_start(&table, self->path, self->out_error);
    if (!status)
        status = take_sources(self, &sources, count, &table);
    mat_sources_free(&sources);
    run_map_free(&map);
    if (status) {
        text_table_free(&table);
        return status;
    }
    return run_take_table(&table, &options->run, out_run, self->out_error);
}

static int read_record(const struct input *self, const struct format_options *options, struct record *out_record)
{
    matvar_t *structure = self->library->var_read(self->file, mat_structure_name);
    bool own = structure && structure->class_type == MAT_C_STRUCT && mat_value_count(structure) == 1;
    matvar_t *kind = own ? self->library->var_field(structure, "kind", 0) : NULL;
    char *text = kind ? mat_text(kind) : NULL;
    int status;
    (void)mat_library_said(); // that another's file has no such structure is no news
    if (text && strcmp(text, "frf") == 0) {
        out_record->kind = record_frf;
        status = read_own_frf(self, structure, &out_record->frf);
    } else if (text && strcmp(text, "run") == 0) {
        status = read_own_run(self, structure, options, &out_record->run);
    } else {
        status = read_foreign(self, options, &out_record->run);
    }
    free(text);
    if (structure)
        self->library->var_free(structure);
    return status;
}

int mat_read_record(const char *path, const struct format_options *options, struct record *out_record,
                    struct format_notes *io_notes, struct error *out_error)
{
    *out_record = (struct record){.kind = record_run};
    struct input input = {.path = path, .notes = io_notes, .out_error = out_error};
    int status = mat_check_layout(path, out_error);
    if (status)
        return status;
    input.library = mat_library_load(path, out_error);
    if (!input.library)
        return error_refused;
    input.file = input.library->open(path, MAT_ACC_RDONLY);
    if (!input.file)
        return refuse(&input, "cannot be read", "a MATLAB file was expected");
    status = read_record(&input, options, out_record);
    (void)input.library->close(input.file);
    return status;
}
