/* SPDX-License-Identifier: MIT */
/* Float products are summed in partial sums of SERVOSCOPE_FRF_BLOCK samples, and these into the total: rounding then
 * grows with the block and with the number of blocks, not with the period. Blocks begin at multiples of their length
 * within the period wherever the caller cuts, so the cut does not change a bit of the result. */
#include "core/bytes.h"
#include "core/fixed.h"
#include "frf/kernel.h"

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
    const struct frf_twiddles_f32 twiddles = self->twiddles.f32;
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
            accumulate(partial, samples, self->channels, twiddles.cosine[index], twiddles.sine[index]);
            samples += self->channels;
            index = frf_next_index(index, step, twiddles.period_samples);
            if (n % SERVOSCOPE_FRF_BLOCK == 0 || n == self->period_samples) {
                flush(total, partial, self->channels);
            }
        }
        bin->bins[b % 2u].index = (uint16_t)index;
    }
}

static bool frame_is_finite(const float *frame, uint32_t channels)
{
    for (uint32_t c = 0; c < channels; ++c) {
        union core_float_bits sample;
        sample.value = frame[c];
        if (!core_float_bits_are_finite(sample.bits)) {
            return false;
        }
    }
    return true;
}

void frf_dft_add_f32(struct frf_dft *self, const float *frames, uint32_t count)
{
    static const float zeros[SERVOSCOPE_FRF_CHANNELS_MAX] = {0.0f};
    uint32_t frame_bytes = self->channels * (uint32_t)sizeof *frames;
    if (self->number != frf_number_f32) {
        self->err.wrong_type = core_count_up(self->err.wrong_type);
        frf_dft_mark(self, frf_reason_wrong_type);
        return;
    }
    while (count > 0) {
        uint32_t good = 0;
        while (good < count && frame_is_finite(frames + good * self->channels, self->channels)) {
            ++good;
        }
        frf_dft_feed(self, frames, frame_bytes, good);
        frames += good * self->channels;
        count -= good;
        if (count > 0) {
            self->err.not_finite = core_count_up(self->err.not_finite);
            frf_dft_mark(self, frf_reason_not_finite);
            frf_dft_feed(self, zeros, frame_bytes, 1);
            frames += self->channels;
            count -= 1u;
        }
    }
}

enum core_status frf_dft_init_f32(struct frf_dft *self, const struct frf_dft_config *config,
                                  const struct frf_twiddles_f32 *twiddles)
{
    if (!twiddles || !twiddles->sine || !twiddles->cosine) {
        return core_err_argument;
    }
    enum core_status status = frf_dft_set_up(self, config, twiddles->period_samples, frf_number_f32, add);
    if (status == core_ok) {
        self->twiddles.f32 = *twiddles;
    }
    return status;
}
