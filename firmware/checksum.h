/* SPDX-License-Identifier: MIT */
/// Fletcher's sum of integer results, in which the order counts.
#ifndef SERVOSCOPE_FIRMWARE_CHECKSUM_H
#define SERVOSCOPE_FIRMWARE_CHECKSUM_H

#include <stdint.h>

/// Begin with 1, 0.
static inline void checksum_add(uint32_t *io_checksum, int64_t value)
{
    uint64_t bits = (uint64_t)value;
    io_checksum[0] += (uint32_t)bits;
    io_checksum[1] += io_checksum[0];
    io_checksum[0] += (uint32_t)(bits >> 32);
    io_checksum[1] += io_checksum[0];
}

#endif
