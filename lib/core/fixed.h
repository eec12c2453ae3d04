/* SPDX-License-Identifier: MIT */
/// Fixed-point helpers of the sample path: rounding and saturation, defined for every input.
#ifndef SERVOSCOPE_CORE_FIXED_H
#define SERVOSCOPE_CORE_FIXED_H

#include <stdbool.h>
#include <stdint.h>

#define CORE_Q30_ONE 1073741824 ///< 1.0 in Q30

/// value / 2^shift, rounded to nearest, halves away from zero (so that it is odd in `value`). 1 <= shift <= 62,
/// |value| <= 2^62. The division by a power of two is defined for negative values where >> is not, and costs a shift.
static inline int64_t core_round_shift_i64(int64_t value, unsigned shift)
{
    int64_t half = (int64_t)1 << (shift - 1u);
    return (value + (value < 0 ? -half : half)) / ((int64_t)1 << shift);
}

/// value / 2^shift, rounded down. 0 <= shift <= 31. >> of a negative value is the implementation's choice, of its
/// complement it is not; compilers make one shift of both.
static inline int32_t core_shift_down_i32(int32_t value, unsigned shift)
{
    return value < 0 ? ~(~value >> shift) : value >> shift; // Deviation 10.1: an int32_t is two's complement
}

/// The number modulo 2^32 that an int32_t can hold. C leaves the conversion of an unsigned value above the signed
/// maximum to the implementation, hence the detour, of which nothing is left in the object.
static inline int32_t core_signed_i32(uint32_t value)
{
    return value < 0x80000000u ? (int32_t)value : (int32_t)(value - 0x80000000u) + INT32_MIN;
}

/// value / 2^32, rounded down.
static inline int32_t core_high_word_i64(int64_t value)
{
    return core_signed_i32((uint32_t)((uint64_t)value >> 32));
}

/// value * factor in Q30, factor 0 .. 1: exact for 0 and 1. |product| <= 2^31 * 2^30 = 2^61.
static inline int32_t core_scale_q30(int32_t value, int32_t factor_q30)
{
    return (int32_t)core_round_shift_i64((int64_t)value * factor_q30, 30);
}

/// The nearest value within -limit .. limit; *io_saturated is set if that is another one, else left alone.
static inline int32_t core_saturate_i32(int64_t value, int32_t limit, bool *io_saturated)
{
    if (value > limit) {
        *io_saturated = true;
        return limit;
    }
    if (value < -(int64_t)limit) {
        *io_saturated = true;
        return -limit;
    }
    return (int32_t)value;
}

/// counter + 1, stopping at the largest value, so that a counter that was once non-zero stays so.
static inline uint32_t core_count_up(uint32_t counter)
{
    return counter == UINT32_MAX ? counter : counter + 1u;
}

#endif
