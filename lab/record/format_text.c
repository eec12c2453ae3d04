/* SPDX-License-Identifier: MIT */
/// Recordings of other programs as text: cells between tabs, semicolons, commas or blanks, a point or a comma as
/// decimal mark, lines of anything in front, one row of names, perhaps a row of units. What was assumed of them is
/// noted.
#include "lab/record/foreign_text.h"
#include "lab/record/format.h"
#include "lab/record/record_table.h"
#include "lab/record/run_guess.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

enum { name_size = 160, sampled_lines = 20 };

struct layout {
    char separator, decimal;
    size_t columns;
    size_t names, units, first; ///< lines; names or units at SIZE_MAX: there are none
};

static size_t count_of(const char *text, char what)
{
    size_t count = 0;
    for (; *text; text++)
        count += *text == what;
    return count;
}

static bool is_blank(const char *line)
{
    return line[strspn(line, " \t;,\r")] == '\0';
}

/// Servoscope's own files have commas between cells and points in numbers; what else has rows of numbers is foreign.
static enum format_match recognise(const unsigned char *head, size_t length)
{
    char text[format_head_size + 1];
    memcpy(text, head, length);
    text[length] = '\0';
    if (strlen(text) != length || strncmp(text, "MATLAB", 6) == 0)
        return format_match_none;
    char *rest = NULL;
    for (char *line = strtok_r(text, "\r\n", &rest); line; line = strtok_r(NULL, "\r\n", &rest)) {
        const bool key = line[0] == '#' || is_blank(line);
        if (!key && (strchr(line, ';') || (strchr(line, '\t') && !strchr(line, ','))) && line[0] != '{')
            return format_match_sure;
        if (!key && strchr(line, ','))
            return format_match_none;
    }
    return format_match_none;
}

/// The separator that most of the last lines agree upon.
static char find_separator(const struct foreign_text *text)
{
    static const char choices[] = "\t;, ";
    const size_t from = text->count > sampled_lines ? text->count - sampled_lines : 0;
    for (const char *choice = choices; *choice; choice++) {
        size_t with = 0;
        for (size_t line = from; line < text->count; line++)
            with += count_of(text->lines[line], *choice) > 0;
        if (2 * with > text->count - from)
            return *choice;
    }
    return '\t';
}

/// Cells of a copy of a line, so that lines can be looked at more than once; *out_copy is the caller's.
static int split_copy(const struct foreign_text *text, size_t line, char separator, char **out_copy,
                      struct foreign_cells *out_cells, struct error *out_error)
{
    *out_cells = (struct foreign_cells){0};
    *out_copy = strdup(text->lines[line]);
    return *out_copy ? foreign_cells_split(*out_copy, separator, out_cells, out_error)
                     : error_set(out_error, error_refused, "%s: memory is short", text->path);
}

/// How many cells a line has, 0 if one of them is neither a number nor empty, or if all are empty.
static size_t count_numbers(const struct foreign_text *text, size_t line, const struct layout *layout)
{
    char *copy;
    struct foreign_cells cells;
    struct error error;
    size_t numbers = 0;
    size_t empty = 0;
    if (split_copy(text, line, layout->separator, &copy, &cells, &error) == 0)
        for (size_t at = 0; at < cells.count; at++) {
            double value;
            empty += cells.items[at][0] == '\0';
            numbers += foreign_number(cells.items[at], layout->decimal, &value);
        }
    const size_t count = numbers > 0 && numbers + empty == cells.count ? cells.count : 0;
    foreign_cells_free(&cells);
    free(copy);
    return count;
}

static bool is_unit(const char *cell)
{
    static const char *const others[] = {"", "-", "s", "ms", "us", "1", "%", "bool", "rad/s^2", "m/s^2"};
    char name[name_size];
    double scale;
    for (size_t i = 0; i < sizeof others / sizeof others[0]; i++)
        if (strcmp(cell, others[i]) == 0)
            return true;
    foreign_name("x", cell, name, sizeof name);
    return run_guess_scale(name, &scale);
}

/// Brackets around a unit belong to whoever wrote them.
static char *bare_unit(char *cell)
{
    const size_t length = strlen(cell);
    if (length > 1 && strchr("[(", cell[0]) && strchr("])", cell[length - 1])) {
        cell[length - 1] = '\0';
        cell++;
    }
    return cell;
}

static bool is_units_row(const struct foreign_text *text, size_t line, const struct layout *layout)
{
    char *copy;
    struct foreign_cells cells;
    struct error error;
    size_t units = 0;
    if (split_copy(text, line, layout->separator, &copy, &cells, &error) == 0)
        for (size_t at = 0; at < cells.count; at++)
            units += is_unit(bare_unit(cells.items[at]));
    const bool all = cells.count > 0 && units == cells.count && !is_blank(text->lines[line]);
    foreign_cells_free(&cells);
    free(copy);
    return all;
}

/// A comma in one of the last lines is a decimal mark wherever commas do not separate and points do not mark decimals.
static char find_decimal(const struct foreign_text *text, char separator)
{
    const size_t from = text->count > sampled_lines ? text->count - sampled_lines : 0;
    for (size_t line = from; line < text->count && separator != ','; line++)
        if (strchr(text->lines[line], ',') && !strchr(text->lines[line], '.'))
            return ',';
    return '.';
}

/// The rows of names and units are the last in front of the numbers, blank lines and comments aside.
static void find_names(const struct foreign_text *text, struct layout *io)
{
    size_t line = io->first;
    while (line > 0 && (is_blank(text->lines[line - 1]) || text->lines[line - 1][0] == '#'))
        line--;
    if (line > 1 && is_units_row(text, line - 1, io))
        io->units = --line;
    if (line > 0)
        io->names = line - 1;
}

static int find_layout(const struct foreign_text *text, struct layout *out, struct error *out_error)
{
    *out = (struct layout){.separator = find_separator(text), .names = SIZE_MAX, .units = SIZE_MAX};
    out->decimal = find_decimal(text, out->separator);
    while (out->first < text->count && (out->columns = count_numbers(text, out->first, out)) == 0)
        out->first++;
    if (out->first == text->count)
        return error_set(out_error, error_refused, "%s: no row of numbers was found", text->path);
    find_names(text, out);
    if (out->names == SIZE_MAX)
        return error_set(out_error, error_refused, "%s:%zu: expected a row of names in front of the numbers",
                         text->path, out->first + 1);
    return 0;
}

static void note_layout(const struct layout *layout, struct format_notes *io_notes)
{
    const char *between = layout->separator == '\t'  ? "tabs"
                          : layout->separator == ';' ? "semicolons"
                          : layout->separator == ',' ? "commas"
                                                     : "blanks";
    format_notes_add(io_notes, format_assumed,
                     "cells between %s, decimal %s, names in line %zu%s, values from line %zu", between,
                     layout->decimal == ',' ? "comma" : "point", layout->names + 1,
                     layout->units == SIZE_MAX ? "" : ", units behind it", layout->first + 1);
}

static bool is_time(const char *name)
{
    static const char *const names[] = {"t", "time", "zeit", "timestamp", "temps", "tiempo"};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++)
        if (strcasecmp(name, names[i]) == 0)
            return true;
    return false;
}

static double time_scale(const char *unit)
{
    return strcmp(unit, "ms") == 0 ? 1e-3 : strcmp(unit, "us") == 0 ? 1e-6 : 1.0;
}

/// A name that has its unit in it, "speed (rpm)", "speed [rpm]", apart.
static void split_name(const char *cell, const char *unit, char out_name[name_size], char out_unit[name_size])
{
    const size_t bare = strcspn(cell, "[(");
    snprintf(out_unit, name_size, "%s", unit);
    snprintf(out_name, name_size, "%s", cell);
    if (bare > 0 && cell[bare] != '\0' && unit[0] == '\0') {
        snprintf(out_unit, name_size, "%.*s", (int)strcspn(cell + bare + 1, "])"), cell + bare + 1);
        snprintf(out_name, name_size, "%.*s", (int)bare, cell);
    }
    for (size_t length = strlen(out_name); length > 0 && out_name[length - 1] == ' ';)
        out_name[--length] = '\0';
}

static int add_column(const char *cell, const char *unit, double *data, size_t rows, bool wants_time,
                      struct text_table *table, struct format_notes *io_notes, struct error *out_error)
{
    char name[name_size], own_unit[name_size], whole[name_size];
    split_name(cell, unit, name, own_unit);
    if (!wants_time || !is_time(name)) {
        foreign_name(name[0] ? name : "column", own_unit, whole, sizeof whole);
        return record_table_add_column(table, whole, data, rows, out_error);
    }
    const double scale = time_scale(own_unit);
    for (size_t n = 0; n < rows; n++)
        data[n] *= scale;
    format_notes_add(io_notes, format_assumed, "time_s is %s in %s", name,
                     own_unit[0] ? own_unit : "seconds: the file gives no unit");
    return record_table_add_column(table, "time_s", data, rows, out_error);
}

static int read_rows(const struct foreign_text *text, const struct layout *layout, size_t rows, double **columns,
                     struct error *out_error)
{
    for (size_t n = 0; n < rows; n++) {
        struct foreign_cells cells;
        const size_t line = layout->first + n;
        int status = foreign_cells_split(text->lines[line], layout->separator, &cells, out_error);
        if (!status && cells.count < layout->columns)
            status = error_set(out_error, error_refused, "%s:%zu: %zu cells, expected %zu", text->path, line + 1,
                               cells.count, layout->columns);
        for (size_t c = 0; c < layout->columns && !status; c++) {
            columns[c][n] = NAN;
            if (cells.items[c][0] != '\0' && !foreign_number(cells.items[c], layout->decimal, &columns[c][n]))
                status = error_set(out_error, error_refused, "%s:%zu: cell %zu: '%s' is not a number", text->path,
                                   line + 1, c + 1, cells.items[c]);
        }
        foreign_cells_free(&cells);
        if (status)
            return status;
    }
    return 0;
}

/// All columns into the table; those not yet handed over are freed by the caller.
static int fill_table(const struct foreign_text *text, const struct layout *layout, size_t rows, double **columns,
                      bool wants_time, struct text_table *table, struct format_notes *io_notes, struct error *out_error)
{
    struct foreign_cells names = {0}, units = {0};
    int status = read_rows(text, layout, rows, columns, out_error);
    if (!status)
        status = foreign_cells_split(text->lines[layout->names], layout->separator, &names, out_error);
    if (!status && layout->units != SIZE_MAX)
        status = foreign_cells_split(text->lines[layout->units], layout->separator, &units, out_error);
    for (size_t c = 0; c < layout->columns && !status; c++) {
        const char *name = c < names.count ? names.items[c] : "";
        const char *unit = c < units.count ? bare_unit(units.items[c]) : "";
        double *data = columns[c];
        columns[c] = NULL;
        status =
            add_column(name, strcmp(unit, "-") == 0 ? "" : unit, data, rows, wants_time, table, io_notes, out_error);
    }
    foreign_cells_free(&names);
    foreign_cells_free(&units);
    return status;
}

/// Line numbers as the file has them, for what is said of a row.
static void number_lines(struct text_table *io_table, size_t first)
{
    for (size_t n = 0; n < io_table->rows; n++)
        io_table->row_line[n] = first + n + 1;
}

static int convert(const struct foreign_text *text, const struct format_options *options, struct run *out_run,
                   struct format_notes *io_notes, struct error *out_error)
{
    struct layout layout;
    int status = find_layout(text, &layout, out_error);
    if (status)
        return status;
    note_layout(&layout, io_notes);
    size_t rows = 0;
    while (layout.first + rows < text->count && !is_blank(text->lines[layout.first + rows]))
        rows++;
    struct text_table table;
    double **columns = calloc(layout.columns, sizeof *columns);
    status = record_table_start(&table, text->path, out_error);
    for (size_t c = 0; c < layout.columns && columns && !status; c++)
        if (!(columns[c] = malloc(rows * sizeof **columns)))
            status = error_set(out_error, error_refused, "%s: memory is short", text->path);
    if (!status && !columns)
        status = error_set(out_error, error_refused, "%s: memory is short", text->path);
    const bool wants_time = !options->run.map || !strstr(options->run.map, "time_s=");
    if (!status)
        status = fill_table(text, &layout, rows, columns, wants_time, &table, io_notes, out_error);
    for (size_t c = 0; c < layout.columns && columns; c++)
        free(columns[c]);
    free(columns);
    if (!status) {
        number_lines(&table, layout.first);
        return foreign_take_run(&table, options, out_run, io_notes, out_error);
    }
    text_table_free(&table);
    return status;
}

static int read_text(const char *path, const struct format_options *options, struct record *out_record,
                     struct format_notes *io_notes, struct error *out_error)
{
    struct foreign_text text;
    *out_record = (struct record){.kind = record_run};
    int status = foreign_text_read(path, &text, out_error);
    if (status)
        return status;
    status = convert(&text, options, &out_record->run, io_notes, out_error);
    foreign_text_free(&text);
    return status;
}

const struct record_format record_format_text = {
    .name = "text",
    .summary = "tables of other programs: tabs or semicolons, decimal commas, a row of units",
    .recognise = recognise,
    .read = read_text,
};
