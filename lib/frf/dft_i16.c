/* SPDX-License-Identifier: MIT */
#include "core/fixed.h"
#include "frf/kernel.h"

void frf_dft_add_i16(struct frf_dft *self, const int16_t *frames, uint32_t count)
{
    if (self->number != frf_number_q15 && self->number != frf_number_q31) {
        self->err.wrong_type = core_count_up(self->err.wrong_type);
        frf_dft_mark(self, frf_reason_wrong_type);
        return;
    }
    /* Rails are looked for in each period's own piece, so that only the periods that were hit are marked. */
    while (count > 0) {
        uint32_t room = self->period_samples - self->position;
        uint32_t piece = count < room ? count : room;
        for (uint32_t i = 0; i < piece * self->channels; ++i) {
            if (frames[i] <= self->rail_low || frames[i] >= self->rail_high) {
                self->err.saturated = core_count_up(self->err.saturated);
                self->reasons |= frf_reason_saturated;
            }
        }
        frf_dft_feed(self, frames, self->channels * (uint32_t)sizeof *frames, piece);
        frames += piece * self->channels;
        count -= piece;
    }
}
