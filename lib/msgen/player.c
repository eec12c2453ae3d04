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

/* 2^31 counts */
static const int64_t travel_max_q30 = (int64_t)1 << 61;

/* Whether c stays within 32 bits and, times the gain, within the limit: c <= |step + 1| * samples in all. */
static enum core_status check_travel(const struct msgen_table *table, const struct msgen_player_config *config)
{
    if (table->travel_q30 == 0) {
        return core_ok;
    }
    uint32_t last_ramp =
        config->fade_out_samples > config->abort_samples ? config->fade_out_samples : config->abort_samples;
    uint64_t samples = (uint64_t)config->periods * table->period_samples + config->fade_in_samples +
                       config->approach_samples + config->dwell_samples + last_ramp;
    int64_t step = table->travel_q30 / (int64_t)table->period_samples;
    uint64_t most = (uint64_t)(step < 0 ? -step : step) + 1u;
    if (table->channels <= msgen_channel_position || most > (uint64_t)travel_max_q30 / samples) {
        return core_err_player_travel;
    }
    int64_t gain = config->gain_q16[msgen_channel_position] ? config->gain_q16[msgen_channel_position] : msgen_gain_one;
    uint64_t limit =
        config->limit[msgen_channel_position] ? (uint32_t)config->limit[msgen_channel_position] : INT32_MAX;
    uint64_t counts = most * samples / CORE_Q30_ONE;
    return counts * (uint64_t)(gain < 0 ? -gain : gain) / msgen_gain_one <= limit ? core_ok : core_err_player_travel;
}

static enum core_status check_config(const struct msgen_player_config *config)
{
    if (config->fade_in_samples > msgen_ramp_samples_max || config->fade_out_samples > msgen_ramp_samples_max ||
        config->abort_samples > msgen_ramp_samples_max || config->abort_samples == 0) {
        return core_err_player_fade;
    }
    if (config->approach_samples > msgen_ramp_samples_max || config->dwell_samples > msgen_ramp_samples_max ||
        (config->approach_samples > 0 && config->fade_in_samples > 0)) {
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

/* Before the first period: approach, fade in, or nothing. */
static void begin_lead(struct msgen_player *self)
{
    const struct msgen_player_config *config = &self->config;
    uint32_t period = self->table->period_samples;
    uint32_t lead = config->fade_in_samples % period;
    self->phase = config->fade_in_samples ? msgen_phase_fade_in : msgen_phase_playing;
    self->index = (self->table->start_index + period - lead) % period;
    self->standing = config->approach_samples > 0;
    begin_ramp(self, config->fade_in_samples);
    if (self->standing) {
        self->phase = msgen_phase_approach;
        begin_ramp(self, config->approach_samples);
        self->ramp_left += config->dwell_samples;
    }
}

enum core_status msgen_player_set_up(struct msgen_player *self, const struct msgen_table *table,
                                     const struct msgen_player_config *config)
{
    if (!self || !table || !config || table->period_samples == 0) {
        return core_err_argument;
    }
    enum core_status status = check_config(config);
    if (status == core_ok) {
        status = check_travel(table, config);
    }
    if (status != core_ok) {
        return status;
    }
    self->table = table;
    self->config = *config;
    for (unsigned c = 0; c < msgen_channels_max; ++c) {
        self->config.gain_q16[c] = config->gain_q16[c] ? config->gain_q16[c] : msgen_gain_one;
        self->config.limit[c] = config->limit[c] ? config->limit[c] : INT32_MAX;
    }
    self->period = 0;
    self->period_position = 0;
    self->factor_q30 = 0;
    self->abort_from_q30 = 0;
    self->standing_velocity = 0;
    self->travel.step_q30 = table->travel_q30 / (int64_t)table->period_samples;
    self->travel.remainder = table->travel_q30 % (int64_t)table->period_samples;
    self->travel.remainder_sum = 0;
    self->travel.position_q30 = 0;
    self->err.saturated = 0;
    begin_lead(self);
    return core_ok;
}

/* The constant speed under the multisine; |sum| <= 2^20 * 2^31. */
static int32_t mean_velocity(const struct msgen_table *table)
{
    int64_t sum = 0;
    for (uint32_t n = 0; n < table->period_samples; ++n) {
        sum += msgen_table_count(table, n, msgen_channel_velocity);
    }
    return (int32_t)(sum / (int64_t)table->period_samples);
}

enum core_status msgen_player_init(struct msgen_player *self, const struct msgen_table *table,
                                   const struct msgen_player_config *config)
{
    if (table && table->format != msgen_format_i16 && table->format != msgen_format_i32) {
        return core_err_player_format;
    }
    enum core_status status = msgen_player_set_up(self, table, config);
    if (status == core_ok && self->standing && table->travel_q30 != 0) {
        self->standing_velocity = mean_velocity(table);
    }
    return status;
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
    self->standing = false;
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

/* The first sample has t = 0; from the first one of the dwell on t = 1. */
static void approach_one(struct msgen_player *self)
{
    self->factor_q30 = smooth_q30(self->ramp_q62);
    self->ramp_left--;
    self->ramp_q62 = self->ramp_left <= self->config.dwell_samples ? one_q62 : self->ramp_q62 + self->step_q62;
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

/* step * factor without 128 bits: |step| <= 2^59, so that the upper and the lower part times 2^30 stay below 2^60. */
static int64_t faded_step_q30(int64_t step_q30, int32_t factor_q30)
{
    uint64_t factor = (uint64_t)factor_q30;
    uint64_t magnitude = (uint64_t)(step_q30 < 0 ? -step_q30 : step_q30);
    uint64_t faded = (magnitude >> 30) * factor + (((magnitude & (CORE_Q30_ONE - 1u)) * factor) >> 30);
    return step_q30 < 0 ? -(int64_t)faded : (int64_t)faded;
}

/* From the last sample to this one, with the speed that the last one was sent with. */
static void travel_one(struct msgen_player *self)
{
    if (self->factor_q30 != CORE_Q30_ONE) {
        self->travel.position_q30 += faded_step_q30(self->travel.step_q30, self->factor_q30);
        return;
    }
    int64_t period = (int64_t)self->table->period_samples;
    self->travel.position_q30 += self->travel.step_q30;
    self->travel.remainder_sum += self->travel.remainder;
    if (self->travel.remainder_sum >= period || self->travel.remainder_sum <= -period) {
        int64_t carry = self->travel.remainder_sum < 0 ? -1 : 1;
        self->travel.remainder_sum -= carry * period;
        self->travel.position_q30 += carry;
    }
}

struct msgen_player_state msgen_player_advance(struct msgen_player *self)
{
    if (self->table->travel_q30 != 0) {
        travel_one(self);
    }
    struct msgen_player_state state = {self->phase, self->period, self->index};
    switch (self->phase) {
    case msgen_phase_approach:
        approach_one(self);
        break;
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
    default: /* damaged memory ends the excitation */
        self->phase = msgen_phase_done;
        self->factor_q30 = 0;
        return state;
    }
    if (!self->standing) {
        advance_index(self);
    }
    return state;
}

/* x; while the table stands still only its position, and the speed of travel. */
static int32_t present_count(const struct msgen_player *self, uint32_t index, uint32_t channel)
{
    if (!self->standing || channel == msgen_channel_position) {
        return msgen_table_count(self->table, index, channel);
    }
    return channel == msgen_channel_velocity ? self->standing_velocity : 0;
}

/* w x, and c where the channel travels. |x| w <= 2^61 and |c| <= 2^61 (check_travel). */
static int32_t faded_count(struct msgen_player *self, uint32_t index, uint32_t channel)
{
    int32_t count = present_count(self, index, channel);
    if (channel != msgen_channel_position || self->table->travel_q30 == 0) {
        return core_scale_q30(count, self->factor_q30);
    }
    bool saturated = false;
    int64_t sum_q30 = (int64_t)count * self->factor_q30 + self->travel.position_q30;
    int32_t position = core_saturate_i32(core_round_shift_i64(sum_q30, 30), INT32_MAX, &saturated);
    if (saturated) {
        self->err.saturated = core_count_up(self->err.saturated);
    }
    return position;
}

/* Whether there is anything but zeros to put out. */
static bool is_silent(const struct msgen_player *self)
{
    return self->factor_q30 == 0 && self->travel.position_q30 == 0;
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
        if (!is_silent(self)) {
            bool saturated = false;
            int32_t faded = faded_count(self, state.index, c);
            int64_t scaled = core_round_shift_i64((int64_t)faded * self->config.gain_q16[c], 16);
            out_samples[c] = core_saturate_i32(scaled, self->config.limit[c], &saturated);
            if (saturated) {
                self->err.saturated = core_count_up(self->err.saturated);
            }
        }
    }
    return state;
}
