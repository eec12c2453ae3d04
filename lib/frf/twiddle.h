/* SPDX-License-Identifier: MIT */
/// Tables of sine and cosine over one period, from which the DFT takes every factor exactly: angle 2 pi k n / N is
/// entry k n mod N. A table is const data (in flash, made on the host) or is built at start-up by
/// frf_twiddles_build_*().
///
/// Where 4 divides N the cosine is the sine a quarter of a period on, and a quarter more sine is stored so that it is
/// read without a wrap; elsewhere the cosine has its own table.
#ifndef SERVOSCOPE_FRF_TWIDDLE_H
#define SERVOSCOPE_FRF_TWIDDLE_H

#include "core/config.h"
#include "core/status.h"

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Words of storage for the table of N samples. N is evaluated more than once.
#define FRF_TWIDDLE_WORDS(N) ((N) % 4u == 0u ? (N) + (N) / 4u : 2u * (N))

/// Factors of the fixed-point tables: entry = round(factor * sin). One less than the power of two, so that 1 is there.
#define FRF_Q15_ONE 32767
#define FRF_Q31_ONE 2147483647

struct frf_twiddles_q15 {
    const int16_t *sine, *cosine; ///< N entries each may be read
    uint32_t period_samples;      ///< N
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
enum core_status frf_twiddles_build_q15(int16_t *storage, uint32_t words, uint32_t period_samples,
                                        struct frf_twiddles_q15 *out_twiddles);
enum core_status frf_twiddles_build_q31(int32_t *storage, uint32_t words, uint32_t period_samples,
                                        struct frf_twiddles_q31 *out_twiddles);
enum core_status frf_twiddles_build_f32(float *storage, uint32_t words, uint32_t period_samples,
                                        struct frf_twiddles_f32 *out_twiddles);

#ifdef __cplusplus
}
#endif

#endif
