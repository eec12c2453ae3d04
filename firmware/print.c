/* SPDX-License-Identifier: MIT */
#include "firmware/print.h"

#include "firmware/board.h"

enum { digits_max = 20 };

/* Digits by subtraction. */
void print_i64(int64_t value)
{
    char text[digits_max + 2];
    unsigned at = 0;
    uint64_t rest = value < 0 ? 0u - (uint64_t)value : (uint64_t)value, power = 10000000000000000000u;
    if (value < 0) {
        text[at++] = '-';
    }
    for (unsigned begun = at; power > 0; power /= 10u) {
        char digit = '0';
        for (; rest >= power; rest -= power) {
            ++digit;
        }
        if (digit != '0' || at > begun || power == 1u) {
            text[at++] = digit;
        }
    }
    text[at] = '\0';
    board_print(text);
}

void print_u32(uint32_t value)
{
    print_i64((int64_t)value);
}

void print_hex(uint32_t value)
{
    char text[11] = "0x";
    for (unsigned i = 0; i < 8u; ++i) {
        text[2u + i] = "0123456789abcdef"[value >> (28u - 4u * i) & 15u];
    }
    board_print(text);
}
