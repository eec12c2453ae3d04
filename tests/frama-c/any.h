/* SPDX-License-Identifier: MIT */
/// Values of which Frama-C's Eva knows nothing but the type.
#ifndef SERVOSCOPE_TESTS_FRAMA_C_ANY_H
#define SERVOSCOPE_TESTS_FRAMA_C_ANY_H

#include "core/real.h"

#include <__fc_builtin.h>
#include <stdbool.h>
#include <stdint.h>

extern volatile uint32_t any_word;
extern volatile int32_t any_signed_word;
extern volatile core_real any_number; ///< NaN and infinite too: Eva runs with -warn-special-float none

static inline uint32_t any_u32(void)
{
    return any_word;
}

static inline int32_t any_i32(void)
{
    return any_signed_word;
}

static inline core_real any_real(void)
{
    return any_number;
}

static inline bool any_bool(void)
{
    return any_word % 2u != 0u;
}

/* low .. high. The analyser's own: written out in C it would be three cases, and those of every sample multiply. */
static inline uint32_t any_between(uint32_t low, uint32_t high)
{
    return Frama_C_unsigned_int_interval(low, high);
}

static inline int16_t any_i16_between(int16_t low, int16_t high)
{
    return (int16_t)Frama_C_interval(low, high);
}

static inline uint8_t any_u8(void)
{
    return (uint8_t)Frama_C_unsigned_int_interval(0, 255);
}

#endif
