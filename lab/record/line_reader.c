/* SPDX-License-Identifier: MIT */
#include "lab/record/line_reader.h"

#include <errno.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <zlib.h>

enum {
    chunk_size = 1 << 17,
    line_length_max = 1 << 26, /* bins lists are long; a binary file or a gzip bomb without a line end is longer */
};

struct line_reader {
    const char *path;
    gzFile file;
    size_t number; /* of the line last returned, from 1 */
    char *joined;  /* owned: a line that crosses the end of a chunk */
    size_t joined_length, joined_capacity;
    size_t at, end;  /* unread part of chunk */
    bool zero_ahead; /* the chunk, or a chunk before it that the joined line began in, holds a binary zero */
    char chunk[chunk_size];
};

static int line_error(const struct line_reader *self, struct error *out_error, const char *what)
{
    return error_set(out_error, error_refused, "%s:%zu: %s", self->path, self->number + 1, what);
}

struct line_reader *line_reader_open(const char *path, struct error *out_error)
{
    struct line_reader *self = calloc(1, sizeof *self);
    if (!self) {
        error_set(out_error, error_refused, "%s: memory is short", path);
        return NULL;
    }
    self->path = path;
    errno = 0;
    self->file = gzopen(path, "rb");
    if (!self->file) {
        error_set(out_error, error_refused, "%s: cannot be read: %s", path,
                  errno ? strerror(errno) : "memory is short");
        free(self);
        return NULL;
    }
    gzbuffer(self->file, chunk_size / 2);
    return self;
}

void line_reader_close(struct line_reader *self)
{
    if (!self)
        return;
    gzclose_r(self->file);
    free(self->joined);
    free(self);
}

size_t line_reader_number(const struct line_reader *self)
{
    return self->number;
}

double line_reader_share(const struct line_reader *self)
{
    struct stat file;
    const z_off_t read = gzoffset(self->file);
    const bool known = stat(self->path, &file) == 0 && S_ISREG(file.st_mode) && file.st_size > 0 && read > 0;
    return known ? (double)read / (double)file.st_size : 0.0;
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

/* zlib puts the file's name in front of its reason. */
static void damaged(const struct line_reader *self, const char *reason, struct error *out_error)
{
    const size_t name = strlen(self->path);
    if (reason && strncmp(reason, self->path, name) == 0 && strncmp(reason + name, ": ", 2) == 0)
        reason += name + 2;
    error_set(out_error, error_refused, "%s:%zu: the gzip file is damaged%s%s", self->path, self->number + 1,
              reason && *reason ? ": " : "", reason ? reason : "");
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
    if (got > 0) {
        bool zero = memchr(self->chunk, '\0', self->end) != NULL;
        self->zero_ahead = zero || (self->zero_ahead && self->joined_length > 0);
        return line_ok;
    }
    if (got == 0 && code != Z_BUF_ERROR)
        return line_end;
    const int system_error = errno;
    if (code == Z_ERRNO && system_error == EISDIR)
        error_set(out_error, error_refused, "%s: is a folder: a file was expected", self->path);
    else if (code == Z_ERRNO)
        line_error(self, out_error, strerror(system_error));
    else if (code == Z_BUF_ERROR)
        line_error(self, out_error, "the gzip file is cut off, or its check sum is missing");
    else
        damaged(self, reason, out_error);
    return line_failed;
}

static enum line_status take_line(struct line_reader *self, const char *text, size_t length, struct line *out_line,
                                  struct error *out_error)
{
    if (self->zero_ahead && memchr(text, '\0', length)) {
        line_error(self, out_error, "contains binary zeros: text in UTF-8 was expected");
        return line_failed;
    }
    if (length > 0 && text[length - 1] == '\r')
        length--;
    if (self->number == 0 && length >= 3 && memcmp(text, "\xEF\xBB\xBF", 3) == 0) {
        text += 3;
        length -= 3;
    }
    self->number++;
    *out_line = (struct line){.text = text, .length = length, .number = self->number};
    return line_ok;
}

enum line_status line_reader_next(struct line_reader *self, struct line *out_line, struct error *out_error)
{
    self->joined_length = 0;
    for (;;) {
        if (self->at == self->end) {
            enum line_status status = refill(self, out_error);
            if (status == line_end && self->joined_length > 0)
                return take_line(self, self->joined, self->joined_length, out_line, out_error);
            if (status != line_ok)
                return status;
        }
        char *start = self->chunk + self->at;
        char *newline = memchr(start, '\n', self->end - self->at);
        size_t length = newline ? (size_t)(newline - start) : self->end - self->at;
        if (newline && self->joined_length == 0) {
            self->at += length + 1;
            return take_line(self, start, length, out_line, out_error);
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
            return take_line(self, self->joined, self->joined_length, out_line, out_error);
        }
    }
}
