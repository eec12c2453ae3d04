/* SPDX-License-Identifier: MIT */
#include "msgen/player.h"

#include "core/fixed.h"

static const uint64_t one_q62 = (uint64_t)1 << 62;

/* s(t) = t^2 (3 - 2 t); t in Q62, 0 .. 1. With t and t^2 in Q30 both products stay below 2^30 * 3 * 2^30 < 2^62. */
static int32_t smooth_q30(uint64_t t_q62)
{
    uint64_t t = t_q62 >> 32;
    uint64_t square = (t * t) >> 30;
    return (int32_t)((square * (3u * (uint64_t)CORE_Q30_ONE - 2u * t)) >> 30);
}

static void begin_ramp(struct msgen_player *self, uint32_t samples)
{
    self->ramp_left = samples;
    self->ramp_q62 = 0;
    self->step_q62 = samples ? one_q62 / samples : 0;
}

/* t after one more sample; exactly 1 at the last one, whatever the division has dropped. */
static uint64_t advance_ramp(struct msgen_player *self)
{
    self->ramp_left--;
    self->ramp_q62 = self->ramp_left == 0 ? one_q62 : self->ramp_q62 + self->step_q62;
    return self->ramp_q62;
}

static enum core_status check_config(const struct msgen_player_config *config)
{
    if (config->fade_in_samples > msgen_ramp_samples_max || config->fade_out_samples > msgen_ramp_samples_max ||
        config->abort_samples > msgen_ramp_samples_max || config->abort_samples == 0) {
        return core_err_player_fade;
    }
    if (config->periods == 0) {
        return core_err_player_periods;
    }
    for (unsigned c = 0; c < msgen_channels_max; ++c) {
        if (config->limit[c] < 0) {
            return core_err_player_limit;
        }
    }
    return core_ok;
}

enum core_status msgen_player_set_up(struct msgen_player *self, const struct msgen_table *table,
                                     const struct msgen_player_config *config)
{
    if (!self || !table || !config || table->period_samples == 0) {
        return core_err_argument;
    }
    enum core_status status = check_config(config);
    if (status != core_ok) {
        return status;
    }
    self->table = table;
    self->config = *config;
    for (unsigned c = 0; c < msgen_channels_max; ++c) {
        self->config.gain_q16[c] = config->gain_q16[c] ? config->gain_q16[c] : msgen_gain_one;
        self->config.limit[c] = config->limit[c] ? config->limit[c] : INT32_MAX;
    }
    uint32_t period = table->period_samples;
    uint32_t lead = config->fade_in_samples % period;
    self->phase = config->fade_in_samples ? msgen_phase_fade_in : msgen_phase_playing;
    self->period = 0;
    self->period_position = 0;
    self->index = (table->start_index + period - lead) % period;
    self->factor_q30 = 0;
    self->abort_from_q30 = 0;
    self->err.saturated = 0;
    begin_ramp(self, config->fade_in_samples);
    return core_ok;
}

enum core_status msgen_player_init(struct msgen_player *self, const struct msgen_table *table,
                                   const struct msgen_player_config *config)
{
    if (table && table->format != msgen_format_i16 && table->format != msgen_format_i32) {
        return core_err_player_format;
    }
    return msgen_player_set_up(self, table, config);
}

void msgen_player_abort(struct msgen_player *self)
{
    if (self->phase == msgen_phase_done || self->phase == msgen_phase_aborting) {
        return;
    }
    if (self->phase == msgen_phase_fade_out && self->ramp_left <= self->config.abort_samples) {
        return;
    }
    if (self->factor_q30 == 0) {
        self->phase = msgen_phase_done;
        return;
    }
    self->phase = msgen_phase_aborting;
    self->abort_from_q30 = self->factor_q30;
    begin_ramp(self, self->config.abort_samples);
}

static void advance_index(struct msgen_player *self)
{
    self->index = self->index + 1u == self->table->period_samples ? 0u : self->index + 1u;
}

static void play_one(struct msgen_player *self)
{
    self->factor_q30 = CORE_Q30_ONE;
    if (++self->period_position < self->table->period_samples) {
        return;
    }
    self->period_position = 0;
    if (++self->period < self->config.periods) {
        return;
    }
    self->period--;
    self->phase = self->config.fade_out_samples ? msgen_phase_fade_out : msgen_phase_done;
    begin_ramp(self, self->config.fade_out_samples);
}

/* The first sample of the fade has t = 0, the first one played t = 1. */
static void fade_in_one(struct msgen_player *self)
{
    self->factor_q30 = smooth_q30(self->ramp_q62);
    advance_ramp(self);
    if (self->ramp_left == 0) {
        self->phase = msgen_phase_playing;
    }
}

static void fade_out_one(struct msgen_player *self, int32_t from_q30)
{
    int32_t left_q30 = CORE_Q30_ONE - smooth_q30(advance_ramp(self));
    self->factor_q30 = core_scale_q30(from_q30, left_q30);
    if (self->ramp_left == 0) {
        self->phase = msgen_phase_done;
    }
}

struct msgen_player_state msgen_player_advance(struct msgen_player *self)
{
    struct msgen_player_state state = {self->phase, self->period, self->index};
    switch (self->phase) {
    case msgen_phase_fade_in:
        fade_in_one(self);
        break;
    case msgen_phase_playing:
        play_one(self);
        break;
    case msgen_phase_fade_out:
        fade_out_one(self, CORE_Q30_ONE);
        break;
    case msgen_phase_aborting:
        fade_out_one(self, self->abort_from_q30);
        break;
    case msgen_phase_done:
        self->factor_q30 = 0;
        return state;
    }
    advance_index(self);
    return state;
}

struct msgen_player_state msgen_player_step(struct msgen_player *self, int32_t *out_samples)
{
    const struct msgen_table *table = self->table;
    if (table->format == msgen_format_f32) {
        self->phase = msgen_phase_done;
    }
    struct msgen_player_state state = msgen_player_advance(self);
    for (uint32_t c = 0; c < table->channels; ++c) {
        out_samples[c] = 0;
        if (self->factor_q30 != 0) {
            bool saturated = false;
            int32_t faded = core_scale_q30(msgen_table_count(table, state.index, c), self->factor_q30);
            int64_t scaled = core_round_shift_i64((int64_t)faded * self->config.gain_q16[c], 16);
            out_samples[c] = core_saturate_i32(scaled, self->config.limit[c], &saturated);
            if (saturated) {
                self->err.saturated = core_count_up(self->err.saturated);
            }
        }
    }
    return state;
}
