/* SPDX-License-Identifier: MIT */
#include "drivers/modbus/table_player.h"

#include "core/bytes.h"
#include "core/fixed.h"

#include <stddef.h>

const double table_player_quick_stop_s = 2.0;
const double table_player_rest_s = 0.5;

static const double per_ms = 1e-3;

enum core_status table_player_init(struct table_player *self, const struct table_player_storage *storage)
{
    if (!self || !storage || storage->samples_max < 4 || storage->bins_max < 1 || storage->periods_kept < 1 ||
        !storage->twiddles || !storage->bins || !storage->transform || !storage->pairs || !storage->kept ||
        !storage->kept_reasons) {
        return core_err_argument;
    }
    static const struct table_player empty;
    *self = empty;
    self->storage = *storage;
    self->state = modbus_state_idle;
    return core_ok;
}

// ---- Preparation, main loop

static double scale_of(const struct msgen_table *table, uint32_t channel)
{
    union core_float_bits scale;
    scale.bits = table->scale_bits[channel];
    return (double)scale.value;
}

static enum core_status prepare_transform(struct table_player *self, const struct msgen_table *table)
{
    const struct table_player_storage *storage = &self->storage;
    if (table->period_samples > storage->samples_max || table->bin_count > storage->bins_max) {
        return core_err_storage;
    }
    for (uint32_t b = 0; b < table->bin_count; ++b) {
        storage->bins[b] = msgen_table_bin(table, b);
    }
    enum core_status status =
        frf_twiddles_build_f32(storage->twiddles, 2u * storage->samples_max, table->period_samples, &self->twiddles);
    if (status != core_ok) {
        return status;
    }
    const struct frf_dft_config config = {
        .bins = storage->bins,
        .bin_count = table->bin_count,
        .channels = table_player_channels,
        .storage = storage->transform,
        .storage_words = FRF_STORAGE_WORDS(storage->bins_max, (uint32_t)table_player_channels),
    };
    status = frf_dft_init_f32(&self->dft, &config, &self->twiddles);
    return status == core_ok ? frf_statistics_init(&self->statistics, storage->pairs, table->bin_count) : status;
}

static enum core_status prepare_player(struct table_player *self)
{
    const struct modbus_run_setup *setup = &self->setup;
    bool approach = setup->approach != 0 && setup->mode == 0;
    const struct msgen_player_config config = {
        .periods = setup->settle_periods + setup->measure_periods,
        .fade_in_samples = setup->approach != 0 ? 0 : setup->fade_samples,
        .approach_samples = approach ? setup->fade_samples : 0,
        .dwell_samples = approach ? setup->dwell_samples : 0,
        .fade_out_samples = setup->fade_samples,
        .abort_samples = setup->abort_samples,
    };
    if (self->table->format == msgen_format_f32) {
        return msgen_player_init_f32(&self->player, self->table, &config);
    }
    return msgen_player_init(&self->player, self->table, &config);
}

/// Limits of 0 do not limit, but for the torque's, which a drive always has.
static enum core_status prepare_guard(struct table_player *self)
{
    const struct modbus_run_setup *setup = &self->setup;
    struct guard_real_limits limits = GUARD_REAL_LIMITS_NONE;
    double silent = (double)setup->host_timeout_ms * per_ms * self->rate_hz;
    if (setup->position_min != 0 || setup->position_max != 0) {
        limits.position_min_rad = (core_real)setup->position_min;
        limits.position_max_rad = (core_real)setup->position_max;
    }
    if (setup->velocity_limit > 0) {
        limits.velocity_max_rad_per_s = (core_real)setup->velocity_limit;
    }
    if (setup->torque_limit > 0) {
        limits.torque_max_Nm = (core_real)setup->torque_limit;
    }
    if (setup->host_timeout_ms > 0) {
        limits.watchdog_samples = silent < 1.0 ? 1u : silent < 4e9 ? (uint32_t)silent : UINT32_MAX - 1u;
    }
    return guard_real_init(&self->guard, &limits);
}

static enum core_status prepare(void *object, const struct msgen_table *table, const struct modbus_run_setup *setup)
{
    struct table_player *self = object;
    self->has_spectra = false;
    self->table = table;
    self->setup = *setup;
    self->rate_hz = (double)table->rate_num_hz / (double)table->rate_den;
    for (uint32_t c = 0; c < table->channels; ++c) {
        self->scale[c] = scale_of(table, c);
    }
    enum core_status status = prepare_transform(self, table);
    status = status == core_ok ? prepare_player(self) : status;
    return status == core_ok ? prepare_guard(self) : status;
}

static struct guard_real_sample guard_sample(const struct table_player *self)
{
    const struct guard_real_sample sample = {(core_real)(self->last.position - self->origin),
                                             (core_real)self->last.velocity, (core_real)self->last.torque,
                                             self->last.valid};
    return sample;
}

static enum core_status arm(void *object)
{
    struct table_player *self = object;
    // Everything from the start: a table may be played again without being uploaded again.
    enum core_status status = prepare(self, self->table, &self->setup);
    self->origin = self->last.position;
    const struct guard_real_sample now = guard_sample(self);
    status = status == core_ok ? guard_real_arm(&self->guard, &now) : status;
    if (status != core_ok) {
        return status;
    }
    for (uint32_t i = 0; i < self->storage.periods_kept; ++i) {
        self->storage.kept_reasons[i] = 0;
    }
    self->has_spectra = true;
    self->feeding = false;
    self->collected = 0;
    self->samples_played = 0;
    self->cycles_max = 0;
    self->trip_value = 0;
    self->faults = 0;
    self->end = modbus_end_none;
    self->request = table_player_no_request;
    SERVOSCOPE_MEMORY_BARRIER();
    self->state = modbus_state_armed; // from here on the sample path owns everything but the statistics
    return core_ok;
}

static void ask_start(void *object)
{
    ((struct table_player *)object)->request = table_player_start;
}

static void ask_stop(void *object)
{
    struct table_player *self = object;
    if (self->state == modbus_state_armed) {
        self->state = modbus_state_idle;
        return;
    }
    self->request = table_player_stop;
}

static void ask_abort(void *object)
{
    ((struct table_player *)object)->request = table_player_abort;
}

static void clear(void *object)
{
    struct table_player *self = object;
    if (self->state == modbus_state_done || self->state == modbus_state_fault) {
        self->state = modbus_state_idle;
        self->faults = 0;
    }
}

static void alive(void *object)
{
    guard_alive(&((struct table_player *)object)->guard.state);
}

static void report(const void *object, struct modbus_report *out_report)
{
    const struct table_player *self = object;
    const struct modbus_report now = {
        .state = self->state,
        .end = self->end,
        .faults = self->faults,
        .periods_done = self->has_spectra ? self->collected : 0,
        .periods_valid = self->has_spectra ? self->statistics.periods : 0,
        .samples_played = self->samples_played,
        .torque_clipped = self->guard.state.count.torque_clipped,
        .cycles_max = self->cycles_max,
        .torque = (float)self->last.torque,
        .position = (float)self->last.position,
        .velocity = (float)self->last.velocity,
        .trip_value = self->trip_value,
    };
    *out_report = now;
}

// ---- Spectra, main loop

static struct frf_complex *kept_at(const struct table_player *self, uint32_t period)
{
    size_t slot = period % self->storage.periods_kept;
    return self->storage.kept + 2u * slot * self->storage.bins_max;
}

void table_player_collect(struct table_player *self)
{
    struct frf_period period;
    if (!self->has_spectra || !frf_dft_latest(&self->dft, &period) || period.sequence == self->collected) {
        return;
    }
    uint32_t number = period.sequence - 1u;
    for (uint32_t missed = self->collected; missed < number; ++missed) {
        self->storage.kept_reasons[missed % self->storage.periods_kept] = frf_reason_late;
    }
    struct frf_complex *kept = kept_at(self, number);
    for (uint32_t b = 0; b < self->dft.bin_count; ++b) {
        kept[2u * b] = frf_period_value(&self->dft, &period, b, 0);
        kept[2u * b + 1u] = frf_period_value(&self->dft, &period, b, 1);
    }
    uint32_t reasons = period.reasons;
    if (!frf_statistics_add_period(&self->statistics, &self->dft, 0, 1) && reasons == 0) {
        reasons = frf_reason_not_finite;
    }
    self->storage.kept_reasons[number % self->storage.periods_kept] = reasons;
    self->collected = period.sequence;
}

static void copy_period(const struct table_player *self, uint32_t period, struct modbus_record *out_records)
{
    const struct frf_complex *kept = kept_at(self, period);
    core_real scale = (core_real)2 / (core_real)self->dft.period_samples;
    for (uint32_t b = 0; b < self->dft.bin_count; ++b) {
        const struct modbus_record record = {
            .input = {(float)(kept[2u * b].real * scale), (float)(kept[2u * b].imaginary * scale)},
            .output = {(float)(kept[2u * b + 1u].real * scale), (float)(kept[2u * b + 1u].imaginary * scale)},
        };
        out_records[b] = record;
    }
}

static void copy_means(const struct table_player *self, struct modbus_record *out_records)
{
    core_real scale = (core_real)2 / (core_real)self->dft.period_samples;
    uint32_t periods = self->statistics.periods;
    core_real square = periods > 1u ? scale * scale / (core_real)(periods - 1u) : 0;
    for (uint32_t b = 0; b < self->dft.bin_count; ++b) {
        const struct frf_pair *pair = &self->statistics.pairs[b];
        const struct modbus_record record = {
            .input = {(float)(pair->input_mean.real * scale), (float)(pair->input_mean.imaginary * scale)},
            .output = {(float)(pair->output_mean.real * scale), (float)(pair->output_mean.imaginary * scale)},
            .input_variance = (float)(pair->input_squares * square),
            .output_variance = (float)(pair->output_squares * square),
            .covariance = {(float)(pair->cross.real * square), (float)(pair->cross.imaginary * square)},
        };
        out_records[b] = record;
    }
}

static uint32_t spectrum(const void *object, uint32_t period, struct modbus_record *out_records, uint32_t *out_count)
{
    const struct table_player *self = object;
    *out_count = 0;
    if (!self->has_spectra) {
        return modbus_spectrum_nothing;
    }
    if (period == MODBUS_MEAN) {
        *out_count = self->statistics.periods;
        copy_means(self, out_records);
        return *out_count > 0 ? modbus_spectrum_valid : modbus_spectrum_not_yet;
    }
    if (period >= self->collected) {
        return modbus_spectrum_not_yet;
    }
    if (self->collected - period > self->storage.periods_kept) {
        return modbus_spectrum_not_kept;
    }
    uint32_t reasons = self->storage.kept_reasons[period % self->storage.periods_kept];
    if (reasons != 0) {
        return modbus_spectrum_left_out | reasons;
    }
    *out_count = 1;
    copy_period(self, period, out_records);
    return modbus_spectrum_valid;
}

struct modbus_device table_player_device(struct table_player *self)
{
    const struct modbus_device device = {self,      prepare, arm,   ask_start, ask_stop,
                                         ask_abort, clear,   alive, report,    spectrum};
    return device;
}

// ---- Sample path

static void begin_quick_stop(struct table_player *self, enum modbus_end end, double seconds)
{
    self->feeding = false;
    self->end = end;
    self->quick_stop_left = (uint32_t)(seconds * self->rate_hz) + 1u;
    self->state = modbus_state_stopping;
}

static bool is_playing(const struct table_player *self)
{
    return self->state == modbus_state_settling || self->state == modbus_state_running ||
           (self->state == modbus_state_stopping && self->quick_stop_left == 0);
}

static void obey(struct table_player *self)
{
    switch (self->request) {
    case table_player_start:
        if (self->state == modbus_state_armed) {
            self->state = modbus_state_settling;
            self->quick_stop_left = 0;
        }
        break;
    case table_player_stop:
        if (is_playing(self)) {
            self->end = self->end == modbus_end_none ? modbus_end_stopped : self->end;
            msgen_player_abort(&self->player);
        }
        break;
    case table_player_abort:
        if (is_playing(self) || self->state == modbus_state_armed) {
            begin_quick_stop(self, modbus_end_aborted, table_player_quick_stop_s);
        }
        break;
    case table_player_no_request:
        return;
    }
    self->request = table_player_no_request;
}

static void play(struct table_player *self, double out_values[msgen_channels_max])
{
    const struct msgen_table *table = self->table;
    out_values[0] = out_values[1] = out_values[2] = 0.0;
    if (table->format == msgen_format_f32) {
        float samples[msgen_channels_max] = {0.0f, 0.0f, 0.0f};
        self->place = msgen_player_step_f32(&self->player, samples);
        for (uint32_t c = 0; c < table->channels; ++c) {
            out_values[c] = (double)samples[c] * self->scale[c];
        }
        return;
    }
    int32_t counts[msgen_channels_max] = {0, 0, 0};
    self->place = msgen_player_step(&self->player, counts);
    for (uint32_t c = 0; c < table->channels; ++c) {
        out_values[c] = (double)counts[c] * self->scale[c];
    }
}

/// From the last sample's phase to this one's.
static void move_on(struct table_player *self)
{
    self->feeding = false;
    switch (self->place.phase) {
    case msgen_phase_playing:
        if (self->place.period >= self->setup.settle_periods) {
            self->feeding = true;
            self->state = modbus_state_running;
        }
        break;
    case msgen_phase_fade_out:
    case msgen_phase_aborting:
        self->state = modbus_state_stopping;
        break;
    case msgen_phase_done:
        // The ramp ends before the axis does: a position loop lags by some tens of milliseconds.
        begin_quick_stop(self, self->end == modbus_end_none ? modbus_end_complete : self->end, table_player_rest_s);
        break;
    case msgen_phase_fade_in:
    case msgen_phase_approach:
        break;
    }
}

static void next_of_table(struct table_player *self, struct table_player_setpoint *out_setpoint)
{
    double values[msgen_channels_max];
    play(self, values);
    move_on(self);
    self->samples_played = core_count_up(self->samples_played);
    bool ended = self->place.phase == msgen_phase_done;
    out_setpoint->control = ended                   ? table_player_quick_stop
                            : self->setup.mode == 0 ? table_player_cascade
                                                    : table_player_torque;
    out_setpoint->torque = (double)guard_real_clip_torque(&self->guard, (core_real)values[msgen_channel_torque]);
    out_setpoint->velocity = values[msgen_channel_velocity];
    out_setpoint->position = self->origin + values[msgen_channel_position];
}

static void next_of_quick_stop(struct table_player *self, struct table_player_setpoint *out_setpoint)
{
    out_setpoint->control = table_player_quick_stop;
    if (--self->quick_stop_left == 0) {
        out_setpoint->control = table_player_off;
        self->state = self->end == modbus_end_fault ? modbus_state_fault : modbus_state_done;
    }
}

void table_player_next(struct table_player *self, struct table_player_setpoint *out_setpoint)
{
    static const struct table_player_setpoint off = {table_player_off, 0.0, 0.0, 0.0};
    *out_setpoint = off;
    obey(self);
    if (self->state == modbus_state_armed) {
        out_setpoint->control = self->setup.mode == 0 ? table_player_cascade : table_player_torque;
        out_setpoint->position = self->origin;
    } else if (is_playing(self)) {
        next_of_table(self, out_setpoint);
    } else if (self->state == modbus_state_stopping) {
        next_of_quick_stop(self, out_setpoint);
    }
    self->setpoint = *out_setpoint;
}

static uint32_t fault_of(enum guard_cause cause)
{
    switch (cause) {
    case guard_cause_sensor:
        return modbus_fault_sensor;
    case guard_cause_travel:
        return modbus_fault_travel;
    case guard_cause_speed:
        return modbus_fault_velocity;
    case guard_cause_watchdog:
        return modbus_fault_watchdog;
    case guard_cause_stuck:
        return modbus_fault_stuck;
    case guard_cause_none:
        break;
    }
    return 0;
}

static void trip(struct table_player *self, uint32_t faults, double value)
{
    if (self->faults == 0) {
        self->trip_value = (float)value;
    }
    self->faults |= faults;
    self->end = modbus_end_fault;
    self->feeding = false;
}

/// A ramp to zero where the sensor can be trusted; without it the drive's own quick stop would be blind too.
static void watch(struct table_player *self)
{
    const struct guard_real_sample now = guard_sample(self);
    if (guard_real_step(&self->guard, &now) == guard_ramp_down && self->end != modbus_end_fault) {
        trip(self, fault_of(self->guard.state.cause), (double)self->guard.trip_value);
        if (self->state == modbus_state_armed) {
            begin_quick_stop(self, modbus_end_fault, table_player_quick_stop_s);
            return;
        }
        msgen_player_abort(&self->player);
    }
    double error = self->setpoint.position - self->last.position;
    double allowed = (double)self->setup.following_error;
    if (self->setup.mode == 0 && allowed > 0.0 && !(error >= -allowed && error <= allowed)) {
        table_player_fail(self, modbus_fault_following, error);
    }
}

static double channel_of(const struct table_player_sample *sample, uint32_t channel)
{
    switch (channel) {
    case modbus_channel_torque_ref:
        return sample->torque_ref;
    case modbus_channel_torque:
        return sample->torque;
    case modbus_channel_position:
        return sample->position;
    default:
        return sample->velocity;
    }
}

/// The position is transformed from where it was armed, so that its digits are those of the motion.
static float fed_value(const struct table_player *self, const struct table_player_sample *sample, uint32_t channel)
{
    double number = channel_of(sample, channel);
    return (float)(channel == modbus_channel_position ? number - self->origin : number);
}

void table_player_take(struct table_player *self, const struct table_player_sample *sample)
{
    self->last = *sample;
    bool under_way = is_playing(self) || self->state == modbus_state_armed;
    if (under_way) {
        watch(self);
    }
    if (!self->feeding) {
        return;
    }
    if (!sample->valid) {
        frf_dft_skip(&self->dft, 1);
        return;
    }
    const float frame[table_player_channels] = {fed_value(self, sample, self->setup.input),
                                                fed_value(self, sample, self->setup.output)};
    frf_dft_add_f32(&self->dft, frame, 1);
}

void table_player_fail(struct table_player *self, uint32_t faults, double value)
{
    bool powered = is_playing(self) || self->state == modbus_state_armed;
    bool stopping = self->state == modbus_state_stopping && self->quick_stop_left > 0;
    trip(self, faults, value);
    if (powered) {
        begin_quick_stop(self, modbus_end_fault, table_player_quick_stop_s);
    } else if (!stopping) {
        self->state = modbus_state_fault;
    }
}
