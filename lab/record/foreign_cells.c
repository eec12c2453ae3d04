/* SPDX-License-Identifier: MIT */
/// Cells of a line, and what stands in them.
#define _XOPEN_SOURCE 700 /* strcasecmp */
#include "lab/record/foreign_text.h"

#include "lab/record/number.h"

#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

enum { number_size = 64 };

static bool is_space(char c)
{
    return c == ' ' || c == '\t' || c == '\r';
}

/// Takes blanks and quotes off a cell; a doubled quote in it stands for one.
static char *trim(char *cell)
{
    while (is_space(*cell))
        cell++;
    size_t length = strlen(cell);
    while (length > 0 && is_space(cell[length - 1]))
        cell[--length] = '\0';
    if (length < 2 || cell[0] != '"' || cell[length - 1] != '"')
        return cell;
    cell[length - 1] = '\0';
    cell++;
    size_t kept = 0;
    for (size_t i = 0; cell[i]; i++) {
        cell[kept++] = cell[i];
        i += cell[i] == '"' && cell[i + 1] == '"';
    }
    cell[kept] = '\0';
    return cell;
}

/// Whether the quote at `at` begins a quoted cell: nothing but blanks are in front of it.
static bool opens_quote(const char *begin, const char *at)
{
    while (begin < at && is_space(*begin))
        begin++;
    return begin == at;
}

/// Ends the cell that begins there, and returns where the next one begins; NULL: it was the last.
static char *cut_cell(char *begin, char separator)
{
    bool quoted = false;
    char *at = begin;
    for (; *at != '\0' && (*at != separator || quoted); at++)
        if (*at == '"')
            quoted = quoted ? false : opens_quote(begin, at);
    if (*at == '\0')
        return NULL;
    *at++ = '\0';
    while (separator == ' ' && is_space(*at))
        at++;
    return at;
}

int foreign_cells_split(char *line, char separator, struct foreign_cells *out_cells, struct error *out_error)
{
    size_t most = 1;
    for (const char *at = line; *at; at++)
        most += *at == separator;
    *out_cells = (struct foreign_cells){.items = malloc(most * sizeof *out_cells->items)};
    if (!out_cells->items)
        return error_set(out_error, error_refused, "memory is short");
    while (separator == ' ' && is_space(*line))
        line++;
    for (char *begin = line; begin;) {
        char *next = cut_cell(begin, separator);
        out_cells->items[out_cells->count++] = trim(begin);
        begin = separator == ' ' && next && *next == '\0' ? NULL : next;
    }
    return 0;
}

void foreign_cells_free(struct foreign_cells *self)
{
    free(self->items);
    *self = (struct foreign_cells){0};
}

bool foreign_line_is_blank(const char *line)
{
    return line[strspn(line, " \t;,\r\"")] == '\0';
}

static bool is_missing(const char *cell)
{
    static const char *const words[] = {"",     "nan", "-nan", "n/a", "#n/a", "#nv", "na",  "null",
                                        "none", "-",   "--",   "---", "*",    "?",   "inf", "1.#qnan"};
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++)
        if (strcasecmp(cell, words[i]) == 0)
            return true;
    return false;
}

/// Characters beyond ASCII that stand for one of it: blanks of other widths, an apostrophe, a minus sign.
static size_t plain_character(const char *at, char *out)
{
    static const struct {
        const char *said;
        char plain;
    } same[] = {{"\xC2\xA0", ' '},      {"\xE2\x80\xAF", ' '}, {"\xE2\x80\x89", ' '},
                {"\xE2\x80\x99", '\''}, {"\xE2\x88\x92", '-'}, {"\xE2\x80\x93", '-'}};
    for (size_t i = 0; i < sizeof same / sizeof same[0]; i++)
        if (strncmp(at, same[i].said, strlen(same[i].said)) == 0) {
            *out = same[i].plain;
            return strlen(same[i].said);
        }
    *out = *at;
    return 1;
}

/// Copies a cell as plain characters; false if it is too long for a number.
static bool copy_plain(const char *cell, char out_text[number_size])
{
    size_t length = 0;
    while (*cell && length + 1 < number_size)
        cell += plain_character(cell, &out_text[length++]);
    out_text[length] = '\0';
    return *cell == '\0';
}

/// Takes the marks between thousands out: one to three digits, then groups of three, all in front of the decimal mark.
/// Returns how many marks there were, -1 if they are no such marks.
static int take_groups(char *text, char decimal, char mark)
{
    char *at = text + (*text == '-' || *text == '+');
    size_t digits = strspn(at, "0123456789");
    int marks = 0;
    if (digits < 1 || digits > 3 || (digits > 1 && *at == '0'))
        return -1;
    at += digits;
    while (*at == mark) {
        if (strspn(at + 1, "0123456789") != 3)
            return -1;
        memmove(at, at + 1, strlen(at));
        at += 3;
        marks++;
    }
    return *at == '\0' || *at == decimal ? marks : -1;
}

/// A cell with a mark that may stand between thousands. A 0 in front is of no thousands.
static enum foreign_value read_grouped(char *text, char decimal, char mark, double *out_value)
{
    const bool has_decimal = strchr(text, decimal) != NULL;
    const bool zero = text[*text == '-' || *text == '+'] == '0';
    const int marks = zero ? -1 : take_groups(text, decimal, mark);
    if (marks < 1)
        return foreign_value_text;
    char *point = strchr(text, decimal);
    if (point)
        *point = '.';
    if (number_parse(text, strlen(text), out_value) != number_ok)
        return foreign_value_text;
    return has_decimal || marks > 1 || mark == ' ' || mark == '\'' ? foreign_value_proven : foreign_value_grouped;
}

/// A decimal mark as a point, and the exponent of Fortran, 1.0D+00, as the usual one.
static void make_usual(char *text, char decimal)
{
    char *mark = decimal == '.' ? NULL : strchr(text, decimal);
    if (mark)
        *mark = '.';
    char *exponent = strpbrk(text, "dD");
    if (exponent && exponent > text && (isdigit((unsigned char)exponent[-1]) || exponent[-1] == '.'))
        *exponent = 'e';
}

enum foreign_value foreign_number(const char *cell, char decimal, double *out_value)
{
    char text[number_size];
    const char *end = cell + strlen(cell);
    *out_value = NAN;
    if (decimal == '.' && *cell && number_read(cell, end, out_value) == end)
        return foreign_value_number;
    *out_value = NAN;
    if (is_missing(cell))
        return foreign_value_missing;
    if (!copy_plain(cell, text))
        return foreign_value_text;
    const char other = decimal == '.' ? ',' : '.';
    const size_t length = strlen(text);
    const char *mark = length > 0 ? strpbrk(text, " '") : NULL;
    if (!mark)
        mark = strchr(text, other);
    if (mark)
        return read_grouped(text, decimal, *mark, out_value);
    make_usual(text, decimal);
    return number_parse(text, length, out_value) == number_ok ? foreign_value_number : foreign_value_text;
}

bool foreign_is_number(enum foreign_value value)
{
    return value == foreign_value_number || value == foreign_value_grouped || value == foreign_value_proven;
}
