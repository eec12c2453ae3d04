/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/modbus_measuring.h"

#include "core/bytes.h"
#include "drivers/modbus/host.h"
#include "ports/modbus_host.h"
#include "ports/place.h"
#include "ports/wall_clock.h"
#include "tools/servoscope/interrupt.h"
#include "tools/servoscope/modbus_response.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const char tcp_prefix[] = "modbus-tcp:", rtu_prefix[] = "modbus-rtu:";
/// The drive stops by itself when nothing was written for that long; a state is read ten times as often.
enum { host_timeout_ms = 5000, poll_ms = 100 };
/// Room above the table's own torque where nobody has set a limit, as in a streamed measurement.
static const double default_torque_margin = 3.0;
/// What a run may take beyond its samples before it is given up.
static const double patience_s = 30.0;

struct job {
    const struct measuring_request *request;
    struct measuring *measuring;
    struct modbus_port *port;
    struct modbus_link link;
    struct modbus_host host;
    struct modbus_host_state state;
    struct modbus_response response;
    struct modbus_record *records;
    uint32_t next_period; ///< not yet asked for
    bool interrupted;
    struct terminal_line line;
};

bool modbus_measuring_is(const char *url)
{
    return strncmp(url, tcp_prefix, sizeof tcp_prefix - 1) == 0 || strncmp(url, rtu_prefix, sizeof rtu_prefix - 1) == 0;
}

// ---- Connection

/// Takes "?slave=N" off the end of a place.
static int split_slave(const char *url, char *out_place, size_t size, uint8_t *out_slave, struct error *out_error)
{
    static const char key[] = "?slave=";
    const char *place = strchr(url, ':') + 1;
    const char *query = strchr(place, '?');
    size_t length = query ? (size_t)(query - place) : strlen(place);
    *out_slave = 1;
    if (length >= size) {
        return error_set(out_error, error_usage, "--drive: '%s' is too long", url);
    }
    memcpy(out_place, place, length);
    out_place[length] = '\0';
    if (!query) {
        return 0;
    }
    double number = 0.0;
    if (strncmp(query, key, sizeof key - 1) != 0 ||
        options_parse_number("--drive", query + sizeof key - 1, &number, out_error) ||
        !(number >= 1.0 && number <= 247.0) || number != floor(number)) {
        return error_set(out_error, error_usage, "--drive: '%s': expected ?slave=N, N 1..247", url);
    }
    *out_slave = (uint8_t)number;
    return 0;
}

static int refuse(const struct job *self, enum modbus_host_status status, struct error *out_error)
{
    const char *detail = self->host.detail[0] ? self->host.detail : modbus_host_status_str(status);
    return error_set(out_error, error_refused, "--drive: %s", detail);
}

static int connect_drive(struct job *self, const char *url, struct error *out_error)
{
    char place[128], text[200];
    struct modbus_port_options options = {0};
    int status = split_slave(url, place, sizeof place, &options.slave, out_error);
    if (status) {
        return status;
    }
    bool tcp = strncmp(url, tcp_prefix, sizeof tcp_prefix - 1) == 0;
    self->port = tcp ? modbus_port_open_tcp(place, &options, text, sizeof text)
                     : modbus_port_open_rtu(place, &options, text, sizeof text);
    if (!self->port) {
        char name[sizeof place];
        long number;
        const bool formed = place_split(place, name, sizeof name, &number);
        return error_set(out_error, formed ? error_refused : error_usage, "--drive: %s", text);
    }
    self->link = modbus_port_link(self->port);
    enum modbus_host_status opened =
        modbus_host_open(&self->host, &self->link, (uint16_t)((unsigned)getpid() * 31u + (unsigned)wall_clock_now_s()));
    if (opened != modbus_host_ok) {
        return refuse(self, opened, out_error);
    }
    bool linear = self->measuring->linear;
    if (linear != self->host.identity.linear) {
        return error_set(out_error, error_refused, "%s is of a %s axis, the drive at %s of a %s one: expected one kind",
                         self->request->table, linear ? "linear" : "rotary", url, linear ? "rotary" : "linear");
    }
    return 0;
}

// ---- Setup

static double peak_torque(const struct msgen_table *table)
{
    union core_float_bits scale = {.bits = table->scale_bits[msgen_channel_torque]};
    double peak = 0.0;
    for (uint32_t n = 0; n < table->period_samples; n++) {
        union core_float_bits sample = {.bits = 0};
        double value;
        if (table->format == msgen_format_f32) {
            sample.bits = msgen_table_float_bits(table, n, msgen_channel_torque);
            value = (double)sample.value;
        } else {
            value = (double)msgen_table_count(table, n, msgen_channel_torque);
        }
        peak = fmax(peak, fabs(value * (double)scale.value));
    }
    return peak;
}

static double rate_hz(const struct msgen_table *table)
{
    return (double)table->rate_num_hz / (double)table->rate_den;
}

static struct modbus_host_setup make_setup(const struct job *self)
{
    const struct measure_plan *plan = &self->measuring->plan;
    const struct guard_real_limits *limits = &plan->limits;
    const struct msgen_table *table = plan->table;
    uint32_t ramp = measure_ramp_samples(table, plan->mode);
    uint32_t fade = plan->fade_samples ? plan->fade_samples : ramp;
    bool limited = limits->torque_max_Nm < CORE_REAL_MAX;
    bool travel = limits->position_max_rad < CORE_REAL_MAX;
    struct modbus_host_setup setup = {
        .table_bytes = msgen_table_header_bytes(table) + msgen_table_data_bytes(table),
        .table_name = table->header_crc32,
        .run = {.mode = plan->mode == drive_mode_cascade ? 0 : 1,
                .input = modbus_channel_torque,
                .output = modbus_channel_velocity,
                .approach = plan->without_fade_in,
                .settle_periods = plan->settle_periods,
                .measure_periods = plan->periods,
                .fade_samples = fade,
                .abort_samples = ramp,
                .dwell_samples = (uint32_t)ceil(measure_dwell_s * rate_hz(table)),
                .host_timeout_ms = host_timeout_ms,
                .torque_limit = (float)(limited ? limits->torque_max_Nm : default_torque_margin * peak_torque(table)),
                .velocity_limit =
                    limits->velocity_max_rad_per_s < CORE_REAL_MAX ? (float)limits->velocity_max_rad_per_s : 0.0f,
                .position_min = travel ? (float)limits->position_min_rad : 0.0f,
                .position_max = travel ? (float)limits->position_max_rad : 0.0f},
    };
    return setup;
}

/// False once the user wants no more: a table takes minutes at 9600 bit/s.
static bool show_upload(void *context, size_t done, size_t total)
{
    struct job *self = context;
    terminal_line_show(&self->line, (double)done / (double)total, "upload, %.1f KiB a second",
                       (double)done / 1024.0 / terminal_line_elapsed_s(&self->line));
    return !*interrupt_flag();
}

static int check_room(const struct job *self, struct error *out_error)
{
    const struct modbus_host_identity *drive = &self->host.identity;
    const struct msgen_table *table = self->measuring->plan.table;
    if (table->period_samples > drive->samples_max || table->bin_count > drive->bins_max) {
        return error_set(out_error, error_refused,
                         "%s has %u samples and %u lines: the drive holds %u samples and %u lines",
                         self->request->table, (unsigned)table->period_samples, (unsigned)table->bin_count,
                         (unsigned)drive->samples_max, (unsigned)drive->bins_max);
    }
    return 0;
}

static int set_up(struct job *self, struct error *out_error)
{
    int status = check_room(self, out_error);
    if (status) {
        return status;
    }
    enum modbus_host_status got = modbus_host_read_state(&self->host, &self->state);
    if (got == modbus_host_ok && self->state.state == modbus_state_fault) {
        got = modbus_host_command(&self->host, modbus_command_reset_fault);
    }
    const struct modbus_host_setup setup = make_setup(self);
    got = got == modbus_host_ok
              ? modbus_host_upload(&self->host, self->measuring->table.bytes, &setup, show_upload, self)
              : got;
    if (*interrupt_flag()) { // nothing begins to move after that
        terminal_line_clear(&self->line);
        return error_set(out_error, error_refused, "stopped early: interrupted by the user before anything was played");
    }
    got = got == modbus_host_ok ? modbus_host_command(&self->host, modbus_command_arm) : got;
    if (*interrupt_flag()) {
        modbus_host_command(&self->host, modbus_command_stop);
        return error_set(out_error, error_refused, "stopped early: interrupted by the user before anything was played");
    }
    got = got == modbus_host_ok ? modbus_host_command(&self->host, modbus_command_start) : got;
    return got == modbus_host_ok ? 0 : refuse(self, got, out_error);
}

// ---- Run

static bool is_over(enum modbus_state state)
{
    return state == modbus_state_done || state == modbus_state_fault;
}

/// Reads every period that has ended since the last time.
static enum modbus_host_status read_periods(struct job *self)
{
    uint32_t bins = self->measuring->plan.table->bin_count;
    uint32_t kept = self->host.identity.periods_kept, done = self->state.periods_done;
    if (done - self->next_period > kept) {
        self->response.unread += done - kept - self->next_period;
        self->next_period = done - kept;
    }
    while (self->next_period < self->state.periods_done) {
        struct modbus_host_spectrum seen;
        enum modbus_host_status got =
            modbus_host_read_spectrum(&self->host, self->next_period, bins, self->records, &seen);
        if (got != modbus_host_ok) {
            return got;
        }
        if (seen.validity == modbus_spectrum_valid) {
            modbus_response_add(&self->response, self->records);
        } else if (seen.validity == modbus_spectrum_not_kept) {
            self->response.unread++;
        } else {
            self->response.left_out++;
        }
        self->next_period++;
    }
    return modbus_host_ok;
}

static void show_run(struct job *self, double share)
{
    terminal_line_show(&self->line, share, "%s, period %u", modbus_state_str(self->state.state),
                       (unsigned)self->state.periods_done);
}

/// Until the drive says that it is done. Reading slower than it measures is allowed: then the means tell.
static int follow(struct job *self, struct error *out_error)
{
    const struct measure_plan *plan = &self->measuring->plan;
    double samples = ((double)plan->settle_periods + plan->periods) * plan->table->period_samples +
                     2.0 * measure_ramp_samples(plan->table, plan->mode) + 2.0 * plan->fade_samples;
    double longest_s = 1.5 * (samples / rate_hz(plan->table) + measure_dwell_s) + patience_s;
    double started_s = wall_clock_now_s();
    self->line.started_s = started_s; // the upload's pace says nothing of the run's
    do {
        enum modbus_host_status got = modbus_host_read_state(&self->host, &self->state);
        if (got == modbus_host_ok && *interrupt_flag() && !self->interrupted) {
            self->interrupted = true;
            got = modbus_host_command(&self->host, modbus_command_stop);
        }
        got = got == modbus_host_ok ? read_periods(self) : got;
        if (got != modbus_host_ok) {
            return refuse(self, got, out_error);
        }
        show_run(self, fmin(1.0, self->state.samples_played / samples));
        if (!is_over(self->state.state)) {
            self->link.wait(self->link.self, poll_ms);
        }
    } while (!is_over(self->state.state) && wall_clock_now_s() - started_s < longest_s);
    if (!is_over(self->state.state)) {
        return error_set(out_error, error_refused, "--drive: after %.0f s the drive is still %s", longest_s,
                         modbus_state_str(self->state.state));
    }
    return 0;
}

static int read_means(struct job *self, struct error *out_error)
{
    struct modbus_host_spectrum seen;
    enum modbus_host_status got = modbus_host_read_spectrum(
        &self->host, MODBUS_MEAN, self->measuring->plan.table->bin_count, self->records, &seen);
    if (got != modbus_host_ok) {
        return refuse(self, got, out_error);
    }
    if (seen.validity == modbus_spectrum_valid) {
        modbus_response_set_means(&self->response, self->records, seen.count);
    }
    return 0;
}

/// Why a run did not get to its end, as an error; 0 if it did.
static int check_end(const struct job *self, struct error *out_error)
{
    const struct modbus_host_state *state = &self->state;
    if (state->end == modbus_end_complete) {
        return 0;
    }
    if (state->end == modbus_end_fault) {
        return error_set(out_error, error_refused, "stopped early: %s (%.6g)", modbus_fault_str(state->faults),
                         (double)state->trip_value);
    }
    return error_set(out_error, error_refused, "stopped early: %s",
                     self->interrupted ? "interrupted by the user" : "stopped by another command");
}

/// Follows the run to its end and reads the means. A drive that is still moving when this fails is told to stop; if it
/// does not hear that, it finds out by itself host_timeout_ms later.
static int play(struct job *self, struct error *out_error)
{
    int status = follow(self, out_error);
    if (status && !is_over(self->state.state)) {
        modbus_host_command(&self->host, modbus_command_stop);
    }
    status = status ? status : read_means(self, out_error);
    terminal_line_clear(&self->line);
    return status ? status : check_end(self, out_error);
}

/// Writes what was read, of a run that ended early or whose connection was lost too: `early` says why.
static int keep(struct job *self, const char *url, const struct error *early, const struct command_context *context,
                struct error *out_error)
{
    const struct modbus_response_facts facts = {
        .out = self->request->out,
        .drive = url,
        .stopped_by = early->status ? early->message : NULL,
        .torque_clipped = self->state.torque_clipped,
        .requests = self->host.count.requests,
        .repeated = self->host.count.repeated,
        .stale = self->host.count.stale,
    };
    if (early->status && self->response.periods < 2) {
        return error_set(out_error, early->status, "%s", early->message);
    }
    int status = modbus_response_write(&self->response, &facts, context, out_error);
    return status          ? status
           : early->status ? error_set(out_error, early->status, "%s; the response of %zu periods until then is kept",
                                       early->message, self->response.periods)
                           : 0;
}

static int measure(struct job *self, const char *url, const struct command_context *context, struct error *out_error)
{
    int status = connect_drive(self, url, out_error);
    if (status) {
        return status;
    }
    self->records = calloc(self->measuring->plan.table->bin_count, sizeof *self->records);
    if (!self->records || !modbus_response_begin(&self->response, &self->measuring->plan)) {
        return error_set(out_error, error_refused, "memory is short");
    }
    status = set_up(self, out_error);
    if (status) {
        return status;
    }
    struct error early = {0, ""};
    play(self, &early);
    return keep(self, url, &early, context, out_error);
}

int modbus_measuring_run(const struct measuring_request *request, const char *url,
                         const struct command_context *context, struct error *out_error)
{
    struct measuring measuring;
    int status = measuring_prepare(request, &measuring, out_error);
    if (status) {
        return status;
    }
    struct job self = {.request = request, .measuring = &measuring};
    struct interrupt signals;
    terminal_line_start(&self.line, context);
    interrupt_catch(&signals, false);
    if (measuring.sequence.segment_count > 0) {
        status = error_set(out_error, error_usage, "--table: %s is a sequence: over Modbus expected one table",
                           request->table);
    } else if (request->periods < 2) {
        status = error_set(out_error, error_usage,
                           "--periods: %lld: a response needs the scatter of at least 2 periods", request->periods);
    } else {
        status = measure(&self, url, context, out_error);
    }
    interrupt_release(&signals);
    modbus_response_free(&self.response);
    modbus_port_close(self.port);
    free(self.records);
    measuring_free(&measuring);
    return status;
}
