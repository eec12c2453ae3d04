/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/sequences.h"

#include "lab/design/amplitude.h"
#include "lab/design/report_sequence.h"
#include "lab/page/page.h"
#include "lab/record/atomic_file.h"
#include "lab/record/manifest.h"
#include "lab/record/sequence_file.h"
#include "lab/record/table_file.h"
#include "tools/servoscope/designing.h"
#include "tools/servoscope/outputs.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#ifndef SERVOSCOPE_VERSION
#define SERVOSCOPE_VERSION "0.1.0"
#endif

enum { report_tables_max = 64 }; ///< a page of more is too much for a browser

/// A sequence while it is designed.
struct work {
    const struct sequences_request *request;
    struct sequences_summary *summary;
    struct sequence_file manifest;
    double *shape; ///< of all lines of one input, in order; NULL: by the limits
    struct design_report_sequence page;
    bool paged; ///< a page is wanted, and begun
    size_t tables_written;
    size_t tables_done;
    size_t lines_before; ///< of one input, in the segments already done
    char *path;          ///< room for the name of any file of the sequence
    size_t path_size;
};

static int refuse_memory(struct error *out_error)
{
    return error_set(out_error, error_refused, "memory is short for the sequence");
}

/// PREFIX-3.mst, with several inputs PREFIX-3-2.mst; ending "" for the prefix of one table.
static const char *table_path(struct work *self, size_t segment, size_t input, const char *ending)
{
    const char *prefix = self->request->prefix;
    if (self->request->inputs > 1) {
        snprintf(self->path, self->path_size, "%s-%zu-%zu%s", prefix, segment + 1, input + 1, ending);
    } else {
        snprintf(self->path, self->path_size, "%s-%zu%s", prefix, segment + 1, ending);
    }
    return self->path;
}

static const char *manifest_path(struct work *self)
{
    snprintf(self->path, self->path_size, "%s.json", self->request->prefix);
    return self->path;
}

static int check_output(const struct work *self, const char *path, struct error *out_error)
{
    static const char list[] = "list:";
    const char *specification = self->request->specification;
    const char *input = strncmp(specification, list, sizeof list - 1) == 0 ? specification + sizeof list - 1 : NULL;
    const char *outputs[] = {path, self->request->report};
    return outputs_check(&input, 1, outputs, 2, out_error);
}

static int check_outputs(struct work *self, struct error *out_error)
{
    static const char *const endings[] = {".mst", ".csv", ".h"};
    const struct design_sequence *sequence = &self->summary->sequence;
    const size_t tables = sequence->segment_count * sequence->inputs;
    int status = check_output(self, manifest_path(self), out_error);
    if (!status && self->request->report && tables > report_tables_max) {
        status = error_set(out_error, error_usage, "--report: %zu tables are too many for a page, expected at most %d",
                           tables, (int)report_tables_max);
    }
    for (size_t i = 0; i < sequence->segment_count; i++) {
        for (size_t file = 0; !status && file < 3 * sequence->inputs; file++) {
            status = check_output(self, table_path(self, i, file / 3, endings[file % 3]), out_error);
        }
    }
    return status;
}

/// All lines of input 1 in one array, to be freed.
static uint32_t *all_bins(const struct design_sequence *sequence, size_t line_count)
{
    uint32_t *bins = calloc(line_count, sizeof *bins);
    size_t used = 0;
    for (size_t i = 0; bins && i < sequence->segment_count; i++) {
        const struct design_lines *lines = &sequence->segments[i].lines[0];
        memcpy(bins + used, lines->bins, lines->count * sizeof *bins);
        used += lines->count;
    }
    return bins;
}

/// The amplitudes are chosen over all lines together; the other inputs' lines get those of the first's neighbours.
static int choose_shape(struct work *self, struct error *out_error)
{
    const char *amplitude = self->request->amplitude;
    if (!amplitude || strcmp(amplitude, "constraint") == 0) {
        return 0;
    }
    uint32_t *bins = all_bins(&self->summary->sequence, self->summary->line_count);
    if (!bins) {
        return refuse_memory(out_error);
    }
    struct design_request whole = *self->request->design;
    whole.bins = bins;
    whole.bin_count = self->summary->line_count;
    int status = design_amplitude_shape(amplitude, &whole, &self->shape, out_error);
    free(bins);
    return status;
}

static int start(struct work *self, struct error *out_error)
{
    const struct sequences_request *request = self->request;
    const struct design_request *design = request->design;
    struct sequences_summary *summary = self->summary;
    const struct design_line_grid grid = {
        .rate_hz = (double)design->rate_num_hz / design->rate_den,
        .period_samples = design->period_samples,
    };
    self->path_size = strlen(request->prefix) + 64;
    self->path = malloc(self->path_size);
    if (!self->path) {
        return refuse_memory(out_error);
    }
    int status = design_sequence_parse(request->specification, &grid, request->inputs, design->seed, &summary->sequence,
                                       out_error);
    if (status) {
        return status;
    }
    for (size_t i = 0; i < summary->sequence.segment_count; i++) {
        summary->line_count += summary->sequence.segments[i].lines[0].count;
    }
    summary->periods = request->periods;
    summary->settle_s =
        isnan(request->settle_time_s) ? (double)grid.period_samples / grid.rate_hz : request->settle_time_s;
    summary->test_time_s = design_sequence_test_time_s(&summary->sequence, request->periods, summary->settle_s);
    summary->effective_lowest_Nm = INFINITY;
    summary->segments = cJSON_CreateArray();
    status = sequence_file_alloc(&self->manifest, summary->sequence.segment_count, request->inputs, out_error);
    status = status ? status : check_outputs(self, out_error);
    return status ? status : choose_shape(self, out_error);
}

/// Passes the progress of one table on as that of the whole sequence.
static void pass_progress(void *context, double share_done, double effective_Nm)
{
    const struct work *self = context;
    const struct design_sequence *sequence = &self->summary->sequence;
    const double tables = (double)(sequence->segment_count * sequence->inputs);
    const struct design_request *design = self->request->design;
    design->progress(design->progress_context, ((double)self->tables_done + share_done) / tables, effective_Nm);
}

static struct design_request request_of_table(struct work *self, size_t segment, size_t input)
{
    const struct design_sequence *sequence = &self->summary->sequence;
    struct design_request request = *self->request->design;
    request.bins = sequence->segments[segment].lines[input].bins;
    request.bin_count = sequence->segments[segment].lines[input].count;
    request.torque_shape = self->shape ? self->shape + self->lines_before : NULL;
    if (!request.method && sequence->kind != design_sequence_multisine) {
        request.method = "schroeder";
    }
    if (request.progress) {
        request.progress = pass_progress;
        request.progress_context = self;
    }
    return request;
}

/// What --json says of a table.
static cJSON *describe_table(struct work *self, size_t segment, size_t input, const struct design_request *request,
                             const struct design_result *result)
{
    const struct sequences_request *asked = self->request;
    const struct sequences_summary *summary = self->summary;
    const double counted = (double)design_sequence_periods(&summary->sequence, segment, asked->periods);
    const double period_s = (double)summary->sequence.period_samples / summary->sequence.rate_hz;
    cJSON *object = asked->describe ? asked->describe(asked->context, table_path(self, segment, input, ""), request,
                                                      result, counted * period_s + summary->settle_s)
                                    : cJSON_CreateObject();
    cJSON_AddStringToObject(object, "file", table_path(self, segment, input, ".mst"));
    cJSON_AddNumberToObject(object, "input", (double)(input + 1));
    cJSON_AddNumberToObject(object, "periods", counted);
    manifest_add_crc32(object, "table_crc32", self->manifest.segments[segment].tables[input].table_crc32);
    return object;
}

/// What the manifest says of a table, which is read back, so that it says what is there.
static int note_table(struct work *self, size_t segment, size_t input, struct error *out_error)
{
    struct sequence_table *entry = &self->manifest.segments[segment].tables[input];
    struct table written;
    const char *path = table_path(self, segment, input, ".mst");
    int status = table_file_read(path, &written, out_error);
    if (status) {
        return status;
    }
    entry->file = strdup(manifest_name_of(path));
    entry->table_crc32 = written.crc32;
    entry->bin_count = written.bin_count;
    entry->bins = written.bins;
    written.bins = NULL;
    table_free(&written);
    return entry->file ? 0 : refuse_memory(out_error);
}

static void note_figures(struct sequences_summary *summary, const struct design_result *result)
{
    summary->method = result->method;
    summary->table_count++;
    summary->effective_lowest_Nm = fmin(summary->effective_lowest_Nm, result->effective_torque_Nm);
    summary->effective_highest_Nm = fmax(summary->effective_highest_Nm, result->effective_torque_Nm);
    summary->cpu_s += result->cpu_s;
    summary->interrupted = summary->interrupted || result->interrupted;
}

static int design_table(struct work *self, size_t segment, size_t input, struct error *out_error)
{
    const struct sequences_request *asked = self->request;
    const struct design_request request = request_of_table(self, segment, input);
    struct design_result result;
    struct error reason = {0, ""};
    int status = design_run(&request, &result, &reason);
    if (!status) {
        status = asked->judge ? asked->judge(asked->context, &request, &result, &reason) : 0;
        status = status ? status : designing_write(table_path(self, segment, input, ""), &request, &result, &reason);
        self->tables_written += status == 0;
        status = status ? status : note_table(self, segment, input, &reason);
        note_figures(self->summary, &result);
        if (!status) {
            cJSON_AddItemToArray(self->summary->segments, describe_table(self, segment, input, &request, &result));
        }
        if (!status && self->paged) {
            const char *name = manifest_name_of(table_path(self, segment, input, ".mst"));
            status = design_report_sequence_add(&self->page, name, &request, &result) ? 0 : refuse_memory(&reason);
        }
        design_result_free(&result);
    }
    self->tables_done++;
    return status ? error_set(out_error, status, "segment %zu: %s", segment + 1, reason.message) : 0;
}

static int design_tables(struct work *self, struct error *out_error)
{
    const struct design_sequence *sequence = &self->summary->sequence;
    int status = 0;
    for (size_t i = 0; i < sequence->segment_count && !status; i++) {
        self->manifest.segments[i].periods = sequence->segments[i].periods;
        for (size_t p = 0; p < sequence->inputs && !status; p++) {
            status = design_table(self, i, p, out_error);
        }
        self->lines_before += sequence->segments[i].lines[0].count;
    }
    return status;
}

/// Tables without a manifest are of no use, and a later sequence of fewer would lie among them.
static void remove_tables(struct work *self)
{
    static const char *const endings[] = {".mst", ".csv", ".h"};
    const struct design_sequence *sequence = &self->summary->sequence;
    for (size_t i = 0; i < self->tables_written; i++) {
        for (size_t file = 0; file < 3; file++) {
            unlink(table_path(self, i / sequence->inputs, i % sequence->inputs, endings[file]));
        }
    }
}

static int write_manifest(struct work *self, struct error *out_error)
{
    const struct sequences_summary *summary = self->summary;
    struct sequence_file *manifest = &self->manifest;
    manifest->kind = design_sequence_kind_str(summary->sequence.kind);
    manifest->sample_rate_hz = summary->sequence.rate_hz;
    manifest->period_samples = summary->sequence.period_samples;
    manifest->periods = summary->periods;
    manifest->settle_s = summary->settle_s;
    manifest->test_time_s = summary->test_time_s;
    return sequence_file_write(manifest_path(self), manifest, out_error);
}

/// The page is made last, when everything that it sums up is known.
static int write_page(struct work *self, FILE *stream, struct error *out_error)
{
    const struct sequences_summary *summary = self->summary;
    const struct design_sequence *sequence = &summary->sequence;
    char title[192], subtitle[320];
    struct page page;
    snprintf(title, sizeof title, "Excitations %s", manifest_name_of(manifest_path(self)));
    snprintf(subtitle, sizeof subtitle,
             "%s: %zu segments, %zu tables of %zu samples at %.6g Hz, %zu lines, measuring takes %.4g s",
             design_sequence_kind_str(sequence->kind), sequence->segment_count,
             sequence->segment_count * sequence->inputs, sequence->period_samples, sequence->rate_hz,
             summary->line_count, summary->test_time_s);
    page_start(&page, stream, title, subtitle);
    if (!design_report_sequence_write(&self->page, &page)) {
        return refuse_memory(out_error);
    }
    // A write error is kept by the stream, and commit reports it with the path and the reason.
    (void)page_end(&page, "servoscope " SERVOSCOPE_VERSION);
    return 0;
}

static int open_page(struct work *self, struct atomic_file *out_file, FILE **out_stream, struct error *out_error)
{
    if (!self->request->report) {
        return 0;
    }
    *out_stream = atomic_file_open(out_file, self->request->report, out_error);
    if (!*out_stream) {
        return error_refused;
    }
    self->paged = true;
    return design_report_sequence_begin(&self->page) ? 0 : refuse_memory(out_error);
}

static int design_all(struct work *self, struct error *out_error)
{
    struct atomic_file file = {0};
    FILE *stream = NULL;
    int status = open_page(self, &file, &stream, out_error);
    if (!status) {
        // Until all tables are new, a manifest of old ones would name a mixture.
        unlink(manifest_path(self));
        status = design_tables(self, out_error);
        status = status ? status : write_manifest(self, out_error);
        if (status) {
            remove_tables(self);
        }
    }
    if (!status && self->paged) {
        status = write_page(self, stream, out_error);
    }
    design_report_sequence_free(&self->page);
    if (!self->paged) {
        return status;
    }
    if (status) {
        atomic_file_discard(&file);
        return status;
    }
    return atomic_file_commit(&file, out_error);
}

int sequences_design_and_write(const struct sequences_request *request, struct sequences_summary *out_summary,
                               struct error *out_error)
{
    *out_summary = (struct sequences_summary){0};
    struct work work = {.request = request, .summary = out_summary};
    int status = start(&work, out_error);
    status = status ? status : design_all(&work, out_error);
    sequence_file_free(&work.manifest);
    free(work.shape);
    free(work.path);
    return status;
}

cJSON *sequences_json(struct sequences_summary *summary)
{
    cJSON *object = cJSON_CreateObject();
    cJSON_AddStringToObject(object, "kind", design_sequence_kind_str(summary->sequence.kind));
    cJSON_AddStringToObject(object, "method", summary->method);
    cJSON_AddNumberToObject(object, "inputs", (double)summary->sequence.inputs);
    cJSON_AddNumberToObject(object, "lines", (double)summary->line_count);
    cJSON_AddNumberToObject(object, "periods", (double)summary->periods);
    cJSON_AddNumberToObject(object, "settle_time_s", summary->settle_s);
    cJSON_AddNumberToObject(object, "test_time_s", summary->test_time_s);
    cJSON_AddNumberToObject(object, "cpu_s", summary->cpu_s);
    cJSON_AddItemToObject(object, "segments", summary->segments);
    summary->segments = NULL;
    return object;
}

void sequences_print(const struct sequences_request *request, const struct sequences_summary *summary)
{
    const struct design_sequence *sequence = &summary->sequence;
    const bool linear = request->design->linear;
    const double line_hz = sequence->rate_hz / (double)sequence->period_samples;
    const struct design_lines *last = &sequence->segments[sequence->segment_count - 1].lines[0];
    printf("%s by %s: %zu lines, %.6g to %.6g Hz, in %zu segment%s of one period of %zu samples (%.6g s)\n",
           design_sequence_kind_str(sequence->kind), summary->method, summary->line_count,
           sequence->segments[0].lines[0].bins[0] * line_hz, last->bins[last->count - 1] * line_hz,
           sequence->segment_count, sequence->segment_count == 1 ? "" : "s", sequence->period_samples, 1 / line_hz);
    if (sequence->inputs > 1) {
        printf("%zu inputs at once, each on lines of its own\n", sequence->inputs);
    }
    printf("effective %s %.4f to %.4f %s\n", linear ? "force" : "torque", summary->effective_lowest_Nm,
           summary->effective_highest_Nm, linear ? "N" : "Nm");
    printf("measuring takes %.6g s with --periods %llu and %.6g s of settling for each segment\n", summary->test_time_s,
           (unsigned long long)summary->periods, summary->settle_s);
    printf("written: %s.json, which measure and simulate take as --table, and its %zu tables .mst with .csv and .h\n",
           request->prefix, summary->table_count);
}

void sequences_summary_free(struct sequences_summary *summary)
{
    design_sequence_free(&summary->sequence);
    cJSON_Delete(summary->segments);
    *summary = (struct sequences_summary){0};
}
