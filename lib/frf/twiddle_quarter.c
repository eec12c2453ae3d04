/* SPDX-License-Identifier: MIT */
/* Needs math.h; firmware whose tables are in flash leaves this file out. */
#include "frf/kernel.h"

#include <math.h>

static enum core_status check(const void *storage, uint32_t words, uint32_t period, const void *out_quarter)
{
    enum core_status status = frf_check_table(storage, period, out_quarter);
    return status == core_ok && words < FRF_QUARTER_WORDS(period) ? core_err_storage : status;
}

/* 2 N eighths of a sample are a quarter of the period. */
static double entry_of(uint32_t step, uint32_t period)
{
    return frf_sine_of_eighths(step * (2u * period / FRF_QUARTER_STEPS(period)), period);
}

enum core_status frf_quarter_build_q15(int16_t *storage, uint32_t words, uint32_t period_samples,
                                       struct frf_quarter_q15 *out_quarter)
{
    enum core_status status = check(storage, words, period_samples, out_quarter);
    if (status != core_ok) {
        return status;
    }
    for (uint32_t i = 0; i < FRF_QUARTER_WORDS(period_samples); ++i) {
        storage[i] = (int16_t)round(FRF_Q15_ONE * entry_of(i, period_samples));
    }
    out_quarter->sine = storage;
    out_quarter->period_samples = period_samples;
    out_quarter->quarter_steps = FRF_QUARTER_STEPS(period_samples);
    out_quarter->sample_steps = 4u * FRF_QUARTER_STEPS(period_samples) / period_samples;
    return core_ok;
}

enum core_status frf_quarter_build_q23(int32_t *storage, uint32_t words, uint32_t period_samples,
                                       struct frf_quarter_q23 *out_quarter)
{
    enum core_status status = check(storage, words, period_samples, out_quarter);
    if (status != core_ok) {
        return status;
    }
    for (uint32_t i = 0; i < FRF_QUARTER_WORDS(period_samples); ++i) {
        storage[i] = (int32_t)round(FRF_Q23_ONE * entry_of(i, period_samples));
    }
    out_quarter->sine = storage;
    out_quarter->period_samples = period_samples;
    out_quarter->quarter_steps = FRF_QUARTER_STEPS(period_samples);
    out_quarter->sample_steps = 4u * FRF_QUARTER_STEPS(period_samples) / period_samples;
    return core_ok;
}

enum core_status frf_quarter_build_q31(int32_t *storage, uint32_t words, uint32_t period_samples,
                                       struct frf_quarter_q31 *out_quarter)
{
    enum core_status status = check(storage, words, period_samples, out_quarter);
    if (status != core_ok) {
        return status;
    }
    for (uint32_t i = 0; i < FRF_QUARTER_WORDS(period_samples); ++i) {
        storage[i] = (int32_t)round(FRF_Q31_ONE * entry_of(i, period_samples));
    }
    out_quarter->sine = storage;
    out_quarter->period_samples = period_samples;
    out_quarter->quarter_steps = FRF_QUARTER_STEPS(period_samples);
    out_quarter->sample_steps = 4u * FRF_QUARTER_STEPS(period_samples) / period_samples;
    return core_ok;
}

enum core_status frf_quarter_build_f32(float *storage, uint32_t words, uint32_t period_samples,
                                       struct frf_quarter_f32 *out_quarter)
{
    enum core_status status = check(storage, words, period_samples, out_quarter);
    if (status != core_ok) {
        return status;
    }
    for (uint32_t i = 0; i < FRF_QUARTER_WORDS(period_samples); ++i) {
        storage[i] = (float)entry_of(i, period_samples);
    }
    out_quarter->sine = storage;
    out_quarter->period_samples = period_samples;
    out_quarter->quarter_steps = FRF_QUARTER_STEPS(period_samples);
    out_quarter->sample_steps = 4u * FRF_QUARTER_STEPS(period_samples) / period_samples;
    return core_ok;
}
