/* SPDX-License-Identifier: MIT */
/* Apart from player.c so that firmware which plays integer tables links no float instruction. */
#include "core/bytes.h"
#include "msgen/player.h"

enum core_status msgen_player_init_f32(struct msgen_player *self, const struct msgen_table *table,
                                       const struct msgen_player_config *config)
{
    if (table && table->format != msgen_format_f32) {
        return core_err_player_format;
    }
    return msgen_player_set_up(self, table, config);
}

struct msgen_player_state msgen_player_step_f32(struct msgen_player *self, float *out_samples)
{
    static const float one_per_q30 = 1.0f / 1073741824.0f;
    const struct msgen_table *table = self->table;
    if (table->format != msgen_format_f32) {
        self->phase = msgen_phase_done;
    }
    struct msgen_player_state state = msgen_player_advance(self);
    float factor = (float)self->factor_q30 * one_per_q30;
    for (uint32_t c = 0; c < table->channels; ++c) {
        out_samples[c] = 0.0f;
        if (self->factor_q30 != 0) {
            union core_float_bits sample;
            sample.bits = msgen_table_float_bits(table, state.index, c);
            out_samples[c] = factor * sample.value;
        }
    }
    return state;
}
