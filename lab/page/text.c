/* SPDX-License-Identifier: MIT */
#include "lab/page/text.h"

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

enum { replacement = 0xFFFD };

/* One character: how many bytes it takes and which it is. An invalid sequence is one byte long and U+FFFD. */
struct character {
    size_t bytes;
    uint32_t code;
};

static bool is_continuation(unsigned char byte)
{
    return (byte & 0xC0u) == 0x80u;
}

static struct character decode(const char *text, size_t length)
{
    const unsigned char *s = (const unsigned char *)text;
    static const uint32_t smallest[5] = {0, 0, 0x80, 0x800, 0x10000};
    struct character invalid = {1, replacement};
    if (s[0] < 0x80) {
        return (struct character){1, s[0]};
    }
    size_t bytes = (s[0] & 0xE0u) == 0xC0u ? 2 : (s[0] & 0xF0u) == 0xE0u ? 3 : (s[0] & 0xF8u) == 0xF0u ? 4 : 0;
    if (bytes == 0 || bytes > length) {
        return invalid;
    }
    uint32_t code = s[0] & (0x7Fu >> bytes);
    for (size_t i = 1; i < bytes; i++) {
        if (!is_continuation(s[i])) {
            return invalid;
        }
        code = code << 6 | (s[i] & 0x3Fu);
    }
    /* Overlong forms, surrogates and the two noncharacters that XML forbids. */
    if (code < smallest[bytes] || code > 0x10FFFF || (code >= 0xD800 && code <= 0xDFFF) || code == 0xFFFE ||
        code == 0xFFFF) {
        return invalid;
    }
    return (struct character){bytes, code};
}

static void write_character(FILE *out, const char *s, struct character c)
{
    switch (c.code) {
    case '&':
        fputs("&amp;", out);
        return;
    case '<':
        fputs("&lt;", out);
        return;
    case '>':
        fputs("&gt;", out);
        return;
    case '"':
        fputs("&quot;", out);
        return;
    case '\'':
        fputs("&#39;", out);
        return;
    case '\t':
    case '\r':
    case '\n':
        fputc(' ', out);
        return;
    default:
        break;
    }
    bool control = c.code < 0x20 || (c.code >= 0x7F && c.code < 0xA0);
    if (control || c.code == replacement) {
        fputs("\xEF\xBF\xBD", out);
        return;
    }
    fwrite(s, 1, c.bytes, out);
}

void text_write_span(FILE *out, struct text_span span)
{
    for (size_t i = 0; i < span.length;) {
        struct character c = decode(span.start + i, span.length - i);
        write_character(out, span.start + i, c);
        i += c.bytes;
    }
}

void text_write(FILE *out, const char *text)
{
    if (text != NULL) {
        text_write_span(out, (struct text_span){text, strlen(text)});
    }
}

static double width_em(uint32_t code)
{
    if (code >= 0x2E80) {
        return 1.05; /* East Asian and pictographs are about square */
    }
    if (code >= 0x80) {
        return 0.75;
    }
    if (strchr("ijl'|I", (int)code) != NULL) {
        return 0.30;
    }
    if (strchr(" !.,:;ft()[]/r-\\`", (int)code) != NULL) {
        return 0.42;
    }
    if (strchr("mwMW@%+<>=~#&", (int)code) != NULL) {
        return 0.99;
    }
    return code >= 'A' && code <= 'Z' ? 0.78 : 0.64;
}

double text_measure_em(struct text_span span)
{
    double width = 0.0;
    for (size_t i = 0; i < span.length;) {
        struct character c = decode(span.start + i, span.length - i);
        width += width_em(c.code);
        i += c.bytes;
    }
    return width;
}

/* Bytes of the longest beginning that fits: up to a space where possible, inside a word where the word alone is too
   long. At least one character, so that wrapping always ends. */
static size_t fitting_length(const char *text, double limit_em)
{
    size_t length = strlen(text);
    size_t end_of_word = 0;
    double width = 0.0;
    size_t i = 0;
    while (i < length) {
        struct character c = decode(text + i, length - i);
        if (c.code == ' ') {
            end_of_word = i;
        }
        width += width_em(c.code);
        if (width > limit_em && i > 0) {
            return end_of_word > 0 ? end_of_word : i;
        }
        i += c.bytes;
    }
    return length;
}

size_t text_wrap(const char *text, double width_limit_em, size_t max, struct text_span *out_lines, int *out_cut)
{
    size_t lines = 0;
    text += strspn(text, " ");
    while (*text != '\0' && lines < max) {
        size_t length = fitting_length(text, width_limit_em);
        out_lines[lines++] = (struct text_span){text, length};
        text += length;
        text += strspn(text, " ");
    }
    if (out_cut != NULL) {
        *out_cut = *text != '\0';
    }
    return lines;
}

void text_copy(const char *text, size_t size, char *out)
{
    size_t used = 0;
    size_t length = text != NULL ? strlen(text) : 0;
    while (used < length) {
        struct character c = decode(text + used, length - used);
        if (used + c.bytes >= size) {
            break;
        }
        memcpy(out + used, text + used, c.bytes);
        used += c.bytes;
    }
    out[used] = '\0';
}

void text_shorten(const char *text, size_t size, char *out)
{
    static const char dots[] = "\xE2\x80\xA6";
    const size_t length = text != NULL ? strlen(text) : 0;
    if (length < size || size < 2 * sizeof dots) {
        text_copy(text, size, out);
        return;
    }
    /* More of the beginning than of the end; no character is cut in two. */
    const size_t room = size - sizeof dots;
    size_t end = length - room / 3;
    while (end < length && is_continuation((unsigned char)text[end])) {
        end++;
    }
    text_copy(text, room - room / 3 + 1, out);
    size_t used = strlen(out);
    memcpy(out + used, dots, sizeof dots - 1);
    used += sizeof dots - 1;
    memcpy(out + used, text + end, length - end + 1);
}
