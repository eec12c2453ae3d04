/* SPDX-License-Identifier: MIT */
#include "lab/record/text_table.h"

#include "lab/record/number.h"
#include "lab/record/text_stream.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

int text_table_read(const char *path, text_table_judge judge, void *context, struct text_table *out_table,
                    struct error *out_error)
{
    struct text_stream stream;
    *out_table = (struct text_table){0};
    int status = text_stream_open(path, judge, context, &stream, out_error);
    if (status)
        return status;
    status = text_stream_fill(&stream, SIZE_MAX, out_error);
    if (!status) {
        *out_table = stream.table;
        stream.table = (struct text_table){0};
    }
    text_stream_close(&stream);
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
    bool plain = length > 0 && name[0] != '#' && !strpbrk(name, ",\"") && !strchr(" \t", name[0]) &&
                 !strchr(" \t", name[length - 1]);
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
