/* SPDX-License-Identifier: MIT */
#include "lab/record/text_table.h"

#include "lab/record/number.h"

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

enum {
    chunk_size = 1 << 16,
    line_length_max = 1 << 26, /* bins lists are long; a binary file or a gzip bomb without a line end is longer */
    columns_max = 4096,
    shown_max = 40, /* characters of a cell that a message quotes */
};

struct line_reader {
    const char *path;
    gzFile file;
    size_t number; /* of the line last returned, from 1 */
    char *line;    /* into chunk or joined; not terminated */
    size_t length;
    char *joined; /* owned: a line that crosses the end of a chunk */
    size_t joined_length, joined_capacity;
    size_t at, end; /* unread part of chunk */
    char chunk[chunk_size];
};

enum line_status { line_end, line_ok, line_failed };

static int line_error(const struct line_reader *self, struct error *out_error, const char *what)
{
    return error_set(out_error, error_refused, "%s:%zu: %s", self->path, self->number + 1, what);
}

static int line_reader_open(struct line_reader *self, const char *path, struct error *out_error)
{
    self->path = path;
    errno = 0;
    self->file = gzopen(path, "rb");
    if (!self->file)
        return error_set(out_error, error_refused, "%s: cannot be read: %s", path,
                         errno ? strerror(errno) : "memory is short");
    return error_none;
}

static void line_reader_close(struct line_reader *self)
{
    if (self->file)
        gzclose_r(self->file);
    free(self->joined);
}

/* Appends the chunk's bytes at .. at + length to the joined line. */
static bool join(struct line_reader *self, size_t length)
{
    size_t need = self->joined_length + length;
    if (need > self->joined_capacity) {
        size_t capacity = need * 2;
        char *grown = realloc(self->joined, capacity);
        if (!grown)
            return false;
        self->joined = grown;
        self->joined_capacity = capacity;
    }
    memcpy(self->joined + self->joined_length, self->chunk + self->at, length);
    self->joined_length = need;
    self->at += length;
    return true;
}

/* Reads the next chunk; line_end at the end of the file. zlib reports a gzip file that was cut off, or whose check sum
 * is wrong, only through gzerror once the data is used up. */
static enum line_status refill(struct line_reader *self, struct error *out_error)
{
    int got = gzread(self->file, self->chunk, chunk_size);
    int code = Z_OK;
    const char *reason = gzerror(self->file, &code);
    self->at = 0;
    self->end = got > 0 ? (size_t)got : 0;
    if (got > 0)
        return line_ok;
    if (got == 0 && code != Z_BUF_ERROR)
        return line_end;
    if (code == Z_ERRNO)
        line_error(self, out_error, strerror(errno));
    else if (code == Z_BUF_ERROR)
        line_error(self, out_error, "the gzip file is cut off, or its check sum is missing");
    else
        line_error(self, out_error, reason && *reason ? reason : "the gzip file is damaged");
    return line_failed;
}

static enum line_status take_line(struct line_reader *self, char *line, size_t length, struct error *out_error)
{
    if (memchr(line, '\0', length)) {
        line_error(self, out_error, "contains binary zeros: text in UTF-8 was expected");
        return line_failed;
    }
    if (length > 0 && line[length - 1] == '\r')
        length--;
    if (self->number == 0 && length >= 3 && memcmp(line, "\xEF\xBB\xBF", 3) == 0) {
        line += 3;
        length -= 3;
    }
    self->line = line;
    self->length = length;
    self->number++;
    return line_ok;
}

static enum line_status next_line(struct line_reader *self, struct error *out_error)
{
    self->joined_length = 0;
    for (;;) {
        if (self->at == self->end) {
            enum line_status status = refill(self, out_error);
            if (status == line_end && self->joined_length > 0)
                return take_line(self, self->joined, self->joined_length, out_error);
            if (status != line_ok)
                return status;
        }
        char *start = self->chunk + self->at;
        char *newline = memchr(start, '\n', self->end - self->at);
        size_t length = newline ? (size_t)(newline - start) : self->end - self->at;
        if (newline && self->joined_length == 0) {
            self->at += length + 1;
            return take_line(self, start, length, out_error);
        }
        if (self->joined_length + length > line_length_max) {
            line_error(self, out_error, "line is longer than 64 MiB: a text file was expected");
            return line_failed;
        }
        if (!join(self, length)) {
            line_error(self, out_error, "memory is short");
            return line_failed;
        }
        if (newline) {
            self->at++;
            return take_line(self, self->joined, self->joined_length, out_error);
        }
    }
}

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

struct table_reader {
    struct line_reader *lines;
    struct text_table *table;
    enum text_cell *kinds;
    size_t capacity; /* rows that the columns have room for */
    struct error *out_error;
};

static int short_of_memory(const struct table_reader *self)
{
    return error_set(self->out_error, error_refused, "%s:%zu: memory is short", self->lines->path, self->lines->number);
}

/* `# key: value`; a comment without a colon is kept under the empty key. */
static int read_key(struct table_reader *self)
{
    struct text_table *table = self->table;
    const char *at = self->lines->line + 1, *end = self->lines->line + self->lines->length;
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
        return short_of_memory(self);
    }
    table->keys[table->key_count] = (struct run_key){key_text, value_text};
    table->key_line[table->key_count++] = self->lines->number;
    return error_none;
}

static int add_name(struct table_reader *self, const struct cell *cell)
{
    struct text_table *table = self->table;
    if (table->column_count == columns_max)
        return error_set(self->out_error, error_refused, "%s:%zu: more than %d columns", self->lines->path,
                         self->lines->number, columns_max);
    struct run_column *columns = realloc(table->columns, (table->column_count + 1) * sizeof *columns);
    if (!columns)
        return short_of_memory(self);
    table->columns = columns;
    char *name = copy_cell(cell);
    if (!name)
        return short_of_memory(self);
    columns[table->column_count++] = (struct run_column){.name = name};
    return error_none;
}

static int check_names(const struct table_reader *self)
{
    const struct text_table *table = self->table;
    double value;
    for (size_t c = 0; c < table->column_count; c++) {
        const char *name = table->columns[c].name;
        if (number_parse(name, strlen(name), &value) == number_ok)
            return error_set(self->out_error, error_refused,
                             "%s:%zu: '%.*s' is a number, the row of column names was expected first", table->path,
                             table->names_line, shown_max, name);
    }
    const char *only = table->columns[0].name;
    if (table->column_count == 1 && (strchr(only, ';') || strchr(only, '\t')))
        return error_set(self->out_error, error_refused,
                         "%s:%zu: columns are separated by %s: commas were expected, and a point as decimal mark",
                         table->path, table->names_line, strchr(only, ';') ? "semicolons" : "tabs");
    return error_none;
}

static int read_names(struct table_reader *self, text_table_judge judge, void *context)
{
    struct text_table *table = self->table;
    table->names_line = self->lines->number;
    const char *at = self->lines->line, *end = at + self->lines->length;
    while (at) {
        struct cell cell;
        at = next_cell(at, end, &cell);
        int status = add_name(self, &cell);
        if (status)
            return status;
    }
    int status = check_names(self);
    if (status)
        return status;
    self->kinds = calloc(table->column_count, sizeof *self->kinds);
    if (!self->kinds)
        return short_of_memory(self);
    for (size_t c = 0; c < table->column_count; c++)
        self->kinds[c] = judge(context, table->columns[c].name);
    return error_none;
}

static bool grow_rows(struct table_reader *self)
{
    size_t capacity = self->capacity ? self->capacity * 2 : 1024;
    for (size_t c = 0; c < self->table->column_count; c++) {
        double *grown = realloc(self->table->columns[c].data, capacity * sizeof *grown);
        if (!grown)
            return false;
        self->table->columns[c].data = grown;
    }
    size_t *lines = realloc(self->table->row_line, capacity * sizeof *lines);
    if (!lines)
        return false;
    self->table->row_line = lines;
    self->capacity = capacity;
    return true;
}

static int read_cell(const struct table_reader *self, size_t column, const struct cell *cell, double *out_value)
{
    enum number_status status = number_parse(cell->text, cell->length, out_value);
    if (status == number_ok)
        return error_none;
    *out_value = NAN;
    enum text_cell kind = self->kinds[column];
    if (kind == text_cell_free || (kind == text_cell_number_or_empty && status == number_empty))
        return error_none;
    int shown = cell->length < shown_max ? (int)cell->length : shown_max;
    return error_set(self->out_error, error_refused, "%s:%zu: %s: '%.*s' %s", self->lines->path, self->lines->number,
                     self->table->columns[column].name, shown, cell->text, number_status_str(status));
}

static int read_row(struct table_reader *self)
{
    struct text_table *table = self->table;
    if (table->rows == self->capacity && !grow_rows(self))
        return short_of_memory(self);
    const char *at = self->lines->line, *end = at + self->lines->length;
    size_t count = 0;
    for (; at; count++) {
        struct cell cell;
        at = next_cell(at, end, &cell);
        if (count >= table->column_count)
            continue;
        int status = read_cell(self, count, &cell, &table->columns[count].data[table->rows]);
        if (status)
            return status;
    }
    if (count != table->column_count)
        return error_set(self->out_error, error_refused,
                         "%s:%zu: row has %zu cells, the row of names (line %zu) has %zu%s", self->lines->path,
                         self->lines->number, count, table->names_line, table->column_count,
                         count == 2 * table->column_count ? ": decimal commas? A point was expected" : "");
    table->row_line[table->rows++] = self->lines->number;
    return error_none;
}

static int read_lines(struct table_reader *self, text_table_judge judge, void *context)
{
    for (;;) {
        enum line_status line = next_line(self->lines, self->out_error);
        if (line == line_failed)
            return error_refused;
        if (line == line_end)
            break;
        int status = error_none;
        if (self->lines->length > 0 && self->lines->line[0] == '#')
            status = read_key(self);
        else if (is_blank(self->lines->line, self->lines->length))
            continue;
        else if (self->table->column_count == 0)
            status = read_names(self, judge, context);
        else
            status = read_row(self);
        if (status)
            return status;
    }
    if (self->table->column_count == 0)
        return error_set(self->out_error, error_refused, "%s:%zu: the file ends without a row of column names",
                         self->lines->path, self->lines->number + 1);
    if (self->table->rows == 0)
        return error_set(self->out_error, error_refused, "%s:%zu: the file ends without a row of numbers",
                         self->lines->path, self->lines->number + 1);
    return error_none;
}

int text_table_read(const char *path, text_table_judge judge, void *context, struct text_table *out_table,
                    struct error *out_error)
{
    *out_table = (struct text_table){0};
    struct line_reader *lines = calloc(1, sizeof *lines);
    out_table->path = copy_text(path, strlen(path));
    if (!lines || !out_table->path) {
        free(lines);
        text_table_free(out_table);
        return error_set(out_error, error_refused, "%s: memory is short", path);
    }
    struct table_reader reader = {.lines = lines, .table = out_table, .out_error = out_error};
    int status = line_reader_open(lines, path, out_error);
    if (!status)
        status = read_lines(&reader, judge, context);
    line_reader_close(lines);
    free(lines);
    free(reader.kinds);
    if (status)
        text_table_free(out_table);
    return status;
}

void text_table_free(struct text_table *self)
{
    for (size_t c = 0; c < self->column_count; c++) {
        free(self->columns[c].name);
        free(self->columns[c].data);
    }
    for (size_t k = 0; k < self->key_count; k++) {
        free(self->keys[k].key);
        free(self->keys[k].value);
    }
    free(self->columns);
    free(self->keys);
    free(self->key_line);
    free(self->row_line);
    free(self->path);
    *self = (struct text_table){0};
}

int text_table_key(const struct text_table *self, const char *key, const char **out_value, size_t *out_line,
                   struct error *out_error)
{
    *out_value = NULL;
    *out_line = 0;
    for (size_t k = 0; k < self->key_count; k++) {
        if (strcmp(self->keys[k].key, key) != 0)
            continue;
        if (*out_value)
            return error_set(out_error, error_refused, "%s:%zu: %s: is there twice, first in line %zu", self->path,
                             self->key_line[k], key, *out_line);
        *out_value = self->keys[k].value;
        *out_line = self->key_line[k];
    }
    return error_none;
}

static void write_name(FILE *stream, const char *name)
{
    size_t length = strlen(name);
    bool plain =
        length > 0 && name[0] != '#' && !strpbrk(name, ",\"") && !is_blank(name, 1) && !is_blank(name + length - 1, 1);
    if (plain) {
        fputs(name, stream);
        return;
    }
    fputc('"', stream);
    for (; *name; name++) {
        if (*name == '"')
            fputc('"', stream);
        fputc(*name, stream);
    }
    fputc('"', stream);
}

void text_write_number(FILE *stream, double value)
{
    char text[number_text_size];
    if (isnan(value))
        return;
    number_format(value, text);
    fputs(text, stream);
}

void text_write_key(FILE *stream, const struct run_key *key)
{
    // A comment with a colon in it needs one in front, or it would read back as a key.
    if (key->key[0] || strchr(key->value, ':'))
        fprintf(stream, "# %s: %s\n", key->key, key->value);
    else
        fprintf(stream, "# %s\n", key->value);
}

void text_write_columns(FILE *stream, const struct run_column *columns, size_t column_count, size_t rows)
{
    for (size_t c = 0; c < column_count; c++) {
        if (c > 0)
            fputc(',', stream);
        write_name(stream, columns[c].name);
    }
    fputc('\n', stream);
    for (size_t n = 0; n < rows; n++) {
        for (size_t c = 0; c < column_count; c++) {
            if (c > 0)
                fputc(',', stream);
            text_write_number(stream, columns[c].data[n]);
        }
        // A row with nothing in it would be a blank line, which is no row.
        if (column_count == 1 && isnan(columns[0].data[n]))
            fputs("\"\"", stream);
        fputc('\n', stream);
    }
}
