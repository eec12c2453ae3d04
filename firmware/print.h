/* SPDX-License-Identifier: MIT */
/// Numbers as text, without stdio.
#ifndef SERVOSCOPE_FIRMWARE_PRINT_H
#define SERVOSCOPE_FIRMWARE_PRINT_H

#include <stdint.h>

void print_u32(uint32_t value);
void print_i64(int64_t value);
void print_hex(uint32_t value);

#endif
