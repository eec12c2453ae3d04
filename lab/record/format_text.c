/* SPDX-License-Identifier: MIT */
/// Recordings of other programs as text: cells between tabs, semicolons, commas, bars or blanks, a point or a comma as
/// decimal mark, marks between thousands, times of day, lines of anything in front, one row of names, perhaps a row of
/// units. What was assumed of them is noted.
#define _XOPEN_SOURCE 700 /* strcasecmp, strdup */
#include "lab/record/foreign_layout.h"
#include "lab/record/foreign_text.h"
#include "lab/record/format.h"
#include "lab/record/record_table.h"
#include "lab/record/run_guess.h"
#include "lab/record/run_names.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

enum { name_size = 160, kept_lines_max = 200 };

/// What is read: the file, how it is laid out, and the values found so far.
struct table_reader {
    const struct foreign_text *text;
    const struct format_options *options;
    struct format_notes *notes;
    struct foreign_layout layout;
    struct text_table table;
    size_t rows;
    size_t *lines;               ///< of each row
    double **columns;            ///< NULL for those that hold no values
    struct foreign_stamp *first; ///< of each column of times
    struct foreign_stamp *last;  ///< the same
    size_t grouped_line;         ///< where marks between thousands were taken for such without proof; 0: nowhere
    char grouped_cell[32];       ///< what stands there
    bool proven, repeated;       ///< such marks are proven; two stamps are equal
};

static int short_of_memory(const struct table_reader *self, struct error *out_error)
{
    return error_set(out_error, error_refused, "%s: memory is short", self->text->path);
}

// ---- Whose file it is

/// Whether a row of names has one of a run's own, times aside, or those of a response.
static bool has_own_name(const char *line)
{
    char *copy = strdup(line);
    struct foreign_cells cells = {0};
    struct error error;
    bool own = !copy;
    if (copy && foreign_cells_split(copy, ',', &cells, &error) == 0)
        for (size_t i = 0; i < cells.count && !own; i++)
            own = strcmp(cells.items[i], "frequency_hz") == 0 ||
                  (run_name_axis(cells.items[i]) != run_axis_unknown && strcmp(cells.items[i], "time_s") != 0);
    foreign_cells_free(&cells);
    free(copy);
    return own;
}

/// What one line says: sure that it is foreign, none that it is not; maybe: nothing.
static enum format_match judge_line(const char *line)
{
    if (line[0] == '#' || foreign_line_is_blank(line))
        return format_match_maybe;
    if (line[0] == '{' || line[0] == '<' || line[0] == '[')
        return format_match_none;
    if (strchr(line, ';') || strchr(line, '|') || (strchr(line, '\t') && !strchr(line, ',')))
        return format_match_sure;
    if (has_own_name(line))
        return format_match_none;
    const size_t numbers = strspn(line, "0123456789.,+-eE \t");
    if (strchr(line, ',') || (line[numbers] == '\0' && strpbrk(line, "0123456789")))
        return format_match_sure;
    return format_match_maybe;
}

/// Servoscope's own files have commas, and names of their own; what else has rows of numbers is foreign.
static enum format_match recognise(const unsigned char *head, size_t length)
{
    // A universal file begins with its mark, which is a number, and has keys in it that look like cells.
    const bool other = length >= 6 && (memcmp(head, "MATLAB", 6) == 0 || memcmp(head, "    -1", 6) == 0);
    char *text = other ? NULL : foreign_text_head(head, length);
    enum format_match match = text ? format_match_maybe : format_match_none;
    char *rest = NULL;
    for (char *line = text ? strtok_r(text, "\r\n", &rest) : NULL; line && match == format_match_maybe;
         line = strtok_r(NULL, "\r\n", &rest))
        match = judge_line(line);
    free(text);
    return match == format_match_sure ? match : format_match_none;
}

// ---- Values

static void look_at_groups(struct table_reader *self, enum foreign_value value, const char *cell, size_t line)
{
    self->proven = self->proven || value == foreign_value_proven;
    if (value == foreign_value_grouped && self->grouped_line == 0) {
        self->grouped_line = line + 1;
        snprintf(self->grouped_cell, sizeof self->grouped_cell, "%s", cell);
    }
}

static int wrong_cell(const struct table_reader *self, size_t line, size_t cell, const char *text, const char *expected,
                      struct error *out_error)
{
    return error_set(out_error, error_refused, "%s:%zu: cell %zu: '%.40s' is not a %s", self->text->path, line + 1,
                     cell + 1, text, expected);
}

/// Seconds since the first stamp of the column.
static int read_stamp(struct table_reader *self, size_t column, size_t line, const char *cell, double *out_value,
                      struct error *out_error)
{
    struct foreign_stamp stamp;
    double none;
    *out_value = NAN;
    if (foreign_number(cell, self->layout.decimal, &none) == foreign_value_missing)
        return 0;
    if (!foreign_stamp_read(cell, &stamp))
        return wrong_cell(self, line, column, cell, "time of day", out_error);
    if (self->rows == 0)
        self->first[column] = stamp;
    else
        self->repeated = self->repeated || foreign_stamp_seconds(&self->last[column], &stamp) == 0.0;
    self->last[column] = stamp;
    *out_value = foreign_stamp_seconds(&self->first[column], &stamp);
    return 0;
}

static int read_cell(struct table_reader *self, size_t column, size_t line, const char *cell, struct error *out_error)
{
    double *out = &self->columns[column][self->rows];
    if (self->layout.kinds[column] == foreign_kind_stamp)
        return read_stamp(self, column, line, cell, out, out_error);
    const enum foreign_value value = foreign_number(cell, self->layout.decimal, out);
    look_at_groups(self, value, cell, line);
    return value == foreign_value_text ? wrong_cell(self, line, column, cell, "number", out_error) : 0;
}

/// Whether cells are none of a row: no number among them, or another count of cells and not all of them numbers.
static bool is_footer(const struct table_reader *self, const struct foreign_cells *cells)
{
    size_t values = 0;
    for (size_t c = 0; c < cells->count; c++) {
        double value;
        values += foreign_is_number(foreign_number(cells->items[c], self->layout.decimal, &value));
    }
    return values == 0 || (cells->count != self->layout.columns && values < cells->count);
}

/// One line as a row. *out_footer: it is none, and may be the first of the lines behind the values.
static int read_row(struct table_reader *self, size_t line, bool *out_footer, struct error *out_error)
{
    struct foreign_cells cells;
    const size_t columns = self->layout.columns;
    *out_footer = false;
    char *copy = strdup(self->text->lines[line]);
    if (!copy)
        return short_of_memory(self, out_error);
    int status = foreign_cells_split(copy, self->layout.separator, &cells, out_error);
    *out_footer = !status && is_footer(self, &cells);
    const bool more = cells.count > columns && cells.items[columns][0] != '\0';
    if (!status && !*out_footer && (cells.count < columns || more))
        status = error_set(out_error, error_refused, "%s:%zu: %zu cells, expected %zu", self->text->path, line + 1,
                           cells.count, columns);
    for (size_t c = 0; !status && !*out_footer && c < columns; c++)
        if (self->columns[c])
            status = read_cell(self, c, line, cells.items[c], out_error);
    foreign_cells_free(&cells);
    free(copy);
    return status;
}

/// Lines behind the last row: what stands there is no value, as none follows it.
static int end_rows(struct table_reader *self, size_t line, struct error *out_error)
{
    struct foreign_text const *text = self->text;
    size_t count = 0;
    for (size_t at = line; at < text->count; at++) {
        if (foreign_line_is_blank(text->lines[at]))
            continue;
        bool footer;
        struct error error;
        if (read_row(self, at, &footer, &error) != 0 || !footer)
            return error_set(out_error, error_refused,
                             "%s:%zu: '%.40s' is no row of %zu values, but line %zu goes on with values: expected one "
                             "table",
                             text->path, line + 1, text->lines[line], self->layout.columns, at + 1);
        count++;
    }
    format_notes_add(self->notes, format_lost, "%zu line%s behind the values, the first is line %zu: '%.60s'", count,
                     count == 1 ? "" : "s", line + 1, text->lines[line]);
    return 0;
}

static int read_rows(struct table_reader *self, struct error *out_error)
{
    const struct foreign_text *text = self->text;
    size_t comments = 0;
    int status = 0;
    for (size_t line = self->layout.first; line < text->count && !status; line++) {
        bool footer;
        if (foreign_line_is_blank(text->lines[line]) || text->lines[line][0] == '#') {
            comments += text->lines[line][0] == '#';
            continue;
        }
        status = read_row(self, line, &footer, out_error);
        if (footer && !status)
            return end_rows(self, line, out_error);
        self->lines[self->rows++] = line + 1;
    }
    if (!status && comments > 0)
        format_notes_add(self->notes, format_lost, "%zu comments between the rows", comments);
    return status;
}

static int check_groups(const struct table_reader *self, struct error *out_error)
{
    const char other = self->layout.decimal == ',' ? '.' : ',';
    if (self->grouped_line == 0)
        return 0;
    if (!self->proven)
        return error_set(out_error, error_refused,
                         "%s:%zu: '%s' may be thousands or decimals, and no other cell tells: expected numbers without "
                         "marks between thousands",
                         self->text->path, self->grouped_line, self->grouped_cell);
    format_notes_add(self->notes, format_assumed, "'%c' stands between thousands, as in '%s' (line %zu)", other,
                     self->grouped_cell, self->grouped_line);
    return 0;
}

// ---- Names

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

/// Whether a name without its unit is one for the time, "Zeit", "time_us".
static bool is_time(const char *name)
{
    static const char *const names[] = {"t",        "time",      "zeit",         "timestamp",     "time stamp",
                                        "temps",    "tiempo",    "tempo",        "zeitstempel",   "x_value",
                                        "elapsed",  "x-axis",    "elapsed time", "relative time", "datum/zeit",
                                        "datetime", "date/time", "uhrzeit",      "date time",     "zeitpunkt",
                                        "seconds",  "rel. time", "clock",        "date_time",     "time_stamp"};
    char bare[name_size];
    double scale;
    snprintf(bare, sizeof bare, "%s", name);
    size_t last = strlen(bare);
    while (last > 0 && bare[last] != '_' && bare[last] != ' ')
        last--;
    if (last > 0 && run_guess_time_scale(bare, &scale))
        bare[last] = '\0';
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++)
        if (strcasecmp(bare, names[i]) == 0)
            return true;
    return false;
}

/// The unit of a column of times: what brings it to seconds. A unit that is not known is asked for.
static int find_time_scale(const struct table_reader *self, const char *name, const char *unit, double *out_scale,
                           struct error *out_error)
{
    char whole[name_size + 8];
    *out_scale = 1.0;
    foreign_name(name, unit, whole, sizeof whole);
    if (run_guess_time_scale(whole, out_scale) || (unit[0] == '\0')) {
        const bool silent = unit[0] == '\0' && !run_guess_time_scale(whole, out_scale);
        if (unit[0])
            format_notes_add(self->notes, format_assumed, "time_s is %s in %s", name, unit);
        else
            format_notes_add(self->notes, format_assumed, "time_s is %s%s", name,
                             silent ? " in seconds: the file gives no unit" : ", in the unit of its name");
        return 0;
    }
    return error_set(out_error, error_refused,
                     "%s:%zu: '%s' is a column of times in '%s', which is no unit that is known: expected --map "
                     "time_s=%s*SECONDS or --rate HZ",
                     self->text->path, self->layout.names + 1, name, unit, name);
}

static bool has_column(const struct text_table *table, const char *name)
{
    for (size_t c = 0; c < table->column_count; c++)
        if (strcmp(table->columns[c].name, name) == 0)
            return true;
    return false;
}

/// Adds a column under a name that no other has.
static int add_named(struct table_reader *self, const char *name, const char *unit, double *data,
                     struct error *out_error)
{
    char own[name_size], whole[2 * name_size];
    foreign_name(name, unit, whole, sizeof whole);
    for (int number = 2; has_column(&self->table, whole); number++) {
        snprintf(own, sizeof own, "%.*s_%d", name_size - 16, name, number);
        foreign_name(own, unit, whole, sizeof whole);
        if (!has_column(&self->table, whole))
            format_notes_add(self->notes, format_kept, "another column %s as %s", name, whole);
    }
    return record_table_add_column(&self->table, whole, data, self->rows, out_error);
}

/// Stamps as the time since the first one. Those that are coarser than the samples are no clock.
static int add_stamps(struct table_reader *self, size_t column, const char *name, double *data, struct error *out_error)
{
    if (self->repeated && self->options->run.rate_hz > 0.0) {
        free(data);
        format_notes_add(self->notes, format_lost, "%s: its times are coarser than the samples", name);
        return 0;
    }
    if (self->repeated) {
        free(data);
        return error_set(out_error, error_refused,
                         "%s: %s: two rows have the same time, which is coarser than the samples: expected --rate HZ",
                         self->text->path, name);
    }
    format_notes_add(self->notes, format_assumed, "time_s is %s, from its first time on%s", name,
                     self->first[column].dated ? "" : ", a time of day without a date that counts");
    return record_table_add_column(&self->table, "time_s", data, self->rows, out_error);
}

/// Whether the column is to become time_s: the first one that looks like it, unless the map says another.
static bool wants_time(const struct table_reader *self)
{
    const char *map = self->options->run.map;
    return (!map || !strstr(map, "time_s=")) && !has_column(&self->table, "time_s");
}

/// Hands a column over to the table; `data` is no longer the caller's.
static int add_column(struct table_reader *self, size_t column, const char *cell, const char *unit, double *data,
                      struct error *out_error)
{
    char name[name_size], own_unit[name_size];
    double scale = 1.0;
    split_name(cell, unit, name, own_unit);
    if (name[0] == '\0')
        snprintf(name, sizeof name, "column_%zu", column + 1);
    if (self->layout.kinds[column] == foreign_kind_stamp && wants_time(self))
        return add_stamps(self, column, name, data, out_error);
    if (self->layout.kinds[column] == foreign_kind_stamp || !is_time(name) || !wants_time(self) ||
        (own_unit[0] && self->options->run.rate_hz > 0.0))
        return add_named(self, name, own_unit, data, out_error);
    int status = find_time_scale(self, name, own_unit, &scale, out_error);
    if (status) {
        free(data);
        return status;
    }
    for (size_t n = 0; n < self->rows; n++)
        data[n] *= scale;
    return record_table_add_column(&self->table, "time_s", data, self->rows, out_error);
}

/// A column that holds no values is said, unless it has no name either: a separator at the ends of the lines.
static void note_without_values(const struct table_reader *self, size_t column, const char *name)
{
    struct foreign_cells cells = {0};
    struct error error;
    char *copy = strdup(self->text->lines[self->layout.first]);
    const bool text = self->layout.kinds[column] == foreign_kind_text;
    const bool split = copy && foreign_cells_split(copy, self->layout.separator, &cells, &error) == 0;
    if (text || name[0])
        format_notes_add(self->notes, format_lost, "column %zu, %s: %s%.40s%s", column + 1, name[0] ? name : "unnamed",
                         text ? "holds no numbers but '" : "is empty",
                         text && split && column < cells.count ? cells.items[column] : "",
                         text ? "' and the like" : "");
    foreign_cells_free(&cells);
    free(copy);
}

/// A row of the head taken apart; empty where the file has none.
static int split_head(const struct table_reader *self, size_t line, bool hash, char **out_copy,
                      struct foreign_cells *out_cells, struct error *out_error)
{
    *out_cells = (struct foreign_cells){0};
    *out_copy = NULL;
    if (line == SIZE_MAX)
        return 0;
    const char *row = self->text->lines[line];
    *out_copy = strdup(row + (hash ? strspn(row, "# ") : 0));
    return *out_copy ? foreign_cells_split(*out_copy, self->layout.separator, out_cells, out_error)
                     : short_of_memory(self, out_error);
}

/// All columns into the table.
static int fill_table(struct table_reader *self, struct error *out_error)
{
    const struct foreign_layout *layout = &self->layout;
    struct foreign_cells names = {0}, units = {0};
    char *names_copy = NULL;
    char *units_copy = NULL;
    int status = split_head(self, layout->names, layout->names_behind_hash, &names_copy, &names, out_error);
    if (!status)
        status = split_head(self, layout->units, false, &units_copy, &units, out_error);
    for (size_t c = 0; c < layout->columns && !status; c++) {
        char unit[name_size] = "";
        const char *name = c < names.count ? names.items[c] : "";
        double *data = self->columns[c];
        self->columns[c] = NULL;
        foreign_bare_unit(c < units.count ? units.items[c] : "", unit, sizeof unit);
        if (data)
            status = add_column(self, c, name, unit, data, out_error);
        else
            note_without_values(self, c, name);
    }
    foreign_cells_free(&names);
    foreign_cells_free(&units);
    free(names_copy);
    free(units_copy);
    if (!status && self->table.column_count == 0)
        status = error_set(out_error, error_refused, "%s: no column holds numbers", self->text->path);
    return status;
}

static int keep_line(struct table_reader *self, char *text, struct error *out_error)
{
    char *colon = text[0] == '#' ? strchr(text, ':') : NULL;
    if (colon)
        *colon = '\0';
    const char *key = colon ? text + strspn(text, "# ") : "";
    const char *value = colon ? colon + 1 : text;
    return record_table_add_key(&self->table, key, value + strspn(value, "# "), out_error);
}

/// What stands in front of the names: keys where a line is `# key: value`, comments else.
static int keep_head(struct table_reader *self, struct error *out_error)
{
    const size_t end = self->layout.names < self->layout.first ? self->layout.names : self->layout.first;
    size_t kept = 0;
    int status = 0;
    for (size_t line = 0; line < end && !status; line++) {
        char *text = self->text->lines[line];
        if (foreign_line_is_blank(text) || strncasecmp(text, "sep=", 4) == 0 || ++kept > kept_lines_max)
            continue;
        status = keep_line(self, text, out_error);
    }
    if (!status && kept > 0)
        format_notes_add(self->notes, format_kept, "%zu line%s in front of the names, as keys and comments",
                         kept > kept_lines_max ? (size_t)kept_lines_max : kept, kept == 1 ? "" : "s");
    if (kept > kept_lines_max)
        format_notes_add(self->notes, format_lost, "%zu more lines in front of the names", kept - kept_lines_max);
    return status;
}

// ---- All of it

static void note_layout(const struct table_reader *self)
{
    const struct foreign_layout *layout = &self->layout;
    const char *between = layout->separator == '\t'  ? "tabs"
                          : layout->separator == ';' ? "semicolons"
                          : layout->separator == ',' ? "commas"
                          : layout->separator == ' ' ? "blanks"
                                                     : "bars";
    char names[80] = "no names: columns are called column_1, column_2, ...";
    if (self->text->encoding != foreign_utf8)
        format_notes_add(self->notes, format_assumed, "characters are %s",
                         self->text->encoding == foreign_utf16 ? "UTF-16" : "Windows-1252, as they are no UTF-8");
    if (layout->names != SIZE_MAX)
        snprintf(names, sizeof names, "names in line %zu%s", layout->names + 1,
                 layout->units == SIZE_MAX ? "" : ", units behind it");
    format_notes_add(self->notes, format_assumed, "cells between %s, decimal %s, %s, values from line %zu", between,
                     layout->decimal == ',' ? "comma" : "point", names, layout->first + 1);
}

static bool make_room(struct table_reader *self)
{
    const size_t columns = self->layout.columns;
    const size_t most = self->text->count - self->layout.first;
    self->lines = malloc(most * sizeof *self->lines);
    self->columns = calloc(columns, sizeof *self->columns);
    self->first = calloc(columns, sizeof *self->first);
    self->last = calloc(columns, sizeof *self->last);
    bool done = self->lines && self->columns && self->first && self->last;
    for (size_t c = 0; c < columns && done; c++)
        if (self->layout.kinds[c] == foreign_kind_number || self->layout.kinds[c] == foreign_kind_stamp)
            done = (self->columns[c] = malloc(most * sizeof **self->columns)) != NULL;
    return done;
}

static void free_reader(struct table_reader *self)
{
    for (size_t c = 0; self->columns && c < self->layout.columns; c++)
        free(self->columns[c]);
    free(self->columns);
    free(self->lines);
    free(self->first);
    free(self->last);
    foreign_layout_free(&self->layout);
    text_table_free(&self->table);
}

static int make_table(struct table_reader *self, struct error *out_error)
{
    int status = foreign_layout_find(self->text, &self->layout, out_error);
    if (status)
        return status;
    note_layout(self);
    status = make_room(self) ? record_table_start(&self->table, self->text->path, out_error)
                             : short_of_memory(self, out_error);
    status = status ? status : read_rows(self, out_error);
    status = status ? status : check_groups(self, out_error);
    status = status ? status : keep_head(self, out_error);
    status = status ? status : fill_table(self, out_error);
    // Line numbers as the file has them, for what is said of a row.
    for (size_t n = 0; !status && n < self->rows; n++)
        self->table.row_line[n] = self->lines[n];
    if (!status && self->layout.names != SIZE_MAX)
        self->table.names_line = self->layout.names + 1;
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
    struct table_reader self = {.text = &text, .options = options, .notes = io_notes};
    status = make_table(&self, out_error);
    if (!status)
        status = foreign_take_run(&self.table, options, &out_record->run, io_notes, out_error);
    free_reader(&self);
    foreign_text_free(&text);
    return status;
}

const struct record_format record_format_text = {
    .name = "text",
    .summary = "tables of other programs: tabs, semicolons or commas, decimal commas, times of day, a row of units",
    .recognise = recognise,
    .read = read_text,
};
