/* SPDX-License-Identifier: MIT */
/// Universal files: dataset 58, time responses as a run, a frequency response function as a response
/// (docs/files.md, "Universal files").
#include "lab/record/foreign_text.h"
#include "lab/record/record_table.h"
#include "lab/record/run_names.h"
#include "lab/record/uff58.h"
#include "lab/record/uff_axis.h"
#include "lab/record/uff_write.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A rate from a step of 6 digits is as uncertain as this; a whole number within it is taken to be meant. */
static const double rate_rounding = 5e-6;

enum { name_size = 192 };

static enum format_match recognise(const unsigned char *head, size_t length)
{
    size_t at = 0;
    while (at < length && memchr(" \r\n", head[at], 3))
        at++;
    if (length - at < 2 || memcmp(head + at, "-1", 2) != 0)
        return format_match_none;
    size_t end = at += 2;
    while (end < length && memchr(" \r\n", head[end], 3))
        end++;
    bool next_line = memchr(head + at, '\n', end - at) != NULL;
    return end == length || (next_line && head[end] >= '1' && head[end] <= '9') ? format_match_sure : format_match_none;
}

static bool begins_with(const char *text, const char *beginning)
{
    return strncmp(text, beginning, strlen(beginning)) == 0;
}

static bool is_ours(const struct uff_file *file)
{
    return strcmp(file->program, uff_program) == 0 &&
           (begins_with(file->description, uff_holds_run) || begins_with(file->description, uff_holds_frf));
}

/* A file of ours says how many functions it has, so that a loss at its end shows. */
static int check_ours(const char *path, const struct uff_file *file, struct error *out_error)
{
    const char *number = strrchr(file->description, ':');
    size_t expected = number ? (size_t)strtoul(number + 1, NULL, 10) : 0;
    if (file->count == expected)
        return error_none;
    return error_set(out_error, error_refused, "%s: has %zu functions, its header says %zu: it is cut off", path,
                     file->count, expected);
}

static size_t count_type(const struct uff_file *file, int function_type)
{
    size_t count = 0;
    for (size_t i = 0; i < file->count; i++)
        count += file->functions[i].function_type == function_type;
    return count;
}

static bool is_carrier(const struct uff58 *f)
{
    return f->function_type == uff_general && f->count == 1 && strcmp(f->id[0], uff_more_keys) == 0;
}

static int take_key(struct text_table *table, char *text, struct error *out_error)
{
    char *colon = strchr(text, ':');
    if (!colon)
        return error_none;
    *colon = '\0';
    return record_table_add_key(table, text, colon + 1 + strspn(colon + 1, " "), out_error);
}

/* The keys of a file of ours, from the identification lines; one may go on over several of them. */
static int take_keys(const struct uff_file *file, struct text_table *table, struct error *out_error)
{
    size_t lines = file->count * uff_key_lines, used = 0;
    char *text = calloc(lines + 1, uff_text_size);
    int status = text ? error_none : error_set(out_error, error_refused, "%s: memory is short", table->path);
    for (size_t place = 0; place < lines && !status; place++) {
        const char *line = file->functions[place / uff_key_lines].id[uff_key_line[place % uff_key_lines]];
        bool goes_on = line[0] == uff_more_mark[0];
        if (!goes_on && used > 0)
            status = take_key(table, text, out_error);
        used = goes_on ? used : 0;
        used += (size_t)snprintf(text + used, uff_text_size, "%s", line + (goes_on ? 1 : 0));
    }
    if (!status && used > 0)
        status = take_key(table, text, out_error);
    free(text);
    return status;
}

static int take_bins(const char *path, const struct uff58 *f, struct text_table *table, struct error *out_error)
{
    char *text = malloc(f->count * 24 + 3), *at = text;
    if (!text)
        return error_set(out_error, error_refused, "%s: memory is short", path);
    for (size_t k = 0; k < f->count; k++)
        at += snprintf(at, 24, "%s%.15g", k ? ", " : "[", f->real[k]);
    strcpy(at, "]");
    int status = record_table_add_key(table, "excited_bins", text, out_error);
    free(text);
    return status;
}

/* Moves a function's values into a column. */
static int move_column(struct uff58 *f, const char *name, struct text_table *table, struct error *out_error)
{
    double *data = f->real;
    f->real = NULL;
    return record_table_add_column(table, name, data, f->count, out_error);
}

static bool has_column(const struct text_table *table, const char *name)
{
    for (size_t c = 0; c < table->column_count; c++)
        if (strcmp(table->columns[c].name, name) == 0)
            return true;
    return false;
}

/* A name of its own for a foreign function: its first line with the units that its axis says, or what the axis says;
   numbered where there are two. A name that a run knows has its unit in it. */
static void name_function(const struct uff58 *f, const struct text_table *table, char out_name[name_size])
{
    char name[name_size / 2], numbered[name_size / 2 + 16];
    snprintf(name, sizeof name, "%s", f->id[0]);
    uff_clean_name(name);
    if (!name[0])
        uff_name_column(&f->numerator, &f->response, false, sizeof name, name);
    const char *units = run_name_axis(name) == run_axis_unknown ? f->numerator.units : "";
    foreign_name(name, units, out_name, name_size);
    for (int number = 2; has_column(table, out_name); number++) {
        snprintf(numbered, sizeof numbered, "%s_%d", name, number);
        foreign_name(numbered, units, out_name, name_size);
    }
}

static void note_units(const struct uff_file *file, struct format_notes *notes)
{
    if (file->has_units && (file->to_si[0] != 1 || file->to_si[1] != 1))
        format_notes_add(notes, format_assumed,
                         "numbers as they stand; the file's units are '%s', which --map can "
                         "scale (length is %.9g to the metre, force %.9g to the newton)",
                         file->units, file->to_si[0], file->to_si[1]);
}

/* The rate of an even time axis whose step has 6 digits. */
static int take_step(const char *path, const struct uff58 *f, struct text_table *table, struct format_notes *notes,
                     struct error *out_error)
{
    if (!(f->abscissa_step > 0))
        return error_set(out_error, error_refused, "%s:%zu: time step %g: a step above 0 was expected", path, f->line,
                         f->abscissa_step);
    double rate_hz = 1.0 / f->abscissa_step, whole = round(rate_hz);
    if (fabs(rate_hz - whole) <= rate_rounding * rate_hz)
        rate_hz = whole;
    format_notes_add(notes, format_assumed,
                     "sample rate %.9g Hz from the step of %.6g s, which has 6 digits; --rate "
                     "says it better",
                     rate_hz, f->abscissa_step);
    return record_table_add_number(table, "sample_rate_hz", rate_hz, out_error);
}

/* The clock of a foreign run: a step, or time stamps, which become a column. */
static int take_clock(const char *path, struct uff58 *f, const struct format_options *options, struct text_table *table,
                      struct format_notes *notes, struct error *out_error)
{
    if (f->even)
        return options->run.rate_hz > 0 ? error_none : take_step(path, f, table, notes, out_error);
    if (has_column(table, "time_s"))
        return error_none;
    double *time_s = f->abscissa_values;
    f->abscissa_values = NULL;
    format_notes_add(notes, format_assumed, "the abscissa of '%s' is time in seconds", table->columns[0].name);
    return record_table_add_column(table, "time_s", time_s, f->count, out_error);
}

static bool same_clock(const struct uff58 *a, const struct uff58 *b)
{
    return a->count == b->count && a->even == b->even &&
           (!a->even || (a->abscissa_min == b->abscissa_min && a->abscissa_step == b->abscissa_step));
}

static int take_foreign_signals(const char *path, struct uff_file *file, const struct format_options *options,
                                struct text_table *table, struct format_notes *notes, struct error *out_error)
{
    struct uff58 *first = NULL;
    int status = error_none;
    for (size_t i = 0; i < file->count && !status; i++) {
        struct uff58 *f = &file->functions[i];
        char name[name_size];
        if (f->function_type != uff_time_response || f->complex || (first && !same_clock(first, f))) {
            format_notes_add(notes, format_lost, "function %zu (line %zu, '%s'): %s", i + 1, f->line, f->id[0],
                             f->function_type != uff_time_response ? "not a time response"
                             : f->complex                          ? "complex"
                                                                   : "not sampled like the first time response");
            continue;
        }
        first = first ? first : f;
        name_function(f, table, name);
        format_notes_add(notes, format_kept, "function %zu (line %zu) as column '%s'", i + 1, f->line, name);
        status = move_column(f, name, table, out_error);
    }
    note_units(file, notes);
    return status ? status : take_clock(path, first, options, table, notes, out_error);
}

static int take_our_signals(const char *path, struct uff_file *file, struct text_table *table, struct error *out_error)
{
    int status = take_keys(file, table, out_error);
    for (size_t i = 0; i < file->count && !status; i++) {
        struct uff58 *f = &file->functions[i];
        bool bins = f->function_type == uff_general && strcmp(f->id[0], "excited_bins") == 0;
        if (is_carrier(f))
            continue;
        status = bins ? take_bins(path, f, table, out_error) : move_column(f, f->id[0], table, out_error);
    }
    return status;
}

static int read_run(const char *path, struct uff_file *file, const struct format_options *options,
                    struct record *out_record, struct format_notes *notes, struct error *out_error)
{
    struct text_table table;
    out_record->kind = record_run;
    int status = record_table_start(&table, path, out_error);
    if (!status)
        status = is_ours(file) ? take_our_signals(path, file, &table, out_error)
                               : take_foreign_signals(path, file, options, &table, notes, out_error);
    if (status) {
        text_table_free(&table);
        return status;
    }
    return is_ours(file) ? run_take_table(&table, &options->run, &out_record->run, out_error)
                         : foreign_take_run(&table, options, &out_record->run, notes, out_error);
}

/* The response to take: the only one, or the one that --function names. */
static struct uff58 *choose_frf(const char *path, struct uff_file *file, size_t number, struct error *out_error)
{
    size_t count = count_type(file, uff_frf), seen = 0;
    if (count == 0) {
        error_set(out_error, error_usage, "%s: holds no frequency response for --function", path);
        return NULL;
    }
    if (number > count || (number == 0 && count > 1)) {
        error_set(out_error, error_usage,
                  "%s: holds %zu frequency responses: --function NUMBER, 1 to %zu, was expected", path, count, count);
        return NULL;
    }
    for (size_t i = 0; i < file->count; i++) {
        seen += file->functions[i].function_type == uff_frf;
        if (file->functions[i].function_type == uff_frf && seen == (number ? number : 1))
            return &file->functions[i];
    }
    return NULL;
}

static bool same_place(const struct uff_dof *a, const struct uff_dof *b)
{
    return a->node == b->node && a->direction == b->direction && strcmp(a->name, b->name) == 0;
}

static int add_frequencies(struct uff58 *f, struct text_table *table, struct error *out_error)
{
    double *frequency_hz = malloc(f->count * sizeof *frequency_hz);
    if (!frequency_hz)
        return error_set(out_error, error_refused, "%s: memory is short", table->path);
    for (size_t k = 0; k < f->count; k++)
        frequency_hz[k] = f->even ? f->abscissa_min + (double)k * f->abscissa_step : f->abscissa_values[k];
    return record_table_add_column(table, "frequency_hz", frequency_hz, f->count, out_error);
}

static int take_response(struct uff58 *f, struct text_table *table, struct error *out_error)
{
    if (!f->complex)
        return error_set(out_error, error_refused, "%s:%zu: the frequency response is real: complex was expected",
                         table->path, f->line);
    int status = move_column(f, "real", table, out_error);
    double *imag = f->imag;
    f->imag = NULL;
    if (status) {
        free(imag);
        return status;
    }
    return record_table_add_column(table, "imag", imag, f->count, out_error);
}

/* The coherence of the same two places; all other functions are listed. */
static int take_coherence(struct uff_file *file, const struct uff58 *f, struct text_table *table,
                          struct format_notes *notes, struct error *out_error)
{
    int status = error_none;
    for (size_t i = 0; i < file->count && !status; i++) {
        struct uff58 *g = &file->functions[i];
        bool coherence = g->function_type == uff_coherence && !g->complex && g->count == f->count &&
                         same_place(&g->response, &f->response) && same_place(&g->reference, &f->reference);
        if (coherence && !has_column(table, "coherence"))
            status = move_column(g, "coherence", table, out_error);
        else if (g != f)
            format_notes_add(notes, format_lost, "function %zu (line %zu, '%s')", i + 1, g->line, g->id[0]);
    }
    return status;
}

static int take_foreign_frf(struct uff_file *file, struct uff58 *f, struct text_table *table,
                            struct format_notes *notes, struct error *out_error)
{
    char input[name_size], output[name_size];
    bool si = file->has_units && file->to_si[0] == 1 && file->to_si[1] == 1;
    uff_name_column(&f->denominator, &f->reference, si, sizeof input, input);
    uff_name_column(&f->numerator, &f->response, si, sizeof output, output);
    if (f->abscissa.quantity != uff_quantity_frequency)
        format_notes_add(notes, format_assumed, "the abscissa is frequency in Hz; the file says quantity %d",
                         f->abscissa.quantity);
    format_notes_add(notes, format_assumed, "from %s to %s, by the axes of the function in line %zu", input, output,
                     f->line);
    note_units(file, notes);
    int status = record_table_add_key(table, "input", input, out_error);
    if (!status)
        status = record_table_add_key(table, "output", output, out_error);
    if (!status)
        status = add_frequencies(f, table, out_error);
    if (!status)
        status = take_response(f, table, out_error);
    return status ? status : take_coherence(file, f, table, notes, out_error);
}

/* Magnitudes that were not estimated are negative in a file of ours. */
static void forget_unknown(struct uff58 *f)
{
    for (size_t k = 0; k < f->count; k++)
        f->real[k] = f->real[k] == FRF_UNKNOWN ? NAN : f->real[k];
}

static int take_our_frf(struct uff_file *file, struct uff58 *f, struct text_table *table, struct error *out_error)
{
    int status = take_keys(file, table, out_error);
    if (!status)
        status = take_response(f, table, out_error);
    for (size_t i = 0; i < file->count && !status; i++) {
        struct uff58 *g = &file->functions[i];
        if (g == f || is_carrier(g))
            continue;
        forget_unknown(g);
        status = move_column(g, g->id[0], table, out_error);
    }
    return status;
}

static int read_frf(const char *path, struct uff_file *file, const struct format_options *options,
                    struct record *out_record, struct format_notes *notes, struct error *out_error)
{
    struct text_table table;
    out_record->kind = record_frf;
    struct uff58 *f = choose_frf(path, file, options->function, out_error);
    if (!f)
        return out_error ? out_error->status : error_usage;
    int status = record_table_start(&table, path, out_error);
    if (!status)
        status = is_ours(file) ? take_our_frf(file, f, &table, out_error)
                               : take_foreign_frf(file, f, &table, notes, out_error);
    if (status) {
        text_table_free(&table);
        return status;
    }
    return frf_take_table(&table, &out_record->frf, out_error);
}

static int read_uff(const char *path, const struct format_options *options, struct record *out_record,
                    struct format_notes *io_notes, struct error *out_error)
{
    struct uff_file file;
    *out_record = (struct record){.kind = record_run};
    int status = uff_file_read(path, &file, out_error);
    if (!status && is_ours(&file))
        status = check_ours(path, &file, out_error);
    bool wants_frf = options->function > 0 || count_type(&file, uff_time_response) == 0;
    if (!status && wants_frf && (options->function > 0 || count_type(&file, uff_frf) > 0))
        status = read_frf(path, &file, options, out_record, io_notes, out_error);
    else if (!status && count_type(&file, uff_time_response) > 0)
        status = read_run(path, &file, options, out_record, io_notes, out_error);
    else if (!status)
        status = error_set(out_error, error_refused,
                           "%s: holds neither time responses (function type 1) nor "
                           "frequency responses (4)",
                           path);
    uff_file_free(&file);
    return status;
}

static int write_uff(const char *path, const struct record *record, struct format_notes *io_notes,
                     struct error *out_error)
{
    return uff_write_record(path, record, false, io_notes, out_error);
}

const struct record_format record_format_uff = {
    .name = "uff",
    .summary = "universal file, dataset 58, in text; read also gzipped and in binary",
    .endings = {".uff", ".unv"},
    .recognise = recognise,
    .read = read_uff,
    .write = write_uff,
};
