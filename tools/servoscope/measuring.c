/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/measuring.h"

#include "lab/record/json_out.h"
#include "tools/servoscope/outputs.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* The only way from a signal handler to the loop. */
static volatile sig_atomic_t stop_requested;

static void request_stop(int signal_number)
{
    (void)signal_number;
    stop_requested = 1;
}

/// While a measurement runs, SIGINT and SIGTERM ask for a ramp down; afterwards they do what they did before.
struct signal_guard {
    struct sigaction interrupt;
    struct sigaction terminate;
};

static void catch_signals(struct signal_guard *out_guard)
{
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_handler = request_stop;
    sigemptyset(&action.sa_mask);
    stop_requested = 0;
    sigaction(SIGINT, &action, &out_guard->interrupt);
    sigaction(SIGTERM, &action, &out_guard->terminate);
}

static void release_signals(const struct signal_guard *guard)
{
    sigaction(SIGINT, &guard->interrupt, NULL);
    sigaction(SIGTERM, &guard->terminate, NULL);
}

struct progress {
    const struct command_context *context;
    double started_s;
    double shown_s;
    double rate_per_s;
};

static double now_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/// One line on the terminal, five times a second, from the second second on.
static void show_progress(void *object, size_t done, size_t total)
{
    struct progress *self = object;
    if (done % 64 != 0 || self->context->quiet || self->context->json || !self->context->terminal) {
        return;
    }
    double now = now_s();
    if (now - self->started_s < 1.0 || now - self->shown_s < 0.2) {
        return;
    }
    double rate = (double)done / (now - self->started_s);
    self->shown_s = now;
    fprintf(stderr, "\r%5.1f %%  %.0f samples/s  %.0f s left   ", 100.0 * (double)done / (double)total, rate,
            (double)(total - done) / rate);
}

static void clear_progress(const struct progress *self)
{
    if (self->shown_s > 0.0) {
        fputs("\r\033[K", stderr);
    }
}

void measuring_defaults(struct measuring_request *out_request)
{
    *out_request = (struct measuring_request){.mode = "cascade", .settle = 1};
}

size_t measuring_options(struct measuring_request *request, struct option *out_options)
{
    const struct option options[] = {
        {.name = "table", .kind = option_text, .target = &request->table, .required = true},
        {.name = "out", .kind = option_text, .target = &request->out, .required = true},
        {.name = "mode", .kind = option_text, .target = &request->mode},
        {.name = "periods",
         .kind = option_integer,
         .target = &request->periods,
         .required = true,
         .lowest = 1,
         .highest = 1e6},
        {.name = "settle", .kind = option_integer, .target = &request->settle, .lowest = 0, .highest = 1e6},
        {.name = "fade", .kind = option_integer, .target = &request->fade_samples, .lowest = 1, .highest = 1 << 24},
        {.name = "limit-position", .kind = option_positive, .target = &request->limit_position_rad},
        {.name = "limit-velocity", .kind = option_positive, .target = &request->limit_velocity_rad_per_s},
        {.name = "limit-torque", .kind = option_positive, .target = &request->limit_torque_Nm},
    };
    memcpy(out_options, options, sizeof options);
    return sizeof options / sizeof options[0];
}

static int read_mode(const char *text, enum drive_mode *out_mode, struct error *out_error)
{
    *out_mode = drive_mode_cascade;
    if (strcmp(text, "cascade") == 0) {
        return 0;
    }
    *out_mode = drive_mode_torque;
    return strcmp(text, "torque") == 0
               ? 0
               : error_set(out_error, error_usage, "--mode: '%s', expected cascade or torque", text);
}

static void set_limits(const struct measuring_request *request, struct guard_real_limits *out_limits)
{
    *out_limits = (struct guard_real_limits)GUARD_REAL_LIMITS_NONE;
    if (request->limit_position_rad > 0.0) {
        out_limits->position_min_rad = -request->limit_position_rad;
        out_limits->position_max_rad = request->limit_position_rad;
    }
    if (request->limit_velocity_rad_per_s > 0.0) {
        out_limits->velocity_max_rad_per_s = request->limit_velocity_rad_per_s;
    }
    if (request->limit_torque_Nm > 0.0) {
        out_limits->torque_max_Nm = request->limit_torque_Nm;
    }
}

int measuring_prepare(const struct measuring_request *request, struct measuring *out_self, struct error *out_error)
{
    *out_self = (struct measuring){.request = request};
    struct measure_plan *plan = &out_self->plan;
    int status = read_mode(request->mode, &plan->mode, out_error);
    const char *inputs[] = {request->table, request->drive_file};
    status = status ? status : outputs_check(inputs, 2, &request->out, 1, out_error);
    status = status ? status : table_bytes_read(request->table, &out_self->table, out_error);
    if (status) {
        return status;
    }
    plan->table = &out_self->table.view;
    plan->periods = (uint32_t)request->periods;
    plan->settle_periods = (uint32_t)request->settle;
    plan->fade_samples = (uint32_t)request->fade_samples;
    set_limits(request, &plan->limits);
    plan->stop_requested = &stop_requested;
    struct error reason;
    status = measure_check(plan, &reason);
    if (status) {
        error_set(out_error, status, "%s: %s", request->table, reason.message);
        measuring_free(out_self);
    }
    return status;
}

static const char *end_name(enum measure_end end)
{
    switch (end) {
    case measure_complete:
        return "complete";
    case measure_interrupted:
        return "interrupted";
    case measure_tripped:
        return "limit";
    case measure_failed:
        break;
    }
    return "drive";
}

static void add_bus(const struct door *door, cJSON *object)
{
    struct door_statistics bus;
    door_read_statistics(door, &bus);
    cJSON *added = cJSON_AddObjectToObject(object, "bus");
    cJSON_AddNumberToObject(added, "bitrate", bus.bitrate);
    cJSON_AddNumberToObject(added, "load", bus.bus_load);
    cJSON_AddNumberToObject(added, "frames", bus.frames);
    cJSON_AddNumberToObject(added, "targets_lost", bus.targets_lost);
    cJSON_AddNumberToObject(added, "setpoints_clipped", bus.setpoints_clipped);
    cJSON_AddNumberToObject(added, "samples_clipped", bus.samples_clipped);
}

static int print_json(const struct measuring *self, const struct run *run, const struct measure_report *report,
                      double rate_per_s, struct error *out_error)
{
    cJSON *object = cJSON_CreateObject();
    cJSON_AddStringToObject(object, "out", self->request->out);
    cJSON_AddStringToObject(object, "ended", end_name(report->end));
    cJSON_AddStringToObject(object, "stopped_by", report->stopped_by);
    cJSON_AddNumberToObject(object, "rows", (double)run->rows);
    cJSON_AddNumberToObject(object, "rows_planned", (double)report->rows_planned);
    cJSON_AddNumberToObject(object, "period_samples", (double)run->period_samples);
    cJSON_AddNumberToObject(object, "periods", (double)run->periods);
    cJSON_AddNumberToObject(object, "settle_periods", (double)run->settle_periods);
    cJSON_AddNumberToObject(object, "sample_rate_hz", run->sample_rate_hz);
    cJSON_AddNumberToObject(object, "samples_lost", (double)report->rows_lost);
    cJSON_AddNumberToObject(object, "samples_late", report->counters.samples_late);
    cJSON_AddNumberToObject(object, "torque_clipped", report->torque_clipped);
    cJSON_AddNumberToObject(object, "samples_per_s", rate_per_s);
    if (self->door) {
        add_bus(self->door, object);
    }
    int status = json_print_stdout(object, out_error);
    cJSON_Delete(object);
    return status;
}

static void print_bus(const struct door *door)
{
    struct door_statistics bus;
    door_read_statistics(door, &bus);
    printf(
        "  bus at %.3g Mbit/s, load %.0f %%, %u frames; %u set-points lost, %u clipped, %u measured values clipped\n",
        1e-6 * bus.bitrate, 100.0 * bus.bus_load, (unsigned)bus.frames, (unsigned)bus.targets_lost,
        (unsigned)bus.setpoints_clipped, (unsigned)bus.samples_clipped);
}

static void print_summary(const char *path, const struct run *run, const struct measure_report *report,
                          double rate_per_s)
{
    printf("%s: %zu settling and %zu counted periods of %zu samples at %.6g Hz, %zu of %zu rows, %zu lost, %u late "
           "(%.3g samples/s)\n",
           path, run->settle_periods, run->periods, run->period_samples, run->sample_rate_hz, run->rows,
           report->rows_planned, report->rows_lost, (unsigned)report->counters.samples_late, rate_per_s);
}

static int keep(const struct measuring *self, struct run *run, const char *source, struct error *out_error)
{
    bool set = run_set_key(run, "drive", source);
    if (set && self->door) {
        struct door_statistics bus;
        char load[32];
        door_read_statistics(self->door, &bus);
        snprintf(load, sizeof load, "%.4g", bus.bus_load);
        set = run_set_key(run, "bus_load", load);
    }
    if (!set) {
        return error_set(out_error, error_refused, "%s: not written: memory is short", self->request->out);
    }
    return run_write(self->request->out, run, out_error);
}

static int report_run(const struct measuring *self, const struct run *run, const struct measure_report *report,
                      const struct progress *progress, struct error *out_error)
{
    if (progress->context->json) {
        return print_json(self, run, report, progress->rate_per_s, out_error);
    }
    if (!progress->context->quiet) {
        print_summary(self->request->out, run, report, progress->rate_per_s);
        if (self->door) {
            print_bus(self->door);
        }
    }
    return 0;
}

int measuring_run(struct measuring *self, const struct drive *drive, const char *source,
                  const struct command_context *context, struct error *out_error)
{
    struct progress progress = {.context = context, .started_s = now_s()};
    struct signal_guard signals;
    struct measure_report report;
    struct run run;
    self->plan.progress = show_progress;
    self->plan.progress_context = &progress;
    catch_signals(&signals);
    int status = measure_run(drive, &self->plan, &run, &report, out_error);
    progress.rate_per_s = (double)report.rows / (now_s() - progress.started_s + 1e-9);
    clear_progress(&progress);
    if (run.rows > 0) {
        struct error reason = {0, ""};
        int written = keep(self, &run, source, &reason);
        written = written ? written : report_run(self, &run, &report, &progress, &reason);
        if (written) {
            status = error_set(out_error, written, "%s", reason.message);
        }
    }
    release_signals(&signals);
    run_free(&run);
    return status;
}

void measuring_free(struct measuring *self)
{
    table_bytes_free(&self->table);
}
