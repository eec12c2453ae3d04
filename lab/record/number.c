/* SPDX-License-Identifier: MIT */
#include "lab/record/number.h"

#include <locale.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* 1e0 .. 1e22 are exact doubles. */
static const double exact_powers[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,  1e9,  1e10, 1e11,
                                      1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};

enum {
    exact_power_max = 22,
    exact_digits_max = 15, /* 10^15 < 2^53: every such integer is an exact double */
    exponent_digits_max = 4,
};

/* A decimal number taken apart, as far as an exact value needs it. */
struct decimal {
    uint64_t digits; /* the first exact_digits_max significant ones */
    int significant; /* how many there were */
    int scale;       /* value = digits 10^scale, if significant <= exact_digits_max */
    bool negative;
    bool exact;
};

static bool is_digit(char c)
{
    return c >= '0' && c <= '9';
}

static const char *scan_digits(const char *at, const char *end, bool fraction, struct decimal *io_decimal, bool *io_any)
{
    for (; at < end && is_digit(*at); at++) {
        *io_any = true;
        if (io_decimal->significant > 0 || *at != '0')
            io_decimal->significant++;
        if (io_decimal->significant <= exact_digits_max)
            io_decimal->digits = io_decimal->digits * 10 + (uint64_t)(*at - '0');
        if (fraction && io_decimal->scale > -10000)
            io_decimal->scale--;
    }
    return at;
}

static const char *scan_sign(const char *at, const char *end, bool *out_negative)
{
    *out_negative = at < end && *at == '-';
    return at < end && (*at == '+' || *at == '-') ? at + 1 : at;
}

/* The exponent behind an 'e'; NULL if there is no digit. */
static const char *scan_exponent(const char *at, const char *end, struct decimal *io_decimal)
{
    bool negative;
    int exponent = 0;
    const char *first = at = scan_sign(at, end, &negative);
    for (; at < end && is_digit(*at); at++)
        exponent = exponent < 100000 ? exponent * 10 + (*at - '0') : exponent;
    io_decimal->scale += negative ? -exponent : exponent;
    io_decimal->exact = at - first <= exponent_digits_max;
    return at > first ? at : NULL;
}

/* Checks the grammar [+-] digits [. digits] [e [+-] digits] over the whole text and collects its value on the way. */
static bool scan_decimal(const char *at, const char *end, struct decimal *out_decimal)
{
    *out_decimal = (struct decimal){.exact = true};
    bool any = false;
    at = scan_sign(at, end, &out_decimal->negative);
    at = scan_digits(at, end, false, out_decimal, &any);
    if (at < end && *at == '.')
        at = scan_digits(at + 1, end, true, out_decimal, &any);
    if (any && at < end && (*at == 'e' || *at == 'E'))
        at = scan_exponent(at + 1, end, out_decimal);
    out_decimal->exact = out_decimal->exact && out_decimal->significant <= exact_digits_max &&
                         abs(out_decimal->scale) <= exact_power_max;
    return any && at == end;
}

/* strtod reads the locale's decimal mark, so the point is replaced by it; the text has passed scan_decimal. */
static double convert(const char *text, size_t length)
{
    char stack[512];
    char *copy = length < sizeof stack - 8 ? stack : malloc(length + 8);
    if (!copy)
        return NAN;
    const char *mark = localeconv()->decimal_point;
    size_t mark_length = strlen(mark) <= 7 ? strlen(mark) : 7;
    const char *point = memchr(text, '.', length);
    size_t before = point ? (size_t)(point - text) : length;
    memcpy(copy, text, before);
    size_t used = before;
    if (point) {
        memcpy(copy + used, mark, mark_length);
        used += mark_length;
        memcpy(copy + used, point + 1, length - before - 1);
        used += length - before - 1;
    }
    copy[used] = '\0';
    double value = strtod(copy, NULL);
    if (copy != stack)
        free(copy);
    return value;
}

static enum number_status why_not(const char *at, const char *end)
{
    const char *start = at < end && (*at == '+' || *at == '-') ? at + 1 : at;
    if (end - start >= 2 && start[0] == '0' && (start[1] == 'x' || start[1] == 'X'))
        return number_hexadecimal;
    const char *comma = memchr(at, ',', (size_t)(end - at));
    struct decimal before, after;
    if (comma && scan_decimal(at, comma, &before) && comma + 1 < end && is_digit(comma[1]) &&
        scan_decimal(comma + 1, end, &after))
        return number_decimal_comma;
    return number_not_a_number;
}

enum number_status number_parse(const char *text, size_t length, double *out_value)
{
    const char *at = text, *end = text + length;
    while (at < end && (*at == ' ' || *at == '\t'))
        at++;
    while (end > at && (end[-1] == ' ' || end[-1] == '\t'))
        end--;
    if (at == end)
        return number_empty;
    struct decimal decimal;
    if (!scan_decimal(at, end, &decimal))
        return why_not(at, end);
    if (decimal.exact) {
        // Both factors are exact doubles, so the one rounding of the product or quotient is strtod's.
        double value = (double)decimal.digits;
        value = decimal.scale < 0 ? value / exact_powers[-decimal.scale] : value * exact_powers[decimal.scale];
        *out_value = decimal.negative ? -value : value;
        return number_ok;
    }
    double value = convert(at, (size_t)(end - at));
    if (!isfinite(value))
        return number_out_of_range;
    *out_value = value;
    return number_ok;
}

const char *number_status_str(enum number_status status)
{
    switch (status) {
    case number_ok:
        return "is a number";
    case number_empty:
        return "is empty, a number was expected";
    case number_hexadecimal:
        return "is hexadecimal, a decimal number was expected";
    case number_decimal_comma:
        return "has a decimal comma, a point was expected";
    case number_out_of_range:
        return "is too large for a double";
    case number_not_a_number:
        break;
    }
    return "is not a number";
}

void number_format(double value, char out_text[number_text_size])
{
    static const int digits[] = {9, 12, 15, 17};
    for (size_t i = 0; i < sizeof digits / sizeof digits[0]; i++) {
        int length = snprintf(out_text, number_text_size, "%.*g", digits[i], value);
        // The locale's decimal mark is the only character that can be none of these.
        for (int c = 0; c < length; c++)
            if (!is_digit(out_text[c]) && !strchr("+-e.", out_text[c]))
                out_text[c] = '.';
        double back;
        if (number_parse(out_text, (size_t)length, &back) == number_ok && memcmp(&back, &value, sizeof value) == 0)
            return;
    }
}
