/* SPDX-License-Identifier: MIT */
#include "lab/record/frf_file.h"

#include "lab/record/atomic_file.h"
#include "lab/record/line_reader.h"
#include "lab/record/number.h"
#include "lab/record/record_table.h"
#include "lab/record/text_table.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

enum {
    column_frequency,
    column_real,
    column_imag,
    column_std,
    column_noise,
    column_odd,
    column_even,
    column_valid,
    column_coherence,
};
enum { frf_columns = 9, frf_columns_required = 3 };

static const char *const column_names[frf_columns] = {
    "frequency_hz", "real", "imag", "std", "noise_std", "odd_distortion", "even_distortion", "valid", "coherence"};

static const char *const text_keys[] = {"input", "output", "units", "method"};

bool frf_set_text(char **text, const char *value)
{
    char *copy = strdup(value);
    if (!copy)
        return false;
    free(*text);
    *text = copy;
    return true;
}

static double *filled(size_t count, double value)
{
    double *data = malloc(count * sizeof *data);
    for (size_t k = 0; data && k < count; k++)
        data[k] = value;
    return data;
}

int frf_alloc(struct frf *out_frf, size_t count, struct error *out_error)
{
    *out_frf = (struct frf){.count = count};
    size_t room = count ? count : 1;
    out_frf->frequency_hz = filled(room, 0);
    out_frf->real = filled(room, 0);
    out_frf->imag = filled(room, 0);
    out_frf->std = filled(room, FRF_UNKNOWN);
    out_frf->noise_std = filled(room, FRF_UNKNOWN);
    out_frf->odd_distortion = filled(room, FRF_UNKNOWN);
    out_frf->even_distortion = filled(room, FRF_UNKNOWN);
    out_frf->coherence = filled(room, FRF_UNKNOWN);
    out_frf->valid = calloc(room, sizeof *out_frf->valid);
    bool texts = frf_set_text(&out_frf->input, "") && frf_set_text(&out_frf->output, "") &&
                 frf_set_text(&out_frf->units, "") && frf_set_text(&out_frf->method, "");
    if (texts && out_frf->frequency_hz && out_frf->real && out_frf->imag && out_frf->std && out_frf->noise_std &&
        out_frf->odd_distortion && out_frf->even_distortion && out_frf->coherence && out_frf->valid)
        return error_none;
    frf_free(out_frf);
    return error_set(out_error, error_refused, "memory is short for %zu frequencies", count);
}

void frf_free(struct frf *self)
{
    for (size_t k = 0; k < self->key_count; k++) {
        free(self->keys[k].key);
        free(self->keys[k].value);
    }
    free(self->keys);
    free(self->frequency_hz);
    free(self->real);
    free(self->imag);
    free(self->std);
    free(self->noise_std);
    free(self->odd_distortion);
    free(self->even_distortion);
    free(self->coherence);
    free(self->valid);
    free(self->input);
    free(self->output);
    free(self->units);
    free(self->method);
    *self = (struct frf){0};
}

static int find_column(const char *name)
{
    for (int i = 0; i < frf_columns; i++)
        if (strcmp(column_names[i], name) == 0)
            return i;
    return -1;
}

static enum text_cell judge(void *context, const char *name)
{
    (void)context;
    switch (find_column(name)) {
    case -1:
        return text_cell_free;
    case column_std:
    case column_noise:
    case column_odd:
    case column_even:
    case column_coherence:
        return text_cell_number_or_empty;
    default:
        return text_cell_number;
    }
}

/* The table's columns by number; NULL where one is missing. */
static int locate_columns(const struct text_table *table, const double *out_columns[frf_columns],
                          struct error *out_error)
{
    for (int i = 0; i < frf_columns; i++)
        out_columns[i] = NULL;
    for (size_t c = 0; c < table->column_count; c++) {
        int i = find_column(table->columns[c].name);
        if (i >= 0 && out_columns[i])
            return error_set(out_error, error_refused, "%s:%zu: there are two columns %s", table->path,
                             table->names_line, column_names[i]);
        if (i >= 0)
            out_columns[i] = table->columns[c].data;
    }
    for (int i = 0; i < frf_columns_required; i++)
        if (!out_columns[i])
            return error_set(out_error, error_refused,
                             "%s:%zu: there is no column %s: a frequency response file was expected", table->path,
                             table->names_line, column_names[i]);
    return error_none;
}

/* The first magnitude of a row that is negative; frf_columns if there is none. */
static int negative_magnitude(const double *const columns[frf_columns], size_t k)
{
    int i = column_std;
    while (i < frf_columns && (i == column_valid || !columns[i] || !(columns[i][k] < 0)))
        i++;
    return i;
}

static int check_row(const struct text_table *table, const double *const columns[frf_columns], size_t k,
                     struct error *out_error)
{
    const char *wrong = NULL;
    int column = column_frequency;
    double frequency_hz = columns[column_frequency][k];
    if (!(frequency_hz >= 0) || (k > 0 && !(frequency_hz > columns[column_frequency][k - 1])))
        wrong = "frequencies from 0 on, in ascending order, were expected";
    for (int i = column_real; i <= column_imag && !wrong; i++) {
        column = i;
        if (!isfinite(columns[i][k]))
            wrong = "a number was expected";
    }
    if (!wrong && negative_magnitude(columns, k) < frf_columns) {
        column = negative_magnitude(columns, k);
        wrong = "a magnitude was expected: 0 or more, or an empty cell";
    }
    if (!wrong && columns[column_valid] && columns[column_valid][k] != 0 && columns[column_valid][k] != 1) {
        column = column_valid;
        wrong = "0 or 1 was expected";
    }
    if (!wrong)
        return error_none;
    return error_set(out_error, error_refused, "%s:%zu: %s: %.9g: %s", table->path, table->row_line[k],
                     column_names[column], columns[column][k], wrong);
}

static void copy_magnitudes(double *to, const double *from, size_t count)
{
    for (size_t k = 0; from && k < count; k++)
        to[k] = isnan(from[k]) ? FRF_UNKNOWN : from[k];
}

static int copy_columns(const struct text_table *table, struct frf *frf, struct error *out_error)
{
    const double *columns[frf_columns];
    int status = locate_columns(table, columns, out_error);
    for (size_t k = 0; k < frf->count && !status; k++)
        status = check_row(table, columns, k, out_error);
    if (status)
        return status;
    memcpy(frf->frequency_hz, columns[column_frequency], frf->count * sizeof(double));
    memcpy(frf->real, columns[column_real], frf->count * sizeof(double));
    memcpy(frf->imag, columns[column_imag], frf->count * sizeof(double));
    copy_magnitudes(frf->std, columns[column_std], frf->count);
    copy_magnitudes(frf->noise_std, columns[column_noise], frf->count);
    copy_magnitudes(frf->odd_distortion, columns[column_odd], frf->count);
    copy_magnitudes(frf->even_distortion, columns[column_even], frf->count);
    copy_magnitudes(frf->coherence, columns[column_coherence], frf->count);
    for (size_t k = 0; k < frf->count; k++)
        frf->valid[k] = !columns[column_valid] || columns[column_valid][k] != 0;
    return error_none;
}

static int read_number(const struct text_table *table, const char *key, bool whole, double *out_value,
                       struct error *out_error)
{
    const char *text;
    size_t line;
    double value = 0;
    int status = text_table_key(table, key, &text, &line, out_error);
    if (status || !text)
        return status;
    const double largest = 9007199254740992.0; // 2^53
    if (number_parse(text, strlen(text), &value) != number_ok || !(value >= 0 && value <= largest) ||
        (whole && value != floor(value)))
        return error_set(out_error, error_refused, "%s:%zu: %s: '%.60s': a %snumber from 0 on was expected",
                         table->path, line, key, text, whole ? "whole " : "");
    *out_value = value;
    return error_none;
}

static bool is_field_key(const char *key)
{
    for (size_t i = 0; i < sizeof text_keys / sizeof text_keys[0]; i++)
        if (strcmp(text_keys[i], key) == 0)
            return true;
    return strcmp(key, "periods") == 0 || strcmp(key, "degrees_of_freedom") == 0;
}

/* Moves the keys that have no field of their own from the table to the response. */
static bool move_other_keys(struct text_table *table, struct frf *frf)
{
    frf->keys = calloc(table->key_count + 1, sizeof *frf->keys);
    if (!frf->keys)
        return false;
    for (size_t k = 0; k < table->key_count; k++) {
        if (is_field_key(table->keys[k].key))
            continue;
        frf->keys[frf->key_count++] = table->keys[k];
        table->keys[k] = (struct run_key){NULL, NULL};
    }
    return true;
}

static int copy_keys(struct text_table *table, struct frf *frf, struct error *out_error)
{
    char **const texts[] = {&frf->input, &frf->output, &frf->units, &frf->method};
    double periods = 0;
    int status = read_number(table, "periods", true, &periods, out_error);
    if (!status)
        status = read_number(table, "degrees_of_freedom", false, &frf->degrees_of_freedom, out_error);
    frf->periods = (size_t)periods;
    for (size_t i = 0; i < sizeof texts / sizeof texts[0] && !status; i++) {
        const char *value;
        size_t line;
        status = text_table_key(table, text_keys[i], &value, &line, out_error);
        if (!status && value && !frf_set_text(texts[i], value))
            status = error_set(out_error, error_refused, "%s: memory is short", table->path);
    }
    if (!status && !move_other_keys(table, frf))
        status = error_set(out_error, error_refused, "%s: memory is short", table->path);
    return status;
}

int frf_take_table(struct text_table *io_table, struct frf *out_frf, struct error *out_error)
{
    int status = frf_alloc(out_frf, io_table->rows, out_error);
    if (!status)
        status = copy_columns(io_table, out_frf, out_error);
    if (!status)
        status = copy_keys(io_table, out_frf, out_error);
    text_table_free(io_table);
    if (status)
        frf_free(out_frf);
    return status;
}

bool frf_file_is(const char *path)
{
    struct error ignored;
    struct line line = {0};
    struct stat file;
    // Of a pipe the first line could be read only once.
    const bool again = stat(path, &file) == 0 && S_ISREG(file.st_mode);
    struct line_reader *reader = again ? line_reader_open(path, &ignored) : NULL;
    const char *first = column_names[column_frequency];
    const size_t length = strlen(first);
    bool found = reader != NULL;
    while (found && line_reader_next(reader, &line, &ignored) == line_ok) {
        if (line.length > 0 && line.text[0] != '#')
            break;
        line.length = 0;
    }
    found = found && line.length > length && strncmp(line.text, first, length) == 0 && line.text[length] == ',';
    if (reader)
        line_reader_close(reader);
    return found;
}

int frf_read(const char *path, struct frf *out_frf, struct error *out_error)
{
    *out_frf = (struct frf){0};
    struct text_table table;
    int status = text_table_read(path, judge, NULL, &table, out_error);
    return status ? status : frf_take_table(&table, out_frf, out_error);
}

static int check_line(const char *path, const struct frf *frf, size_t k, struct error *out_error)
{
    const char *wrong = NULL;
    if (!isfinite(frf->frequency_hz[k]) || (k > 0 && !(frf->frequency_hz[k] > frf->frequency_hz[k - 1])))
        wrong = "its frequency does not ascend";
    else if (!isfinite(frf->real[k]) || !isfinite(frf->imag[k]))
        wrong = "its response is not finite";
    else if (!isfinite(frf->std[k]) || !isfinite(frf->noise_std[k]) || !isfinite(frf->odd_distortion[k]) ||
             !isfinite(frf->even_distortion[k]) || (frf->coherence && !isfinite(frf->coherence[k])))
        wrong = "one of its deviations or distortions is not finite";
    if (!wrong)
        return error_none;
    return error_set(out_error, error_refused, "%s: not written: line %zu at %g Hz: %s", path, k, frf->frequency_hz[k],
                     wrong);
}

static void write_magnitude(FILE *stream, double value)
{
    fputc(',', stream);
    if (frf_known(value))
        text_write_number(stream, value);
}

void frf_write_keys(FILE *stream, const struct frf *frf)
{
    const char *const texts[] = {frf->input, frf->output, frf->units, frf->method};
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++)
        if (texts[i] && texts[i][0])
            fprintf(stream, "# %s: %s\n", text_keys[i], texts[i]);
    if (frf->periods > 0)
        fprintf(stream, "# periods: %zu\n", frf->periods);
    if (frf->degrees_of_freedom > 0) {
        fputs("# degrees_of_freedom: ", stream);
        text_write_number(stream, frf->degrees_of_freedom);
        fputc('\n', stream);
    }
    for (size_t k = 0; k < frf->key_count; k++)
        text_write_key(stream, &frf->keys[k]);
}

static bool has_coherence(const struct frf *frf)
{
    for (size_t k = 0; frf->coherence && k < frf->count; k++)
        if (frf_known(frf->coherence[k]))
            return true;
    return false;
}

static void write_line(FILE *stream, const struct frf *frf, size_t k, bool with_coherence)
{
    text_write_number(stream, frf->frequency_hz[k]);
    fputc(',', stream);
    text_write_number(stream, frf->real[k]);
    fputc(',', stream);
    text_write_number(stream, frf->imag[k]);
    write_magnitude(stream, frf->std[k]);
    write_magnitude(stream, frf->noise_std[k]);
    write_magnitude(stream, frf->odd_distortion[k]);
    write_magnitude(stream, frf->even_distortion[k]);
    fprintf(stream, ",%d", frf->valid[k] ? 1 : 0);
    if (with_coherence)
        write_magnitude(stream, frf->coherence[k]);
    fputc('\n', stream);
}

int frf_write(const char *path, const struct frf *frf, struct error *out_error)
{
    if (frf->count == 0)
        return error_set(out_error, error_refused, "%s: not written: the response has no frequencies", path);
    for (size_t k = 0; k < frf->count; k++) {
        int status = check_line(path, frf, k, out_error);
        if (status)
            return status;
    }
    struct atomic_file file;
    FILE *stream = atomic_file_open(&file, path, out_error);
    if (!stream)
        return error_refused;
    frf_write_keys(stream, frf);
    bool with_coherence = has_coherence(frf);
    for (int i = 0; i < (with_coherence ? frf_columns : column_coherence); i++)
        fprintf(stream, "%s%s", i ? "," : "", column_names[i]);
    fputc('\n', stream);
    for (size_t k = 0; k < frf->count; k++)
        write_line(stream, frf, k, with_coherence);
    return atomic_file_commit(&file, out_error);
}
