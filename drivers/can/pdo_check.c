/* SPDX-License-Identifier: MIT */
#include "drivers/can/pdo_check.h"

uint8_t pdo_check(uint8_t check, const uint8_t *data, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        check ^= data[i];
        for (int bit = 0; bit < 8; bit++)
            check = (uint8_t)((check & 0x80) ? (check << 1) ^ 0x1D : check << 1);
    }
    return check;
}
