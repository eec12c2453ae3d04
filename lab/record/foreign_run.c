/* SPDX-License-Identifier: MIT */
#define _XOPEN_SOURCE 700 /* open_memstream */
#include "lab/record/foreign_text.h"

#include "lab/record/record_table.h"
#include "lab/record/run_guess.h"
#include "lab/record/run_names.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int short_of_memory(const char *path, struct error *out_error)
{
    return error_set(out_error, error_refused, "%s: memory is short", path);
}

/// Spellings of units that the list of run_guess.h has under another name.
static const char *usual_unit(const char *unit)
{
    static const struct {
        const char *said, *usual;
    } same[] = {
        {"\xC2\xB0", "deg"},
        {"\xC2\xB0/s", "deg/s"},
        {"1/min", "rpm"},
        {"U/min", "rpm"},
        {"rev/min", "rpm"},
        {"r/min", "rpm"},
        {"min-1", "rpm"},
        {"min^-1", "rpm"},
        {"RPM", "rpm"},
        {"Rpm", "rpm"},
        {"\xC2\xB5m", "um"},
        {"\xCE\xBCm", "um"},
        {"N\xC2\xB7m", "Nm"},
        {"N m", "Nm"},
        {"N*m", "Nm"},
        {"N.m", "Nm"},
        {"N-m", "Nm"},
        {"Grad", "deg"},
        {"degree", "deg"},
        {"degrees", "deg"},
        {"degree/s", "deg/s"},
        {"Grad/s", "deg/s"},
        {"\xC2\xB5s", "us"},
        {"\xCE\xBCs", "us"},
        {"Volt", "V"},
        {"volt", "V"},
        {"Ampere", "A"},
        {"ampere", "A"},
        {"Amp", "A"},
        {"Newton", "N"},
        {"radian", "rad"},
        {"rad/sec", "rad/s"},
        {"deg/sec", "deg/s"},
        {"m/sec", "m/s"},
        {"mm/sec", "mm/s"},
        {"rad.s-1", "rad/s"},
        {"\xC2\xB5"
         "A",
         "uA"},
        {"second", "s"},
        {"seconds", "s"},
        {"sec", "s"},
        {"Sekunden", "s"},
        {"msec", "ms"},
        {"millisecond", "ms"},
        {"milliseconds", "ms"},
    };
    for (size_t i = 0; i < sizeof same / sizeof same[0]; i++)
        if (strcmp(unit, same[i].said) == 0)
            return same[i].usual;
    return unit;
}

void foreign_name(const char *name, const char *unit, char *out_name, size_t size)
{
    unit = usual_unit(unit);
    snprintf(out_name, size, unit[0] ? "%s [%s]" : "%s%s", name, unit);
    for (char *at = out_name; *at; at++)
        if (strchr(",=*\"\t", *at))
            *at = '_';
}

/// Whether a column is the one that a map speaks of: by its whole name, or without the unit behind it.
static bool is_called(const char *column, const char *source)
{
    const size_t length = strlen(source);
    return strcmp(column, source) == 0 ||
           (strncmp(column, source, length) == 0 && strncmp(column + length, " [", 2) == 0);
}

/// The factor to SI that a column's unit asks for; false if it has none that is known.
static bool unit_scale(const struct run_map_entry *entry, const char *column, double *out_scale)
{
    *out_scale = 1.0;
    return strcmp(entry->name, "time_s") == 0 ? run_guess_time_scale(column, out_scale)
                                              : run_guess_scale(column, out_scale);
}

/// The whole name of the column that an entry speaks of; what it says itself if there is none.
static const char *find_column(const struct text_table *table, const char *source)
{
    for (size_t c = 0; c < table->column_count; c++)
        if (strcmp(table->columns[c].name, source) == 0)
            return source;
    for (size_t c = 0; c < table->column_count; c++)
        if (is_called(table->columns[c].name, source))
            return table->columns[c].name;
    return source;
}

static void note_unit(const struct run_map_entry *entry, const char *column, double scale,
                      struct format_notes *io_notes)
{
    double factor;
    const bool known = unit_scale(entry, column, &factor);
    if (!known && strrchr(column, '[')) {
        format_notes_add(io_notes, format_assumed, "%s: the unit of %s is none that is known; its values times %g",
                         entry->name, column, entry->scale);
    } else if (!known) {
        format_notes_add(io_notes, format_assumed, "%s: the file gives %s no unit; its values times %g", entry->name,
                         column, entry->scale);
    } else if (!entry->scaled) {
        format_notes_add(io_notes, format_assumed, "%s: %s, its unit by the file, times %g", entry->name, column,
                         scale);
    } else {
        format_notes_add(io_notes, format_assumed, "%s: %s times %g as --map says, not what its unit would give",
                         entry->name, column, entry->scale);
    }
}

/// The map as text, its columns by their whole names and with the factors of their units.
static char *resolve_map(const struct text_table *table, const struct run_map *map, bool guessed,
                         struct format_notes *io_notes)
{
    char *text = NULL;
    size_t size = 0;
    FILE *stream = open_memstream(&text, &size);
    if (!stream)
        return NULL;
    for (size_t i = 0; i < map->count; i++) {
        const struct run_map_entry *entry = &map->entries[i];
        double scale;
        const char *column = find_column(table, entry->source);
        unit_scale(entry, column, &scale);
        if (!guessed)
            note_unit(entry, column, scale, io_notes);
        fprintf(stream, "%s%s=%s*%.17g", i ? "," : "", entry->name, column,
                guessed || entry->scaled ? entry->scale : scale);
        if (guessed)
            format_notes_add(io_notes, format_assumed, "%s is %s times %g, by the name and unit that the file gives",
                             entry->name, column, entry->scale);
    }
    return fclose(stream) == 0 ? text : NULL;
}

/// A column whose place could not be guessed is no loss, but one to know of.
static void note_unnamed(const struct run *run, struct format_notes *io_notes)
{
    for (size_t c = 0; c < run->column_count; c++) {
        const char *name = run->columns[c].name;
        size_t missing = 0;
        for (size_t n = 0; n < run->rows; n++)
            missing += isnan(run->columns[c].data[n]);
        if (run_name_axis(name) == run_axis_unknown && strcmp(name, "t_s") != 0 && 2 * missing <= run->rows)
            format_notes_add(io_notes, format_kept, "%s under its own name: what it is can be said with --map", name);
    }
}

/// Which columns the run will know: those of the map, and those that have a run's own name.
static bool *list_used(const struct text_table *table, const struct run_map *map)
{
    bool *used = calloc(table->column_count + 1, sizeof *used);
    for (size_t c = 0; used && c < table->column_count; c++) {
        used[c] = run_name_axis(table->columns[c].name) != run_axis_unknown;
        for (size_t i = 0; i < map->count; i++)
            used[c] = used[c] || strcmp(table->columns[c].name, find_column(table, map->entries[i].source)) == 0;
    }
    return used;
}

/// The column that says which samples are valid: that of the map, else `valid`.
static const char *find_valid(const struct text_table *table, const struct run_map *map)
{
    for (size_t i = 0; i < map->count; i++)
        if (strcmp(map->entries[i].name, "valid") == 0)
            return find_column(table, map->entries[i].source);
    return "valid";
}

static size_t count_missing(const struct text_table *table, size_t column)
{
    size_t missing = 0;
    for (size_t n = 0; n < table->rows; n++)
        missing += isnan(table->columns[column].data[n]);
    return missing;
}

/// Columns of which less than half is there keep their names: marking the gaps would leave no recording.
static const char **list_sparse(const struct text_table *table, size_t *out_count, struct format_notes *io_notes)
{
    const char **names = calloc(table->column_count + 1, sizeof *names);
    *out_count = 0;
    for (size_t c = 0; names && c < table->column_count; c++) {
        const size_t missing = count_missing(table, c);
        if (2 * missing <= table->rows)
            continue;
        names[(*out_count)++] = table->columns[c].name;
        format_notes_add(io_notes, format_kept, "%s under its own name: %zu of its %zu cells are empty",
                         table->columns[c].name, missing, table->rows);
    }
    return names;
}

/// The map that the user gave, or the one that the units give.
static int make_map(const struct text_table *table, const char *given, struct run_map *out_map,
                    struct format_notes *io_notes, struct error *out_error)
{
    if (given)
        return run_map_parse(out_map, given, out_error);
    size_t sparse_count;
    const char **sparse = list_sparse(table, &sparse_count, io_notes);
    int status = sparse ? run_guess_map(table, sparse, sparse_count, out_map, out_error)
                        : short_of_memory(table->path, out_error);
    free(sparse);
    return status;
}

static int check_sparse(const struct text_table *table, const bool *used, struct error *out_error)
{
    for (size_t c = 0; c < table->column_count; c++) {
        const size_t missing = used[c] ? count_missing(table, c) : 0;
        if (2 * missing > table->rows)
            return error_set(out_error, error_refused,
                             "%s: %s: %zu of its %zu cells are empty: expected values in at least half of the rows",
                             table->path, table->columns[c].name, missing, table->rows);
    }
    return 0;
}

int foreign_take_run(struct text_table *io_table, const struct format_options *options, struct run *out_run,
                     struct format_notes *io_notes, struct error *out_error)
{
    struct run_map map = {0};
    struct run_options run_options = options->run;
    char *text = NULL;
    int status = make_map(io_table, options->run.map, &map, io_notes, out_error);
    bool *used = status ? NULL : list_used(io_table, &map);
    if (!status && !used)
        status = short_of_memory(io_table->path, out_error);
    status = status ? status : check_sparse(io_table, used, out_error);
    status = status ? status : foreign_mark_gaps(io_table, used, find_valid(io_table, &map), io_notes, out_error);
    if (!status && !(text = resolve_map(io_table, &map, !options->run.map, io_notes)))
        status = short_of_memory(io_table->path, out_error);
    run_options.map = text;
    status = status ? status : run_take_table(io_table, &run_options, out_run, out_error);
    if (!status && !options->run.map)
        note_unnamed(out_run, io_notes);
    text_table_free(io_table);
    free(text);
    free(used);
    run_map_free(&map);
    return status;
}
