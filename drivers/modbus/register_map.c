/* SPDX-License-Identifier: MIT */
#include "drivers/modbus/register_map.h"

#include "core/bytes.h"

#include <stddef.h>

static uint32_t bits_of(float value)
{
    union core_float_bits both;
    both.value = value;
    return both.bits;
}

static float float_of(uint32_t bits)
{
    union core_float_bits both;
    both.bits = bits;
    return both.value;
}

static uint32_t value(const struct modbus_map *self, enum modbus_field_id field)
{
    return self->values[field];
}

static float float_value(const struct modbus_map *self, enum modbus_field_id field)
{
    return float_of(self->values[field]);
}

// ---- Defaults

static void set_identity(struct modbus_map *self)
{
    const struct modbus_map_config *config = &self->config;
    self->values[modbus_field_identity] = modbus_identity;
    self->values[modbus_field_version] = modbus_map_version;
    self->values[modbus_field_order_probe] = modbus_order_probe;
    self->values[modbus_field_float_probe] = modbus_float_probe;
    self->values[modbus_field_chunk_words] = modbus_chunk_words;
    self->values[modbus_field_bins_max] = config->bins_max;
    self->values[modbus_field_table_bytes_max] = config->table_bytes;
    self->values[modbus_field_samples_max] = config->samples_max;
    self->values[modbus_field_periods_kept] = config->periods_kept < 0xFFFFu ? config->periods_kept : 0xFFFFu;
    self->values[modbus_field_mean_bins] = modbus_mean_bins;
    self->values[modbus_field_period_bins] = modbus_period_bins;
    self->values[modbus_field_axis] = config->linear ? 1u : 0u;
}

enum core_status modbus_map_init(struct modbus_map *self, const struct modbus_map_config *config)
{
    if (!self || !config || !config->table || !config->snapshot || config->table_bytes < msgen_header_bytes ||
        config->bins_max < 1 || config->bins_max > 0xFFFFu) {
        return core_err_argument;
    }
    static const struct modbus_map empty;
    *self = empty;
    self->config = *config;
    set_identity(self);
    self->values[modbus_field_input] = modbus_channel_torque;
    self->values[modbus_field_output] = modbus_channel_velocity;
    self->values[modbus_field_settle_periods] = 1;
    self->values[modbus_field_measure_periods] = 2;
    self->values[modbus_field_fade_samples] = 1000;
    self->values[modbus_field_abort_samples] = 1000;
    self->values[modbus_field_host_timeout_ms] = 2000;
    self->latched.validity = modbus_spectrum_nothing;
    return core_ok;
}

// ---- State

static enum modbus_state state_of(const struct modbus_map *self, const struct modbus_report *report)
{
    return report->state == modbus_state_idle ? self->resting : report->state;
}

static enum modbus_state present_state(const struct modbus_map *self)
{
    struct modbus_report report;
    self->config.device.report(self->config.device.self, &report);
    return state_of(self, &report);
}

static void refresh(struct modbus_map *self)
{
    struct modbus_report report;
    self->config.device.report(self->config.device.self, &report);
    self->values[modbus_field_state] = (uint32_t)state_of(self, &report);
    self->values[modbus_field_end] = (uint32_t)report.end;
    self->values[modbus_field_faults] = report.faults;
    self->values[modbus_field_periods_done] = report.periods_done;
    self->values[modbus_field_periods_valid] = report.periods_valid;
    self->values[modbus_field_samples_played] = report.samples_played;
    self->values[modbus_field_torque_clipped] = report.torque_clipped;
    self->values[modbus_field_cycles_max] = report.cycles_max;
    self->values[modbus_field_torque] = bits_of(report.torque);
    self->values[modbus_field_position] = bits_of(report.position);
    self->values[modbus_field_velocity] = bits_of(report.velocity);
    self->values[modbus_field_trip_value] = bits_of(report.trip_value);
}

static bool is_at_rest(enum modbus_state state)
{
    return state == modbus_state_idle || state == modbus_state_uploading || state == modbus_state_verified ||
           state == modbus_state_done;
}

static bool is_moving(enum modbus_state state)
{
    return state == modbus_state_settling || state == modbus_state_running || state == modbus_state_stopping;
}

static void name_table(struct modbus_map *self)
{
    const struct msgen_table *table = &self->view;
    bool valid = self->view_valid;
    self->values[modbus_field_table_name] = valid ? table->header_crc32 : 0;
    self->values[modbus_field_table_samples] = valid ? table->period_samples : 0;
    self->values[modbus_field_table_bins] = valid ? table->bin_count : 0;
    self->values[modbus_field_rate_hz] = valid ? bits_of((float)table->rate_num_hz / (float)table->rate_den) : 0;
}

/// The table is no longer what was verified.
static void unverify(struct modbus_map *self)
{
    self->config.device.clear(self->config.device.self);
    self->resting = modbus_state_uploading;
    self->view_valid = false;
    name_table(self);
}

// ---- Commands

static struct modbus_run_setup read_setup(const struct modbus_map *self)
{
    const struct modbus_run_setup setup = {
        .mode = value(self, modbus_field_mode),
        .input = value(self, modbus_field_input),
        .output = value(self, modbus_field_output),
        .approach = value(self, modbus_field_approach),
        .settle_periods = value(self, modbus_field_settle_periods),
        .measure_periods = value(self, modbus_field_measure_periods),
        .fade_samples = value(self, modbus_field_fade_samples),
        .abort_samples = value(self, modbus_field_abort_samples),
        .dwell_samples = value(self, modbus_field_dwell_samples),
        .host_timeout_ms = value(self, modbus_field_host_timeout_ms),
        .torque_limit = float_value(self, modbus_field_torque_limit),
        .velocity_limit = float_value(self, modbus_field_velocity_limit),
        .position_min = float_value(self, modbus_field_position_min),
        .position_max = float_value(self, modbus_field_position_max),
        .following_error = float_value(self, modbus_field_following_error),
    };
    return setup;
}

static int32_t open_upload(struct modbus_map *self)
{
    if (!is_at_rest(present_state(self))) {
        return modbus_result_state;
    }
    unverify(self);
    return modbus_result_ok;
}

static int32_t verify(struct modbus_map *self)
{
    if (!is_at_rest(present_state(self))) {
        return modbus_result_state;
    }
    unverify(self);
    uint32_t size = value(self, modbus_field_table_bytes);
    if (size == 0 || size > self->config.table_bytes) {
        return modbus_result_size;
    }
    enum core_status status = msgen_table_open(self->config.table, size, &self->view);
    if (status != core_ok) {
        return status;
    }
    if (self->view.header_crc32 != value(self, modbus_field_table_crc32)) {
        return modbus_result_name;
    }
    const struct modbus_run_setup setup = read_setup(self);
    if (self->view.bin_count > self->config.bins_max || self->view.linear != self->config.linear ||
        (setup.mode == 0 && self->view.channels < msgen_channels_max)) {
        return modbus_result_setup;
    }
    status = self->config.device.prepare(self->config.device.self, &self->view, &setup);
    if (status != core_ok) {
        return status;
    }
    self->view_valid = true;
    self->resting = modbus_state_verified;
    name_table(self);
    return modbus_result_ok;
}

static int32_t arm(struct modbus_map *self)
{
    if (value(self, modbus_field_key) != modbus_key) {
        return modbus_result_key;
    }
    if (present_state(self) != modbus_state_verified) {
        return modbus_result_state;
    }
    self->latched.validity = modbus_spectrum_nothing; // of the run before
    return self->config.device.arm(self->config.device.self) == core_ok ? modbus_result_ok : modbus_result_drive;
}

static int32_t start(struct modbus_map *self)
{
    if (value(self, modbus_field_key) != modbus_key) {
        return modbus_result_key;
    }
    if (present_state(self) != modbus_state_armed) {
        return modbus_result_state;
    }
    self->config.device.start(self->config.device.self);
    return modbus_result_ok;
}

static int32_t stop(struct modbus_map *self)
{
    enum modbus_state state = present_state(self);
    if (state != modbus_state_armed && !is_moving(state)) {
        return modbus_result_state;
    }
    self->config.device.stop(self->config.device.self);
    return modbus_result_ok;
}

static int32_t abort_run(struct modbus_map *self)
{
    enum modbus_state state = present_state(self);
    if (state != modbus_state_armed && !is_moving(state)) {
        return modbus_result_state;
    }
    self->config.device.abort(self->config.device.self);
    return modbus_result_ok;
}

static int32_t reset_fault(struct modbus_map *self)
{
    if (present_state(self) != modbus_state_fault) {
        return modbus_result_state;
    }
    unverify(self);
    return modbus_result_ok;
}

static int32_t execute(struct modbus_map *self)
{
    switch (value(self, modbus_field_command)) {
    case modbus_command_open_upload:
        return open_upload(self);
    case modbus_command_verify:
        return verify(self);
    case modbus_command_arm:
        return arm(self);
    case modbus_command_start:
        return start(self);
    case modbus_command_stop:
        return stop(self);
    case modbus_command_abort:
        return abort_run(self);
    case modbus_command_reset_fault:
        return reset_fault(self);
    default:
        return modbus_result_unknown;
    }
}

/// The outcome of a command that is repeated is the one it had.
static enum modbus_exception command(struct modbus_map *self)
{
    uint32_t sequence = value(self, modbus_field_sequence);
    if (sequence != value(self, modbus_field_acknowledged)) {
        int32_t result = execute(self);
        self->values[modbus_field_result] = (uint32_t)result & 0xFFFFu;
        self->values[modbus_field_acknowledged] = sequence;
    }
    self->values[modbus_field_key] = 0; // a key opens one command
    uint32_t result = value(self, modbus_field_result);
    if (result == modbus_result_drive) {
        return modbus_exception_device;
    }
    return result == modbus_result_ok ? modbus_exception_none : modbus_exception_value;
}

// ---- Windows

static uint16_t table_word(const struct modbus_map *self, uint32_t word)
{
    uint32_t offset = value(self, modbus_field_upload_offset);
    if (offset > 0x7FFFFFFFu - word || 2u * (offset + word) + 1u >= self->config.table_bytes) {
        return 0;
    }
    const uint8_t *bytes = self->config.table + 2u * (size_t)(offset + word);
    return (uint16_t)((unsigned)bytes[0] << 8 | bytes[1]);
}

static uint16_t bin_word(const struct modbus_map *self, uint32_t word)
{
    uint32_t index = value(self, modbus_field_bin_first) + word;
    if (!self->view_valid || index >= self->view.bin_count) {
        return 0;
    }
    uint32_t bin = msgen_table_bin(&self->view, index);
    return (uint16_t)(bin & 0xFFFFu);
}

static uint16_t half(uint32_t bits, uint32_t word)
{
    return (uint16_t)(word == 0 ? bits >> 16 : bits & 0xFFFFu);
}

static uint32_t window_bins(const struct modbus_map *self)
{
    uint32_t first = value(self, modbus_field_read_first);
    uint32_t most = self->latched.is_mean ? modbus_mean_bins : modbus_period_bins;
    if (self->latched.validity != modbus_spectrum_valid || first >= self->latched.bins) {
        return 0;
    }
    return self->latched.bins - first < most ? self->latched.bins - first : most;
}

static uint16_t spectrum_head(const struct modbus_map *self, uint32_t word)
{
    switch (word) {
    case 0:
        return self->latched.sequence;
    case 1:
        return (uint16_t)self->latched.validity;
    case 2:
    case 3:
        return half(self->latched.period, word - 2u);
    case 4:
        return (uint16_t)value(self, modbus_field_read_first);
    case 5:
        return (uint16_t)window_bins(self);
    default:
        return half(self->latched.count, word - 6u);
    }
}

static uint16_t spectrum_word(const struct modbus_map *self, uint32_t word)
{
    if (word < modbus_spectrum_head_words) {
        return spectrum_head(self, word);
    }
    uint32_t index = word - modbus_spectrum_head_words;
    uint32_t words = self->latched.is_mean ? modbus_mean_words : modbus_period_words;
    if (index / words >= window_bins(self)) {
        return 0;
    }
    const struct modbus_record *record = &self->config.snapshot[value(self, modbus_field_read_first) + index / words];
    const float numbers[] = {record->input[0],      record->input[1],       record->output[0],
                             record->output[1],     record->input_variance, record->output_variance,
                             record->covariance[0], record->covariance[1]};
    return half(bits_of(numbers[index % words / 2u]), index % 2u);
}

/// A new sequence number takes a new snapshot; the same one moves the window on the one that is there.
static void latch(struct modbus_map *self)
{
    uint16_t sequence = (uint16_t)value(self, modbus_field_read_sequence);
    uint32_t period = value(self, modbus_field_read_period);
    bool same = self->latched.validity != modbus_spectrum_nothing && sequence == self->latched.sequence &&
                period == self->latched.period;
    if (same) {
        return;
    }
    uint32_t count = 0;
    uint32_t bins = value(self, modbus_field_table_bins);
    uint32_t validity = modbus_spectrum_nothing;
    if (bins > 0) {
        validity = self->config.device.spectrum(self->config.device.self, period, self->config.snapshot, &count);
    }
    self->latched.validity = validity;
    self->latched.sequence = sequence;
    self->latched.period = period;
    self->latched.is_mean = period == MODBUS_MEAN;
    self->latched.count = count;
    self->latched.bins = bins;
}

// ---- Access

static uint16_t word_of(const struct modbus_map *self, uint32_t field, uint32_t word)
{
    switch (field) {
    case modbus_field_bin_data:
        return bin_word(self, word);
    case modbus_field_upload_data:
        return table_word(self, word);
    case modbus_field_spectrum:
        return spectrum_word(self, word);
    default:
        break;
    }
    uint32_t bits = self->values[field];
    return modbus_fields[field].words == 2 ? half(bits, word) : (uint16_t)bits;
}

/// The field that holds `address`, searched from `from` on; modbus_field_count if none does.
static uint32_t field_at(uint32_t address, uint32_t from)
{
    uint32_t field = from;
    while (field < modbus_field_count &&
           address >= (uint32_t)modbus_fields[field].address + modbus_fields[field].words) {
        ++field;
    }
    return field < modbus_field_count && address >= modbus_fields[field].address ? field : modbus_field_count;
}

enum modbus_exception modbus_map_read(struct modbus_map *self, uint32_t address, uint32_t count, uint16_t *out_words)
{
    if (count == 0) {
        return modbus_exception_value;
    }
    refresh(self);
    uint32_t field = 0;
    for (uint32_t i = 0; i < count; ++i) {
        field = field_at(address + i, field);
        if (field == modbus_field_count) {
            return modbus_exception_address;
        }
        out_words[i] = word_of(self, field, address + i - modbus_fields[field].address);
    }
    return modbus_exception_none;
}

static bool value_is_allowed(const struct modbus_field *field, uint32_t bits)
{
    if (field->kind == modbus_f32) {
        return core_float_bits_are_finite(bits) && (field->most == 0 || bits >> 31 == 0 || bits == 0x80000000u);
    }
    return bits >= field->least && bits <= field->most;
}

static uint32_t bits_from(const struct modbus_field *field, const uint16_t *words)
{
    return field->words == 2 ? (uint32_t)words[0] << 16 | words[1] : words[0];
}

/// A field of one number: whether it may be written whole, with this value, in this state.
static enum modbus_exception check_number(const struct modbus_field *field, enum modbus_state state, uint32_t left,
                                          const uint16_t *words)
{
    if (field->access == modbus_read_only) {
        return modbus_exception_address;
    }
    if (left < field->words || !value_is_allowed(field, bits_from(field, words))) {
        return modbus_exception_value;
    }
    if (field->access == modbus_setup && !is_at_rest(state)) {
        return modbus_exception_value;
    }
    return modbus_exception_none;
}

/// Data comes directly behind its offset, into room that is there, while uploading.
static enum modbus_exception check_upload(const struct modbus_map *self, enum modbus_state state, uint32_t offset,
                                          uint32_t count)
{
    uint32_t room = self->config.table_bytes / 2u;
    bool fits = count <= modbus_chunk_words && offset <= room && count <= room - offset;
    if (count > 0 && state != modbus_state_uploading) {
        return modbus_exception_value;
    }
    return fits ? modbus_exception_none : modbus_exception_value;
}

/// A command is written whole, in one request.
static bool splits_command(uint32_t address, uint32_t count)
{
    uint32_t first = modbus_fields[modbus_field_command].address;
    uint32_t last = modbus_fields[modbus_field_sequence].address;
    bool touches = address <= last && address + count > first;
    return touches && (address > first || address + count <= last);
}

static enum modbus_exception check_write(const struct modbus_map *self, uint32_t address, uint32_t count,
                                         const uint16_t *words)
{
    enum modbus_state state = present_state(self);
    uint32_t field = 0;
    for (uint32_t i = 0; i < count; i += modbus_fields[field].words) {
        field = field_at(address + i, field);
        if (field == modbus_field_count) {
            return modbus_exception_address;
        }
        const struct modbus_field *at = &modbus_fields[field];
        if (at->kind == modbus_window) {
            return at->access == modbus_data ? modbus_exception_value : modbus_exception_address;
        }
        if (address + i != at->address) {
            return at->access == modbus_read_only ? modbus_exception_address : modbus_exception_value;
        }
        enum modbus_exception exception = check_number(at, state, count - i, words + i);
        if (exception != modbus_exception_none) {
            return exception;
        }
        if (field == modbus_field_upload_offset) {
            uint32_t behind = count - i - at->words;
            return check_upload(self, state, bits_from(at, words + i), behind);
        }
    }
    return splits_command(address, count) ? modbus_exception_value : modbus_exception_none;
}

static void store_data(struct modbus_map *self, const uint16_t *words, uint32_t count)
{
    uint8_t *bytes = self->config.table + 2u * (size_t)value(self, modbus_field_upload_offset);
    for (uint32_t i = 0; i < count; ++i) {
        bytes[2u * i] = (uint8_t)(words[i] >> 8);
        bytes[2u * i + 1u] = (uint8_t)(words[i] & 0xFFu);
    }
}

/// What a write sets off besides the values; one request touches one group (they lie apart).
static enum modbus_exception react(struct modbus_map *self, uint32_t field)
{
    if (field == modbus_field_sequence) {
        return command(self);
    }
    if (field >= modbus_field_read_period && field <= modbus_field_read_sequence) {
        latch(self);
    }
    if (modbus_fields[field].access == modbus_setup && present_state(self) != modbus_state_idle) {
        unverify(self);
    }
    return modbus_exception_none;
}

enum modbus_exception modbus_map_write(struct modbus_map *self, uint32_t address, uint32_t count, const uint16_t *words)
{
    if (count == 0) {
        return modbus_exception_value;
    }
    enum modbus_exception exception = check_write(self, address, count, words);
    if (exception != modbus_exception_none) {
        return exception;
    }
    self->config.device.alive(self->config.device.self);
    uint32_t field = field_at(address, 0);
    uint32_t last = field;
    for (uint32_t i = 0; i < count;) {
        field = field_at(address + i, field);
        if (field == modbus_field_upload_data) {
            store_data(self, words + i, count - i);
            break;
        }
        self->values[field] = bits_from(&modbus_fields[field], words + i);
        last = field;
        i += modbus_fields[field].words;
    }
    return react(self, last);
}
