/* SPDX-License-Identifier: MIT */
#include "lab/record/text_stream.h"

#include "lab/record/line_reader.h"
#include "lab/record/number.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum {
    columns_max = 4096,
    shown_max = 40, /* characters of a cell that a message quotes */
};

struct cell {
    const char *text;
    size_t length;
    bool quoted;
};

static bool is_blank(const char *text, size_t length)
{
    for (size_t i = 0; i < length; i++)
        if (text[i] != ' ' && text[i] != '\t')
            return false;
    return true;
}

/* Takes the blanks off both ends. */
static struct cell trim(const char *at, const char *end)
{
    while (at < end && is_blank(at, 1))
        at++;
    while (end > at && is_blank(end - 1, 1))
        end--;
    return (struct cell){.text = at, .length = (size_t)(end - at)};
}

/* Position of the quote that ends a quoted cell, or the end; a doubled quote stands for one. */
static const char *find_closing_quote(const char *at, const char *end)
{
    while (at < end) {
        if (*at == '"' && !(at + 1 < end && at[1] == '"'))
            return at;
        at += *at == '"' ? 2 : 1;
    }
    return end;
}

/* The cell at `at` and where the next one starts; NULL after the last. Quotes protect commas. */
static const char *next_cell(const char *at, const char *end, struct cell *out_cell)
{
    while (at < end && is_blank(at, 1))
        at++;
    bool quoted = at < end && *at == '"';
    const char *stop = quoted ? find_closing_quote(at + 1, end) : at;
    const char *comma = memchr(stop, ',', (size_t)(end - stop));
    if (quoted)
        *out_cell = (struct cell){.text = at + 1, .length = (size_t)(stop - at - 1), .quoted = true};
    else
        *out_cell = trim(at, comma ? comma : end);
    return comma ? comma + 1 : NULL;
}

static char *copy_text(const char *text, size_t length)
{
    char *copy = malloc(length + 1);
    if (copy) {
        memcpy(copy, text, length);
        copy[length] = '\0';
    }
    return copy;
}

static char *copy_cell(const struct cell *cell)
{
    char *copy = copy_text(cell->text, cell->length);
    if (!copy || !cell->quoted)
        return copy;
    size_t kept = 0;
    for (size_t i = 0; copy[i]; i++) {
        copy[kept++] = copy[i];
        i += copy[i] == '"' && copy[i + 1] == '"';
    }
    copy[kept] = '\0';
    return copy;
}

/// Line of the last row or key that was read, for messages.
static size_t line_number(const struct text_stream *self)
{
    return line_reader_number(self->lines);
}

static int short_of_memory(const struct text_stream *self, struct error *out_error)
{
    return error_set(out_error, error_refused, "%s:%zu: memory is short", self->table.path, line_number(self));
}

/* `# key: value`; a comment without a colon is kept under the empty key. */
static int read_key(struct text_stream *self, const struct line *line, struct error *out_error)
{
    struct text_table *table = &self->table;
    const char *at = line->text + 1, *end = line->text + line->length;
    const char *colon = memchr(at, ':', (size_t)(end - at));
    struct cell key = trim(at, colon ? colon : at), value = trim(colon ? colon + 1 : at, end);

    struct run_key *keys = realloc(table->keys, (table->key_count + 1) * sizeof *keys);
    if (keys)
        table->keys = keys;
    size_t *key_line = realloc(table->key_line, (table->key_count + 1) * sizeof *key_line);
    if (key_line)
        table->key_line = key_line;
    char *key_text = copy_text(key.text, key.length), *value_text = copy_text(value.text, value.length);
    if (!keys || !key_line || !key_text || !value_text) {
        free(key_text);
        free(value_text);
        return short_of_memory(self, out_error);
    }
    table->keys[table->key_count] = (struct run_key){key_text, value_text};
    table->key_line[table->key_count++] = line->number;
    return error_none;
}

static int add_name(struct text_stream *self, const struct cell *cell, struct error *out_error)
{
    struct text_table *table = &self->table;
    if (table->column_count == columns_max)
        return error_set(out_error, error_refused, "%s:%zu: more than %d columns", table->path, table->names_line,
                         columns_max);
    struct run_column *columns = realloc(table->columns, (table->column_count + 1) * sizeof *columns);
    if (columns)
        table->columns = columns;
    char **names = realloc(self->cell_names, (table->column_count + 1) * sizeof *names);
    if (names)
        self->cell_names = names;
    char *name = copy_cell(cell), *copy = name ? copy_text(name, strlen(name)) : NULL;
    if (!columns || !names || !copy) {
        free(name);
        return short_of_memory(self, out_error);
    }
    columns[table->column_count++] = (struct run_column){.name = name};
    names[self->cell_count++] = copy;
    return error_none;
}

static int check_names(const struct text_table *table, struct error *out_error)
{
    double value;
    for (size_t c = 0; c < table->column_count; c++) {
        const char *name = table->columns[c].name;
        if (number_parse(name, strlen(name), &value) == number_ok)
            return error_set(out_error, error_refused,
                             "%s:%zu: '%.*s' is a number, the row of column names was expected first", table->path,
                             table->names_line, shown_max, name);
    }
    const char *only = table->columns[0].name;
    if (table->column_count == 1 && (strchr(only, ';') || strchr(only, '\t')))
        return error_set(out_error, error_refused,
                         "%s:%zu: columns are separated by %s: commas were expected, and a point as decimal mark; "
                         "'servoscope convert' makes such a file of it",
                         table->path, table->names_line, strchr(only, ';') ? "semicolons" : "tabs");
    return error_none;
}

static int read_names(struct text_stream *self, const struct line *line, text_table_judge judge, void *context,
                      struct error *out_error)
{
    struct text_table *table = &self->table;
    table->names_line = line->number;
    const char *at = line->text, *end = at + line->length;
    while (at) {
        struct cell cell;
        at = next_cell(at, end, &cell);
        int status = add_name(self, &cell, out_error);
        if (status)
            return status;
    }
    int status = check_names(table, out_error);
    if (status)
        return status;
    self->kinds = calloc(table->column_count, sizeof *self->kinds);
    if (!self->kinds)
        return short_of_memory(self, out_error);
    for (size_t c = 0; c < table->column_count; c++)
        self->kinds[c] = judge(context, table->columns[c].name);
    return error_none;
}

/* Room for `rows` rows in every column, those behind the file's own too. */
static bool make_room(struct text_stream *self, size_t rows)
{
    struct text_table *table = &self->table;
    if (rows > SIZE_MAX / sizeof(double))
        return false;
    for (size_t c = 0; c < table->column_count; c++) {
        double *grown = realloc(table->columns[c].data, rows * sizeof *grown);
        if (!grown)
            return false;
        table->columns[c].data = grown;
    }
    size_t *lines = realloc(table->row_line, rows * sizeof *lines);
    if (!lines)
        return false;
    table->row_line = lines;
    self->capacity = rows;
    self->columns_with_room = table->column_count;
    return true;
}

static int read_cell(const struct text_stream *self, size_t column, const struct cell *cell, double *out_value,
                     struct error *out_error)
{
    enum number_status status = number_parse(cell->text, cell->length, out_value);
    if (status == number_ok)
        return error_none;
    *out_value = NAN;
    enum text_cell kind = self->kinds[column];
    if (kind == text_cell_free || (kind == text_cell_number_or_empty && status == number_empty))
        return error_none;
    int shown = cell->length < shown_max ? (int)cell->length : shown_max;
    return error_set(out_error, error_refused, "%s:%zu: %s: '%.*s' %s", self->table.path, line_number(self),
                     self->cell_names[column], shown, cell->text, number_status_str(status));
}

/* Most rows are nothing but plain numbers and commas. Returns how many cells are; *out_at is what follows them, NULL at
 * the end of the row. */
static size_t read_plain_cells(const struct text_stream *self, const char *at, const char *end, const char **out_at)
{
    const struct text_table *table = &self->table;
    size_t count = 0;
    while (at && count < self->cell_count) {
        const char *stop = number_read(at, end, &table->columns[count].data[table->rows]);
        if (!stop || (stop < end && *stop != ','))
            break;
        at = stop < end ? stop + 1 : NULL;
        count++;
    }
    *out_at = at;
    return count;
}

static int read_row(struct text_stream *self, const struct line *line, struct error *out_error)
{
    struct text_table *table = &self->table;
    const char *at, *end = line->text + line->length;
    size_t count = read_plain_cells(self, line->text, end, &at);
    for (; at; count++) {
        struct cell cell;
        at = next_cell(at, end, &cell);
        if (count >= self->cell_count)
            continue;
        int status = read_cell(self, count, &cell, &table->columns[count].data[table->rows], out_error);
        if (status)
            return status;
    }
    if (count != self->cell_count)
        return error_set(out_error, error_refused, "%s:%zu: row has %zu cells, the row of names (line %zu) has %zu%s",
                         table->path, line->number, count, table->names_line, self->cell_count,
                         count == 2 * self->cell_count ? ": decimal commas? A point was expected" : "");
    table->row_line[table->rows++] = line->number;
    self->row_total++;
    return error_none;
}

static int read_header(struct text_stream *self, text_table_judge judge, void *context, struct error *out_error)
{
    while (self->cell_count == 0) {
        struct line line;
        enum line_status read = line_reader_next(self->lines, &line, out_error);
        if (read == line_failed)
            return error_refused;
        if (read == line_end && line_number(self) == 0)
            return error_set(out_error, error_refused, "%s: the file is empty: a row of column names was expected",
                             self->table.path);
        if (read == line_end)
            return error_set(out_error, error_refused, "%s:%zu: the file ends without a row of column names",
                             self->table.path, line_number(self) + 1);
        int status = error_none;
        if (line.length > 0 && line.text[0] == '#')
            status = read_key(self, &line, out_error);
        else if (!is_blank(line.text, line.length))
            status = read_names(self, &line, judge, context, out_error);
        if (status)
            return status;
    }
    return error_none;
}

int text_stream_open(const char *path, text_table_judge judge, void *context, struct text_stream *out_self,
                     struct error *out_error)
{
    *out_self = (struct text_stream){.table = {.path = copy_text(path, strlen(path))}};
    if (!out_self->table.path)
        return error_set(out_error, error_refused, "%s: memory is short", path);
    out_self->lines = line_reader_open(out_self->table.path, out_error);
    int status = out_self->lines ? read_header(out_self, judge, context, out_error) : error_refused;
    if (status)
        text_stream_close(out_self);
    return status;
}

/* Rows come in unknown number: room grows with them, and no further than what was asked for. */
static bool has_room(struct text_stream *self, size_t wanted)
{
    enum { first_rows = 1024 };
    if (self->table.rows < self->capacity && self->columns_with_room == self->table.column_count)
        return true;
    size_t rows = self->capacity ? self->capacity * 2 : first_rows;
    rows = rows < wanted ? rows : wanted;
    return make_room(self, rows > self->capacity ? rows : self->capacity);
}

int text_stream_fill(struct text_stream *self, size_t rows, struct error *out_error)
{
    while (!self->ended && self->table.rows < rows) {
        struct line line;
        enum line_status read = line_reader_next(self->lines, &line, out_error);
        if (read == line_failed)
            return error_refused;
        if (read == line_end) {
            self->ended = true;
            break;
        }
        int status = error_none;
        if (line.length > 0 && line.text[0] == '#')
            status = read_key(self, &line, out_error);
        else if (is_blank(line.text, line.length))
            continue;
        else if (!has_room(self, rows))
            status = short_of_memory(self, out_error);
        else
            status = read_row(self, &line, out_error);
        if (status)
            return status;
    }
    if (self->ended && self->row_total == 0)
        return error_set(out_error, error_refused, "%s:%zu: the file ends without a row of numbers", self->table.path,
                         line_number(self) + 1);
    return error_none;
}

void text_stream_forget_rows(struct text_stream *self)
{
    self->table.rows = 0;
}

double *text_stream_give_column(struct text_stream *self, size_t column)
{
    double *data = self->table.columns[column].data;
    self->table.columns[column].data = NULL;
    self->capacity = 0;
    return data;
}

double text_stream_share(const struct text_stream *self)
{
    return self->lines ? line_reader_share(self->lines) : 0.0;
}

void text_stream_close(struct text_stream *self)
{
    line_reader_close(self->lines);
    for (size_t c = 0; c < self->cell_count; c++)
        free(self->cell_names[c]);
    free(self->cell_names);
    free(self->kinds);
    text_table_free(&self->table);
    *self = (struct text_stream){0};
}
