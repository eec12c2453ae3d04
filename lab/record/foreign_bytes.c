/* SPDX-License-Identifier: MIT */
/// The bytes of a text file as lines of UTF-8, whatever they were.
#include "lab/record/foreign_text.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

static const size_t bytes_max = (size_t)1 << 31;
enum { first_room = 1 << 16, quoted_max = 200 };

static int short_of_memory(const char *path, struct error *out_error)
{
    return error_set(out_error, error_refused, "%s: memory is short", path);
}

static int read_failed(const char *path, gzFile file, size_t length, struct error *out_error)
{
    int code = Z_OK;
    const int system_error = errno;
    (void)gzerror(file, &code);
    return error_set(out_error, error_refused, "%s: after %zu bytes: %s", path, length,
                     code == Z_ERRNO       ? strerror(system_error)
                     : code == Z_BUF_ERROR ? "the gzip file is cut off, or its check sum is missing"
                                           : "the gzip file is damaged");
}

/// All bytes of an open file; room for one more behind them.
static int read_open(const char *path, gzFile file, unsigned char **out_bytes, size_t *out_length,
                     struct error *out_error)
{
    size_t room = 0;
    *out_bytes = NULL;
    *out_length = 0;
    for (;;) {
        if (*out_length + first_room >= room) {
            room = room ? 2 * room : 4 * (size_t)first_room;
            unsigned char *grown = room <= 2 * bytes_max ? realloc(*out_bytes, room) : NULL;
            if (!grown)
                return error_set(out_error, error_refused, "%s: more than 2 GiB of text, or memory is short", path);
            *out_bytes = grown;
        }
        const int got = gzread(file, *out_bytes + *out_length, first_room);
        int code = Z_OK;
        (void)gzerror(file, &code);
        if (got < 0 || (got == 0 && code == Z_BUF_ERROR))
            return read_failed(path, file, *out_length, out_error);
        if (got == 0)
            return 0;
        *out_length += (size_t)got;
    }
}

static int read_all(const char *path, unsigned char **out_bytes, size_t *out_length, struct error *out_error)
{
    errno = 0;
    gzFile file = gzopen(path, "rb");
    *out_bytes = NULL;
    *out_length = 0;
    if (!file)
        return error_set(out_error, error_refused, "%s: cannot be read: %s", path,
                         errno ? strerror(errno) : "memory is short");
    int status = read_open(path, file, out_bytes, out_length, out_error);
    gzclose_r(file);
    if (status) {
        free(*out_bytes);
        *out_bytes = NULL;
    }
    return status;
}

static char *put_utf8(char *out, uint32_t code)
{
    if (code < 0x80) {
        *out++ = (char)code;
        return out;
    }
    if (code < 0x800) {
        *out++ = (char)(0xC0 | code >> 6);
    } else if (code < 0x10000) {
        *out++ = (char)(0xE0 | code >> 12);
        *out++ = (char)(0x80 | (code >> 6 & 0x3F));
    } else {
        *out++ = (char)(0xF0 | code >> 18);
        *out++ = (char)(0x80 | (code >> 12 & 0x3F));
        *out++ = (char)(0x80 | (code >> 6 & 0x3F));
    }
    *out++ = (char)(0x80 | (code & 0x3F));
    return out;
}

/// Text of UTF-16; a zero in it, which is no text, becomes a blank.
static char *from_utf16(const unsigned char *bytes, size_t length, bool big)
{
    char *text = malloc(length / 2 * 3 + 1);
    char *at = text;
    for (size_t i = 0; text && i + 1 < length; i += 2) {
        uint32_t code = (uint32_t)bytes[i + !big] << 8 | bytes[i + big];
        if (code >= 0xD800 && code < 0xDC00 && i + 3 < length) {
            const uint32_t low = (uint32_t)bytes[i + 2 + !big] << 8 | bytes[i + 2 + big];
            if (low >= 0xDC00 && low < 0xE000) {
                code = 0x10000 + ((code - 0xD800) << 10) + (low - 0xDC00);
                i += 2;
            }
        }
        at = put_utf8(at, code ? code : ' ');
    }
    if (text)
        *at = '\0';
    return text;
}

/// Windows-1252: Latin-1 but for 0x80 to 0x9F, of which only the apostrophe, the dash and the euro occur in tables.
static char *from_windows(const unsigned char *bytes, size_t length)
{
    char *text = malloc(3 * length + 1);
    char *at = text;
    for (size_t i = 0; text && i < length; i++) {
        const unsigned char byte = bytes[i];
        const uint32_t code = byte == 0x92 ? 0x2019 : byte == 0x96 ? 0x2013 : byte == 0x80 ? 0x20AC : byte;
        at = put_utf8(at, code);
    }
    if (text)
        *at = '\0';
    return text;
}

/// How many bytes the character at `at` has in UTF-8; 0: it is none. `cut`: the bytes may end within it.
static size_t utf8_length(const unsigned char *at, size_t left, bool cut)
{
    const size_t length = *at < 0x80 ? 1 : *at >> 5 == 6 ? 2 : *at >> 4 == 14 ? 3 : *at >> 3 == 30 ? 4 : 0;
    for (size_t i = 1; i < length; i++) {
        if (i >= left)
            return cut ? left : 0;
        if (at[i] >> 6 != 2)
            return 0;
    }
    return length;
}

static bool is_utf8(const unsigned char *bytes, size_t length, bool cut)
{
    for (size_t at = 0; at < length;) {
        const size_t step = utf8_length(bytes + at, length - at, cut);
        if (step == 0)
            return false;
        at += step;
    }
    return true;
}

/// -1: no UTF-16; else whether its bytes begin with the more significant one.
static int utf16_order(const unsigned char *bytes, size_t length)
{
    if (length >= 2 && bytes[0] == 0xFF && bytes[1] == 0xFE)
        return 0;
    if (length >= 2 && bytes[0] == 0xFE && bytes[1] == 0xFF)
        return 1;
    const size_t looked = length < 512 ? length & ~(size_t)1 : 512;
    size_t zeros[2] = {0, 0};
    for (size_t i = 0; i < looked; i++)
        zeros[i % 2] += bytes[i] == 0;
    for (int big = 0; big < 2; big++)
        if (looked >= 8 && zeros[big] == 0 && 5 * zeros[!big] > 2 * looked)
            return big;
    return -1;
}

/// The bytes as UTF-8 without byte order mark; NULL if they are binary (*out_binary) or memory is short. `cut`: they
/// are the beginning of more.
static char *decode(const unsigned char *bytes, size_t length, bool cut, enum foreign_encoding *out_encoding,
                    bool *out_binary)
{
    const int big = utf16_order(bytes, length);
    *out_binary = false;
    *out_encoding = big >= 0 ? foreign_utf16 : foreign_utf8;
    if (big >= 0) {
        const size_t mark = bytes[0] >= 0xFE ? 2 : 0;
        return from_utf16(bytes + mark, length - mark, big == 1);
    }
    *out_binary = memchr(bytes, '\0', length) != NULL;
    if (*out_binary)
        return NULL;
    const size_t mark = length >= 3 && memcmp(bytes, "\xEF\xBB\xBF", 3) == 0 ? 3 : 0;
    if (!is_utf8(bytes, length, cut)) {
        *out_encoding = foreign_windows;
        return from_windows(bytes, length);
    }
    char *text = malloc(length - mark + 1);
    if (text) {
        memcpy(text, bytes + mark, length - mark);
        text[length - mark] = '\0';
    }
    return text;
}

/// Where the quote that begins at `at` ends; NULL if it does not soon, and then it is no quote.
static char *closing_quote(char *at)
{
    for (size_t i = 1; i < quoted_max && at[i] != '\0'; i++)
        if (at[i] == '"' && at[i + 1] == '"')
            i++;
        else if (at[i] == '"')
            return at + i;
    return NULL;
}

static bool begins_cell(const char *text, const char *at)
{
    return at == text || strchr("\n\r\t;,", at[-1]) != NULL;
}

/// A line end between quotes becomes a blank. Returns how many lines it hid from the count of lines.
static size_t join_quoted(const char *text, char *at, char **out_end)
{
    char *end = *at == '"' && begins_cell(text, at) ? closing_quote(at) : NULL;
    size_t hidden = 0;
    for (char *inside = at; end && inside < end; inside++) {
        hidden += *inside == '\n' || (*inside == '\r' && inside[1] != '\n');
        *inside = *inside == '\n' || *inside == '\r' ? ' ' : *inside;
    }
    *out_end = end ? end : at;
    return hidden;
}

char *foreign_text_head(const unsigned char *head, size_t length)
{
    enum foreign_encoding encoding;
    bool binary;
    char *text = decode(head, length, true, &encoding, &binary);
    for (char *at = text; at && *at; at++)
        if (*at == '"')
            (void)join_quoted(text, at, &at);
    return text;
}

static bool add_lines(struct foreign_text *self, size_t *io_room, char *line, size_t empty_ones)
{
    static char nothing[1] = "";
    const size_t need = self->count + 1 + empty_ones;
    if (need > *io_room) {
        *io_room = 2 * need + 1024;
        char **lines = realloc(self->lines, *io_room * sizeof *lines);
        if (!lines)
            return false;
        self->lines = lines;
    }
    self->lines[self->count++] = line;
    while (empty_ones-- > 0)
        self->lines[self->count++] = nothing;
    return true;
}

static bool split_lines(struct foreign_text *self)
{
    size_t room = 0;
    size_t hidden = 0;
    char *line = self->bytes;
    for (char *at = self->bytes;; at++) {
        if (*at == '"')
            hidden += join_quoted(self->bytes, at, &at);
        if (*at != '\n' && *at != '\r' && *at != '\0')
            continue;
        const char end = *at;
        char *const next = at + (end == '\r' && at[1] == '\n') + 1;
        *at = '\0';
        if (end == '\0' && *line == '\0')
            return true;
        if (!add_lines(self, &room, line, hidden))
            return false;
        if (end == '\0')
            return true;
        hidden = 0;
        line = next;
        at = next - 1;
    }
}

int foreign_text_read(const char *path, struct foreign_text *out_self, struct error *out_error)
{
    unsigned char *bytes;
    size_t length;
    bool binary = false;
    *out_self = (struct foreign_text){.path = path};
    int status = read_all(path, &bytes, &length, out_error);
    if (status)
        return status;
    out_self->bytes = decode(bytes, length, false, &out_self->encoding, &binary);
    free(bytes);
    if (binary)
        return error_set(out_error, error_refused, "%s: contains binary zeros: text was expected", path);
    if (!out_self->bytes || !split_lines(out_self))
        status = short_of_memory(path, out_error);
    if (status)
        foreign_text_free(out_self);
    return status;
}

void foreign_text_free(struct foreign_text *self)
{
    free(self->lines);
    free(self->bytes);
    self->lines = NULL;
    self->bytes = NULL;
    self->count = 0;
}
