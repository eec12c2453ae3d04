/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/measuring.h"

#include "lab/record/json_out.h"
#include "lab/record/manifest.h"
#include "ports/wall_clock.h"
#include "tools/servoscope/interrupt.h"
#include "tools/servoscope/measured.h"
#include "tools/servoscope/measured_page.h"
#include "tools/servoscope/measuring_live.h"
#include "tools/servoscope/measuring_sequence.h"
#include "tools/servoscope/outputs.h"

#include <string.h>

void measuring_defaults(struct measuring_request *out_request)
{
    *out_request = (struct measuring_request){.mode = "cascade", .settle = 1};
}

size_t measuring_options(struct measuring_request *request, struct option *out_options)
{
    const struct option options[] = {
        {.name = "table", .kind = option_text, .target = &request->table, .required = true},
        {.name = "out", .kind = option_text, .target = &request->out, .required = true},
        {.name = "report", .kind = option_text, .target = &request->report},
        {.name = "mode", .kind = option_text, .target = &request->mode},
        {.name = "periods",
         .kind = option_integer,
         .target = &request->periods,
         .required = true,
         .lowest = 1,
         .highest = 1e6},
        {.name = "settle",
         .kind = option_integer,
         .target = &request->settle,
         .lowest = 0,
         .highest = 1e6,
         .out_given = &request->settle_given},
        {.name = "fade",
         .kind = option_integer,
         .target = &request->fade_samples,
         .lowest = 0,
         .highest = 1 << 24,
         .out_given = &request->fade_given},
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
    const char *inputs[] = {request->table, request->drive_file}, *outputs[] = {request->out, request->report};
    status = status ? status : outputs_check(inputs, 2, outputs, 2, out_error);
    if (status) {
        return status;
    }
    plan->fade_samples = (uint32_t)request->fade_samples;
    plan->without_fade_in = request->fade_given && request->fade_samples == 0;
    set_limits(request, &plan->limits);
    plan->stop_requested = interrupt_flag();
    if (manifest_is(request->table)) {
        return measuring_sequence_prepare(out_self, out_error);
    }
    status = table_bytes_read(request->table, &out_self->table, out_error);
    if (status) {
        return status;
    }
    out_self->linear = out_self->table.view.linear;
    plan->table = &out_self->table.view;
    plan->periods = (uint32_t)request->periods;
    plan->settle_periods = (uint32_t)request->settle;
    struct error reason;
    status = measure_check(plan, &reason);
    if (status) {
        error_set(out_error, status, "%s: %s", request->table, reason.message);
        measuring_free(out_self);
    }
    return status;
}

static int report_run(const struct measured *measured, const struct command_context *context, struct error *out_error)
{
    if (context->json) {
        cJSON *object = measured_json(measured);
        int status = json_print_stdout(object, out_error);
        cJSON_Delete(object);
        return status;
    }
    if (!context->quiet) {
        measured_print(measured);
    }
    return 0;
}

int measuring_run(struct measuring *self, const struct drive *drive, const char *source,
                  const struct command_context *context, struct error *out_error)
{
    if (self->sequence.segment_count > 0) {
        return measuring_sequence_run(self, drive, source, context, out_error);
    }
    struct measuring_live live;
    struct interrupt signals;
    struct measure_report report;
    struct run run;
    const double started_s = wall_clock_now_s();
    measuring_live_start(&live, context, started_s, NULL, &self->plan);
    interrupt_catch(&signals, false);
    int status = measure_run(drive, &self->plan, &run, &report, out_error);
    double rate_per_s = (double)report.rows / (wall_clock_now_s() - started_s + 1e-9);
    measuring_live_stop(&live);
    if (run.rows > 0) {
        const struct measured measured = {self->request->out, source, &run, &report, rate_per_s, self->door};
        struct error reason = {0, ""};
        int written = measured_keep(&measured, &reason);
        if (!written && self->request->report) {
            written = measured_page_write(self->request->report, &measured, &self->plan, &reason);
        }
        written = written ? written : report_run(&measured, context, &reason);
        if (written) {
            status = error_set(out_error, written, "%s", reason.message);
        }
    }
    interrupt_release(&signals);
    run_free(&run);
    return status;
}

void measuring_free(struct measuring *self)
{
    table_bytes_free(&self->table);
    sequence_file_free(&self->sequence);
}
