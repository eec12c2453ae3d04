/* SPDX-License-Identifier: MIT */
#include "lab/record/atomic_file.h"
#include "lab/record/mat_file.h"
#include "lab/record/matio/mat_library.h"
#include "lab/record/matio/mat_names.h"
#include "lab/record/number.h"
#include "lab/record/record_table.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* 2^31 bytes of a variable of version 5, and some for its head. */
static const size_t version_5_rows_max = (((size_t)1 << 31) - 4096) / sizeof(double);

/* The variables of a file while they are made, written and compared. */
struct output {
    const struct mat_library *library;
    matvar_t **variables;
    size_t count, capacity;
    bool failed; /* memory is short */
    double *owned;
};

static matvar_t *numbers(struct output *self, const char *name, const double *data, size_t rows)
{
    size_t dims[2] = {rows, 1};
    return self->library->var_create(name, MAT_C_DOUBLE, MAT_T_DOUBLE, 2, dims, (void *)data, MAT_F_DONT_COPY_DATA);
}

static matvar_t *number(struct output *self, const double *value)
{
    size_t dims[2] = {1, 1};
    return self->library->var_create(NULL, MAT_C_DOUBLE, MAT_T_DOUBLE, 2, dims, (void *)value, 0);
}

/* The next character of UTF-8; a byte that begins none stands for itself. */
static uint32_t take_utf8(const unsigned char **io_at)
{
    const unsigned char *at = *io_at;
    int more = at[0] >= 0xf0 ? 3 : at[0] >= 0xe0 ? 2 : at[0] >= 0xc2 ? 1 : 0;
    uint32_t c = more ? at[0] & (0x3fu >> more) : at[0];
    for (int i = 1; i <= more; i++) {
        if ((at[i] & 0xc0) != 0x80) {
            *io_at = at + 1;
            return at[0];
        }
        c = c << 6 | (at[i] & 0x3fu);
    }
    *io_at = at + more + 1;
    return c;
}

static matvar_t *text(struct output *self, const char *utf8)
{
    uint16_t *wide = malloc((strlen(utf8) + 1) * sizeof *wide);
    size_t count = 0;
    const unsigned char *at = (const unsigned char *)utf8;
    while (wide && *at) {
        uint32_t c = take_utf8(&at);
        if (c >= 0x10000)
            wide[count++] = (uint16_t)(0xd800 + ((c - 0x10000) >> 10));
        wide[count++] = (uint16_t)(c >= 0x10000 ? 0xdc00 + ((c - 0x10000) & 0x3ff) : c);
    }
    size_t dims[2] = {count ? 1 : 0, count};
    matvar_t *made = wide ? self->library->var_create(NULL, MAT_C_CHAR, MAT_T_UINT16, 2, dims, wide, 0) : NULL;
    free(wide);
    return made;
}

/* A structure's field belongs to it from here on. */
static void set_field(struct output *self, matvar_t *structure, const char *name, matvar_t *value)
{
    if (!value || !structure || self->library->var_add_field(structure, name) != 0) {
        self->failed = true;
        if (value)
            self->library->var_free(value);
        return;
    }
    (void)self->library->var_set_field(structure, name, 0, value);
}

static matvar_t *add(struct output *self, matvar_t *variable)
{
    if (variable && self->count < self->capacity)
        self->variables[self->count++] = variable;
    else
        self->failed = true;
    return variable;
}

static matvar_t *add_structure(struct output *self, const char *name)
{
    size_t dims[2] = {1, 1};
    return add(self, self->library->var_create_struct(name, 2, dims, NULL, 0));
}

/* Pairs of texts as a cell array of two columns. */
static matvar_t *pairs(struct output *self, const struct run_key *items, size_t count)
{
    matvar_t **cells = calloc(2 * count, sizeof *cells);
    for (size_t k = 0; cells && k < count; k++) {
        cells[k] = text(self, items[k].key);
        cells[count + k] = text(self, items[k].value);
        self->failed = self->failed || !cells[k] || !cells[count + k];
    }
    size_t dims[2] = {count, 2};
    matvar_t *made = cells ? self->library->var_create(NULL, MAT_C_CELL, MAT_T_CELL, 2, dims, cells, 0) : NULL;
    for (size_t k = 0; !made && cells && k < 2 * count; k++)
        if (cells[k])
            self->library->var_free(cells[k]);
    free(cells);
    return made;
}

static matvar_t *bins(struct output *self, const struct run *run)
{
    double *values = malloc(run->bin_count * sizeof *values);
    for (size_t k = 0; values && k < run->bin_count; k++)
        values[k] = run->bins[k];
    size_t dims[2] = {1, run->bin_count};
    matvar_t *made = values ? self->library->var_create(NULL, MAT_C_DOUBLE, MAT_T_DOUBLE, 2, dims, values, 0) : NULL;
    free(values);
    return made;
}

/* Whether a number would be printed as just this text, so that it reads back the same. */
static bool is_canonical(const char *value, double *out_number)
{
    char printed[number_text_size];
    if (number_parse(value, strlen(value), out_number) != number_ok)
        return false;
    number_format(*out_number, printed);
    return strcmp(printed, value) == 0;
}

/* Keys with a field of their own, and the others as pairs. */
static int set_keys(struct output *self, matvar_t *structure, const struct record *record, struct error *out_error)
{
    struct record_keys keys;
    int status = record_keys_list(record, &keys, out_error);
    size_t others = 0;
    for (size_t k = 0; k < keys.count && !status; k++) {
        const char *value = keys.items[k].value;
        double number_value;
        enum mat_key kind = mat_key_kind(record->kind, keys.items[k].key);
        if (kind == mat_key_number && is_canonical(value, &number_value))
            set_field(self, structure, keys.items[k].key, number(self, &number_value));
        else if (kind == mat_key_list)
            set_field(self, structure, keys.items[k].key, bins(self, &record->run));
        else if (kind == mat_key_text || kind == mat_key_number)
            set_field(self, structure, keys.items[k].key, text(self, value));
        else { // moved to the front, in order
            struct run_key other = keys.items[k];
            keys.items[k] = keys.items[others];
            keys.items[others++] = other;
        }
    }
    if (!status && others > 0)
        set_field(self, structure, "keys", pairs(self, keys.items, others));
    record_keys_free(&keys);
    return status;
}

/* Whether the variable of a column is that of an earlier one, or another column's own name. */
static bool is_taken(const struct run *run, size_t column, const char (*variables)[mat_name_size])
{
    for (size_t other = 0; other < run->column_count; other++)
        if ((other < column && strcmp(variables[other], variables[column]) == 0) ||
            (other > column && strcmp(run->columns[other].name, variables[column]) == 0 &&
             strcmp(run->columns[column].name, variables[column]) != 0))
            return true;
    return false;
}

static void add_run(struct output *self, const struct run *run, matvar_t *structure, struct format_notes *notes)
{
    struct run_key *names = calloc(run->column_count, sizeof *names);
    char(*variables)[mat_name_size] = calloc(run->column_count, sizeof *variables);
    for (size_t c = 0; names && variables && c < run->column_count; c++) {
        const char *column = run->columns[c].name;
        mat_name_variable(column, c, variables[c]);
        for (size_t number = c + 1; is_taken(run, c, (const char(*)[mat_name_size])variables); number++)
            snprintf(variables[c], mat_name_size, "column_%zu", number);
        if (strcmp(variables[c], column) != 0)
            format_notes_add(notes, format_kept, "column '%s' as variable %s, which MATLAB takes for a name", column,
                             variables[c]);
        names[c] = (struct run_key){variables[c], run->columns[c].name};
        add(self, numbers(self, variables[c], run->columns[c].data, run->rows));
    }
    if (names && variables)
        set_field(self, structure, "columns", pairs(self, names, run->column_count));
    else
        self->failed = true;
    free(names);
    free(variables);
}

/* Magnitudes that were not estimated are NaN in MATLAB. */
static const double *with_nan(const double *from, double *to, size_t count)
{
    for (size_t k = 0; k < count; k++)
        to[k] = frf_known(from[k]) ? from[k] : NAN;
    return to;
}

static matvar_t *valid_flags(struct output *self, const struct frf *frf)
{
    unsigned char *flags = malloc(frf->count);
    for (size_t k = 0; flags && k < frf->count; k++)
        flags[k] = frf->valid[k];
    size_t dims[2] = {frf->count, 1};
    matvar_t *made =
        flags ? self->library->var_create(NULL, MAT_C_UINT8, MAT_T_UINT8, 2, dims, flags, MAT_F_LOGICAL) : NULL;
    free(flags);
    return made;
}

static void add_frf(struct output *self, const struct frf *frf)
{
    const char *names[record_frf_columns];
    const double *columns[record_frf_columns];
    size_t dims[2] = {frf->count, 1};
    struct mat_complex_split_t response = {frf->real, frf->imag};
    matvar_t *structure = add_structure(self, "frf");
    self->owned = malloc(record_frf_columns * frf->count * sizeof *self->owned);
    if (!structure || !self->owned) {
        self->failed = true;
        return;
    }
    record_frf_list(frf, names, columns);
    set_field(self, structure, names[0], numbers(self, NULL, frf->frequency_hz, frf->count));
    set_field(self, structure, "response",
              self->library->var_create(NULL, MAT_C_DOUBLE, MAT_T_DOUBLE, 2, dims, &response, MAT_F_COMPLEX));
    for (size_t i = 3; i < record_frf_columns; i++)
        if (columns[i])
            set_field(self, structure, names[i],
                      numbers(self, NULL, with_nan(columns[i], self->owned + i * frf->count, frf->count), frf->count));
    set_field(self, structure, "valid", valid_flags(self, frf));
}

static bool same_data(const struct mat_library *library, matvar_t *a, matvar_t *b);

static bool same_fields(const struct mat_library *library, matvar_t *a, matvar_t *b)
{
    unsigned count = library->var_field_count(a);
    char *const *names = library->var_field_names(a);
    bool same = count == library->var_field_count(b);
    for (unsigned i = 0; same && i < count; i++)
        same = same_data(library, library->var_field(a, names[i], 0), library->var_field(b, names[i], 0));
    return same;
}

static bool same_cells(const struct mat_library *library, const matvar_t *a, const matvar_t *b, size_t count)
{
    bool same = true;
    for (size_t i = 0; same && i < count; i++)
        same = same_data(library, ((matvar_t **)a->data)[i], ((matvar_t **)b->data)[i]);
    return same;
}

static bool same_text(const matvar_t *a, const matvar_t *b)
{
    char *first = mat_text(a), *second = mat_text(b);
    bool same = first && second && strcmp(first, second) == 0;
    free(first);
    free(second);
    return same;
}

static bool same_numbers(const matvar_t *a, const matvar_t *b, size_t count)
{
    size_t size = count * (size_t)a->data_size;
    if (a->data_size != b->data_size)
        return false;
    if (!a->isComplex)
        return memcmp(a->data, b->data, size) == 0;
    const struct mat_complex_split_t *first = a->data, *second = b->data;
    return memcmp(first->Re, second->Re, size) == 0 && memcmp(first->Im, second->Im, size) == 0;
}

/* Whether what was read back is what was to be written, bit for bit. */
static bool same_data(const struct mat_library *library, matvar_t *a, matvar_t *b)
{
    if (!a || !b || a->class_type != b->class_type || a->isComplex != b->isComplex)
        return false;
    size_t count = mat_value_count(a);
    if (count != mat_value_count(b))
        return false;
    if (count == 0)
        return true;
    if (a->class_type == MAT_C_STRUCT)
        return same_fields(library, a, b);
    if (!a->data || !b->data)
        return false;
    if (a->class_type == MAT_C_CELL)
        return same_cells(library, a, b, count);
    return a->class_type == MAT_C_CHAR ? same_text(a, b) : same_numbers(a, b, count);
}

/* The name of the first variable that cannot be read back; NULL if the file is as it should be. matio does not say when
 * a disk is full. */
static const char *compare_file(const struct output *self, const char *path)
{
    const struct mat_library *library = self->library;
    mat_t *file = library->open(path, MAT_ACC_RDONLY);
    const char *wrong = file ? NULL : "header";
    for (size_t i = 0; i < self->count && !wrong; i++) {
        matvar_t *variable = library->var_read(file, self->variables[i]->name);
        if (!same_data(library, self->variables[i], variable))
            wrong = self->variables[i]->name;
        if (variable)
            library->var_free(variable);
    }
    if (file)
        (void)library->close(file);
    return wrong;
}

static int write_variables(const struct output *self, const char *temporary, enum mat_version version, const char *path,
                           struct error *out_error)
{
    const struct mat_library *library = self->library;
    mat_t *file =
        version == mat_version_73
            ? library->create(temporary, "MATLAB 7.3 MAT-file, written by servoscope through matio", MAT_FT_MAT73)
            : library->create(temporary, "MATLAB 5.0 MAT-file, written by servoscope through matio", MAT_FT_MAT5);
    if (!file)
        return error_set(out_error, error_refused, "%s: cannot be written%s: %s", path,
                         version == mat_version_73 ? " (version 7.3 needs a matio with HDF5)" : "", mat_library_said());
    const char *wrong = NULL;
    for (size_t i = 0; i < self->count && !wrong; i++)
        if (library->var_write(file, self->variables[i], MAT_COMPRESSION_NONE) != 0)
            wrong = self->variables[i]->name;
    bool closed = library->close(file) == 0;
    if (!wrong && closed)
        wrong = compare_file(self, temporary);
    if (closed && !wrong)
        return error_none;
    return error_set(out_error, error_refused,
                     "%s: writing failed at %s (is the disk full?); the file is as it was before", path,
                     wrong ? wrong : "its end");
}

static int write_file(const struct output *self, const char *path, enum mat_version version, struct error *out_error)
{
    struct atomic_file file;
    if (!atomic_file_open(&file, path, out_error))
        return error_refused;
    int status = file.temporary ? write_variables(self, file.temporary, version, path, out_error)
                                : error_set(out_error, error_refused,
                                            "%s: is a device or a pipe: a MATLAB file needs an ordinary file", path);
    if (!status)
        return atomic_file_commit(&file, out_error);
    atomic_file_discard(&file);
    return status;
}

static int fill(struct output *self, const char *path, const struct record *record, struct format_notes *notes,
                struct error *out_error)
{
    bool run = record->kind == record_run;
    self->capacity = 2 + (run ? record->run.column_count : 0);
    self->variables = calloc(self->capacity, sizeof *self->variables);
    matvar_t *structure = self->variables ? add_structure(self, mat_structure_name) : NULL;
    set_field(self, structure, "kind", text(self, run ? "run" : "frf"));
    int status = structure ? set_keys(self, structure, record, out_error) : error_none;
    if (structure && run)
        add_run(self, &record->run, structure, notes);
    else if (structure)
        add_frf(self, &record->frf);
    if (!status && (self->failed || !structure))
        status = error_set(out_error, error_refused, "%s: not written: memory is short", path);
    return status;
}

int mat_write_record(const char *path, const struct record *record, enum mat_version version,
                     struct format_notes *io_notes, struct error *out_error)
{
    struct output output = {.library = mat_library_load(path, out_error)};
    if (!output.library)
        return error_refused;
    if (version == mat_version_5 && record->kind == record_run && record->run.rows > version_5_rows_max)
        return error_set(out_error, error_refused,
                         "%s: %zu samples make variables of more than 2 GiB, which version 5 cannot hold: --to mat73 "
                         "was expected",
                         path, record->run.rows);
    int status = fill(&output, path, record, io_notes, out_error);
    if (!status)
        status = write_file(&output, path, version, out_error);
    for (size_t i = 0; i < output.count; i++)
        output.library->var_free(output.variables[i]);
    free(output.variables);
    free(output.owned);
    return status;
}
