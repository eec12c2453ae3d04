/* SPDX-License-Identifier: MIT */
/// Little-endian numbers in byte spans of any alignment, on a host of either byte order.
/// Compilers turn each into one load or store where the target allows it.
#ifndef SERVOSCOPE_CORE_BYTES_H
#define SERVOSCOPE_CORE_BYTES_H

#include <stdint.h>

static inline uint16_t core_get_u16(const uint8_t *bytes)
{
    return (uint16_t)(bytes[0] | ((unsigned)bytes[1] << 8));
}

static inline uint32_t core_get_u32(const uint8_t *bytes)
{
    return bytes[0] | ((uint32_t)bytes[1] << 8) | ((uint32_t)bytes[2] << 16) | ((uint32_t)bytes[3] << 24);
}

/* The conversion of an unsigned value above the signed maximum is implementation-defined in C99, hence the detour. */
static inline int16_t core_get_i16(const uint8_t *bytes)
{
    int32_t value = core_get_u16(bytes);
    return (int16_t)(value < 0x8000 ? value : value - 0x10000);
}

static inline int32_t core_get_i32(const uint8_t *bytes)
{
    uint32_t value = core_get_u32(bytes);
    return value < 0x80000000u ? (int32_t)value : (int32_t)(value - 0x80000000u) + INT32_MIN;
}

static inline void core_put_u16(uint8_t *out_bytes, uint16_t value)
{
    out_bytes[0] = (uint8_t)(value & 0xFFu);
    out_bytes[1] = (uint8_t)(value >> 8);
}

static inline void core_put_u32(uint8_t *out_bytes, uint32_t value)
{
    out_bytes[0] = (uint8_t)(value & 0xFFu);
    out_bytes[1] = (uint8_t)((value >> 8) & 0xFFu);
    out_bytes[2] = (uint8_t)((value >> 16) & 0xFFu);
    out_bytes[3] = (uint8_t)(value >> 24);
}

/// The bits of an IEEE single as a number, and back, without touching a float register in integer-only code.
union core_float_bits {
    float value;
    uint32_t bits;
};

/// Whether the bits are those of a number: neither infinite nor NaN.
static inline int core_float_bits_are_finite(uint32_t bits)
{
    return (bits & 0x7F800000u) != 0x7F800000u;
}

#endif
