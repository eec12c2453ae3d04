/* SPDX-License-Identifier: MIT */
#include "core/fixed.h"
#include "frf/kernel.h"

/* Whether all of a frame fits 24 bits: the kernels' sums have no room for more. Counts what has reached a rail. */
static bool look_at(struct frf_dft *self, const int32_t *frame)
{
    bool fits = true;
    for (uint32_t c = 0; c < self->channels; ++c) {
        if (frame[c] <= self->rail_low || frame[c] >= self->rail_high) {
            self->err.saturated = core_count_up(self->err.saturated);
            self->reasons |= frf_reason_saturated;
            if (frame[c] < FRF_I24_MIN || frame[c] > FRF_I24_MAX) {
                fits = false;
            }
        }
    }
    return fits;
}

void frf_dft_add_i24(struct frf_dft *self, const int32_t *frames, uint32_t count)
{
    static const int32_t zeros[SERVOSCOPE_FRF_CHANNELS_MAX] = {0};
    uint32_t frame_bytes = self->channels * (uint32_t)sizeof *frames;
    if (self->number != frf_number_q23) {
        self->err.wrong_type = core_count_up(self->err.wrong_type);
        frf_dft_mark(self, frf_reason_wrong_type);
        return;
    }
    /* A piece is of one period, so that only the periods that were hit are marked, and ends with a frame that does not
     * fit, if there is one. */
    while (count > 0) {
        uint32_t room = self->period_samples - self->position;
        uint32_t piece = count < room ? count : room, good = 0;
        while (good < piece && look_at(self, frames + good * self->channels)) {
            ++good;
        }
        frf_dft_feed(self, frames, frame_bytes, good);
        frames += good * self->channels;
        count -= good;
        if (good < piece) {
            frf_dft_feed(self, zeros, frame_bytes, 1);
            frames += self->channels;
            --count;
        }
    }
}
