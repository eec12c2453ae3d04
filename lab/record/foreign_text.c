/* SPDX-License-Identifier: MIT */
#define _XOPEN_SOURCE 700 /* open_memstream */
#include "lab/record/foreign_text.h"

#include "lab/record/line_reader.h"
#include "lab/record/number.h"
#include "lab/record/record_table.h"
#include "lab/record/run_guess.h"
#include "lab/record/run_names.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int short_of_memory(const char *path, struct error *out_error)
{
    return error_set(out_error, error_refused, "%s: memory is short", path);
}

static bool add_line(struct foreign_text *self, size_t *io_room, const struct line *line)
{
    if (self->count == *io_room) {
        size_t room = *io_room ? 2 * *io_room : 1024;
        char **lines = realloc(self->lines, room * sizeof *lines);
        if (!lines)
            return false;
        self->lines = lines;
        *io_room = room;
    }
    char *copy = malloc(line->length + 1);
    if (!copy)
        return false;
    memcpy(copy, line->text, line->length);
    copy[line->length] = '\0';
    self->lines[self->count++] = copy;
    return true;
}

int foreign_text_read(const char *path, struct foreign_text *out_self, struct error *out_error)
{
    *out_self = (struct foreign_text){.path = path};
    struct line_reader *reader = line_reader_open(path, out_error);
    if (!reader)
        return error_refused;
    size_t room = 0;
    struct line line;
    int status = 0;
    enum line_status got;
    while (!status && (got = line_reader_next(reader, &line, out_error)) != line_end) {
        if (got == line_failed)
            status = error_refused;
        else if (!add_line(out_self, &room, &line))
            status = short_of_memory(path, out_error);
    }
    line_reader_close(reader);
    if (status)
        foreign_text_free(out_self);
    return status;
}

void foreign_text_free(struct foreign_text *self)
{
    for (size_t i = 0; i < self->count; i++)
        free(self->lines[i]);
    free(self->lines);
    self->lines = NULL;
    self->count = 0;
}

static char *trim(char *cell)
{
    cell += strspn(cell, " ");
    size_t length = strlen(cell);
    while (length > 0 && (cell[length - 1] == ' ' || cell[length - 1] == '\r'))
        cell[--length] = '\0';
    if (length > 1 && cell[0] == '"' && cell[length - 1] == '"') {
        cell[length - 1] = '\0';
        cell++;
    }
    return cell;
}

int foreign_cells_split(char *line, char separator, struct foreign_cells *out_cells, struct error *out_error)
{
    size_t most = 1;
    for (const char *at = line; *at; at++)
        most += *at == separator;
    *out_cells = (struct foreign_cells){.items = malloc(most * sizeof *out_cells->items)};
    if (!out_cells->items)
        return error_set(out_error, error_refused, "memory is short");
    bool quoted = false;
    char *begin = line;
    for (char *at = line;; at++) {
        quoted = *at == '"' ? !quoted : quoted;
        if (*at != '\0' && (*at != separator || quoted))
            continue;
        const bool last = *at == '\0';
        *at = '\0';
        out_cells->items[out_cells->count++] = trim(begin);
        begin = at + 1;
        if (last)
            return 0;
    }
}

void foreign_cells_free(struct foreign_cells *self)
{
    free(self->items);
    *self = (struct foreign_cells){0};
}

bool foreign_number(char *cell, char decimal, double *out_value)
{
    if (decimal != '.' && !strchr(cell, '.')) {
        char *mark = strchr(cell, decimal);
        if (mark)
            *mark = '.';
    }
    return number_parse(cell, strlen(cell), out_value) == number_ok;
}

/// Spellings of units that the list of run_guess.h has under another name.
static const char *usual_unit(const char *unit)
{
    static const struct {
        const char *said, *usual;
    } same[] = {
        {"\xC2\xB0", "deg"}, {"\xC2\xB0/s", "deg/s"}, {"1/min", "rpm"},     {"U/min", "rpm"}, {"rev/min", "rpm"},
        {"\xC2\xB5m", "um"}, {"\xCE\xBCm", "um"},     {"N\xC2\xB7m", "Nm"}, {"N m", "Nm"},    {"N*m", "Nm"},
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

/// The whole name of the column and the factor that its unit asks for.
static const char *find_column(const struct text_table *table, const char *source, double *out_scale)
{
    *out_scale = 1.0;
    for (size_t c = 0; c < table->column_count; c++)
        if (is_called(table->columns[c].name, source)) {
            run_guess_scale(table->columns[c].name, out_scale);
            return table->columns[c].name;
        }
    return source;
}

static void note_unit(const struct run_map_entry *entry, const char *column, double scale,
                      struct format_notes *io_notes)
{
    double factor;
    const bool known = run_guess_scale(column, &factor);
    if (!known && strrchr(column, '[')) {
        format_notes_add(io_notes, format_assumed, "%s: the unit of %s is none that is known; its values times %g",
                         entry->name, column, entry->scale);
    } else if (!known) {
        format_notes_add(io_notes, format_assumed, "%s: the file gives %s no unit; its values times %g", entry->name,
                         column, entry->scale);
    } else if (entry->scale == 1.0) {
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
        const char *column = find_column(table, entry->source, &scale);
        if (!guessed)
            note_unit(entry, column, scale, io_notes);
        fprintf(stream, "%s%s=%s*%.17g", i ? "," : "", entry->name, column,
                guessed || entry->scale != 1.0 ? entry->scale : scale);
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
        if (run_name_axis(name) == run_axis_unknown && strcmp(name, "t_s") != 0)
            format_notes_add(io_notes, format_kept, "%s under its own name: what it is can be said with --map", name);
    }
}

int foreign_take_run(struct text_table *io_table, const struct format_options *options, struct run *out_run,
                     struct format_notes *io_notes, struct error *out_error)
{
    const bool guessed = !options->run.map;
    struct run_map map = {0};
    int status =
        guessed ? run_guess_map(io_table, NULL, 0, &map, out_error) : run_map_parse(&map, options->run.map, out_error);
    struct run_options run_options = options->run;
    char *text = status ? NULL : resolve_map(io_table, &map, guessed, io_notes);
    if (!status && !text)
        status = short_of_memory(io_table->path, out_error);
    run_options.map = text;
    if (!status)
        status = run_take_table(io_table, &run_options, out_run, out_error);
    if (!status && guessed)
        note_unnamed(out_run, io_notes);
    text_table_free(io_table);
    free(text);
    run_map_free(&map);
    return status;
}
