/* SPDX-License-Identifier: MIT */
#include "frf/dft.h"

#define FRF_TABLE  struct frf_twiddles_q15
#define FRF_MEMBER q15
#define FRF_SAMPLE int16_t
#define FRF_FACTOR int32_t
#include "frf/dft_by_twos.h"
#include "frf/dft_integer.h"

static inline void look_up(const struct frf_twiddles_q15 *table, uint32_t index, int32_t *out_cosine, int32_t *out_sine)
{
    *out_cosine = table->cosine[index];
    *out_sine = table->sine[index];
}

/* |sum| <= 2^15 * (2^15 - 1) * N: has to stay below 2^63. */
CORE_STATIC_ASSERT((uint64_t)SERVOSCOPE_FRF_PERIOD_MAX <= ((uint64_t)1 << 62) >> (15 + 15),
                   q15_accumulator_cannot_overflow);

/* One part of one bin; returns the index after it. */
static uint32_t add_part(union frf_word *sum, int32_t sign, const int16_t *table, struct frf_walk walk,
                         const int16_t *samples, uint32_t count, bool fresh)
{
    int64_t part = count >= 2u ? FRF_SUM_BY_TWOS(table, samples, &walk, count / 2u) : 0;
    if (count % 2u != 0) {
        part += samples[(count - 1u) * walk.stride] * table[walk.index];
        walk.index = frf_next_index(walk.index, walk.step, walk.period);
    }
    sum->sum = (fresh ? 0 : sum->sum) + sign * part;
    return walk.index;
}

/* For cores without a long multiply. The same sums. */
static void add_by_twos(struct frf_dft *self, const void *frames, uint32_t count, bool fresh)
{
    const struct frf_twiddles_q15 *twiddles = &self->twiddles.q15;
    union frf_word *sums = frf_active_bank(self);
    for (uint32_t b = 0; b < self->bin_count; ++b) {
        union frf_word *bin = &self->bins[b / 2u];
        struct frf_walk walk = {bin->bins[b % 2u].index, bin->bins[b % 2u].step, twiddles->period_samples,
                                self->channels};
        for (uint32_t c = 0; c < self->channels; ++c) {
            const int16_t *samples = (const int16_t *)frames + c;
            (void)add_part(sums, 1, twiddles->cosine, walk, samples, count, fresh);
            bin->bins[b % 2u].index = (uint16_t)add_part(sums + 1, -1, twiddles->sine, walk, samples, count, fresh);
            sums += 2;
        }
    }
}

enum core_status frf_dft_init_q15(struct frf_dft *self, const struct frf_dft_config *config,
                                  const struct frf_twiddles_q15 *twiddles)
{
    if (!twiddles || !twiddles->sine || !twiddles->cosine) {
        return core_err_argument;
    }
    frf_kernel *kernel = SERVOSCOPE_FRF_LONG_MULTIPLY ? add : add_by_twos;
    enum core_status status = frf_dft_set_up(self, config, twiddles->period_samples, frf_number_q15, kernel);
    if (status == core_ok) {
        self->twiddles.q15 = *twiddles;
    }
    return status;
}
