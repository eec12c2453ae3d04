/* SPDX-License-Identifier: MIT */
/// Tables of sine and cosine over one period, from which the DFT takes every factor: angle 2 pi k n / N is entry
/// k n mod N. A table is const data (in flash, made on the host) or is built at start-up by the functions below.
///
///     table      entries                    factors                              words, N = 2000 / 65536
///     full       5/4 N, or 2 N              correctly rounded, a load each                  2500 / 81920
///     quarter    N/4 + 1, N/2 + 1 or N + 1  the same to the last bit                         501 / 16385
///     two-level  about 2 sqrt(N) pairs      within 0.7 (Q15), 0.51 (Q23), 1.4 (Q31) steps    190 / 1024
///
/// The kind of table is its type, and each kind has its own frf_dft_init_*(); what comes after that is the
/// same for all. A program links the kinds that it sets up.
///
/// Full: where 4 divides N the cosine is the sine a quarter of a period on, and a quarter more sine is stored so that
///       it
/// is read without a wrap; elsewhere the cosine has its own table.
///
/// Quarter: sine of the first quarter, both ends included, in steps of which a sample is 1, 2 or 4: as many as it takes
/// for a quarter of a period to be a whole number of them. The cosine is the sine of the rest of the quarter.
///
/// Two-level: with B samples to a group, angle a of a group's middle and angle b from there, |b| <= pi B / N,
///
///     cos(a + b) = cos a - (cos a (1 - cos b) + sin a sin b)
///     sin(a + b) = sin a - (sin a (1 - cos b) - cos a sin b)
///
/// What is subtracted is small, so rounding of 1 - cos b and sin b, stored eight times finer, hardly matters.
#ifndef SERVOSCOPE_FRF_TWIDDLE_H
#define SERVOSCOPE_FRF_TWIDDLE_H

#include "core/config.h"
#include "core/status.h"

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Factors of the fixed-point tables: entry = round(factor * sin). One less than the power of two, so that 1 is there.
#define FRF_Q15_ONE 32767
#define FRF_Q23_ONE 8388607
#define FRF_Q31_ONE 2147483647

/// Words of storage for the full table of N samples. N is evaluated more than once.
#define FRF_TWIDDLE_WORDS(N) ((N) % 4u == 0u ? (N) + (N) / 4u : 2u * (N))

struct frf_twiddles_q15 {
    const int16_t *sine, *cosine; ///< N entries each may be read
    uint32_t period_samples;      ///< N
};

/// For samples of 24 bits.
struct frf_twiddles_q23 {
    const int32_t *sine, *cosine;
    uint32_t period_samples;
};

struct frf_twiddles_q31 {
    const int32_t *sine, *cosine;
    uint32_t period_samples;
};

struct frf_twiddles_f32 {
    const float *sine, *cosine;
    uint32_t period_samples;
};

/// Builds a table in storage of FRF_TWIDDLE_WORDS(period_samples) words. Uses math.h (sin, double); not for an
/// interrupt.
/// Range:    4 <= period_samples <= SERVOSCOPE_FRF_PERIOD_MAX
/// Accuracy: every entry correctly rounded from sin() in double of an angle reduced exactly to one octant, so that
///           sin(pi - x) = sin x, sin(-x) = -sin x and cos x = sin(pi/2 - x) hold exactly
/// Errors:   core_err_argument (null), core_err_frf_period, core_err_storage
/// Lifetime: storage must outlive out_twiddles
/// Test:     tests/unit/test_frf_dft.c
enum core_status frf_twiddles_build_q15(int16_t *storage, uint32_t words, uint32_t period_samples,
                                        struct frf_twiddles_q15 *out_twiddles);
enum core_status frf_twiddles_build_q23(int32_t *storage, uint32_t words, uint32_t period_samples,
                                        struct frf_twiddles_q23 *out_twiddles);
enum core_status frf_twiddles_build_q31(int32_t *storage, uint32_t words, uint32_t period_samples,
                                        struct frf_twiddles_q31 *out_twiddles);
enum core_status frf_twiddles_build_f32(float *storage, uint32_t words, uint32_t period_samples,
                                        struct frf_twiddles_f32 *out_twiddles);

/// Steps of a quarter table in a quarter of N samples: N/4, N/2 or N, as 4, 2 or 1 divides N. And words of its storage.
#define FRF_QUARTER_STEPS(N) ((N) % 4u == 0u ? (N) / 4u : (N) % 2u == 0u ? (N) / 2u : (N))
#define FRF_QUARTER_WORDS(N) (FRF_QUARTER_STEPS(N) + 1u)
CORE_STATIC_ASSERT(FRF_QUARTER_WORDS(65536u) == 16385u, quarter_of_65536_samples);
CORE_STATIC_ASSERT(FRF_QUARTER_WORDS(2002u) == 1002u, quarter_of_2002_samples);

struct frf_quarter_q15 {
    const int16_t *sine; ///< FRF_QUARTER_WORDS(N) entries
    uint32_t period_samples;
    uint32_t quarter_steps; ///< FRF_QUARTER_STEPS(N)
    uint32_t sample_steps;  ///< 1, 2 or 4
};

struct frf_quarter_q23 {
    const int32_t *sine;
    uint32_t period_samples;
    uint32_t quarter_steps;
    uint32_t sample_steps;
};

struct frf_quarter_q31 {
    const int32_t *sine;
    uint32_t period_samples;
    uint32_t quarter_steps;
    uint32_t sample_steps;
};

struct frf_quarter_f32 {
    const float *sine;
    uint32_t period_samples;
    uint32_t quarter_steps;
    uint32_t sample_steps;
};

/// Builds a quarter table in storage of FRF_QUARTER_WORDS(period_samples) words; otherwise as frf_twiddles_build_q15().
/// Test: tests/unit/test_frf_twiddle.c
enum core_status frf_quarter_build_q15(int16_t *storage, uint32_t words, uint32_t period_samples,
                                       struct frf_quarter_q15 *out_quarter);
enum core_status frf_quarter_build_q23(int32_t *storage, uint32_t words, uint32_t period_samples,
                                       struct frf_quarter_q23 *out_quarter);
enum core_status frf_quarter_build_q31(int32_t *storage, uint32_t words, uint32_t period_samples,
                                       struct frf_quarter_q31 *out_quarter);
enum core_status frf_quarter_build_f32(float *storage, uint32_t words, uint32_t period_samples,
                                       struct frf_quarter_f32 *out_quarter);

/// Bits of B, the samples of a group of a two-level table: about sqrt(N), and at least 32 groups, so that
/// |b| <= pi / 32 and 8 sin b stays below 1. N from 32 on; below there is a group a sample.
#define FRF_GROUP_BITS(N)                                                                                              \
    ((N) >= 32768u  ? 8u                                                                                               \
     : (N) >= 8192u ? 7u                                                                                               \
     : (N) >= 2048u ? 6u                                                                                               \
     : (N) >= 1024u ? 5u                                                                                               \
     : (N) >= 512u  ? 4u                                                                                               \
     : (N) >= 256u  ? 3u                                                                                               \
     : (N) >= 128u  ? 2u                                                                                               \
     : (N) >= 64u   ? 1u                                                                                               \
                    : 0u)
/// Elements of a two-level table's two arrays. N is evaluated more than once.
#define FRF_COARSE_POINTS(N) (((N) + (1u << FRF_GROUP_BITS(N)) - 1u) >> FRF_GROUP_BITS(N))
#define FRF_FINE_TURNS(N)    (1u << FRF_GROUP_BITS(N))
CORE_STATIC_ASSERT(FRF_COARSE_POINTS(2000u) + FRF_FINE_TURNS(2000u) == 63u + 32u, two_levels_of_2000_samples);
CORE_STATIC_ASSERT(FRF_COARSE_POINTS(16384u) + FRF_FINE_TURNS(16384u) == 256u, two_levels_of_16384_samples);
CORE_STATIC_ASSERT(FRF_COARSE_POINTS(65536u) + FRF_FINE_TURNS(65536u) == 512u, two_levels_of_65536_samples);

/// cos a and sin a in 32 bits: Q31 for factors of Q31, with the scale of the factors shifted up for shorter ones.
struct frf_point {
    int32_t cosine, sine;
};

/// 1 - cos b and sin b in Q34.
struct frf_turn {
    int32_t less, sine;
};

/// The same in Q18.
struct frf_turn_q15 {
    int16_t less, sine;
};

struct frf_point_f32 {
    float cosine, sine;
};

struct frf_turn_f32 {
    float less, sine;
};

struct frf_two_level_q15 {
    const struct frf_point *coarse;  ///< FRF_COARSE_POINTS(N), scaled by FRF_Q15_ONE 2^16
    const struct frf_turn_q15 *fine; ///< FRF_FINE_TURNS(N)
    uint32_t period_samples;
    uint32_t group_bits; ///< FRF_GROUP_BITS(N)
};

struct frf_two_level_q23 {
    const struct frf_point *coarse; ///< scaled by FRF_Q23_ONE 2^8
    const struct frf_turn *fine;
    uint32_t period_samples;
    uint32_t group_bits;
};

struct frf_two_level_q31 {
    const struct frf_point *coarse; ///< scaled by FRF_Q31_ONE
    const struct frf_turn *fine;
    uint32_t period_samples;
    uint32_t group_bits;
};

struct frf_two_level_f32 {
    const struct frf_point_f32 *coarse;
    const struct frf_turn_f32 *fine;
    uint32_t period_samples;
    uint32_t group_bits;
};

/// Builds a two-level table in arrays of FRF_COARSE_POINTS(period_samples) and FRF_FINE_TURNS(period_samples) elements.
/// Accuracy: factors off by at most, in steps of their own: q15 0.7, q23 0.51, q31 1.4 (0.5 is correct rounding); f32
///           8e-8 (3e-8). No fixed-point factor is beyond 1.
/// Errors:   core_err_argument (null), core_err_frf_period, core_err_storage (either array)
/// Test:     tests/unit/test_frf_twiddle.c
enum core_status frf_two_level_build_q15(struct frf_point *coarse, uint32_t coarse_points, struct frf_turn_q15 *fine,
                                         uint32_t fine_turns, uint32_t period_samples,
                                         struct frf_two_level_q15 *out_table);
enum core_status frf_two_level_build_q23(struct frf_point *coarse, uint32_t coarse_points, struct frf_turn *fine,
                                         uint32_t fine_turns, uint32_t period_samples,
                                         struct frf_two_level_q23 *out_table);
enum core_status frf_two_level_build_q31(struct frf_point *coarse, uint32_t coarse_points, struct frf_turn *fine,
                                         uint32_t fine_turns, uint32_t period_samples,
                                         struct frf_two_level_q31 *out_table);
enum core_status frf_two_level_build_f32(struct frf_point_f32 *coarse, uint32_t coarse_points,
                                         struct frf_turn_f32 *fine, uint32_t fine_turns, uint32_t period_samples,
                                         struct frf_two_level_f32 *out_table);

#ifdef __cplusplus
}
#endif

#endif
