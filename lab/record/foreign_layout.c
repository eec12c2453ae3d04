/* SPDX-License-Identifier: MIT */
#define _XOPEN_SOURCE 700 /* strcasecmp, strdup */
#include "lab/record/foreign_layout.h"

#include "lab/record/run_guess.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

enum { sampled_lines = 60, unit_size = 160 };

/// The lines that the layout is judged by.
struct sample {
    size_t count;
    size_t lines[sampled_lines];
};

static void take_sample(const struct foreign_text *text, struct sample *out)
{
    out->count = 0;
    for (size_t line = text->count; line > 0 && out->count < sampled_lines; line--)
        if (!foreign_line_is_blank(text->lines[line - 1]) && text->lines[line - 1][0] != '#')
            out->lines[out->count++] = line - 1;
}

/// Cells of a copy of a line, so that lines can be looked at more than once; *out_copy is the caller's.
static bool split_copy(const char *line, char separator, char **out_copy, struct foreign_cells *out_cells)
{
    struct error error;
    *out_cells = (struct foreign_cells){0};
    *out_copy = strdup(line);
    return *out_copy && foreign_cells_split(*out_copy, separator, out_cells, &error) == 0;
}

static size_t count_cells(const char *line, char separator)
{
    char *copy;
    struct foreign_cells cells;
    const size_t count = split_copy(line, separator, &copy, &cells) ? cells.count : 0;
    foreign_cells_free(&cells);
    free(copy);
    return count;
}

static size_t usual_count(const struct foreign_text *text, const struct sample *sample, char separator)
{
    size_t counts[sampled_lines];
    size_t best = 0;
    size_t most = 0;
    for (size_t i = 0; i < sample->count; i++)
        counts[i] = count_cells(text->lines[sample->lines[i]], separator);
    for (size_t i = 0; i < sample->count; i++) {
        size_t same = 0;
        for (size_t k = 0; k < sample->count; k++)
            same += counts[k] == counts[i];
        if (same > most) {
            most = same;
            best = counts[i];
        }
    }
    return best;
}

static enum foreign_kind kind_of(const char *cell, char decimal, bool *out_grouped)
{
    double value;
    struct foreign_stamp stamp;
    const enum foreign_value got = foreign_number(cell, decimal, &value);
    *out_grouped = got == foreign_value_grouped || got == foreign_value_proven;
    return got == foreign_value_missing       ? foreign_kind_empty
           : foreign_is_number(got)           ? foreign_kind_number
           : foreign_stamp_read(cell, &stamp) ? foreign_kind_stamp
                                              : foreign_kind_text;
}

/// How much of a line is numbers and times, 0 to 1. Marks between thousands need more faith than none.
static double score_cells(const struct foreign_cells *cells, char decimal)
{
    double score = 0.0;
    for (size_t at = 0; at < cells->count; at++) {
        bool grouped;
        const enum foreign_kind kind = kind_of(cells->items[at], decimal, &grouped);
        score += kind == foreign_kind_text ? 0.0 : kind == foreign_kind_empty ? 0.5 : grouped ? 0.9 : 1.0;
    }
    return cells->count ? score / (double)cells->count : 0.0;
}

static double score(const struct foreign_text *text, const struct sample *sample, char separator, char decimal,
                    size_t columns)
{
    double sum = 0.0;
    for (size_t i = 0; i < sample->count; i++) {
        char *copy;
        struct foreign_cells cells;
        if (split_copy(text->lines[sample->lines[i]], separator, &copy, &cells) && cells.count == columns)
            sum += score_cells(&cells, decimal);
        foreign_cells_free(&cells);
        free(copy);
    }
    // "1,234" between commas is in quotes because of its comma, which then is none of a decimal.
    return separator == ',' && decimal == ',' ? 0.85 * sum : sum;
}

/// "sep=;" in front is what a spreadsheet goes by.
static char declared_separator(const struct foreign_text *text)
{
    const char *line = text->count > 0 ? text->lines[0] : "";
    return strncasecmp(line, "sep=", 4) == 0 && line[4] != '\0' && line[5] == '\0' ? line[4] : '\0';
}

static void find_marks(const struct foreign_text *text, const struct sample *sample, struct foreign_layout *io)
{
    const char declared[2] = {declared_separator(text), '\0'};
    const char *separators = declared[0] ? declared : "\t;|, ";
    double best = 0.0;
    *io = (struct foreign_layout){.separator = separators[0], .decimal = '.'};
    for (const char *separator = separators; *separator; separator++) {
        const size_t columns = usual_count(text, sample, *separator);
        for (const char *decimal = ".,"; *decimal; decimal++) {
            const double own = score(text, sample, *separator, *decimal, columns);
            if (own > best + 1e-9 || (own > best - 1e-9 && own > 0.0 && columns > io->columns)) {
                best = own;
                io->separator = *separator;
                io->decimal = *decimal;
                io->columns = columns;
            }
        }
    }
}

/// What most of a column's cells are.
static enum foreign_kind usual_kind(const size_t seen[4])
{
    const size_t numbers = seen[foreign_kind_number], stamps = seen[foreign_kind_stamp],
                 texts = seen[foreign_kind_text];
    return numbers > 0 && numbers >= stamps && numbers >= texts ? foreign_kind_number
           : stamps > 0 && stamps >= texts                      ? foreign_kind_stamp
           : texts > 0                                          ? foreign_kind_text
                                                                : foreign_kind_empty;
}

static bool find_kinds(const struct foreign_text *text, const struct sample *sample, struct foreign_layout *io)
{
    size_t(*seen)[4] = calloc(io->columns + 1, sizeof *seen);
    io->kinds = calloc(io->columns + 1, sizeof *io->kinds);
    for (size_t i = 0; seen && io->kinds && i < sample->count; i++) {
        char *copy;
        struct foreign_cells cells;
        bool grouped;
        if (split_copy(text->lines[sample->lines[i]], io->separator, &copy, &cells) && cells.count == io->columns)
            for (size_t c = 0; c < cells.count; c++)
                seen[c][kind_of(cells.items[c], io->decimal, &grouped)]++;
        foreign_cells_free(&cells);
        free(copy);
    }
    for (size_t c = 0; seen && io->kinds && c < io->columns; c++)
        io->kinds[c] = usual_kind(seen[c]);
    const bool done = seen && io->kinds;
    free(seen);
    return done;
}

/// Whether a line is a row of values: as many cells, numbers and times where the others have them, and not all empty.
static bool is_row(const struct foreign_text *text, size_t line, const struct foreign_layout *layout)
{
    char *copy;
    struct foreign_cells cells;
    size_t values = 0;
    bool fits = split_copy(text->lines[line], layout->separator, &copy, &cells) && cells.count == layout->columns;
    for (size_t c = 0; fits && c < layout->columns; c++) {
        bool grouped;
        const enum foreign_kind kind = kind_of(cells.items[c], layout->decimal, &grouped);
        const enum foreign_kind usual = layout->kinds[c];
        const bool judged = usual == foreign_kind_number || usual == foreign_kind_stamp;
        fits = !judged || kind == usual || kind == foreign_kind_empty;
        values += judged && kind == usual;
    }
    foreign_cells_free(&cells);
    free(copy);
    return fits && values > 0;
}

static size_t next_line(const struct foreign_text *text, size_t line)
{
    do
        line++;
    while (line < text->count && foreign_line_is_blank(text->lines[line]));
    return line;
}

/// The first row: a line like the rows with another such line behind it, so that a row of numbers among the names is
/// none.
static bool find_first(const struct foreign_text *text, struct foreign_layout *io)
{
    for (io->first = 0; io->first < text->count; io->first++) {
        if (foreign_line_is_blank(text->lines[io->first]) || !is_row(text, io->first, io))
            continue;
        const size_t next = next_line(text, io->first);
        if (next >= text->count || is_row(text, next, io))
            return true;
    }
    return false;
}

void foreign_bare_unit(const char *cell, char *out_unit, size_t size)
{
    const size_t length = strlen(cell);
    const bool bracket = length > 1 && strchr("[(", cell[0]) && strchr("])", cell[length - 1]);
    snprintf(out_unit, size, "%.*s", (int)(bracket ? length - 2 : length), bracket ? cell + 1 : cell);
    if (strcmp(out_unit, "-") == 0)
        out_unit[0] = '\0';
}

bool foreign_is_unit(const char *cell)
{
    static const char *const others[] = {"",   "-",   "1",  "%",  "bool", "rad/s^2", "m/s^2", "hz",
                                         "kg", "bar", "°C", "°F", "inc",  "counts",  "cnt",   "hh:mm:ss"};
    char unit[unit_size], name[unit_size + 8];
    double scale;
    for (size_t i = 0; i < sizeof others / sizeof others[0]; i++)
        if (strcasecmp(cell, others[i]) == 0)
            return true;
    foreign_bare_unit(cell, unit, sizeof unit);
    if (strpbrk(unit, "[("))
        return false; // "Moment [Nm]" is a name
    foreign_name("x", unit, name, sizeof name);
    return strcmp(unit, cell) != 0 || run_guess_scale(name, &scale) || run_guess_time_scale(name, &scale);
}

/// Whether a line in front of the rows holds units: as many cells, most of them units.
static bool is_units_row(const struct foreign_text *text, size_t line, const struct foreign_layout *layout)
{
    char *copy;
    struct foreign_cells cells;
    size_t units = 0;
    size_t filled = 0;
    bool fits = split_copy(text->lines[line], layout->separator, &copy, &cells) && cells.count <= layout->columns + 1 &&
                cells.count + 1 >= layout->columns;
    for (size_t at = 0; fits && at < cells.count; at++) {
        filled += cells.items[at][0] != '\0';
        units += cells.items[at][0] != '\0' && foreign_is_unit(cells.items[at]);
    }
    foreign_cells_free(&cells);
    free(copy);
    return fits && units > 0 && 2 * units >= filled;
}

/// The nearest line above that is not blank, SIZE_MAX if there is none.
static size_t line_above(const struct foreign_text *text, size_t line)
{
    while (line > 0 && foreign_line_is_blank(text->lines[line - 1]))
        line--;
    return line > 0 ? line - 1 : SIZE_MAX;
}

/// Whether a line may be the row of names; one more cell is a separator at the line's end.
static bool is_names_row(const struct foreign_text *text, size_t line, const struct foreign_layout *layout, bool hash)
{
    const char *row = text->lines[line] + (hash ? strspn(text->lines[line], "# ") : 0);
    const size_t count = count_cells(row, layout->separator);
    return count == layout->columns || count == layout->columns + 1 ||
           (count + 1 == layout->columns && layout->columns > 2 &&
            layout->kinds[layout->columns - 1] == foreign_kind_empty);
}

static int find_names(const struct foreign_text *text, struct foreign_layout *io, struct error *out_error)
{
    io->names = io->units = SIZE_MAX;
    size_t line = line_above(text, io->first);
    const bool hash = line != SIZE_MAX && text->lines[line][0] == '#';
    if (hash && is_names_row(text, line, io, true)) {
        io->names = line;
        io->names_behind_hash = true;
        return 0;
    }
    while (line != SIZE_MAX && text->lines[line][0] == '#')
        line = line_above(text, line);
    if (line == SIZE_MAX)
        return 0;
    const size_t above = is_units_row(text, line, io) ? line_above(text, line) : SIZE_MAX;
    if (above != SIZE_MAX && text->lines[above][0] != '#' && is_names_row(text, above, io, false)) {
        io->units = line;
        line = above;
    }
    if (is_names_row(text, line, io, false)) {
        io->names = line;
        return 0;
    }
    const size_t count = count_cells(text->lines[line], io->separator);
    if (2 * count != io->columns || io->separator != ',')
        return 0;
    return error_set(out_error, error_refused,
                     "%s:%zu: %zu cells between commas, but the row of names (line %zu) has %zu: decimal commas cannot "
                     "be told from those between cells; expected another separator, or quotes around the numbers",
                     text->path, io->first + 1, io->columns, line + 1, count);
}

int foreign_layout_find(const struct foreign_text *text, struct foreign_layout *out_self, struct error *out_error)
{
    struct sample sample;
    take_sample(text, &sample);
    find_marks(text, &sample, out_self);
    if (out_self->columns > 0 && !find_kinds(text, &sample, out_self)) {
        foreign_layout_free(out_self);
        return error_set(out_error, error_refused, "%s: memory is short", text->path);
    }
    int status = out_self->columns > 0 && find_first(text, out_self)
                     ? find_names(text, out_self, out_error)
                     : error_set(out_error, error_refused, "%s: no row of numbers was found", text->path);
    if (status)
        foreign_layout_free(out_self);
    return status;
}

void foreign_layout_free(struct foreign_layout *self)
{
    free(self->kinds);
    self->kinds = NULL;
}
