/* SPDX-License-Identifier: MIT */
#include "firmware/modbus_door.h"

#include "core/bytes.h"
#include "drivers/modbus/crc16.h"
#include "drivers/modbus/pdu.h"
#include "firmware/axis.h"

#include <stddef.h>

static uint8_t uploaded[modbus_door_table_bytes];

// ---- Device

static enum core_status device_prepare(void *self, const struct msgen_table *table,
                                       const struct modbus_run_setup *setup)
{
    const struct axis_setup axis_setup = {.settle_periods = setup->settle_periods,
                                          .measure_periods = setup->measure_periods,
                                          .fade_samples = setup->fade_samples,
                                          .abort_samples = setup->abort_samples,
                                          .watchdog_samples = setup->host_timeout_ms * (axis_rate_hz / 1000u),
                                          .torque_limit_Nm = setup->torque_limit,
                                          .velocity_limit_rad_per_s = setup->velocity_limit,
                                          .position_min_rad = setup->position_min,
                                          .position_max_rad = setup->position_max};
    (void)self;
    /* What this example does not do is refused: other channels, torque mode, the approach, a following error. */
    if (setup->mode != 0 || setup->approach != 0 || setup->following_error > 0.0f ||
        setup->input != modbus_channel_torque || setup->output != modbus_channel_velocity) {
        return core_err_argument;
    }
    return axis_prepare(table, &axis_setup);
}

static enum core_status device_arm(void *self)
{
    (void)self;
    return axis_arm();
}

static void device_start(void *self)
{
    (void)self;
    axis_start();
}

static void device_stop(void *self)
{
    (void)self;
    axis_stop();
}

static void device_clear(void *self)
{
    (void)self;
    axis_rest();
}

static void device_alive(void *self)
{
    (void)self;
    guard_alive(&axis.path.guard.state);
}

static enum modbus_state state_of_axis(void)
{
    switch (axis.state) {
    case axis_armed:
        return modbus_state_armed;
    case axis_playing:
        return axis.path.measuring ? modbus_state_running : modbus_state_settling;
    case axis_done:
        return axis.path.guard.state.mode == guard_tripped ? modbus_state_fault : modbus_state_done;
    case axis_resting:
        break;
    }
    return modbus_state_idle;
}

static void device_report(const void *self, struct modbus_report *out_report)
{
    static const uint32_t faults[] = {
        [guard_cause_sensor] = modbus_fault_sensor,  [guard_cause_travel] = modbus_fault_travel,
        [guard_cause_speed] = modbus_fault_velocity, [guard_cause_watchdog] = modbus_fault_watchdog,
        [guard_cause_stuck] = modbus_fault_stuck,
    };
    bool tripped = axis.path.guard.state.mode == guard_tripped;
    struct modbus_report report = {.state = state_of_axis()};
    (void)self;
    report.end = axis.state != axis_done ? modbus_end_none
                 : tripped               ? modbus_end_fault
                 : axis.stop_wanted      ? modbus_end_stopped
                                         : modbus_end_complete;
    report.faults = tripped ? faults[axis.path.guard.state.cause] : 0;
    report.periods_done = axis.results.sequence;
    report.periods_valid = axis.results.statistics.periods;
    report.samples_played = axis.path.samples;
    report.torque_clipped = axis.path.guard.state.count.torque_clipped;
    report.cycles_max = axis.longest_instructions;
    report.torque = axis.belt.torque_Nm;
    report.position = axis.belt.motor_position_rad;
    report.velocity = axis.belt.motor_velocity_rad_per_s;
    *out_report = report;
}

static uint32_t device_spectrum(const void *self, uint32_t period, struct modbus_record *out_records,
                                uint32_t *out_count)
{
    const struct results *results = &axis.results;
    uint32_t periods = results->statistics.periods;
    core_real input = results->input_unit, output = results->output_unit;
    core_real degrees = (core_real)(periods > 1u ? periods - 1u : 1u);
    (void)self;
    *out_count = 0;
    if (period != MODBUS_MEAN) {
        return modbus_spectrum_not_kept;
    }
    for (uint32_t bin = 0; bin < results->statistics.bin_count; ++bin) {
        const struct frf_pair *pair = &results->pairs[bin];
        const struct modbus_record record = {
            .input = {(float)(pair->input_mean.real * input), (float)(pair->input_mean.imaginary * input)},
            .output = {(float)(pair->output_mean.real * output), (float)(pair->output_mean.imaginary * output)},
            .input_variance = (float)(pair->input_squares * input * input / degrees),
            .output_variance = (float)(pair->output_squares * output * output / degrees),
            .covariance = {(float)(pair->cross.real * input * output / degrees),
                           (float)(pair->cross.imaginary * input * output / degrees)}};
        out_records[bin] = record;
    }
    *out_count = periods;
    return periods > 0 ? modbus_spectrum_valid : modbus_spectrum_not_yet;
}

enum core_status modbus_door_init(struct modbus_door *self)
{
    static const struct modbus_door empty;
    const struct modbus_map_config config = {.device = {.self = self,
                                                        .prepare = device_prepare,
                                                        .arm = device_arm,
                                                        .start = device_start,
                                                        .stop = device_stop,
                                                        .abort = device_stop,
                                                        .clear = device_clear,
                                                        .alive = device_alive,
                                                        .report = device_report,
                                                        .spectrum = device_spectrum},
                                             .table = uploaded,
                                             .table_bytes = sizeof uploaded,
                                             .snapshot = self->snapshot,
                                             .bins_max = results_bins_max,
                                             .samples_max = SERVOSCOPE_FRF_PERIOD_MAX};
    *self = empty;
    modbus_rtu_slave_init(&self->slave, &self->map, modbus_door_address, modbus_rtu_timing_of(115200u));
    return modbus_map_init(&self->map, &config);
}

void modbus_door_serve(struct modbus_door *self, uint64_t now_us)
{
    for (uint32_t i = 0; i < self->to_slave.size; ++i) {
        modbus_rtu_slave_byte(&self->slave, self->to_slave.bytes[i], now_us);
    }
    self->to_slave.size = 0;
    if (self->to_master.size == 0) {
        self->to_master.size = modbus_rtu_slave_poll(&self->slave, now_us, self->to_master.bytes);
    }
}

// ---- Master

static void put_word(struct modbus_line *line, uint32_t word)
{
    line->bytes[line->size++] = (uint8_t)(word >> 8 & 0xFFu);
    line->bytes[line->size++] = (uint8_t)(word & 0xFFu);
}

static void put_long(struct modbus_line *line, uint32_t value)
{
    put_word(line, value >> 16);
    put_word(line, value & 0xFFFFu);
}

static void put_float(struct modbus_line *line, float value)
{
    union core_float_bits number = {.value = value};
    put_long(line, number.bits);
}

/* A write of `words` registers; then they follow. Reading first makes it function 23. */
static void begin_request(struct modbus_door *self, uint32_t read_address, uint32_t read_words, uint32_t address,
                          uint32_t words)
{
    struct modbus_line *line = &self->to_slave;
    line->size = 0;
    line->bytes[line->size++] = modbus_door_address;
    line->bytes[line->size++] = read_words > 0 ? modbus_function_read_write : modbus_function_write_many;
    if (read_words > 0) {
        put_word(line, read_address);
        put_word(line, read_words);
    }
    put_word(line, address);
    put_word(line, words);
    line->bytes[line->size++] = (uint8_t)(2u * words);
}

static void end_request(struct modbus_door *self, uint64_t now_us)
{
    struct modbus_line *line = &self->to_slave;
    uint16_t check = modbus_crc16(line->bytes, line->size);
    line->bytes[line->size++] = (uint8_t)(check & 0xFFu);
    line->bytes[line->size++] = (uint8_t)(check >> 8);
    self->waiting = true;
    self->asked_us = now_us;
    ++self->requests;
}

static void ask_setup(struct modbus_door *self, const uint8_t *table, uint32_t table_bytes)
{
    struct modbus_line *line = &self->to_slave;
    struct msgen_table view;
    const uint32_t fade_samples = axis_rate_hz / 20u, host_timeout_ms = 500;
    (void)msgen_table_open(table, table_bytes, &view);
    begin_request(self, 0, 0, modbus_fields[modbus_field_table_bytes].address, 30);
    put_long(line, table_bytes);
    put_long(line, view.header_crc32);
    put_word(line, 0); /* cascade */
    put_word(line, modbus_channel_torque);
    put_word(line, modbus_channel_velocity);
    put_word(line, 0); /* no approach */
    put_long(line, 1); /* period to settle */
    put_long(line, 6); /* periods to measure */
    put_long(line, fade_samples);
    put_long(line, fade_samples); /* of an abort */
    put_float(line, 1.9f);        /* Nm */
    put_float(line, 3.5f);        /* rad/s */
    put_float(line, -1.0f);       /* rad */
    put_float(line, 1.0f);
    put_float(line, 0.0f); /* following error is not watched */
    put_long(line, 0);     /* no dwell */
    put_long(line, host_timeout_ms);
}

static void ask_command(struct modbus_door *self, enum modbus_command command)
{
    begin_request(self, modbus_fields[modbus_field_state].address, 3, modbus_fields[modbus_field_command].address, 3);
    put_word(&self->to_slave, command);
    put_word(&self->to_slave, modbus_key);
    put_word(&self->to_slave, ++self->sequence);
}

static void ask_chunk(struct modbus_door *self, const uint8_t *table, uint32_t table_bytes)
{
    uint32_t left = table_bytes - self->offset, bytes = left < 2u * modbus_chunk_words ? left : 2u * modbus_chunk_words;
    begin_request(self, 0, 0, modbus_fields[modbus_field_upload_offset].address, 2u + bytes / 2u);
    put_long(&self->to_slave, self->offset / 2u);
    for (uint32_t i = 0; i < bytes; ++i) {
        self->to_slave.bytes[self->to_slave.size++] = table[self->offset + i];
    }
    self->offset += bytes;
}

static void ask_spectrum(struct modbus_door *self)
{
    begin_request(self, modbus_fields[modbus_field_spectrum].address, modbus_spectrum_words,
                  modbus_fields[modbus_field_read_period].address, 4);
    put_long(&self->to_slave, MODBUS_MEAN);
    put_word(&self->to_slave, self->bins_read);
    put_word(&self->to_slave, self->sequence);
}

static uint32_t word_at(const struct modbus_line *line, uint32_t word)
{
    const uint8_t *bytes = line->bytes + 3u + 2u * word; /* behind address, function and length */
    return (uint32_t)bytes[0] << 8 | bytes[1];
}

static float float_at(const struct modbus_line *line, uint32_t word)
{
    union core_float_bits number = {.bits = word_at(line, word) << 16 | word_at(line, word + 1u)};
    return number.value;
}

static void keep_spectrum(struct modbus_door *self)
{
    const struct modbus_line *line = &self->to_master;
    uint32_t count = word_at(line, 5);
    self->read_count = word_at(line, 6) << 16 | word_at(line, 7);
    for (uint32_t i = 0; i < count && self->bins_read < results_bins_max; ++i, ++self->bins_read) {
        struct modbus_record *record = &self->readings[self->bins_read];
        uint32_t at = modbus_spectrum_head_words + i * modbus_mean_words;
        float *values[] = {&record->input[0],      &record->input[1],       &record->output[0],
                           &record->output[1],     &record->input_variance, &record->output_variance,
                           &record->covariance[0], &record->covariance[1]};
        for (uint32_t v = 0; v < sizeof values / sizeof *values; ++v) {
            *values[v] = float_at(line, at + 2u * v);
        }
    }
}

enum { step_setup, step_open, step_upload, step_verify, step_arm, step_start, step_run, step_read, step_end };

/* Takes the reply, if there is one; what it answers decides what comes next. */
static bool take_reply(struct modbus_door *self, uint32_t table_bytes)
{
    if (self->to_master.size == 0) {
        return false;
    }
    bool is_exception = (self->to_master.bytes[1] & 0x80u) != 0;
    bool is_result = self->step != step_setup && self->step != step_upload && self->step != step_read;
    if (is_exception || (is_result && self->step != step_run && word_at(&self->to_master, 2) != modbus_result_ok)) {
        ++self->refused;
        self->step = step_end;
    } else if (self->step == step_upload) {
        self->step += self->offset >= table_bytes;
    } else if (self->step == step_run) {
        uint32_t state = word_at(&self->to_master, 0);
        self->step += state == modbus_state_done || state == modbus_state_fault;
    } else if (self->step == step_read) {
        keep_spectrum(self);
        self->step += word_at(&self->to_master, 5) == 0 || self->bins_read >= self->map.latched.bins;
    } else {
        ++self->step;
    }
    self->to_master.size = 0;
    self->waiting = false;
    return true;
}

bool modbus_door_measure(struct modbus_door *self, const uint8_t *table, uint32_t table_bytes, uint64_t now_us)
{
    const uint64_t poll_period_us = 20000;
    if (self->waiting && !take_reply(self, table_bytes)) {
        return false;
    }
    if (self->step == step_end) {
        return true;
    }
    switch (self->step) {
    case step_setup:
        ask_setup(self, table, table_bytes);
        break;
    case step_open:
        ask_command(self, modbus_command_open_upload);
        break;
    case step_upload:
        ask_chunk(self, table, table_bytes);
        break;
    case step_verify:
        ask_command(self, modbus_command_verify);
        break;
    case step_arm:
        ask_command(self, modbus_command_arm);
        break;
    case step_start:
        ask_command(self, modbus_command_start);
        break;
    case step_run:
        if (now_us - self->asked_us < poll_period_us) {
            return false;
        }
        begin_request(self, modbus_fields[modbus_field_state].address, 3, modbus_fields[modbus_field_nonce].address, 1);
        put_word(&self->to_slave, self->requests & 0xFFFFu);
        break;
    default:
        ask_spectrum(self);
        break;
    }
    end_request(self, now_us);
    return false;
}
