/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/measuring_sequence.h"

#include "lab/record/json_out.h"
#include "lab/record/manifest.h"
#include "lab/record/run_sequence.h"
#include "ports/wall_clock.h"
#include "tools/servoscope/interrupt.h"
#include "tools/servoscope/measured.h"
#include "tools/servoscope/measured_page.h"
#include "tools/servoscope/measuring_live.h"
#include "tools/servoscope/outputs.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/// More periods than this are a slip of the pen; it keeps every product below within 64 bits.
static const uint64_t periods_max = 1000000000;

static int refuse_memory(const char *path, struct error *out_error)
{
    return error_set(out_error, error_refused, "%s: memory is short", path);
}

/// RUN.csv -> RUN-3.csv, to be freed.
static char *run_path(const char *out, size_t segment)
{
    const char *name = manifest_name_of(out);
    const char *dot = strrchr(name, '.');
    const size_t stem = dot && dot > name ? (size_t)(dot - out) : strlen(out);
    const size_t size = strlen(out) + 24;
    char *path = malloc(size);
    if (path) {
        snprintf(path, size, "%.*s-%zu%s", (int)stem, out, segment + 1, out + stem);
    }
    return path;
}

/// Settling in whole periods: as asked for, else the manifest's time rounded up.
static int plan_periods(const struct measuring *self, size_t segment, struct measure_plan *io_plan,
                        struct error *out_error)
{
    static const double rounding = 1e-9;
    const struct sequence_file *sequence = &self->sequence;
    const double period_s = (double)sequence->period_samples / sequence->sample_rate_hz;
    const double settle =
        self->request->settle_given ? (double)self->request->settle : ceil(sequence->settle_s / period_s - rounding);
    const uint64_t periods = (uint64_t)self->request->periods * sequence->segments[segment].periods;
    if (!(settle <= (double)periods_max) || periods > periods_max) {
        return error_set(out_error, error_usage, "%llu counted and %.9g settling periods: expected at most %llu",
                         (unsigned long long)periods, settle, (unsigned long long)periods_max);
    }
    io_plan->settle_periods = (uint32_t)settle;
    io_plan->periods = (uint32_t)periods;
    return 0;
}

/// Reads a segment's table, checks that it is the manifest's, and makes its plan, whose table is *out_table.
static int load_segment(const struct measuring *self, size_t segment, struct table_bytes *out_table,
                        struct measure_plan *out_plan, struct error *out_error)
{
    const struct sequence_file *sequence = &self->sequence;
    struct error reason = {0, ""};
    char *path = manifest_beside(sequence->path, sequence->segments[segment].tables[0].file);
    int status = path ? table_bytes_read(path, out_table, out_error) : refuse_memory(sequence->path, out_error);
    if (status) {
        free(path);
        return status;
    }
    const struct msgen_table *view = &out_table->view;
    status = sequence_file_check_table(sequence, segment, 0, path, view->header_crc32,
                                       (double)view->rate_num_hz / view->rate_den, view->period_samples, out_error);
    if (!status) {
        *out_plan = self->plan;
        out_plan->table = view;
        status = plan_periods(self, segment, out_plan, &reason);
        status = status ? status : measure_check(out_plan, &reason);
        status = status ? error_set(out_error, status, "%s: %s", path, reason.message) : 0;
    }
    free(path);
    if (status) {
        table_bytes_free(out_table);
    }
    return status;
}

static int check_inputs(const struct sequence_file *sequence, const char *out, struct error *out_error)
{
    if (sequence->inputs == 1) {
        return 0;
    }
    char *first = run_path(manifest_name_of(out), 0);
    char *last = run_path(manifest_name_of(out), sequence->segment_count - 1);
    int status = error_set(
        out_error, error_refused,
        "%s: plays %zu inputs at once, and this drive has one axis: expected a sequence designed "
        "without --inputs. Where a machine plays and records them itself, frf --design %s takes one run for each "
        "segment, %s to %s, with the columns torque_1_Nm to torque_%zu_Nm",
        sequence->path, sequence->inputs, manifest_name_of(sequence->path), first ? first : "the first",
        last ? last : "the last", sequence->inputs);
    free(first);
    free(last);
    return status;
}

/// A run must not take the place of anything that is still to be played.
static int check_outputs(const struct measuring *self, struct error *out_error)
{
    const struct sequence_file *sequence = &self->sequence;
    const struct measuring_request *request = self->request;
    struct stat info;
    if (stat(request->out, &info) == 0 && !S_ISREG(info.st_mode)) {
        return error_set(out_error, error_usage, "--out: '%s' is no ordinary file: a sequence writes several beside it",
                         request->out);
    }
    const size_t input_count = sequence->segment_count + 4;
    const char **inputs = calloc(input_count, sizeof *inputs);
    char **tables = calloc(sequence->segment_count, sizeof *tables);
    int status = inputs && tables ? 0 : refuse_memory(sequence->path, out_error);
    for (size_t i = 0; !status && i < sequence->segment_count; i++) {
        inputs[i] = tables[i] = manifest_beside(sequence->path, sequence->segments[i].tables[0].file);
        status = tables[i] ? 0 : refuse_memory(sequence->path, out_error);
    }
    for (size_t i = 0; !status && i < sequence->segment_count; i++) {
        inputs[input_count - 4] = request->report;
        inputs[input_count - 3] = request->table;
        inputs[input_count - 2] = request->drive_file;
        inputs[input_count - 1] = request->out;
        char *path = run_path(request->out, i);
        const char *output = path;
        status =
            path ? outputs_check(inputs, input_count, &output, 1, out_error) : refuse_memory(request->out, out_error);
        free(path);
    }
    for (size_t i = 0; tables && i < sequence->segment_count; i++) {
        free(tables[i]);
    }
    free(tables);
    free(inputs);
    return status;
}

static int check_segments(struct measuring *self, struct error *out_error)
{
    int status = 0;
    for (size_t i = 0; i < self->sequence.segment_count && !status; i++) {
        struct table_bytes table;
        struct measure_plan plan;
        status = load_segment(self, i, &table, &plan, out_error);
        if (status) {
            return status;
        }
        const bool linear = table.view.linear;
        table_bytes_free(&table);
        if (i > 0 && linear != self->linear) {
            status = error_set(out_error, error_refused, "%s: %s and %s are of different kinds of axis: expected one",
                               self->sequence.path, self->sequence.segments[0].tables[0].file,
                               self->sequence.segments[i].tables[0].file);
        }
        self->linear = linear;
    }
    return status;
}

int measuring_sequence_prepare(struct measuring *self, struct error *out_error)
{
    int status = sequence_file_read(self->request->table, &self->sequence, out_error);
    status = status ? status : check_inputs(&self->sequence, self->request->out, out_error);
    status = status ? status : check_outputs(self, out_error);
    status = status ? status : check_segments(self, out_error);
    if (status) {
        measuring_free(self);
    }
    return status;
}

/// A sequence while it is measured.
struct playing {
    struct measuring *measuring;
    const struct drive *drive;
    const char *source;
    const struct command_context *context;
    double started_s;
    size_t samples_before; ///< played in earlier segments
    size_t samples_planned;
    double position_rad; ///< where the axis stands, from where it stood at first
    struct run_sequence runs;
    struct measure_report report; ///< of the last segment
    size_t rows;
    size_t rows_lost;
    cJSON *said;     ///< array: what --json says of each segment
    struct run keys; ///< the last run's keys, without its columns, for the page
    size_t page_count;
    struct measure_page_segment *page_segments; ///< NULL: no page is wanted
};

/// The guard counts from where the axis stands now, the person from where it stood at first.
static void shift_limits(struct measure_plan *plan, double position_rad)
{
    struct guard_real_limits *limits = &plan->limits;
    if (limits->position_max_rad < CORE_REAL_MAX) {
        limits->position_max_rad -= (core_real)position_rad;
        limits->position_min_rad -= (core_real)position_rad;
    }
}

/// An older manifest of this name would speak of runs that are about to be replaced.
static void forget_older(const struct playing *self)
{
    const char *path = self->measuring->request->out;
    struct stat info;
    if (self->rows == 0 && lstat(path, &info) == 0 && S_ISREG(info.st_mode)) {
        unlink(path);
    }
}

static int keep_segment(struct playing *self, size_t segment, struct run *run, double rate_per_s,
                        struct error *out_error)
{
    struct run_sequence_segment *entry = &self->runs.segments[segment];
    char *path = run_path(self->measuring->request->out, segment);
    char number[48];
    snprintf(number, sizeof number, "%zu of %zu", segment + 1, self->runs.segment_count);
    if (!path || !run_set_key(run, "segment", number)) {
        free(path);
        return refuse_memory(self->measuring->request->out, out_error);
    }
    struct measured measured = {path, self->source, run, &self->report, rate_per_s, self->measuring->door};
    forget_older(self);
    int status = measured_keep(&measured, out_error);
    measured.door = NULL; // the bus counts on from segment to segment: it is said once, at the end
    if (!status) {
        entry->run = strdup(manifest_name_of(path));
        entry->periods = run->periods;
        self->rows += run->rows;
        self->rows_lost += self->report.rows_lost;
        cJSON_AddItemToArray(self->said, measured_json(&measured));
        if (!self->context->json && !self->context->quiet) {
            measured_print(&measured);
        }
        status = entry->run ? 0 : refuse_memory(path, out_error);
    }
    free(path);
    return status;
}

static int refuse_page(const struct playing *self, struct error *out_error)
{
    return refuse_memory(self->measuring->request->report, out_error);
}

/// The bus's keys count on from segment to segment: the last ones are those of the whole.
static bool keep_keys(struct playing *self, const struct run *run)
{
    run_free(&self->keys);
    self->keys.sample_rate_hz = run->sample_rate_hz;
    bool kept = true;
    for (size_t i = 0; i < run->key_count && kept; i++) {
        kept = run_set_key(&self->keys, run->keys[i].key, run->keys[i].value);
    }
    return kept;
}

/// What the page needs of a segment, whose run does not stay in memory.
static int keep_for_page(struct playing *self, size_t segment, const struct run *run, const struct measure_plan *plan,
                         struct error *out_error)
{
    struct measure_summary summary;
    if (!self->page_segments) {
        return 0;
    }
    if (!keep_keys(self, run) ||
        !measure_summary_make(run, plan->table, &plan->limits, self->report.rows_planned, &summary)) {
        return refuse_page(self, out_error);
    }
    struct measure_page_segment *kept = &self->page_segments[self->page_count];
    const bool made = measure_page_segment_make(&summary, &self->report, kept);
    measure_summary_free(&summary);
    if (!made) {
        return refuse_page(self, out_error);
    }
    kept->name = self->runs.segments[segment].run;
    self->page_count++;
    return 0;
}

static int write_page(struct playing *self, const struct error *stopped, struct error *out_error)
{
    const struct measuring_request *request = self->measuring->request;
    const struct measure_page_sequence sequence = {
        .kind = self->runs.kind,
        .planned = self->runs.segment_count,
        .stopped_by = stopped->status ? stopped->message : NULL,
        .keys = &self->keys,
        .count = self->page_count,
        .segments = self->page_segments,
        .linear = self->measuring->linear,
    };
    return measured_page_write_sequence(request->report, request->out, self->source, &sequence, out_error);
}

static int prepare_page(struct playing *self, struct error *out_error)
{
    if (self->measuring->request->report) {
        self->page_segments = calloc(self->runs.segment_count, sizeof *self->page_segments);
        return self->page_segments ? 0 : refuse_page(self, out_error);
    }
    return 0;
}

static void free_page(struct playing *self)
{
    for (size_t i = 0; i < self->page_count; i++) {
        measure_page_segment_free(&self->page_segments[i]);
    }
    free(self->page_segments);
    run_free(&self->keys);
}

static int play_segment(struct playing *self, size_t segment, struct error *out_error)
{
    struct table_bytes table;
    struct measure_plan plan;
    struct run run;
    int status = load_segment(self->measuring, segment, &table, &plan, out_error);
    if (status) {
        return status;
    }
    struct measuring_live live;
    const struct measuring_live_place place = {segment + 1, self->runs.segment_count, self->samples_before,
                                               self->samples_planned};
    shift_limits(&plan, self->position_rad);
    measuring_live_start(&live, self->context, self->started_s, &place, &plan);
    const double begun_s = wall_clock_now_s();
    status = measure_run(self->drive, &plan, &run, &self->report, out_error);
    const double took_s = wall_clock_now_s() - begun_s + 1e-9;
    measuring_live_stop(&live);
    self->position_rad += self->report.end_position_rad;
    self->samples_before += self->report.rows_planned;
    if (run.rows > 0) {
        struct error reason = {0, ""};
        int written = keep_segment(self, segment, &run, (double)self->report.rows / took_s, &reason);
        written = written ? written : keep_for_page(self, segment, &run, &plan, &reason);
        status = written ? error_set(out_error, written, "%s", reason.message) : status;
    }
    run_free(&run);
    table_bytes_free(&table);
    return status;
}

static int play_segments(struct playing *self, struct error *out_error)
{
    int status = 0;
    for (size_t i = 0; i < self->runs.segment_count && !status; i++) {
        struct error reason = {0, ""};
        if (*interrupt_flag()) {
            self->report.end = measure_interrupted;
            snprintf(self->report.stopped_by, sizeof self->report.stopped_by, "interrupted by the user");
            status = error_set(&reason, error_refused, "stopped early: %s", self->report.stopped_by);
        }
        status = status ? status : play_segment(self, i, &reason);
        if (status) {
            error_set(out_error, status, "segment %zu of %zu: %s", i + 1, self->runs.segment_count, reason.message);
        }
    }
    return status;
}

/// What is planned for each segment; also the length of the whole for the progress.
static int plan_runs(struct playing *self, struct error *out_error)
{
    const struct sequence_file *sequence = &self->measuring->sequence;
    int status = run_sequence_alloc(&self->runs, sequence->segment_count, out_error);
    self->runs.kind = sequence->kind;
    for (size_t i = 0; i < sequence->segment_count && !status; i++) {
        struct measure_plan plan = {0};
        struct run_sequence_segment *segment = &self->runs.segments[i];
        status = plan_periods(self->measuring, i, &plan, out_error);
        segment->table = strdup(manifest_name_of(sequence->segments[i].tables[0].file));
        segment->table_crc32 = sequence->segments[i].tables[0].table_crc32;
        segment->periods_planned = plan.periods;
        self->samples_planned += ((size_t)plan.periods + plan.settle_periods) * sequence->period_samples;
        status = status || segment->table ? status : refuse_memory(sequence->path, out_error);
    }
    return status;
}

static int write_manifest(struct playing *self, const struct error *stopped, struct error *out_error)
{
    if (stopped->status) {
        self->runs.stopped_by = strdup(stopped->message);
    }
    return run_sequence_write(self->measuring->request->out, &self->runs, out_error);
}

static int print_json(struct playing *self, struct error *out_error)
{
    cJSON *object = cJSON_CreateObject();
    cJSON_AddStringToObject(object, "out", self->measuring->request->out);
    cJSON_AddStringToObject(object, "kind", self->runs.kind);
    cJSON_AddStringToObject(object, "ended", measured_end_str(self->report.end));
    cJSON_AddStringToObject(object, "stopped_by", self->report.stopped_by);
    cJSON_AddNumberToObject(object, "segments_planned", (double)self->runs.segment_count);
    cJSON_AddNumberToObject(object, "rows", (double)self->rows);
    cJSON_AddNumberToObject(object, "rows_planned", (double)self->samples_planned);
    cJSON_AddNumberToObject(object, "samples_lost", (double)self->rows_lost);
    cJSON_AddNumberToObject(object, "samples_per_s", (double)self->rows / (wall_clock_now_s() - self->started_s));
    if (self->measuring->door) {
        measured_add_bus(self->measuring->door, object);
    }
    cJSON_AddItemToObject(object, "segments", self->said);
    self->said = NULL;
    int status = json_print_stdout(object, out_error);
    cJSON_Delete(object);
    return status;
}

static void print_summary(const struct playing *self)
{
    size_t measured = 0;
    uint64_t fewest = UINT64_MAX;
    for (size_t i = 0; i < self->runs.segment_count; i++) {
        const struct run_sequence_segment *segment = &self->runs.segments[i];
        measured += segment->run && segment->periods == segment->periods_planned;
        fewest = segment->periods_planned < fewest ? segment->periods_planned : fewest;
    }
    printf("%s: %zu of %zu segments of %s complete, %zu of %zu rows, %zu lost\n", self->measuring->request->out,
           measured, self->runs.segment_count, self->runs.kind, self->rows, self->samples_planned, self->rows_lost);
    if (self->measuring->door) {
        measured_print_bus(self->measuring->door);
    }
    if (fewest < 2) {
        puts("  a segment has one counted period: frf needs two for a standard deviation, give --periods 2 or more");
    }
}

/// Writes the manifest and says what there is; nothing if nothing was kept.
static int finish(struct playing *self, int status, struct error *io_error)
{
    struct error reason = {0, ""};
    const struct error stopped = status ? *io_error : reason;
    if (self->rows == 0) {
        return status;
    }
    int written = write_manifest(self, &stopped, &reason);
    if (!written && self->page_segments) {
        written = write_page(self, &stopped, &reason);
    }
    if (!written && self->context->json) {
        written = print_json(self, &reason);
    } else if (!written && !self->context->quiet) {
        print_summary(self);
    }
    return written ? error_set(io_error, written, "%s", reason.message) : status;
}

int measuring_sequence_run(struct measuring *self, const struct drive *drive, const char *source,
                           const struct command_context *context, struct error *out_error)
{
    struct playing playing = {.measuring = self, .drive = drive, .source = source, .context = context};
    struct interrupt signals;
    playing.started_s = wall_clock_now_s();
    playing.said = cJSON_CreateArray();
    int status = plan_runs(&playing, out_error);
    status = status ? status : prepare_page(&playing, out_error);
    interrupt_catch(&signals, false);
    if (!status) {
        struct error reason = {0, ""};
        status = play_segments(&playing, &reason);
        status = finish(&playing, status, &reason);
        status = status ? error_set(out_error, status, "%s", reason.message) : 0;
    }
    interrupt_release(&signals);
    free_page(&playing);
    run_sequence_free(&playing.runs);
    cJSON_Delete(playing.said);
    return status;
}
