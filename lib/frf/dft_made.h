/* SPDX-License-Identifier: MIT */
/* The integer variants' loop where a factor takes more than a load, not a header of its own: dft_quarter_*.c and
 * dft_two_level_*.c include it, each once, having defined
 *   FRF_TABLE    the type of the table
 *   FRF_MEMBER   its member of struct frf_dft's twiddles
 *   FRF_SAMPLE   the type of a sample
 *   FRF_PRODUCT  the type in which a sample and a factor are multiplied without overflow
 * and defines look_up() after it. Factors are made for some samples ahead, then used: both at a time are more than the
 * registers of these cores hold, and the channels share what was made. */
#include "frf/kernel.h"

enum { made_at_once = 16 };

/* The two factors of an angle. */
static inline struct frf_point look_up(const FRF_TABLE *table, uint32_t index);

/* Returns the index after the last. */
static inline uint32_t make_factors(const FRF_TABLE *table, uint32_t step, uint32_t index, uint32_t count,
                                    struct frf_point *out_factors)
{
    for (uint32_t n = 0; n < count; ++n) {
        out_factors[n] = look_up(table, index);
        index = frf_next_index(index, step, table->period_samples);
    }
    return index;
}

/* The imaginary part is summed with the opposite sign because multiply-accumulate instructions only add. */
static inline void accumulate(union frf_word *sums, const struct frf_point *factors, const FRF_SAMPLE *samples,
                              uint32_t channels, uint32_t count, bool fresh)
{
    int64_t real = fresh ? 0 : sums[0].sum, minus_imaginary = fresh ? 0 : -sums[1].sum;
    for (uint32_t n = 0; n < count; ++n) {
        real += (FRF_PRODUCT)*samples * factors[n].cosine;
        minus_imaginary += (FRF_PRODUCT)*samples * factors[n].sine;
        samples += channels;
    }
    sums[0].sum = real;
    sums[1].sum = -minus_imaginary;
}

static void add(struct frf_dft *self, const void *frames, uint32_t count, bool fresh)
{
    struct frf_point factors[made_at_once];
    const FRF_TABLE table = self->twiddles.FRF_MEMBER;
    union frf_word *sums = frf_active_bank(self);
    for (uint32_t b = 0; b < self->bin_count; ++b) {
        union frf_word *bin = &self->bins[b / 2u];
        uint32_t step = bin->bins[b % 2u].step, index = bin->bins[b % 2u].index;
        for (uint32_t at = 0; at < count; at += made_at_once) {
            const FRF_SAMPLE *samples = (const FRF_SAMPLE *)frames + at * self->channels;
            uint32_t piece = count - at;
            if (piece > made_at_once) {
                piece = made_at_once;
            }
            index = make_factors(&table, step, index, piece, factors);
            for (uint32_t c = 0; c < self->channels; ++c) {
                accumulate(sums + 2u * c, factors, samples + c, self->channels, piece, fresh && at == 0);
            }
        }
        bin->bins[b % 2u].index = (uint16_t)index;
        sums += 2u * self->channels;
    }
}
