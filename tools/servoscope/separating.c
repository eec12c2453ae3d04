/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/separating.h"

#include "lab/design/sequence.h"
#include "lab/experiment/separation.h"
#include "lab/measure/measure.h"
#include "lab/record/json_out.h"
#include "lab/record/model_file.h"
#include "sim/node/direct_drive.h"
#include "tools/servoscope/designing.h"
#include "tools/servoscope/interrupt.h"
#include "tools/servoscope/outputs.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586;

/// Rates that differ by less than this share are the same fraction, written differently.
static const double same_rate = 1e-9;

/// Tables of the excitation: PREFIX alone, or PREFIX-1 and PREFIX-2.
enum { endings_count = 3, outputs_count = endings_count * (1 + variant_tables_max) };

struct progress {
    struct terminal_line line;
};

static int check_options(const struct design_options *options, struct error *out_error)
{
    if (!options->separate)
        return error_set(out_error, error_usage, "--model: '%s' is for --separate CAUSE,CAUSE", options->model);
    if (!options->model)
        return error_set(out_error, error_usage,
                         "--model is missing: --separate simulates the drive, expected what diagnose was given or the "
                         "model it wrote");
    const char *refused = options->predict                 ? "predict"
                          : options->report                ? "report"
                          : options->dft_header            ? "dft-header"
                          : options->minimum_effective > 0 ? "minimum-effective"
                          : options->inputs > 1            ? "inputs"
                                                           : NULL;
    if (!refused && design_sequence_is(options->lines))
        return error_set(out_error, error_usage, "--lines: '%s' is a sequence, expected one multisine for --separate",
                         options->lines);
    return refused ? error_set(out_error, error_usage, "--%s is for a single table, not for --separate", refused) : 0;
}

int separating_prepare(const struct design_options *options, const struct design_request *request,
                       struct separating *out_self, struct error *out_error)
{
    *out_self = (struct separating){.options = options, .request = request};
    int status = check_options(options, out_error);
    status = status ? status : separation_parse(options->separate, out_self->effects, out_error);
    status = status ? status : model_file_read(options->model, &out_self->model, out_error);
    if (status)
        return status;
    double rate_hz = (double)request->rate_num_hz / request->rate_den;
    if (out_self->model.linear != request->linear)
        return error_set(out_error, error_refused, "--model: %s is of a %s axis, the limits are of a %s one",
                         options->model, out_self->model.linear ? "linear" : "rotary",
                         request->linear ? "linear" : "rotary");
    if (!(fabs(out_self->model.sample_rate_hz - rate_hz) <= same_rate * rate_hz))
        return error_set(out_error, error_refused, "--model: %s has sample_rate_hz %.9g, expected --rate's %.9g Hz",
                         options->model, out_self->model.sample_rate_hz, rate_hz);
    return 0;
}

/// Prefix of one table of an excitation.
static void name_table(const struct separating *self, size_t tables, size_t table, char *out_name, size_t size)
{
    if (tables == 1)
        snprintf(out_name, size, "%s", self->options->out);
    else
        snprintf(out_name, size, "%s-%zu", self->options->out, table + 1);
}

/// All names that may be written, before anything is searched for.
static int check_outputs(const struct separating *self, struct error *out_error)
{
    static const char list[] = "list:";
    static const char *const endings[endings_count] = {".mst", ".csv", ".h"};
    const char *lines = self->options->lines;
    const char *inputs[] = {self->options->model, strncmp(lines, list, sizeof list - 1) == 0 ? lines + 5 : NULL};
    const char *outputs[outputs_count] = {NULL};
    const size_t size = strlen(self->options->out) + sizeof "-1.mst";
    char *names = calloc(outputs_count, size), *prefix = malloc(size);
    if (!names || !prefix) {
        free(names);
        free(prefix);
        return error_set(out_error, error_refused, "memory is short");
    }
    for (size_t i = 0; i < outputs_count; i++) {
        size_t table = i / endings_count;
        name_table(self, table == 0 ? 1 : variant_tables_max, table == 0 ? 0 : table - 1, prefix, size);
        snprintf(names + i * size, size, "%s%s", prefix, endings[i % endings_count]);
        outputs[i] = names + i * size;
    }
    int status = outputs_check(inputs, 2, outputs, outputs_count, out_error);
    free(names);
    free(prefix);
    return status;
}

/// What `servoscope measure` would record of a table on a drive that is this model.
static int measure(void *user, const struct sim_model *drive, const struct variant *excitation, size_t number,
                   struct run *out_run, struct error *out_error)
{
    const struct variant_table *played = &excitation->tables[number];
    struct table table = {0};
    struct msgen_table view;
    uint8_t *bytes = NULL;
    size_t size = 0;
    (void)user;
    memset(out_run, 0, sizeof *out_run);
    int status = designing_table(&played->request, &played->result, &table, out_error);
    status = status ? status : table_file_encode("the table", &table, &bytes, &size, out_error);
    table_free(&table);
    if (!status && msgen_table_open(bytes, size, &view) != core_ok)
        status = error_set(out_error, error_refused, "the table that was just made cannot be opened");
    if (!status) {
        const struct measure_plan plan = {
            .table = &view,
            .mode = played->request.torque_mode ? drive_mode_torque : drive_mode_cascade,
            .settle_periods = (uint32_t)excitation->settle_periods,
            .periods = (uint32_t)excitation->periods,
            .limits = GUARD_REAL_LIMITS_NONE,
            .stop_requested = interrupt_flag(),
        };
        struct direct_drive simulated;
        struct measure_report report;
        struct drive door = direct_drive_init(&simulated, drive);
        status = measure_run(&door, &plan, out_run, &report, out_error);
        door.operations->close(door.self);
        if (status)
            run_free(out_run);
    }
    free(bytes);
    return status;
}

static bool show_progress(void *user, const char *what, size_t done, size_t total)
{
    struct progress *progress = user;
    terminal_line_show(&progress->line, (double)done / (double)total, "%zu of %zu: %s", done + 1, total, what);
    return !*interrupt_flag();
}

static int write_tables(const struct separating *self, const struct variant *excitation, struct error *out_error)
{
    const size_t size = strlen(self->options->out) + sizeof "-1";
    char *name = malloc(size);
    int status = name ? 0 : error_set(out_error, error_refused, "memory is short for the file names");
    for (size_t i = 0; !status && i < excitation->table_count; i++) {
        name_table(self, excitation->table_count, i, name, size);
        status = designing_write(name, &excitation->tables[i].request, &excitation->tables[i].result, out_error);
    }
    free(name);
    return status;
}

/// The command that measures one table; the drive's address is the reader's to fill in.
static void say_measure(const struct separating *self, const struct variant *excitation, size_t table, char *out_text,
                        size_t size)
{
    char number[8] = "";
    if (excitation->table_count > 1)
        snprintf(number, sizeof number, "-%zu", table + 1);
    snprintf(out_text, size,
             "servoscope measure --drive URL --table %s%s.mst%s --periods %zu --settle %zu --out %s%s-run.csv",
             self->options->out, number, self->request->torque_mode ? " --mode torque" : "", excitation->periods,
             excitation->settle_periods, self->options->out, number);
}

static void say_diagnose(const struct separating *self, const struct variant *excitation, char *out_text, size_t size)
{
    const char *out = self->options->out;
    if (excitation->table_count > 1)
        snprintf(out_text, size, "servoscope diagnose %s-1-run.csv %s-2-run.csv --model NOMINAL.json", out, out);
    else
        snprintf(out_text, size, "servoscope diagnose %s-run.csv --model NOMINAL.json", out);
}

static cJSON *json_of_cause(const struct separation *separation, size_t index)
{
    static const char *const sources[] = {
        [separation_of_model] = "model", [separation_of_scan] = "scan", [separation_of_rival] = "imitation"};
    const struct separation_cause *cause = &separation->causes[index];
    const struct sim_effect *e = sim_effects[cause->effect];
    cJSON *object = cJSON_CreateObject();
    cJSON_AddStringToObject(object, "id", e->id);
    cJSON *parameters = cJSON_AddObjectToObject(object, "parameters");
    for (size_t i = 0; i < e->parameter_count; i++)
        cJSON_AddNumberToObject(parameters,
                                separation->given.linear ? e->parameters[i].linear_name : e->parameters[i].name,
                                cause->values[i]);
    cJSON_AddStringToObject(object, "size_from", sources[cause->source]);
    return object;
}

static cJSON *json_of_candidate(const struct separation_candidate *c)
{
    cJSON *object = cJSON_CreateObject();
    cJSON_AddStringToObject(object, "excitation", variant_kind_str(c->excitation.kind));
    cJSON_AddItemToObject(object, "nats", c->measured ? cJSON_CreateNumber(c->nats) : cJSON_CreateNull());
    cJSON_AddItemToObject(object, "test_time_s",
                          c->excitation.table_count > 0 ? cJSON_CreateNumber(c->excitation.test_time_s)
                                                        : cJSON_CreateNull());
    cJSON_AddItemToObject(object, "evidence",
                          c->measured ? cJSON_CreateDoubleArray(c->evidence, 2) : cJSON_CreateNull());
    if (c->measured)
        cJSON_AddStringToObject(object, "says", c->excitation.says);
    else
        cJSON_AddStringToObject(object, "why_not", c->excitation.why_not);
    return object;
}

static void add_commands(const struct separating *self, const struct separation *separation, cJSON *object)
{
    char text[1024];
    cJSON *list = cJSON_AddArrayToObject(object, "commands");
    if (separation->chosen < 0)
        return;
    const struct variant *excitation = &separation->candidates[separation->chosen].excitation;
    for (size_t i = 0; i < excitation->table_count; i++) {
        say_measure(self, excitation, i, text, sizeof text);
        cJSON_AddItemToArray(list, cJSON_CreateString(text));
    }
    say_diagnose(self, excitation, text, sizeof text);
    cJSON_AddItemToArray(list, cJSON_CreateString(text));
}

static cJSON *to_json(const struct separating *self, const struct separation *separation)
{
    cJSON *object = cJSON_CreateObject();
    cJSON *causes = cJSON_AddArrayToObject(object, "causes");
    for (size_t i = 0; i < 2; i++)
        cJSON_AddItemToArray(causes, json_of_cause(separation, i));
    cJSON *list = cJSON_AddArrayToObject(object, "separation");
    for (size_t i = 0; i < variant_kinds; i++)
        cJSON_AddItemToArray(list, json_of_candidate(&separation->candidates[i]));
    cJSON_AddNumberToObject(object, "enough_nats", self->options->nats);
    cJSON_AddBoolToObject(object, "enough", separation->enough);
    if (separation->chosen >= 0)
        cJSON_AddStringToObject(object, "chosen",
                                variant_kind_str(separation->candidates[separation->chosen].excitation.kind));
    else
        cJSON_AddNullToObject(object, "chosen");
    cJSON_AddItemToObject(object, "checked_nats",
                          cJSON_CreateDoubleArray(separation->checked_nats, (int)separation->checked));
    if (separation->chosen < 0)
        cJSON_AddStringToObject(object, "reason", separation->reason);
    add_commands(self, separation, object);
    return object;
}

static void print_candidates(const struct separation *separation)
{
    printf("\n  %-16s %8s %9s  %s\n", "excitation", "nats", "takes", "what is played");
    for (size_t i = 0; i < variant_kinds; i++) {
        const struct separation_candidate *c = &separation->candidates[i];
        const char *name = variant_kind_str(c->excitation.kind);
        if (c->measured)
            printf("%c %-16s %8.1f %7.4g s  %s\n", (int)i == separation->chosen ? '*' : ' ', name, c->nats,
                   c->excitation.test_time_s, c->excitation.says);
        else
            printf("  %-16s %8s %9s  %s\n", name, "-", "-", c->excitation.why_not);
    }
}

static void print_chosen(const struct separating *self, const struct separation *separation)
{
    const struct separation_candidate *c = &separation->candidates[separation->chosen];
    const struct variant *excitation = &c->excitation;
    char text[1024];
    printf("\n%s: %s; expected to separate them by %.1f nats", variant_kind_str(excitation->kind), excitation->says,
           c->nats);
    if (!separation->enough)
        printf(", less than the %.3g asked for, and none does better", self->options->nats);
    printf(".\nSimulated again with fresh noise:");
    for (size_t i = 0; i < separation->checked; i++)
        printf("%s %.1f", i > 0 ? "," : "", separation->checked_nats[i]);
    printf(" nats (a tie is below %.3g).\n", separation_tie_nats);
    for (size_t i = 0; i < excitation->table_count; i++) {
        say_measure(self, excitation, i, text, sizeof text);
        printf("  %s\n", text);
    }
    say_diagnose(self, excitation, text, sizeof text);
    printf("  %s\n", text);
}

static void print(const struct separating *self, const struct separation *separation)
{
    char text[512];
    for (size_t i = 0; i < 2; i++) {
        separation_describe_cause(separation, i, text, sizeof text);
        printf("%s\n", text);
    }
    print_candidates(separation);
    if (separation->chosen >= 0)
        print_chosen(self, separation);
    else
        printf("\nNothing separates them: %s. Nothing was written.\n", separation->reason);
}

static int deliver(const struct separating *self, const struct separation *separation, struct error *out_error)
{
    int status = 0;
    if (separation->chosen >= 0)
        status = write_tables(self, &separation->candidates[separation->chosen].excitation, out_error);
    if (!status && self->context->json) {
        cJSON *object = to_json(self, separation);
        status = json_print_stdout(object, out_error);
        cJSON_Delete(object);
    } else if (!status && !self->context->quiet) {
        print(self, separation);
    }
    return status;
}

int separating_run(const struct separating *self, struct error *out_error)
{
    struct progress progress;
    struct separation *separation = calloc(1, sizeof *separation);
    struct design_request quiet = *self->request;
    quiet.progress = NULL;
    const struct separation_request request = {
        .model = &self->model,
        .effects = {self->effects[0], self->effects[1]},
        .basis = {.request = &quiet,
                  .offset = *self->offset,
                  .periods = (size_t)self->options->periods,
                  .settle_time_s = self->options->settle_time_s,
                  .turn = two_pi * (self->request->linear ? self->model.pulley_radius_m : 1.0)},
        .enough_nats = self->options->nats,
        .door = {.measure = measure},
        .progress = show_progress,
        .user = &progress,
    };
    int status = separation ? check_outputs(self, out_error) : error_set(out_error, error_refused, "memory is short");
    terminal_line_start(&progress.line, self->context);
    status = status ? status : separation_run(&request, separation, out_error);
    terminal_line_clear(&progress.line);
    if (!status) {
        status = deliver(self, separation, out_error);
        separation_free(separation);
    }
    free(separation);
    return status;
}
