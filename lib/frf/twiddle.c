/* SPDX-License-Identifier: MIT */
/* Needs math.h; firmware whose tables are in flash leaves this file out. */
#include "frf/kernel.h"

#include <math.h>
#include <stddef.h>

double frf_sine_of_eighths(uint32_t eighths, uint32_t period)
{
    static const double two_pi = 6.28318530717958647692;
    double sign = 1.0;
    if (eighths >= 4u * period) {
        eighths -= 4u * period;
        sign = -1.0;
    }
    if (eighths > 2u * period) {
        eighths = 4u * period - eighths;
    }
    if (eighths > period) {
        return sign * cos(two_pi * (double)(2u * period - eighths) / (8.0 * (double)period));
    }
    return sign * sin(two_pi * (double)eighths / (8.0 * (double)period));
}

/* Entry `index` of the storage: sine, then as much sine again as makes the cosine readable, or a cosine table. */
static double entry_of(uint32_t index, uint32_t period)
{
    if (index < period) {
        return frf_sine_of_eighths(8u * index, period);
    }
    uint32_t eighths = 8u * (index - period) + (period % 4u == 0u ? 0u : 2u * period);
    return frf_sine_of_eighths(eighths >= 8u * period ? eighths - 8u * period : eighths, period);
}

static uint32_t cosine_offset(uint32_t period)
{
    return period % 4u == 0u ? period / 4u : period;
}

enum core_status frf_check_table(const void *storage, uint32_t period, const void *out_table)
{
    if (!storage || !out_table) {
        return core_err_argument;
    }
    return period < 4u || period > SERVOSCOPE_FRF_PERIOD_MAX ? core_err_frf_period : core_ok;
}

static enum core_status check(const void *storage, uint32_t words, uint32_t period, const void *out_twiddles)
{
    enum core_status status = frf_check_table(storage, period, out_twiddles);
    return status == core_ok && words < FRF_TWIDDLE_WORDS(period) ? core_err_storage : status;
}

enum core_status frf_twiddles_build_q15(int16_t *storage, uint32_t words, uint32_t period_samples,
                                        struct frf_twiddles_q15 *out_twiddles)
{
    enum core_status status = check(storage, words, period_samples, out_twiddles);
    if (status != core_ok) {
        return status;
    }
    for (uint32_t i = 0; i < FRF_TWIDDLE_WORDS(period_samples); ++i) {
        storage[i] = (int16_t)round(FRF_Q15_ONE * entry_of(i, period_samples));
    }
    out_twiddles->sine = storage;
    out_twiddles->cosine = storage + cosine_offset(period_samples);
    out_twiddles->period_samples = period_samples;
    return core_ok;
}

enum core_status frf_twiddles_build_q23(int32_t *storage, uint32_t words, uint32_t period_samples,
                                        struct frf_twiddles_q23 *out_twiddles)
{
    enum core_status status = check(storage, words, period_samples, out_twiddles);
    if (status != core_ok) {
        return status;
    }
    for (uint32_t i = 0; i < FRF_TWIDDLE_WORDS(period_samples); ++i) {
        storage[i] = (int32_t)round(FRF_Q23_ONE * entry_of(i, period_samples));
    }
    out_twiddles->sine = storage;
    out_twiddles->cosine = storage + cosine_offset(period_samples);
    out_twiddles->period_samples = period_samples;
    return core_ok;
}

enum core_status frf_twiddles_build_q31(int32_t *storage, uint32_t words, uint32_t period_samples,
                                        struct frf_twiddles_q31 *out_twiddles)
{
    enum core_status status = check(storage, words, period_samples, out_twiddles);
    if (status != core_ok) {
        return status;
    }
    for (uint32_t i = 0; i < FRF_TWIDDLE_WORDS(period_samples); ++i) {
        storage[i] = (int32_t)round(FRF_Q31_ONE * entry_of(i, period_samples));
    }
    out_twiddles->sine = storage;
    out_twiddles->cosine = storage + cosine_offset(period_samples);
    out_twiddles->period_samples = period_samples;
    return core_ok;
}

enum core_status frf_twiddles_build_f32(float *storage, uint32_t words, uint32_t period_samples,
                                        struct frf_twiddles_f32 *out_twiddles)
{
    enum core_status status = check(storage, words, period_samples, out_twiddles);
    if (status != core_ok) {
        return status;
    }
    for (uint32_t i = 0; i < FRF_TWIDDLE_WORDS(period_samples); ++i) {
        storage[i] = (float)entry_of(i, period_samples);
    }
    out_twiddles->sine = storage;
    out_twiddles->cosine = storage + cosine_offset(period_samples);
    out_twiddles->period_samples = period_samples;
    return core_ok;
}
