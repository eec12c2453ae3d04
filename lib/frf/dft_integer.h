/* SPDX-License-Identifier: MIT */
/* The integer variants' loop, not a header of its own: dft_*.c include it, each once, having defined
 *   FRF_TABLE   the type of the table
 *   FRF_MEMBER  its member of struct frf_dft's twiddles
 *   FRF_SAMPLE  the type of a sample
 *   FRF_FACTOR  the type in which a sample and a factor are multiplied without overflow
 * and defines look_up() after it. */
#include "frf/kernel.h"

/* The two factors of an angle. */
static inline void look_up(const FRF_TABLE *table, uint32_t index, FRF_FACTOR *out_cosine, FRF_FACTOR *out_sine);

/* One bin over one piece; returns the index after it. `channels` is a constant at every call but the last, so that the
 * sums stay in registers. The imaginary part is summed with the opposite sign because multiply-accumulate instructions
 * only add. */
static inline uint32_t add_bin(union frf_word *sums, const FRF_TABLE table, uint32_t step, uint32_t index,
                               const FRF_SAMPLE *frames, uint32_t count, uint32_t channels, bool fresh)
{
    int64_t real[SERVOSCOPE_FRF_CHANNELS_MAX], minus_imaginary[SERVOSCOPE_FRF_CHANNELS_MAX];
    for (uint32_t c = 0; c < channels; ++c) {
        real[c] = fresh ? 0 : sums[2u * c].sum;
        minus_imaginary[c] = fresh ? 0 : -sums[2u * c + 1u].sum;
    }
    for (uint32_t n = 0; n < count; ++n) {
        FRF_FACTOR cosine, sine;
        look_up(&table, index, &cosine, &sine);
        for (uint32_t c = 0; c < channels; ++c) {
            real[c] += frames[c] * cosine;
            minus_imaginary[c] += frames[c] * sine;
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

static void add(struct frf_dft *self, const void *frames, uint32_t count, bool fresh)
{
    const FRF_SAMPLE *samples = (const FRF_SAMPLE *)frames;
    union frf_word *bank = frf_active_bank(self);
    const FRF_TABLE table = self->twiddles.FRF_MEMBER;
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
