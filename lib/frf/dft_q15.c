/* SPDX-License-Identifier: MIT */
#include "frf/kernel.h"

/* |sum| <= 2^15 * (2^15 - 1) * N: has to stay below 2^63. */
CORE_STATIC_ASSERT((uint64_t)SERVOSCOPE_FRF_PERIOD_MAX <= ((uint64_t)1 << 62) >> (15 + 15),
                   accumulator_cannot_overflow);

/* One bin over one piece; returns the index after it. `channels` is a constant at every call but the last, so that the
 * sums stay in registers. The imaginary part is summed with the opposite sign because multiply-accumulate instructions
 * only add. */
static inline uint32_t add_bin(union frf_word *sums, struct frf_twiddles_q15 twiddles, uint32_t step, uint32_t index,
                               const int16_t *frames, uint32_t count, uint32_t channels, bool fresh)
{
    int64_t real[SERVOSCOPE_FRF_CHANNELS_MAX], minus_imaginary[SERVOSCOPE_FRF_CHANNELS_MAX];
    for (uint32_t c = 0; c < channels; ++c) {
        real[c] = fresh ? 0 : sums[2u * c].sum;
        minus_imaginary[c] = fresh ? 0 : -sums[2u * c + 1u].sum;
    }
    for (uint32_t n = 0; n < count; ++n) {
        int32_t cosine = twiddles.cosine[index], sine = twiddles.sine[index];
        for (uint32_t c = 0; c < channels; ++c) {
            real[c] += frames[c] * cosine;
            minus_imaginary[c] += frames[c] * sine;
        }
        frames += channels;
        index = frf_next_index(index, step, twiddles.period_samples);
    }
    for (uint32_t c = 0; c < channels; ++c) {
        sums[2u * c].sum = real[c];
        sums[2u * c + 1u].sum = -minus_imaginary[c];
    }
    return index;
}

static void add(struct frf_dft *self, const void *frames, uint32_t count, bool fresh)
{
    const int16_t *samples = frames;
    union frf_word *bank = frf_active_bank(self);
    for (uint32_t b = 0; b < self->bin_count; ++b) {
        union frf_word *bin = &self->bins[b / 2u];
        uint32_t step = bin->bins[b % 2u].step, index = bin->bins[b % 2u].index;
        union frf_word *sums = bank + frf_sum_offset(self, b, 0);
        switch (self->channels) {
        case 1:
            index = add_bin(sums, self->twiddles.q15, step, index, samples, count, 1, fresh);
            break;
        case 2:
            index = add_bin(sums, self->twiddles.q15, step, index, samples, count, 2, fresh);
            break;
        case 3:
            index = add_bin(sums, self->twiddles.q15, step, index, samples, count, 3, fresh);
            break;
        default:
            index = add_bin(sums, self->twiddles.q15, step, index, samples, count, self->channels, fresh);
            break;
        }
        bin->bins[b % 2u].index = (uint16_t)index;
    }
}

enum core_status frf_dft_init_q15(struct frf_dft *self, const struct frf_dft_config *config,
                                  const struct frf_twiddles_q15 *twiddles)
{
    if (!twiddles || !twiddles->sine || !twiddles->cosine) {
        return core_err_argument;
    }
    enum core_status status = frf_dft_set_up(self, config, twiddles->period_samples, frf_number_q15, add);
    if (status == core_ok) {
        self->twiddles.q15 = *twiddles;
    }
    return status;
}
