/* SPDX-License-Identifier: MIT */
#include "core/bytes.h"
#include "core/fixed.h"
#include "frf/dft.h"

#define FRF_TABLE  struct frf_twiddles_f32
#define FRF_MEMBER f32
#include "frf/dft_float.h"

static inline void look_up(const struct frf_twiddles_f32 *table, uint32_t index, float *out_cosine, float *out_sine)
{
    *out_cosine = table->cosine[index];
    *out_sine = table->sine[index];
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
