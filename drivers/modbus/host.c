/* SPDX-License-Identifier: MIT */
#include "drivers/modbus/host.h"

#include "core/bytes.h"

#include <stdio.h>
#include <string.h>

enum {
    state_words = 0x5E - 0x1F, ///< NONCE up to the end of the setup
    setup_words = 30,
};

static uint32_t address_of(enum modbus_field_id field)
{
    return modbus_fields[field].address;
}

static uint32_t u32_at(const uint16_t *words)
{
    return (uint32_t)words[0] << 16 | words[1];
}

static float f32_at(const uint16_t *words)
{
    union core_float_bits both;
    both.bits = u32_at(words);
    return both.value;
}

static void put_u32(uint16_t *out_words, uint32_t value)
{
    out_words[0] = (uint16_t)(value >> 16);
    out_words[1] = (uint16_t)(value & 0xFFFFu);
}

static void put_f32(uint16_t *out_words, float value)
{
    union core_float_bits both;
    both.value = value;
    put_u32(out_words, both.bits);
}

// ---- Attempts

/// What an exception of this map means (docs/modbus.md).
static const char *exception_str(int code)
{
    switch (code) {
    case modbus_exception_function:
        return "no such function";
    case modbus_exception_address:
        return "no such register";
    case modbus_exception_value:
        return "a value out of range, or not in this state";
    case modbus_exception_device:
        return "the drive cannot do it now";
    case modbus_exception_busy:
        return "another client commands";
    default:
        return "none of this register map";
    }
}

/// Notes a failure and settles the link. Returns whether another attempt makes sense; *io_status says what to report.
static bool try_again(struct modbus_host *self, const char *doing, int link_status, enum modbus_host_status *io_status)
{
    const char *name = self->link->name(self->link->self);
    if (link_status > 0) {
        snprintf(self->detail, sizeof self->detail, "%s: %s: exception %02d (%s)", name, doing, link_status,
                 exception_str(link_status));
        *io_status = modbus_host_refused;
        return false;
    }
    bool lost = link_status == modbus_link_lost;
    bool late = link_status == modbus_link_timeout;
    self->count.timeouts += late ? 1u : 0u;
    self->count.damaged += link_status == modbus_link_damaged ? 1u : 0u;
    snprintf(self->detail, sizeof self->detail, "%s: %s: %s", name, doing,
             lost   ? "the connection is gone"
             : late ? "no reply in time"
                    : "the reply is damaged or not for this request");
    *io_status = lost ? modbus_host_lost : modbus_host_no_reply;
    self->count.repeated++;
    return self->link->settle(self->link->self) == modbus_link_ok;
}

static void note_stale(struct modbus_host *self)
{
    self->count.stale++;
}

/// One exchange whose reply proves itself: it has to begin with `proof`.
static enum modbus_host_status prove(struct modbus_host *self, const char *doing, enum modbus_field_id write_field,
                                     const uint16_t *words, uint32_t write_count, enum modbus_field_id read_field,
                                     uint32_t read_count, uint16_t proof, uint16_t *out_words)
{
    enum modbus_host_status status = modbus_host_no_reply;
    for (unsigned attempt = 0; attempt < modbus_host_attempts; ++attempt) {
        self->count.requests++;
        int got = self->link->exchange(self->link->self, address_of(write_field), write_count, words,
                                       address_of(read_field), read_count, out_words);
        if (got == modbus_link_ok && out_words[0] == proof) {
            return modbus_host_ok;
        }
        if (got == modbus_link_ok) {
            note_stale(self);
            got = modbus_link_damaged;
        }
        if (!try_again(self, doing, got, &status)) {
            return status;
        }
    }
    return status;
}

// ---- State

enum modbus_host_status modbus_host_read_state(struct modbus_host *self, struct modbus_host_state *out_state)
{
    uint16_t words[state_words];
    enum modbus_host_status status = modbus_host_no_reply;
    // Each attempt has a number of its own, or the late reply to the first would answer the second.
    for (unsigned attempt = 0; attempt < modbus_host_attempts; ++attempt) {
        self->nonce++;
        self->count.requests++;
        int got = self->link->exchange(self->link->self, address_of(modbus_field_nonce), 1, &self->nonce,
                                       address_of(modbus_field_nonce), state_words, words);
        if (got == modbus_link_ok && words[0] == self->nonce) {
            status = modbus_host_ok;
            break;
        }
        if (got == modbus_link_ok) {
            note_stale(self);
            got = modbus_link_damaged;
        }
        if (!try_again(self, "reading the state", got, &status)) {
            return status;
        }
    }
    if (status != modbus_host_ok) {
        return status;
    }
    const uint16_t *at = words + 1; // 0x0020
    const struct modbus_host_state state = {
        .state = (enum modbus_state)at[0x00],
        .acknowledged = at[0x01],
        .result = at[0x02],
        .end = (enum modbus_end)at[0x03],
        .faults = u32_at(at + 0x04),
        .periods_done = u32_at(at + 0x06),
        .periods_valid = u32_at(at + 0x08),
        .samples_played = u32_at(at + 0x0A),
        .torque_clipped = u32_at(at + 0x0C),
        .cycles_max = u32_at(at + 0x0E),
        .torque = f32_at(at + 0x10),
        .position = f32_at(at + 0x12),
        .velocity = f32_at(at + 0x14),
        .trip_value = f32_at(at + 0x16),
        .table_name = u32_at(at + 0x18),
        .rate_hz = f32_at(at + 0x1E),
    };
    *out_state = state;
    memcpy(out_state->setup, at + 0x20, sizeof out_state->setup);
    return modbus_host_ok;
}

// ---- Opening

static enum modbus_host_status read_identity(struct modbus_host *self, uint16_t out_words[16])
{
    enum modbus_host_status status = modbus_host_no_reply;
    for (unsigned attempt = 0; attempt < modbus_host_attempts; ++attempt) {
        self->count.requests++;
        int got = self->link->read(self->link->self, 0, 16, out_words);
        if (got == modbus_link_ok) {
            return modbus_host_ok;
        }
        if (!try_again(self, "reading the identity", got, &status)) {
            return status;
        }
    }
    return status;
}

enum modbus_host_status modbus_host_open(struct modbus_host *self, const struct modbus_link *link, uint16_t first_nonce)
{
    memset(self, 0, sizeof *self);
    self->link = link;
    self->nonce = first_nonce;
    uint16_t words[16];
    enum modbus_host_status status = read_identity(self, words);
    if (status != modbus_host_ok) {
        return status;
    }
    bool known = words[0] == modbus_identity && words[1] >> 8 == modbus_map_version >> 8;
    if (!known || u32_at(words + 2) != modbus_order_probe || u32_at(words + 4) != modbus_float_probe) {
        snprintf(self->detail, sizeof self->detail,
                 "%s: registers 0..5 are %04X %04X %04X %04X %04X %04X, expected 4D53 01xx 0102 0304 3F80 0000 "
                 "(a drive with servoscope's map, high word first)",
                 link->name(link->self), (unsigned)words[0], (unsigned)words[1], (unsigned)words[2], (unsigned)words[3],
                 (unsigned)words[4], (unsigned)words[5]);
        return modbus_host_identity;
    }
    const struct modbus_host_identity identity = {
        .chunk_words = words[6],
        .bins_max = words[7],
        .table_bytes_max = u32_at(words + 8),
        .samples_max = u32_at(words + 10),
        .periods_kept = words[12],
        .linear = words[15] == 1u,
    };
    self->identity = identity;
    struct modbus_host_state state;
    status = modbus_host_read_state(self, &state);
    self->read_sequence = self->nonce;
    return status;
}

// ---- Commands and setup

enum modbus_host_status modbus_host_command(struct modbus_host *self, enum modbus_command command)
{
    struct modbus_host_state state;
    enum modbus_host_status status = modbus_host_read_state(self, &state);
    if (status != modbus_host_ok) {
        return status;
    }
    bool needs_key = command == modbus_command_arm || command == modbus_command_start;
    const uint16_t words[3] = {(uint16_t)command, needs_key ? modbus_key : 0, (uint16_t)(state.acknowledged + 1u)};
    for (unsigned attempt = 0; attempt < modbus_host_attempts; ++attempt) {
        self->count.requests++;
        int got = self->link->write(self->link->self, address_of(modbus_field_command), 3, words);
        if (got < 0 && !try_again(self, "giving a command", got, &status)) {
            return status;
        }
        if (got == modbus_exception_busy) {
            try_again(self, "another client commands the drive", got, &status);
            return status;
        }
        // Whatever the reply said, the drive's own account of it counts.
        status = modbus_host_read_state(self, &state);
        if (status != modbus_host_ok) {
            return status;
        }
        if (state.acknowledged == words[2]) {
            break;
        }
        status = modbus_host_no_reply;
    }
    if (status == modbus_host_ok && state.result != modbus_result_ok) {
        snprintf(self->detail, sizeof self->detail, "%s: command %d is refused in state '%s': %s",
                 self->link->name(self->link->self), (int)command, modbus_state_str(state.state),
                 modbus_result_str(state.result));
        return modbus_host_refused;
    }
    return status;
}

static void encode_setup(const struct modbus_host_setup *setup, uint16_t out_words[setup_words])
{
    const struct modbus_run_setup *run = &setup->run;
    put_u32(out_words + 0, setup->table_bytes);
    put_u32(out_words + 2, setup->table_name);
    out_words[4] = (uint16_t)run->mode;
    out_words[5] = (uint16_t)run->input;
    out_words[6] = (uint16_t)run->output;
    out_words[7] = (uint16_t)run->approach;
    put_u32(out_words + 8, run->settle_periods);
    put_u32(out_words + 10, run->measure_periods);
    put_u32(out_words + 12, run->fade_samples);
    put_u32(out_words + 14, run->abort_samples);
    put_f32(out_words + 16, run->torque_limit);
    put_f32(out_words + 18, run->velocity_limit);
    put_f32(out_words + 20, run->position_min);
    put_f32(out_words + 22, run->position_max);
    put_f32(out_words + 24, run->following_error);
    put_u32(out_words + 26, run->dwell_samples);
    put_u32(out_words + 28, run->host_timeout_ms);
}

enum modbus_host_status modbus_host_write_setup(struct modbus_host *self, const struct modbus_host_setup *setup)
{
    uint16_t words[setup_words];
    encode_setup(setup, words);
    enum modbus_host_status status = modbus_host_no_reply;
    for (unsigned attempt = 0; attempt < modbus_host_attempts; ++attempt) {
        self->count.requests++;
        int got = self->link->write(self->link->self, address_of(modbus_field_table_bytes), setup_words, words);
        if (got != modbus_link_ok && !try_again(self, "writing the setup", got, &status)) {
            return status;
        }
        struct modbus_host_state state;
        status = modbus_host_read_state(self, &state);
        if (status != modbus_host_ok || memcmp(state.setup, words, sizeof words) == 0) {
            return status;
        }
        snprintf(self->detail, sizeof self->detail, "%s: the setup reads back otherwise than it was written",
                 self->link->name(self->link->self));
        status = modbus_host_no_reply;
    }
    return status;
}

// ---- Table

static enum modbus_host_status send_chunk(struct modbus_host *self, const uint8_t *table, uint32_t offset_words,
                                          uint32_t count)
{
    uint16_t words[2 + modbus_chunk_words];
    put_u32(words, offset_words);
    for (uint32_t i = 0; i < count; ++i) {
        const uint8_t *bytes = table + 2u * (size_t)(offset_words + i);
        words[2u + i] = (uint16_t)((unsigned)bytes[0] << 8 | bytes[1]);
    }
    enum modbus_host_status status = modbus_host_no_reply;
    for (unsigned attempt = 0; attempt < modbus_host_attempts; ++attempt) {
        self->count.requests++;
        int got = self->link->write(self->link->self, address_of(modbus_field_upload_offset), 2u + count, words);
        if (got == modbus_link_ok) {
            return modbus_host_ok; // a stale echo may hide a lost chunk: VERIFY finds out
        }
        if (!try_again(self, "sending the table", got, &status)) {
            return status;
        }
    }
    return status;
}

static enum modbus_host_status send_table(struct modbus_host *self, const uint8_t *table, uint32_t bytes,
                                          bool (*progress)(void *context, size_t done, size_t total), void *context)
{
    uint32_t total = bytes / 2u;
    uint32_t most = self->identity.chunk_words < modbus_chunk_words ? self->identity.chunk_words : modbus_chunk_words;
    for (uint32_t done = 0; done < total;) {
        uint32_t count = total - done < most ? total - done : most;
        enum modbus_host_status status = send_chunk(self, table, done, count);
        if (status != modbus_host_ok) {
            return status;
        }
        done += count;
        if (progress && !progress(context, done, total)) {
            snprintf(self->detail, sizeof self->detail, "ended while the table was sent");
            return modbus_host_ended;
        }
    }
    return modbus_host_ok;
}

enum modbus_host_status modbus_host_upload(struct modbus_host *self, const uint8_t *table,
                                           const struct modbus_host_setup *setup,
                                           bool (*progress)(void *context, size_t done, size_t total), void *context)
{
    if (setup->table_bytes > self->identity.table_bytes_max || setup->table_bytes % 2u != 0 ||
        self->identity.chunk_words == 0) {
        snprintf(self->detail, sizeof self->detail, "the table has %lu bytes, the drive holds %lu",
                 (unsigned long)setup->table_bytes, (unsigned long)self->identity.table_bytes_max);
        return modbus_host_argument;
    }
    enum modbus_host_status status = modbus_host_ok;
    for (unsigned attempt = 0; attempt < 2; ++attempt) { // once more where a chunk was lost unseen
        status = modbus_host_command(self, modbus_command_open_upload);
        status = status == modbus_host_ok ? modbus_host_write_setup(self, setup) : status;
        status = status == modbus_host_ok ? send_table(self, table, setup->table_bytes, progress, context) : status;
        status = status == modbus_host_ok ? modbus_host_command(self, modbus_command_verify) : status;
        if (status != modbus_host_refused) {
            break;
        }
    }
    return status;
}

// ---- Spectra

static void decode_record(const uint16_t *words, bool is_mean, struct modbus_record *out_record)
{
    const struct modbus_record record = {
        .input = {f32_at(words), f32_at(words + 2)},
        .output = {f32_at(words + 4), f32_at(words + 6)},
        .input_variance = is_mean ? f32_at(words + 8) : 0.0f,
        .output_variance = is_mean ? f32_at(words + 10) : 0.0f,
        .covariance = {is_mean ? f32_at(words + 12) : 0.0f, is_mean ? f32_at(words + 14) : 0.0f},
    };
    *out_record = record;
}

enum modbus_host_status modbus_host_read_spectrum(struct modbus_host *self, uint32_t period, uint32_t bins,
                                                  struct modbus_record *out_records,
                                                  struct modbus_host_spectrum *out_spectrum)
{
    bool is_mean = period == MODBUS_MEAN;
    uint32_t words_of_bin = is_mean ? modbus_mean_words : modbus_period_words;
    uint16_t window[modbus_spectrum_words];
    self->read_sequence++;
    for (uint32_t first = 0; first < bins;) {
        uint16_t select[4];
        put_u32(select, period);
        select[2] = (uint16_t)first;
        select[3] = self->read_sequence;
        enum modbus_host_status status =
            prove(self, "reading a spectrum", modbus_field_read_period, select, 4, modbus_field_spectrum,
                  modbus_spectrum_words, self->read_sequence, window);
        if (status != modbus_host_ok) {
            return status;
        }
        const struct modbus_host_spectrum seen = {window[1], u32_at(window + 2), u32_at(window + 6), bins};
        bool of_this_request = seen.period == period && window[4] == first;
        bool of_one_snapshot = first == 0 || seen.count == out_spectrum->count;
        uint32_t count = window[5];
        bool fits = count >= 1 && count <= bins - first &&
                    modbus_spectrum_head_words + count * words_of_bin <= modbus_spectrum_words;
        *out_spectrum = seen;
        if (of_this_request && seen.validity != modbus_spectrum_valid) {
            return modbus_host_ok;
        }
        if (!of_this_request || !of_one_snapshot || !fits) {
            note_stale(self);
            snprintf(self->detail, sizeof self->detail, "%s: a spectrum came that was not asked for",
                     self->link->name(self->link->self));
            return modbus_host_no_reply;
        }
        for (uint32_t i = 0; i < count; ++i) {
            decode_record(window + modbus_spectrum_head_words + i * words_of_bin, is_mean, &out_records[first + i]);
        }
        first += count;
    }
    return modbus_host_ok;
}

// ---- Text

const char *modbus_host_status_str(enum modbus_host_status status)
{
    switch (status) {
    case modbus_host_ok:
        return "ok";
    case modbus_host_no_reply:
        return "no usable reply";
    case modbus_host_lost:
        return "the connection is gone";
    case modbus_host_refused:
        return "refused by the drive";
    case modbus_host_identity:
        return "not a drive with servoscope's register map";
    case modbus_host_argument:
        return "more than the drive holds";
    case modbus_host_ended:
        return "ended by the caller";
    }
    return "unknown status";
}

const char *modbus_result_str(uint32_t result)
{
    if (result >= 0x8000u) {
        return core_status_str((enum core_status)((int32_t)result - 0x10000));
    }
    switch (result) {
    case modbus_result_ok:
        return "done";
    case modbus_result_unknown:
        return "no such command";
    case modbus_result_state:
        return "not possible in this state";
    case modbus_result_key:
        return "the key is missing";
    case modbus_result_size:
        return "the table's length is 0 or more than the drive holds";
    case modbus_result_name:
        return "the drive holds another table than the one that was named";
    case modbus_result_setup:
        return "table, mode and axis do not go together, or the table has too many lines";
    case modbus_result_drive:
        return "the drive cannot be armed: it stands outside its limits, or its sensor is invalid";
    default:
        return "unknown result";
    }
}

const char *modbus_state_str(uint32_t state)
{
    static const char *const names[] = {"idle",     "uploading", "verified", "armed",
                                        "settling", "running",   "done",     "stopping"};
    if (state == modbus_state_fault) {
        return "fault";
    }
    return state < sizeof names / sizeof names[0] ? names[state] : "unknown state";
}

const char *modbus_fault_str(uint32_t faults)
{
    static const struct {
        uint32_t bit;
        const char *text;
    } texts[] = {
        {modbus_fault_sensor, "the sensor is invalid"},
        {modbus_fault_travel, "travel limit"},
        {modbus_fault_velocity, "speed limit"},
        {modbus_fault_watchdog, "the host was silent for too long"},
        {modbus_fault_stuck, "the axis does not move under torque"},
        {modbus_fault_following, "following error"},
        {modbus_fault_drive, "fault of the drive itself"},
        {modbus_fault_late, "the drive missed a sample"},
    };
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; ++i) {
        if (faults & texts[i].bit) {
            return texts[i].text;
        }
    }
    return "no fault";
}
