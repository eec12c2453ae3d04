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

static const float one_per_q30 = 1.0f / 1073741824.0f;

/* The speed of travel in the table's numbers. */
static float travel_velocity(const struct msgen_table *table)
{
    union core_float_bits position, velocity;
    position.bits = table->scale_bits[msgen_channel_position];
    velocity.bits = table->scale_bits[msgen_channel_velocity];
    float per_period = (float)table->travel_q30 * one_per_q30 * (position.value / velocity.value);
    return per_period * ((float)table->rate_num_hz / (float)table->rate_den) / (float)table->period_samples;
}

/* x; while the table stands still only its position, and the speed of travel. */
static float present_value(const struct msgen_player *self, uint32_t index, uint32_t channel)
{
    if (!self->standing || channel == msgen_channel_position) {
        union core_float_bits sample;
        sample.bits = msgen_table_float_bits(self->table, index, channel);
        return sample.value;
    }
    bool travels = channel == msgen_channel_velocity && self->table->travel_q30 != 0;
    return travels ? travel_velocity(self->table) : 0.0f;
}

struct msgen_player_state msgen_player_step_f32(struct msgen_player *self, float *out_samples)
{
    const struct msgen_table *table = self->table;
    if (table->format != msgen_format_f32) {
        self->phase = msgen_phase_done;
    }
    struct msgen_player_state state = msgen_player_advance(self);
    float factor = (float)self->factor_q30 * one_per_q30;
    for (uint32_t c = 0; c < table->channels; ++c) {
        out_samples[c] = 0.0f;
        if (self->factor_q30 != 0) {
            out_samples[c] = factor * present_value(self, state.index, c);
        }
    }
    if (table->travel_q30 != 0 && table->format == msgen_format_f32) {
        out_samples[msgen_channel_position] += (float)self->travel.position_q30 * one_per_q30;
    }
    return state;
}
