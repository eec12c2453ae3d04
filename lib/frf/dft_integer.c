/* SPDX-License-Identifier: MIT */
/* Both integer variants: one loop, compiled once for each width of the table. */
#include "frf/kernel.h"

/* |sum| <= 2^15 * (2^31 - 1) * N has to stay below 2^63; Q15 follows. */
CORE_STATIC_ASSERT((uint64_t)SERVOSCOPE_FRF_PERIOD_MAX <= ((uint64_t)1 << 62) >> (15 + 31),
                   accumulator_cannot_overflow);

struct table {
    const void *cosine, *sine;
    uint32_t period_samples;
    bool is_q31; ///< entries are int32_t, else int16_t
};

static inline int32_t entry(const void *table, uint32_t index, bool is_q31)
{
    return is_q31 ? ((const int32_t *)table)[index] : ((const int16_t *)table)[index];
}

/* 16 by 16 bit fits 32, which a core without a long multiply does in one instruction. */
static inline int64_t product(int16_t sample, int32_t factor, bool is_q31)
{
    return is_q31 ? (int64_t)sample * factor : (int64_t)(sample * factor);
}

/* One bin over one piece; returns the index after it. `channels` is a constant at every call but the last, and
 * table.is_q31 at every one, so that the sums stay in registers. The imaginary part is summed with the opposite sign
 * because multiply-accumulate instructions only add. */
static inline uint32_t add_bin(union frf_word *sums, struct table table, uint32_t step, uint32_t index,
                               const int16_t *frames, uint32_t count, uint32_t channels, bool fresh)
{
    int64_t real[SERVOSCOPE_FRF_CHANNELS_MAX], minus_imaginary[SERVOSCOPE_FRF_CHANNELS_MAX];
    for (uint32_t c = 0; c < channels; ++c) {
        real[c] = fresh ? 0 : sums[2u * c].sum;
        minus_imaginary[c] = fresh ? 0 : -sums[2u * c + 1u].sum;
    }
    for (uint32_t n = 0; n < count; ++n) {
        int32_t cosine = entry(table.cosine, index, table.is_q31), sine = entry(table.sine, index, table.is_q31);
        for (uint32_t c = 0; c < channels; ++c) {
            real[c] += product(frames[c], cosine, table.is_q31);
            minus_imaginary[c] += product(frames[c], sine, table.is_q31);
        }
        frames += channels;
        index = frf_next_index(index, step, table.period_samples);
    }
    for (uint32_t c = 0; c < channels; ++c) {
        sums[2u * c].sum = real[c];
        sums[2u * c + 1u].sum = -minus_imaginary[c];
    }
    return index;
}

static inline void add(struct frf_dft *self, struct table table, const int16_t *samples, uint32_t count, bool fresh)
{
    union frf_word *bank = frf_active_bank(self);
    for (uint32_t b = 0; b < self->bin_count; ++b) {
        union frf_word *bin = &self->bins[b / 2u];
        uint32_t step = bin->bins[b % 2u].step, index = bin->bins[b % 2u].index;
        union frf_word *sums = bank + frf_sum_offset(self, b, 0);
        switch (self->channels) {
        case 1:
            index = add_bin(sums, table, step, index, samples, count, 1, fresh);
            break;
        case 2:
            index = add_bin(sums, table, step, index, samples, count, 2, fresh);
            break;
        case 3:
            index = add_bin(sums, table, step, index, samples, count, 3, fresh);
            break;
        default:
            index = add_bin(sums, table, step, index, samples, count, self->channels, fresh);
            break;
        }
        bin->bins[b % 2u].index = (uint16_t)index;
    }
}

static void add_q15(struct frf_dft *self, const void *frames, uint32_t count, bool fresh)
{
    const struct frf_twiddles_q15 *twiddles = &self->twiddles.q15;
    struct table table = {twiddles->cosine, twiddles->sine, twiddles->period_samples, false};
    add(self, table, frames, count, fresh);
}

static void add_q31(struct frf_dft *self, const void *frames, uint32_t count, bool fresh)
{
    const struct frf_twiddles_q31 *twiddles = &self->twiddles.q31;
    struct table table = {twiddles->cosine, twiddles->sine, twiddles->period_samples, true};
    add(self, table, frames, count, fresh);
}

enum core_status frf_dft_init_q15(struct frf_dft *self, const struct frf_dft_config *config,
                                  const struct frf_twiddles_q15 *twiddles)
{
    if (!twiddles || !twiddles->sine || !twiddles->cosine) {
        return core_err_argument;
    }
    enum core_status status = frf_dft_set_up(self, config, twiddles->period_samples, frf_number_q15, add_q15);
    if (status == core_ok) {
        self->twiddles.q15 = *twiddles;
    }
    return status;
}

enum core_status frf_dft_init_q31(struct frf_dft *self, const struct frf_dft_config *config,
                                  const struct frf_twiddles_q31 *twiddles)
{
    if (!twiddles || !twiddles->sine || !twiddles->cosine) {
        return core_err_argument;
    }
    enum core_status status = frf_dft_set_up(self, config, twiddles->period_samples, frf_number_q31, add_q31);
    if (status == core_ok) {
        self->twiddles.q31 = *twiddles;
    }
    return status;
}
