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
    five_power_max = 27,
    digits_max = 19, /* 10^19 < 2^64 */
    exponent_digits_max = 4,
};

static const uint64_t exact_integer_max = 9007199254740992u; /* 2^53 */

/* A decimal number taken apart. */
struct decimal {
    uint64_t digits; /* the significant ones, if there are at most digits_max */
    int significant; /* how many there are; leading zeros are none */
    int scale;       /* value = digits 10^scale */
    bool negative;
    bool plain; /* the exponent has few enough digits for `scale` to be right */
};

static bool is_digit(char c)
{
    return (unsigned char)(c - '0') < 10;
}

#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
/* Eight digits at a time: neighbours are joined to numbers of two, four and eight digits, four, two and one at once. */
static bool read_eight_digits(const char *at, uint64_t *out_value)
{
    uint64_t text;
    memcpy(&text, at, sizeof text);
    uint64_t high = text & 0xF0F0F0F0F0F0F0F0u;
    uint64_t carried = (text + 0x0606060606060606u) & 0xF0F0F0F0F0F0F0F0u;
    if ((high | carried >> 4) != 0x3333333333333333u)
        return false;
    text = (text & 0x0F0F0F0F0F0F0F0Fu) * (10u << 8 | 1u) >> 8;
    text = (text & 0x00FF00FF00FF00FFu) * (100u << 16 | 1u) >> 16;
    *out_value = (text & 0x0000FFFF0000FFFFu) * ((uint64_t)10000u << 32 | 1u) >> 32;
    return true;
}
#else
static bool read_eight_digits(const char *at, uint64_t *out_value)
{
    (void)at;
    (void)out_value;
    return false;
}
#endif

/* Appends the digits at `at`; with more than digits_max of them io_digits overflows, and nobody looks at it. */
static const char *scan_digits(const char *at, const char *end, uint64_t *io_digits)
{
    uint64_t digits = *io_digits, eight;
    while (end - at >= 8 && read_eight_digits(at, &eight)) {
        digits = digits * 100000000u + eight;
        at += 8;
    }
    for (; at < end && is_digit(*at); at++)
        digits = digits * 10 + (uint64_t)(*at - '0');
    *io_digits = digits;
    return at;
}

static const char *skip_zeros(const char *at, const char *end)
{
    while (at < end && *at == '0')
        at++;
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
    io_decimal->plain = at - first <= exponent_digits_max;
    return at > first ? at : NULL;
}

static int count_of(const char *from, const char *to)
{
    return to - from < 10000 ? (int)(to - from) : 10000;
}

/* The longest number [+-] digits [. digits] [e [+-] digits] at `at`; returns where it ends, NULL if there is none. */
static const char *scan_decimal(const char *at, const char *end, struct decimal *out_decimal)
{
    struct decimal decimal = {.plain = true};
    at = scan_sign(at, end, &decimal.negative);
    const char *whole = at, *first = skip_zeros(at, end);
    at = scan_digits(first, end, &decimal.digits);
    decimal.significant = count_of(first, at);
    bool any = at > whole;
    if (at < end && *at == '.') {
        const char *fraction = at + 1;
        first = decimal.significant == 0 ? skip_zeros(fraction, end) : fraction;
        at = scan_digits(first, end, &decimal.digits);
        decimal.significant += count_of(first, at);
        decimal.scale = -count_of(fraction, at);
        any = any || at > fraction;
    }
    if (any && at < end && (*at == 'e' || *at == 'E'))
        at = scan_exponent(at + 1, end, &decimal);
    *out_decimal = decimal;
    return any ? at : NULL;
}

/* 5^0 .. 5^27 are exact in 64 bits. */
static const uint64_t powers_of_five[] = {
    1,
    5,
    25,
    125,
    625,
    3125,
    15625,
    78125,
    390625,
    1953125,
    9765625,
    48828125,
    244140625,
    1220703125,
    6103515625,
    30517578125,
    152587890625,
    762939453125,
    3814697265625,
    19073486328125,
    95367431640625,
    476837158203125,
    2384185791015625,
    11920928955078125,
    59604644775390625,
    298023223876953125,
    1490116119384765625,
    7450580596923828125,
};

#ifdef __SIZEOF_INT128__
__extension__ typedef unsigned __int128 uint128;

/* The upper 64 bits of a b, and whether the lower ones are not all zero. */
static uint64_t multiply(uint64_t a, uint64_t b, bool *out_more)
{
    const uint128 product = (uint128)a * b;
    *out_more = (uint64_t)product != 0;
    return (uint64_t)(product >> 64);
}

/* a 2^63 / b, rounded down, and whether something is left over; both have their highest bit. */
static uint64_t divide(uint64_t a, uint64_t b, bool *out_more)
{
    const uint128 dividend = (uint128)a << 63;
    *out_more = dividend % b != 0;
    return (uint64_t)(dividend / b);
}
#else
static uint64_t multiply(uint64_t a, uint64_t b, bool *out_more)
{
    const uint64_t a_low = (uint32_t)a, a_high = a >> 32, b_low = (uint32_t)b, b_high = b >> 32;
    const uint64_t low = a_low * b_low, cross = a_high * b_low + (low >> 32);
    const uint64_t middle = a_low * b_high + (uint32_t)cross;
    *out_more = (uint32_t)low != 0 || (uint32_t)middle != 0;
    return a_high * b_high + (cross >> 32) + (middle >> 32);
}

static uint64_t divide(uint64_t a, uint64_t b, bool *out_more)
{
    uint64_t quotient = a >= b, rest = a >= b ? a - b : a;
    for (int bit = 0; bit < 63; bit++) {
        const bool carry = rest >> 63 != 0;
        rest <<= 1;
        quotient <<= 1;
        if (carry || rest >= b) {
            rest -= b;
            quotient |= 1;
        }
    }
    *out_more = rest != 0;
    return quotient;
}
#endif

/* digits 5^power or digits / 5^-power as 62 to 64 bits times a power of two. What those bits leave out is never zero
 * and never half a last place of the 53 that a double has: it sets the lowest bit, so that rounding them to a double
 * rounds as the exact value would. */
static double scale_by_five(uint64_t digits, int power, int exponent)
{
    const int shift = __builtin_clzll(digits);
    const int factor_shift = __builtin_clzll(powers_of_five[abs(power)]);
    const uint64_t factor = powers_of_five[abs(power)] << factor_shift;
    bool more;
    const uint64_t bits = power < 0 ? divide(digits << shift, factor, &more) : multiply(digits << shift, factor, &more);
    exponent += power < 0 ? factor_shift - 63 - shift : 64 - factor_shift - shift;
    return ldexp((double)(bits | more), exponent);
}

/* Whether the value is that of a double that is neither too large nor denormal, in so few operations that rounding can
 * be seen to be right. */
static bool convert_fast(const struct decimal *decimal, double *out_value)
{
    if (!decimal->plain || decimal->significant > digits_max)
        return false;
    double value = (double)decimal->digits;
    int scale = decimal->scale;
    if (decimal->digits <= exact_integer_max && abs(scale) <= exact_power_max)
        // Both factors are exact doubles, so the one rounding of the product or quotient is strtod's.
        value = scale < 0 ? value / exact_powers[-scale] : value * exact_powers[scale];
    else if (decimal->digits > 0 && abs(scale) <= five_power_max)
        value = scale_by_five(decimal->digits, scale, scale);
    else if (decimal->digits > 0)
        return false;
    *out_value = decimal->negative ? -value : value;
    return true;
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
    struct decimal part;
    if (comma && scan_decimal(at, comma, &part) == comma && comma + 1 < end && is_digit(comma[1]) &&
        scan_decimal(comma + 1, end, &part) == end)
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
    if (scan_decimal(at, end, &decimal) != end)
        return why_not(at, end);
    if (convert_fast(&decimal, out_value))
        return number_ok;
    double value = convert(at, (size_t)(end - at));
    if (!isfinite(value))
        return number_out_of_range;
    *out_value = value;
    return number_ok;
}

const char *number_read(const char *at, const char *end, double *out_value)
{
    struct decimal decimal;
    const char *stop = scan_decimal(at, end, &decimal);
    return stop && convert_fast(&decimal, out_value) ? stop : NULL;
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
