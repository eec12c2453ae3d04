/* SPDX-License-Identifier: MIT */
/// Times of day as programs write them.
#define _XOPEN_SOURCE 700 /* strncasecmp */
#include "lab/record/foreign_text.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

static const int64_t second_ns = 1000000000;
static const int64_t day_ns = 86400 * (int64_t)1000000000;

/// A whole number of least to most digits at *io_at, which moves behind it; -1: there is none.
static int64_t read_digits(const char **io_at, size_t least, size_t most)
{
    const size_t digits = strspn(*io_at, "0123456789");
    int64_t value = 0;
    if (digits < least || digits > most)
        return -1;
    for (size_t i = 0; i < digits; i++)
        value = 10 * value + (*(*io_at)++ - '0');
    return value;
}

/// Days since 1970-03-01 of a date of the Gregorian calendar: years begin in March, so that the leap day is the last.
static int64_t day_number(int64_t year, int64_t month, int64_t day)
{
    const int64_t months = month < 3 ? month + 9 : month - 3;
    const int64_t years = month < 3 ? year - 1 : year;
    return 365 * years + years / 4 - years / 100 + years / 400 + (153 * months + 2) / 5 + day - 1;
}

/// The year is the first or the last of the three; 3/4/2026 is a day of March or of April: whoever wrote it knows.
static bool take_date(int64_t first, int64_t second, int64_t third, bool slashes, struct foreign_stamp *io_stamp)
{
    const bool year_first = first >= 1000;
    if (third < 1 || (!year_first && third < 1000))
        return false;
    const int64_t year = year_first ? first : third;
    const int64_t day = year_first ? third : first;
    io_stamp->dated = (year_first || !slashes) && second <= 12 && day <= 31;
    io_stamp->day = io_stamp->dated ? day_number(year, second, day) : 0;
    return true;
}

/// Three numbers with one mark between them.
static bool read_date(const char **io_at, struct foreign_stamp *io_stamp)
{
    const char *at = *io_at;
    const int64_t first = read_digits(&at, 1, 4);
    const char mark = *at;
    if (first < 0 || mark == '\0' || !strchr("-/.", mark))
        return false;
    at++;
    const int64_t second = read_digits(&at, 1, 2);
    if (second < 1 || *at != mark)
        return false;
    at++;
    const int64_t third = read_digits(&at, 1, 4);
    *io_at = at;
    return take_date(first, second, third, mark == '/', io_stamp);
}

/// Digits behind a point, a comma, or (of three) a colon, in ns; 0 if there are none.
static int64_t read_fraction(const char **io_at)
{
    if (**io_at == '\0')
        return 0;
    const char *at = *io_at + 1;
    const size_t digits = strspn(at, "0123456789");
    if (digits == 0 || (**io_at != '.' && **io_at != ',' && !(**io_at == ':' && digits == 3)))
        return 0;
    int64_t value = 0;
    int64_t scale = second_ns;
    for (size_t i = 0; i<digits; i++, scale = scale> 1 ? scale / 10 : scale)
        value = i < 9 ? 10 * value + (at[i] - '0') : value;
    *io_at = at + digits;
    return digits < 9 ? value * scale : value;
}

static bool read_clock(const char **io_at, int64_t *out_ns)
{
    const int64_t hours = read_digits(io_at, 1, 4);
    if (hours < 0 || *(*io_at)++ != ':')
        return false;
    const int64_t minutes = read_digits(io_at, 2, 2);
    if (minutes < 0 || minutes > 59 || *(*io_at)++ != ':')
        return false;
    const int64_t seconds = read_digits(io_at, 2, 2);
    if (seconds < 0 || seconds > 60)
        return false;
    *out_ns = (3600 * hours + 60 * minutes + seconds) * second_ns + read_fraction(io_at);
    return true;
}

static const char *skip_blanks(const char *at)
{
    while (*at == ' ')
        at++;
    return at;
}

static const char *take_noon(const char *at, int64_t *io_ns)
{
    const int64_t noon = 43200 * second_ns;
    if (strncasecmp(at, "am", 2) != 0 && strncasecmp(at, "pm", 2) != 0)
        return at;
    const bool twelve = *io_ns >= noon;
    *io_ns += (twelve ? -noon : 0) + (tolower((unsigned char)*at) == 'p' ? noon : 0);
    return skip_blanks(at + 2);
}

/// "+01", "+01:00" or "+0100" taken off; NULL if that is none.
static const char *take_zone(const char *at, int64_t *io_ns)
{
    const int64_t sign = *at++ == '+' ? -1 : 1;
    const int64_t hours = read_digits(&at, 2, 4);
    const int64_t whole = hours > 23 ? hours / 100 : hours;
    int64_t minutes = hours > 23 ? hours % 100 : 0;
    if (hours >= 0 && *at == ':') {
        at++;
        minutes = read_digits(&at, 2, 2);
    }
    *io_ns += sign * (3600 * whole + 60 * minutes) * second_ns;
    return hours < 0 || minutes < 0 ? NULL : at;
}

/// AM and PM, a time zone; false if something else is behind the clock.
static bool read_rest(const char *at, int64_t *io_ns)
{
    at = take_noon(skip_blanks(at), io_ns);
    if (*at == 'Z' || strncmp(at, "UTC", 3) == 0)
        at += *at == 'Z' ? 1 : 3;
    if (*at == '+' || *at == '-')
        at = take_zone(at, io_ns);
    return at && *skip_blanks(at) == '\0';
}

bool foreign_stamp_read(const char *cell, struct foreign_stamp *out_stamp)
{
    const char *const begin = skip_blanks(cell);
    const char *at = begin;
    *out_stamp = (struct foreign_stamp){.dated = false};
    if (!read_date(&at, out_stamp)) {
        at = begin;
    } else {
        if (*at != 'T' && *at != ' ' && *at != '_' && *at != ',')
            return false;
        at = skip_blanks(at + 1);
    }
    return read_clock(&at, &out_stamp->ns) && read_rest(at, &out_stamp->ns);
}

double foreign_stamp_seconds(const struct foreign_stamp *from, const struct foreign_stamp *to)
{
    const int64_t days = from->dated && to->dated ? to->day - from->day : 0;
    int64_t ns = to->ns - from->ns;
    // A damaged date is centuries off, which is more than 64 bits of ns hold.
    if (days < -36500 || days > 36500)
        return (double)days * 86400.0 + (double)ns / 1e9;
    ns += days * day_ns;
    if (!(from->dated && to->dated) && ns < -day_ns / 2)
        ns += day_ns;
    return (double)ns / 1e9;
}
