/* SPDX-License-Identifier: MIT */
/// A factor of a two-level table, made of its two parts; not for applications.
///
/// A part's own error and the sum's are all there is to a factor's: what is taken off the coarse value is small, and
/// formed finer than the result. Differences are modulo 2^32, so that no table whatever makes one overflow; with
/// those of frf_two_level_build_*() none wraps.
#ifndef SERVOSCOPE_FRF_TWO_LEVEL_H
#define SERVOSCOPE_FRF_TWO_LEVEL_H

#include "core/fixed.h"
#include "frf/twiddle.h"

#ifdef __cplusplus
extern "C" {
#endif

/* FRF_GROUP_BITS(): as long as a bit more leaves 32 groups and at most twice as many turns as groups. */
static inline uint32_t frf_group_bits(uint32_t period)
{
    uint32_t bits = 0;
    while (period >> (bits + 1u) >= 32u && period >> (2u * bits + 1u) > 0u) {
        ++bits;
    }
    return bits;
}

/* Q31 by Q34 and the upper word of it: what is taken off, in Q33, plus `more` of Q33. |turn| < 0.1 2^34, so that the
 * sum stays below 2^63. */
static inline int32_t frf_off_cosine_q33(const struct frf_point *coarse, const struct frf_turn *turn, int32_t more)
{
    int64_t sum = (int64_t)coarse->cosine * turn->less + (int64_t)coarse->sine * turn->sine;
    return core_high_word_i64(sum + more * ((int64_t)1 << 32));
}

static inline int32_t frf_off_sine_q33(const struct frf_point *coarse, const struct frf_turn *turn, int32_t more)
{
    int64_t sum = (int64_t)coarse->sine * turn->less - (int64_t)coarse->cosine * turn->sine;
    return core_high_word_i64(sum + more * ((int64_t)1 << 32));
}

/* minuend - subtrahend / 4 + half, the quarter rounded down */
static inline int32_t frf_minus_quarter(int32_t minuend, int32_t subtrahend, uint32_t half)
{
    return core_signed_i32((uint32_t)minuend - (uint32_t)core_shift_down_i32(subtrahend, 2) + half);
}

static inline struct frf_point frf_two_level_factor_q31(const struct frf_point *coarse, const struct frf_turn *turn)
{
    struct frf_point factor;
    factor.cosine = frf_minus_quarter(coarse->cosine, frf_off_cosine_q33(coarse, turn, 2), 0);
    factor.sine = frf_minus_quarter(coarse->sine, frf_off_sine_q33(coarse, turn, 2), 0);
    return factor;
}

/* Eight bits more than the factor has are there until the end. */
static inline struct frf_point frf_two_level_factor_q23(const struct frf_point *coarse, const struct frf_turn *turn)
{
    struct frf_point factor;
    factor.cosine =
        core_shift_down_i32(frf_minus_quarter(coarse->cosine, frf_off_cosine_q33(coarse, turn, 0), 128u), 8);
    factor.sine = core_shift_down_i32(frf_minus_quarter(coarse->sine, frf_off_sine_q33(coarse, turn, 0), 128u), 8);
    return factor;
}

/* Sixteen bits more, and products of 16 by 16 bits for cores that multiply no wider: Q15 by Q18, |turn| < 0.1 2^18, so
 * that two stay below 2^31. */
static inline struct frf_point frf_two_level_factor_q15(const struct frf_point *coarse, const struct frf_turn_q15 *turn)
{
    int32_t cosine = core_shift_down_i32(coarse->cosine, 16), sine = core_shift_down_i32(coarse->sine, 16);
    int32_t off_cosine = cosine * turn->less + sine * turn->sine;
    int32_t off_sine = sine * turn->less - cosine * turn->sine;
    struct frf_point factor;
    factor.cosine = core_shift_down_i32(frf_minus_quarter(coarse->cosine, off_cosine, 32768u), 16);
    factor.sine = core_shift_down_i32(frf_minus_quarter(coarse->sine, off_sine, 32768u), 16);
    return factor;
}

#ifdef __cplusplus
}
#endif

#endif
