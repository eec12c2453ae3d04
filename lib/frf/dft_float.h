/* SPDX-License-Identifier: MIT */
/* The float variants' loop, not a header of its own: dft_*f32.c include it, each once, having defined
 *   FRF_TABLE   the type of the table
 *   FRF_MEMBER  its member of struct frf_dft's twiddles
 * and defines look_up() after it. Products are summed in partial sums of SERVOSCOPE_FRF_BLOCK samples, and these into
 * the total: rounding then grows with the block and with the number of blocks, not with the period. Blocks begin at
 * multiples of their length within the period wherever the caller cuts, so the cut does not change a bit of the
 * result. */
#include "frf/kernel.h"

/* The two factors of an angle. */
static inline void look_up(const FRF_TABLE *table, uint32_t index, float *out_cosine, float *out_sine);

static inline void accumulate(union frf_word *partial, const float *frames, uint32_t channels, float cosine, float sine)
{
    for (uint32_t c = 0; c < channels; ++c) {
        partial[c].pair[0] += frames[c] * cosine;
        partial[c].pair[1] -= frames[c] * sine;
    }
}

static void flush(union frf_word *total, union frf_word *partial, uint32_t channels)
{
    for (uint32_t c = 0; c < channels; ++c) {
        for (unsigned part = 0; part < 2; ++part) {
            total[c].pair[part] += partial[c].pair[part];
            partial[c].pair[part] = 0.0f;
        }
    }
}

static void add(struct frf_dft *self, const void *frames, uint32_t count, bool fresh)
{
    const FRF_TABLE table = self->twiddles.FRF_MEMBER;
    for (uint32_t b = 0; b < self->bin_count; ++b) {
        const float *samples = (const float *)frames;
        union frf_word *bin = &self->bins[b / 2u];
        union frf_word *total = frf_active_bank(self) + b * self->channels;
        union frf_word *partial = self->partial + b * self->channels;
        uint32_t step = bin->bins[b % 2u].step, index = bin->bins[b % 2u].index;
        for (uint32_t c = 0; fresh && c < self->channels; ++c) {
            total[c].pair[0] = total[c].pair[1] = 0.0f;
            partial[c].pair[0] = partial[c].pair[1] = 0.0f;
        }
        for (uint32_t n = self->position + 1u; n <= self->position + count; ++n) {
            float cosine, sine;
            look_up(&table, index, &cosine, &sine);
            accumulate(partial, samples, self->channels, cosine, sine);
            samples += self->channels;
            index = frf_next_index(index, step, table.period_samples);
            if (n % SERVOSCOPE_FRF_BLOCK == 0 || n == self->period_samples) {
                flush(total, partial, self->channels);
            }
        }
        bin->bins[b % 2u].index = (uint16_t)index;
    }
}
