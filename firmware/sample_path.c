/* SPDX-License-Identifier: MIT */
#include "firmware/sample_path.h"

enum core_status sample_path_init(struct sample_path *self, const struct guard_limits *limits,
                                  const struct msgen_table *table, const struct msgen_player_config *player,
                                  const struct frf_block_config *dft, uint32_t settle_periods)
{
    enum core_status status = guard_init(&self->guard, limits);
    if (status == core_ok) {
        status = msgen_player_init(&self->player, table, player);
    }
    if (status == core_ok) {
        status = frf_block_init(&self->dft, dft);
    }
    self->measuring = self->done = false;
    self->samples = self->late = self->tail_samples = 0;
    self->settle_periods = settle_periods;
    return status;
}

/* The DFT's period begins with the first counted one of the table. After the last one it is fed on for a block less a
 * sample, because the work on a block is spread over the next; what it is fed with then is dropped. */
static void measure(struct sample_path *self, bool counts, const int16_t *channels)
{
    if (counts && !self->measuring) {
        frf_block_restart(&self->dft);
        self->tail_samples = self->dft.table.layout.block_samples - 1u;
    }
    self->measuring = counts;
    if (counts) {
        frf_block_add_i16(&self->dft, channels, 1);
    } else if (self->tail_samples > 0) {
        frf_block_add_i16(&self->dft, channels, 1);
        if (--self->tail_samples == 0) {
            frf_block_restart(&self->dft);
        }
    }
}

void sample_path_step(struct sample_path *self, const struct sample_path_input *input,
                      struct sample_path_output *out_output)
{
    if (guard_step(&self->guard, &input->guard) == guard_ramp_down) {
        msgen_player_abort(&self->player);
    }
    struct msgen_player_state state = msgen_player_step(&self->player, out_output->reference);
    bool counts = state.phase == msgen_phase_playing && state.period >= self->settle_periods;
    measure(self, counts, input->channels);
    self->done = out_output->done = state.phase == msgen_phase_done && self->tail_samples == 0;
    self->samples = self->samples + 1u;
}

void sample_path_mark_late(struct sample_path *self)
{
    self->late = self->late + 1u;
    frf_block_mark(&self->dft, frf_reason_late);
}
