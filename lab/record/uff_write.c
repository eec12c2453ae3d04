/* SPDX-License-Identifier: MIT */
#include "lab/record/uff_write.h"

#include "lab/record/atomic_file.h"
#include "lab/record/record_table.h"
#include "lab/record/uff58.h"
#include "lab/record/uff_axis.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* The first line is the function's name, the third a date by convention. */
const int uff_key_line[uff_key_lines] = {1, 3, 4};

const char uff_program[] = "servoscope", uff_holds_run[] = "servoscope run, functions: ",
           uff_holds_frf[] = "servoscope frequency response, functions: ";

const char uff_more_mark[] = "+", uff_more_keys[] = "more keys";

enum { key_lines_max = 4096 };

/* An abscissa that is off by less than this of itself is as exact as one of which each value is written: 6 digits. */
static const double abscissa_tolerance = 5e-6;

/* What is written, in order. Data belongs to the record or to `owned`. */
struct output {
    size_t count, capacity;
    struct uff58 *functions;
    double *owned;
    double zero;
};

static struct uff58 *add_function(struct output *self, const char *name, int function_type, size_t count)
{
    if (self->count == self->capacity)
        return NULL;
    struct uff58 *f = &self->functions[self->count++];
    *f = (struct uff58){.function_type = function_type, .count = count};
    size_t length = strlen(name) < uff_text_size - 1 ? strlen(name) : uff_text_size - 1;
    memcpy(f->id[0], name, length);
    return f;
}

static void set_even(struct uff58 *f, double start, double step)
{
    f->even = true;
    f->abscissa_min = start;
    f->abscissa_step = step;
}

static bool all_finite(const double *data, size_t count, size_t *out_missing)
{
    *out_missing = 0;
    for (size_t n = 0; n < count; n++)
        *out_missing += !isfinite(data[n]);
    return *out_missing == 0;
}

static struct uff_axis time_axis(void)
{
    return (struct uff_axis){.quantity = uff_quantity_time, .label = "time", .units = "s"};
}

static double *bins_as_numbers(const struct run *run)
{
    double *numbers = malloc(run->bin_count * sizeof *numbers);
    for (size_t k = 0; numbers && k < run->bin_count; k++)
        numbers[k] = run->bins[k];
    return numbers;
}

static bool add_run(struct output *self, const struct run *run, struct format_notes *notes)
{
    const double *time_s = run_column(run, "time_s");
    for (size_t c = 0; c < run->column_count; c++) {
        const struct run_column *column = &run->columns[c];
        size_t missing;
        if (!all_finite(column->data, run->rows, &missing)) {
            format_notes_add(notes, format_lost,
                             "column %s: %zu of its cells hold no number, which a universal file "
                             "cannot say",
                             column->name, missing);
            continue;
        }
        if (strlen(column->name) >= uff_text_size)
            format_notes_add(notes, format_lost, "the end of the name %s: 80 characters fit", column->name);
        struct uff58 *f = add_function(self, column->name, uff_time_response, run->rows);
        set_even(f, time_s ? time_s[0] : 0, 1.0 / run->sample_rate_hz);
        f->abscissa = time_axis();
        f->real = column->data;
        uff_describe(column->name, &f->numerator, &f->response);
    }
    if (run->bin_count == 0)
        return true;
    self->owned = bins_as_numbers(run);
    struct uff58 *bins = add_function(self, "excited_bins", uff_general, run->bin_count);
    set_even(bins, 1, 1);
    bins->abscissa = (struct uff_axis){.quantity = uff_quantity_general, .label = "line"};
    bins->numerator = (struct uff_axis){.quantity = uff_quantity_general, .label = "excited_bins"};
    bins->real = self->owned;
    return bins->real != NULL;
}

/* Whether the frequencies lie evenly as nearly as the file can say them otherwise. */
static bool find_spacing(const struct frf *frf, double *out_start, double *out_step)
{
    const double *f = frf->frequency_hz;
    *out_start = uff_abscissa_rounded(f[0]);
    *out_step = frf->count > 1 ? uff_abscissa_rounded((f[frf->count - 1] - f[0]) / (double)(frf->count - 1)) : 1;
    for (size_t k = 0; k < frf->count; k++)
        if (!(fabs(*out_start + (double)k * *out_step - f[k]) <= abscissa_tolerance * f[k]))
            return false;
    return true;
}

static void set_frequencies(struct uff58 *f, const struct frf *frf)
{
    double start, step;
    f->abscissa = (struct uff_axis){.quantity = uff_quantity_frequency, .label = "frequency", .units = "Hz"};
    if (find_spacing(frf, &start, &step))
        set_even(f, start, step);
    else
        f->abscissa_values = frf->frequency_hz;
}

static double *valid_as_numbers(const struct frf *frf)
{
    double *numbers = malloc(frf->count * sizeof *numbers);
    for (size_t k = 0; numbers && k < frf->count; k++)
        numbers[k] = frf->valid[k] ? 1 : 0;
    return numbers;
}

static bool add_frf(struct output *self, const struct frf *frf, struct format_notes *notes)
{
    const char *names[record_frf_columns];
    const double *columns[record_frf_columns];
    record_frf_list(frf, names, columns);
    self->owned = valid_as_numbers(frf);
    struct uff58 *f = add_function(self, "frequency response", uff_frf, frf->count);
    set_frequencies(f, frf);
    f->complex = true;
    f->real = frf->real;
    f->imag = frf->imag;
    uff_describe(frf->output, &f->numerator, &f->response);
    uff_describe(frf->input, &f->denominator, &f->reference);
    for (int i = 0; i < record_frf_columns; i++) {
        bool valid = strcmp(names[i], "valid") == 0;
        double *data = valid ? self->owned : (double *)columns[i];
        if (!data || data == frf->real || data == frf->imag)
            continue;
        bool coherence = strcmp(names[i], "coherence") == 0;
        struct uff58 *g = add_function(self, names[i], coherence ? uff_coherence : uff_general, frf->count);
        set_frequencies(g, frf);
        g->real = data;
        g->response = f->response;
        g->reference = f->reference;
        g->numerator = (struct uff_axis){.quantity = uff_quantity_general};
        snprintf(g->numerator.label, sizeof g->numerator.label, "%s", names[i]);
    }
    format_notes_add(notes, format_kept,
                     "frequencies, deviations and flags of the lines as functions of their own; a "
                     "magnitude that was not estimated is %g",
                     FRF_UNKNOWN);
    return self->owned != NULL;
}

/* The keys as lines of identification. */
struct key_lines {
    size_t count;
    char (*items)[uff_text_size];
};

static bool add_line(struct key_lines *self, const char *beginning, const char *text, size_t length)
{
    char(*items)[uff_text_size] = realloc(self->items, (self->count + 1) * sizeof *items);
    if (!items)
        return false;
    self->items = items;
    snprintf(items[self->count++], uff_text_size, "%s%.*s", beginning, (int)length, text);
    return true;
}

/* One key; what a line does not hold goes on in the next, which begins with a mark. Blanks at a line's end are lost to
 * readers, so none ends there. Returns false if memory is short; *out_kept: whether the key has a form that reads back.
 * */
static bool add_key(struct key_lines *self, const struct run_key *key, bool *out_kept)
{
    size_t size = strlen(key->key) + strlen(key->value) + 3, first_line = self->count;
    char *text = malloc(size);
    *out_kept = key->key[0] != uff_more_mark[0];
    if (!text)
        return false;
    snprintf(text, size, "%s: %s", key->key, key->value);
    size_t left = strlen(text);
    bool good = true;
    for (const char *at = text; left > 0 && good && *out_kept;) {
        const char *beginning = at == text ? "" : uff_more_mark;
        size_t most = uff_text_size - 1 - strlen(beginning), length = left < most ? left : most;
        while (length > 0 && length < left && at[length - 1] == ' ')
            length--;
        *out_kept = length > 0 && self->count < key_lines_max;
        good = !*out_kept || add_line(self, beginning, at, length);
        at += length;
        left -= length;
    }
    if (!*out_kept)
        self->count = first_line;
    free(text);
    return good;
}

static bool list_keys(const struct record_keys *keys, bool run, struct key_lines *out_lines, struct format_notes *notes)
{
    for (size_t k = 0; k < keys->count; k++) {
        bool kept = true;
        if (run && strcmp(keys->items[k].key, "excited_bins") == 0) // a function of its own
            continue;
        if (!add_key(out_lines, &keys->items[k], &kept))
            return false;
        if (!kept)
            format_notes_add(notes, format_lost, "key %s: the identification lines have no room for it",
                             keys->items[k].key);
    }
    return true;
}

/* Functions of one value, whose lines hold what those of the others do not. */
static bool add_carriers(struct output *self, size_t lines)
{
    size_t count = self->count * uff_key_lines < lines ? (lines - 1) / uff_key_lines + 1 - self->count : 0;
    struct uff58 *functions = realloc(self->functions, (self->count + count) * sizeof *functions);
    if (!functions)
        return false;
    self->functions = functions;
    self->capacity = self->count + count;
    for (size_t i = 0; i < count; i++) {
        struct uff58 *f = add_function(self, uff_more_keys, uff_general, 1);
        set_even(f, 0, 1);
        f->real = &self->zero;
    }
    return true;
}

/* Lays the keys into the identification lines of the functions. */
static int place_keys(struct output *self, const struct record *record, struct format_notes *notes,
                      struct error *out_error)
{
    struct record_keys keys;
    struct key_lines lines = {0};
    int status = record_keys_list(record, &keys, out_error);
    if (status)
        return status;
    if (!list_keys(&keys, record->kind == record_run, &lines, notes) || !add_carriers(self, lines.count))
        status = error_set(out_error, error_refused, "memory is short");
    for (size_t i = 0; !status && i < lines.count; i++)
        memcpy(self->functions[i / uff_key_lines].id[uff_key_line[i % uff_key_lines]], lines.items[i],
               sizeof lines.items[i]);
    if (lines.count > 0)
        format_notes_add(notes, format_kept, "keys in the identification lines 2, 4 and 5 of the functions");
    free(lines.items);
    record_keys_free(&keys);
    return status;
}

static int write_functions(const char *path, const struct output *output, const char *holds, bool binary,
                           struct error *out_error)
{
    struct atomic_file file;
    FILE *stream = atomic_file_open(&file, path, out_error);
    if (!stream)
        return error_refused;
    char description[uff_text_size];
    snprintf(description, sizeof description, "%s%zu", holds, output->count);
    uff_write_header(stream, description, uff_program);
    for (size_t i = 0; i < output->count; i++)
        uff_write_function(stream, &output->functions[i], binary);
    return atomic_file_commit(&file, out_error);
}

int uff_write_record(const char *path, const struct record *record, bool binary, struct format_notes *io_notes,
                     struct error *out_error)
{
    bool run = record->kind == record_run;
    struct output output = {.capacity = run ? record->run.column_count + 1 : record_frf_columns + 1};
    output.functions = malloc(output.capacity * sizeof *output.functions);
    bool good =
        output.functions && (run ? add_run(&output, &record->run, io_notes) : add_frf(&output, &record->frf, io_notes));
    int status = good ? error_none : error_set(out_error, error_refused, "%s: not written: memory is short", path);
    if (!status && output.count == 0)
        status = error_set(out_error, error_refused, "%s: not written: no column holds numbers throughout", path);
    if (!status)
        status = place_keys(&output, record, io_notes, out_error);
    if (!status)
        status = write_functions(path, &output, run ? uff_holds_run : uff_holds_frf, binary, out_error);
    if (!status && !binary)
        format_notes_add(io_notes, format_lost,
                         "digits beyond the 13th of each number (field E20.12); --to uff58b keeps all");
    free(output.functions);
    free(output.owned);
    return status;
}
