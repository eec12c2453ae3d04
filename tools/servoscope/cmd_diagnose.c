/* SPDX-License-Identifier: MIT */
/// servoscope diagnose: what a simulation gets wrong about recordings, named, or "this cannot be explained".
#include "lab/diagnose/diagnosis.h"
#include "lab/diagnose/wording.h"
#include "lab/record/json_out.h"
#include "lab/record/model_file.h"
#include "lab/record/run.h"
#include "tools/servoscope/command.h"
#include "tools/servoscope/interrupt.h"
#include "tools/servoscope/options.h"
#include "tools/servoscope/outputs.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { outputs_max = 3, sentences_max = 12 };

struct arguments {
    struct option_values runs;
    struct option_values validate;
    const char *model;
    const char *json_out;
    const char *report;
    const char *extended;
    const char *map;
    double rate_hz;
};

/// Everything that was read; freed as one.
struct inputs {
    size_t fit_count, count;
    struct run *runs; ///< count of them, those to fit first
    struct sim_model model;
};

static int read_options(int argc, char **argv, struct arguments *out, struct error *out_error)
{
    const struct option options[] = {
        {.name = "validate", .kind = option_list, .target = &out->validate},
        {.name = "model", .kind = option_text, .target = &out->model},
        {.name = "json-out", .kind = option_text, .target = &out->json_out},
        {.name = "report", .kind = option_text, .target = &out->report},
        {.name = "extended", .kind = option_text, .target = &out->extended},
        {.name = "map", .kind = option_text, .target = &out->map},
        {.name = "rate", .kind = option_positive, .target = &out->rate_hz},
    };
    const struct option_operands operands = {"RUN.csv", 1, option_values_max, &out->runs};
    return options_parse(argc, argv, options, sizeof options / sizeof options[0], &operands, out_error);
}

/// Fills in the output files that were asked for, in the order in which they are written.
static size_t list_outputs(const struct arguments *arguments, const char *out_paths[outputs_max])
{
    const char *all[outputs_max] = {arguments->json_out, arguments->extended, arguments->report};
    size_t count = 0;
    for (size_t i = 0; i < outputs_max; i++) {
        if (all[i]) {
            out_paths[count++] = all[i];
        }
    }
    return count;
}

/// No output may take the place of an input or of another output, and every folder has to be there.
static int check_outputs(const struct arguments *arguments, struct error *out_error)
{
    const char *inputs[2 * option_values_max + 1], *outputs[outputs_max];
    size_t count = 0;
    for (size_t i = 0; i < arguments->runs.count; i++) {
        inputs[count++] = arguments->runs.items[i];
    }
    for (size_t i = 0; i < arguments->validate.count; i++) {
        inputs[count++] = arguments->validate.items[i];
    }
    inputs[count++] = arguments->model;
    return outputs_check(inputs, count, outputs, list_outputs(arguments, outputs), out_error);
}

static void free_inputs(struct inputs *self)
{
    for (size_t i = 0; i < self->count && self->runs; i++) {
        run_free(&self->runs[i]);
    }
    free(self->runs);
}

/// What all runs have to share with the first: rate and units. The diagnosis itself says which columns it needs.
static int check_alike(const struct inputs *inputs, const struct arguments *arguments, struct error *out_error)
{
    const struct run *first = &inputs->runs[0];
    const double near = 1e-3; // clocks differ; diagnosis_run() says by how much
    for (size_t i = 1; i < inputs->count; i++) {
        const struct run *run = &inputs->runs[i];
        if (!(fabs(run->sample_rate_hz / first->sample_rate_hz - 1.0) <= near)) {
            return error_set(out_error, error_refused, "%s: sampled at %.9g Hz, expected %.9g Hz as in %s", run->path,
                             run->sample_rate_hz, first->sample_rate_hz, first->path);
        }
        if (run->linear != first->linear) {
            return error_set(out_error, error_refused, "%s: recorded in %s, expected %s as in %s", run->path,
                             run->linear ? "m and N" : "rad and Nm", first->linear ? "m and N" : "rad and Nm",
                             first->path);
        }
    }
    if (arguments->model && inputs->model.linear != first->linear) {
        return error_set(out_error, error_refused, "%s: a model of a %s axis, but %s was recorded in %s",
                         arguments->model, inputs->model.linear ? "linear" : "rotary", first->path,
                         first->linear ? "m and N" : "rad and Nm");
    }
    return 0;
}

/// Reads all files before any work starts. free_inputs() in every case.
static int read_inputs(const struct arguments *arguments, struct inputs *out, struct error *out_error)
{
    const struct run_options options = {.map = arguments->map, .rate_hz = arguments->rate_hz, .guess = true};
    size_t total = arguments->runs.count + arguments->validate.count;
    *out = (struct inputs){.fit_count = arguments->runs.count, .runs = calloc(total, sizeof *out->runs)};
    if (!out->runs) {
        return error_set(out_error, error_refused, "memory is short");
    }
    int status = arguments->model ? model_file_read(arguments->model, &out->model, out_error) : 0;
    for (size_t i = 0; i < total && !status; i++) {
        const char *path =
            i < out->fit_count ? arguments->runs.items[i] : arguments->validate.items[i - out->fit_count];
        status = run_read(path, &options, &out->runs[i], out_error);
        out->count += status == 0;
    }
    return status ? status : check_alike(out, arguments, out_error);
}

// ---- Progress

/// One line on the terminal; false once Ctrl-C was pressed.
static bool show_progress(void *user, const char *what)
{
    struct terminal_line *line = user;
    if (terminal_line_due(line)) {
        fprintf(stderr, "\r\033[K%3.0f s  %.60s", terminal_line_elapsed_s(line), what);
    }
    return !*interrupt_flag();
}

/// Runs the diagnosis; the first Ctrl-C ends the search with the best so far, the second one the program.
static int diagnose(const struct inputs *inputs, const struct arguments *arguments,
                    const struct command_context *context, struct diagnosis *out_diagnosis, struct error *out_error)
{
    struct terminal_line line;
    terminal_line_start(&line, context);
    const struct diagnosis_request request = {
        .fit = inputs->runs,
        .fit_count = inputs->fit_count,
        .validate = inputs->runs + inputs->fit_count,
        .validate_count = inputs->count - inputs->fit_count,
        .model = arguments->model ? &inputs->model : NULL,
        .progress = show_progress,
        .user = &line,
    };
    struct interrupt signals;
    interrupt_catch(&signals, true);
    int status = diagnosis_run(&request, out_diagnosis, out_error);
    interrupt_release(&signals);
    terminal_line_clear(&line);
    return status;
}

// ---- What is said

static void print_heading(const char *heading)
{
    printf("\n%s\n", heading);
}

static void print_causes(const struct diagnosis *self, const char *heading, const struct diagnosis_cause *causes,
                         size_t count)
{
    if (count > 0) {
        print_heading(heading);
    }
    for (size_t i = 0; i < count; i++) {
        char name[wording_short], evidence[wording_short], unseen[wording_size];
        wording_evidence(causes[i].evidence, evidence);
        wording_effect(causes[i].effect, name);
        wording_unseen(self, &causes[i], unseen);
        printf("  %s (evidence %s): %s%s%s\n", name, evidence, causes[i].says, unseen[0] ? " " : "", unseen);
    }
}

static void print_figures(const char *name, const struct diagnosis_figures *figures)
{
    char error[wording_short];
    wording_percent(figures->validation_nrmse, error);
    printf("  %-15s %10s %14.3f\n", name, error, figures->whitened_rms);
}

static void print_gain(const struct diagnosis *self)
{
    char noise[wording_short];
    wording_percent(self->noise_floor_nrmse, noise);
    printf("\n%-17s %10s %14s\n", "on unseen data", "error", "over expected");
    print_figures(self->model_given ? "model as given" : "rigid body", &self->nominal);
    print_figures("refitted", &self->refitted);
    if (wording_is_extended(self)) {
        print_figures("extended", &self->extended);
    }
    printf("  %-15s %10s %14.3f\n", "perfect model", noise, 1.0);
    const char *remark = wording_refit(self);
    if (remark) {
        printf("%s\n", remark);
    }
}

/// Where a model is wrong, and what of that is noise.
static void print_misfit(const struct diagnosis *self, const char *name, enum misfit_model model)
{
    char where[wording_size], noise[wording_short];
    wording_percent(misfit_noise_share(&self->misfit, model), noise);
    wording_where(self, &self->misfit, model, where);
    if (!misfit_is_left(&self->misfit, model))
        printf("  %-15s nothing beyond noise\n", name);
    else
        printf("  %-15s %s; noise is %s of what it leaves, squared\n", name, where[0] ? where : "everywhere alike",
               noise);
}

static void print_where(const struct diagnosis *self)
{
    print_heading("Where it is wrong, on unseen data");
    print_misfit(self, self->model_given ? "model as given" : "rigid body", misfit_given);
    print_misfit(self, wording_is_extended(self) ? "extended" : "refitted", misfit_extended);
}

static void print_limits(const struct diagnosis *self)
{
    if (self->verdict == diagnosis_unexplained) {
        char left[wording_size];
        wording_left(self, left);
        print_heading("Unexplained");
        printf("  %s.\n", left);
    }
    if (self->untestable_count > 0) {
        print_heading("Not tested for");
    }
    for (size_t i = 0; i < self->untestable_count; i++) {
        char name[wording_short];
        wording_effect(self->untestable[i].effect, name);
        printf("  %s: %s\n", name, self->untestable[i].why);
    }
}

static void print_next(const struct diagnosis *self)
{
    char sentences[sentences_max][wording_size];
    size_t count = wording_next(self, sentences_max, sentences);
    if (count > 0) {
        print_heading("Next");
    }
    for (size_t i = 0; i < count; i++) {
        printf("  %s\n", sentences[i]);
    }
}

static void print_summary(const struct diagnosis *self, const struct arguments *arguments)
{
    char headline[wording_size], gain[wording_size];
    const char *outputs[outputs_max];
    wording_headline(self, headline);
    wording_gain(self, gain);
    printf("%s\n%s\n", headline, gain);
    for (size_t i = 0; i < self->oddities.count; i++) {
        printf("Note: %s\n", self->oddities.texts[i]);
    }
    print_causes(self, "Causes", self->causes, self->cause_count);
    print_causes(self, "What might be, without being claimed", self->candidates, self->candidate_count);
    print_gain(self);
    print_where(self);
    print_limits(self);
    print_next(self);
    size_t count = list_outputs(arguments, outputs);
    for (size_t i = 0; i < count; i++) {
        printf("%s%s%s", i == 0 ? "\nWritten: " : ", ", outputs[i], i + 1 == count ? "\n" : "");
    }
}

/// Writes what was asked for, then says it.
static int deliver(const struct diagnosis *self, const struct arguments *arguments,
                   const struct command_context *context, struct error *out_error)
{
    cJSON *object = diagnosis_json(self);
    if (!object) {
        return error_set(out_error, error_refused, "memory is short");
    }
    int status = arguments->json_out ? json_write(arguments->json_out, object, out_error) : 0;
    if (!status && arguments->extended) {
        status = model_file_write(arguments->extended, &self->extended_model, &self->deviations, out_error);
    }
    if (!status && arguments->report) {
        status = diagnosis_report(self, arguments->report, out_error);
    }
    if (!status && context->json) {
        status = json_print_stdout(object, out_error);
    } else if (!status && !context->quiet) {
        print_summary(self, arguments);
    }
    cJSON_Delete(object);
    return status;
}

static int run(int argc, char **argv, const struct command_context *context, struct error *out_error)
{
    struct arguments arguments = {0};
    struct inputs inputs = {0};
    int status = read_options(argc, argv, &arguments, out_error);
    status = status ? status : check_outputs(&arguments, out_error);
    status = status ? status : read_inputs(&arguments, &inputs, out_error);
    struct diagnosis *diagnosis = status ? NULL : calloc(1, sizeof *diagnosis);
    if (!status && !diagnosis) {
        status = error_set(out_error, error_refused, "memory is short");
    }
    status = status ? status : diagnose(&inputs, &arguments, context, diagnosis, out_error);
    if (!status) {
        status = deliver(diagnosis, &arguments, context, out_error);
        diagnosis_free(diagnosis);
    }
    if (!status && *interrupt_flag()) {
        status = error_set(out_error, error_refused,
                           "interrupted: what was found until then is the best so far, the "
                           "search was not finished");
    }
    free(diagnosis);
    free_inputs(&inputs);
    return status;
}

const struct command command_cmd_diagnose = {
    .name = "diagnose",
    .summary = "name what a simulation gets wrong about recordings, extend it, measure the gain",
    .help = "servoscope diagnose: name what a simulation gets wrong about recordings, extend it, measure the gain\n"
            "\n"
            "usage: servoscope diagnose RUN.csv [more.csv] [--validate RUN.csv ...] [--model NOMINAL.json] [options]\n"
            "\n"
            "  RUN.csv ...          recordings to fit, of one drive; all names that belong to no option\n"
            "  --validate RUN ...   recordings to judge by, which the fit does not see: all names up to the next "
            "option\n"
            "                       (default: the last third of the first run is held back)\n"
            "  --model M.json       the simulation to be judged (default: a rigid body without friction)\n"
            "  --json-out D.json    the diagnosis as a file; --json prints the same object\n"
            "  --report R.html      one page with figures\n"
            "  --extended M.json    the model with the causes, for servoscope simulate and measure --drive sim:M.json\n"
            "  --map NAME=COLUMN[*SCALE],...  --rate HZ    for recordings of others; hold for every run named\n"
            "                       NAME is torque_Nm, torque_ref_Nm, position_rad, velocity_rad_per_s, force_N,\n"
            "                       position_m, velocity_m_per_s, current_A, current_ref_A (all: docs/files.md)\n"
            "                       without --map columns are named by the units in their names, and a note says how;\n"
            "                       values are taken times SCALE, whatever unit COLUMN names:\n"
            "                       position_rad=angle_deg*0.0174532925\n"
            "                       semicolons, tabs, decimal commas, MATLAB: servoscope convert first\n"
            "\n"
            "A cause is named only if the data cannot do without it; what has no name stays \"unexplained\". Error is "
            "the RMS of the\n"
            "torque that the model misplaces for the measured motion, over the RMS of the measured torque. Evidence is "
            "a\n"
            "log-likelihood ratio in nats. \"Over expected\" weighs the error by its noise: 1 is a perfect model.\n"
            "The exit status is 0 whatever the verdict is. Ctrl-C ends the search and "
            "reports the\n"
            "best so far, with exit status 1.\n"
            "\n"
            "example:\n"
            "  servoscope diagnose run1.csv --validate run2.csv --model nominal.json --report r.html --extended "
            "extended.json\n"
            "a log with a current and an encoder of 8192 counts a turn:\n"
            "  servoscope diagnose log.csv --rate 1000 --map torque_Nm=iq*0.71,position_rad=counts*0.000766990394\n",
    .run = run,
};
