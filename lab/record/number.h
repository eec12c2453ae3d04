/* SPDX-License-Identifier: MIT */
/// Numbers as text, both ways: the decimal point is a point whatever the locale says, what is written reads back bit
/// for bit, and what is no plain decimal number is refused with a reason.
#ifndef SERVOSCOPE_RECORD_NUMBER_H
#define SERVOSCOPE_RECORD_NUMBER_H

#include <stddef.h>

enum number_status {
    number_ok = 0,
    number_empty,         ///< nothing but blanks
    number_not_a_number,  ///< nan, inf, words, rests
    number_hexadecimal,   ///< 0x..., which strtod would take
    number_decimal_comma, ///< 1,5
    number_out_of_range,  ///< beyond the largest double
};

enum { number_text_size = 32 };

/// Reads the decimal number in text[0 .. length), blanks around it allowed; *out_value is set only with number_ok.
/// Test: tests/unit/test_run_file.c
enum number_status number_parse(const char *text, size_t length, double *out_value);

/// Reads the number that begins at `at`, to the last bit, and returns where it ends. For numbers of up to 19 digits and
/// powers of ten from -27 to 27, which is what recordings hold; NULL for others and for what is none: number_parse
/// tells which.
/// Test: tests/unit/test_run_file.c
const char *number_read(const char *at, const char *end, double *out_value);

/// What is wrong, to follow the quoted text in a message: "is not a number".
const char *number_status_str(enum number_status status);

/// Writes the shortest of 9, 12, 15 or 17 digits that reads back bit for bit; `value` has to be finite.
void number_format(double value, char out_text[number_text_size]);

#endif
