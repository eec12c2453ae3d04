/* SPDX-License-Identifier: MIT */
#define _XOPEN_SOURCE 700 /* strcasecmp */
#include "lab/record/format.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <zlib.h>

void record_free(struct record *self)
{
    run_free(&self->run);
    frf_free(&self->frf);
    *self = (struct record){0};
}

void format_notes_add(struct format_notes *self, enum format_note kind, const char *format, ...)
{
    char text[1024];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    // A note quotes what a file says; it has to stay one line and must not steer a terminal.
    for (char *c = text; *c; c++)
        if ((unsigned char)*c < 0x20 || *c == 0x7f)
            *c = '?';
    char *copy = self->count < format_notes_max ? strdup(text) : NULL;
    if (!copy) {
        self->dropped++;
        return;
    }
    self->items[self->count].kind = kind;
    self->items[self->count++].text = copy;
}

void format_notes_free(struct format_notes *self)
{
    for (size_t i = 0; i < self->count; i++)
        free(self->items[i].text);
    *self = (struct format_notes){0};
}

const struct record_format *format_by_name(const char *name)
{
    for (size_t i = 0; record_formats[i]; i++)
        if (record_formats[i]->write && strcmp(record_formats[i]->name, name) == 0)
            return record_formats[i];
    return NULL;
}

const struct record_format *format_by_ending(const char *path)
{
    size_t length = strlen(path);
    for (size_t i = 0; record_formats[i]; i++) {
        for (size_t e = 0; e < format_endings_max && record_formats[i]->endings[e]; e++) {
            const char *ending = record_formats[i]->endings[e];
            size_t size = strlen(ending);
            if (length > size && strcasecmp(path + length - size, ending) == 0)
                return record_formats[i];
        }
    }
    return NULL;
}

static int read_head(const char *path, unsigned char *out_head, size_t *out_length, struct error *out_error)
{
    errno = 0;
    gzFile file = gzopen(path, "rb");
    int got = file ? gzread(file, out_head, format_head_size) : -1;
    const char *reason = errno ? strerror(errno) : "its gzip form is damaged";
    if (file)
        gzclose_r(file);
    *out_length = got > 0 ? (size_t)got : 0;
    if (got < 0)
        return error_set(out_error, error_refused, "%s: cannot be read: %s", path, reason);
    if (got == 0)
        return error_set(out_error, error_refused, "%s: is empty", path);
    return error_none;
}

int format_by_content(const char *path, const struct record_format **out_format, struct error *out_error)
{
    unsigned char head[format_head_size];
    size_t length;
    *out_format = NULL;
    int status = read_head(path, head, &length, out_error);
    if (status)
        return status;
    enum format_match best = format_match_none;
    for (size_t i = 0; record_formats[i]; i++) {
        const struct record_format *format = record_formats[i];
        enum format_match match = format->recognise ? format->recognise(head, length) : format_match_none;
        if (match > best) {
            best = match;
            *out_format = format;
        }
    }
    if (*out_format)
        return error_none;
    char names[256];
    format_list(true, sizeof names, names);
    return error_set(out_error, error_refused,
                     "%s: holds neither a run nor a frequency response in a format that is known (%s)", path, names);
}

void format_list(bool readers, size_t size, char *out_text)
{
    size_t used = 0, left = 0;
    out_text[0] = '\0';
    for (size_t i = 0; record_formats[i]; i++)
        left += readers ? record_formats[i]->recognise != NULL : record_formats[i]->write != NULL;
    bool first = true;
    for (size_t i = 0; record_formats[i] && used < size; i++) {
        if (readers ? !record_formats[i]->recognise : !record_formats[i]->write)
            continue;
        const char *between = first ? "" : left > 1 ? ", " : " or ";
        used += (size_t)snprintf(out_text + used, size - used, "%s%s", between, record_formats[i]->name);
        first = false;
        left--;
    }
}
