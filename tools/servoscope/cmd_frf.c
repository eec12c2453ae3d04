/* SPDX-License-Identifier: MIT */
/// servoscope frf: from a recording to a frequency response with its standard deviation.
#include "lab/design/lines.h"
#include "lab/estimate/advise.h"
#include "lab/estimate/arbitrary.h"
#include "lab/estimate/clocked.h"
#include "lab/estimate/frf_mean.h"
#include "lab/estimate/method.h"
#include "lab/estimate/parametric_frf.h"
#include "lab/estimate/periodic.h"
#include "lab/estimate/realisations.h"
#include "lab/estimate/setup.h"
#include "lab/record/atomic_file.h"
#include "lab/record/frf_file.h"
#include "lab/record/json_out.h"
#include "lab/record/manifest.h"
#include "lab/record/run.h"
#include "tools/servoscope/command.h"
#include "tools/servoscope/comparing.h"
#include "tools/servoscope/estimating_matrix.h"
#include "tools/servoscope/estimating_options.h"
#include "tools/servoscope/estimating_outcome.h"
#include "tools/servoscope/estimating_page.h"
#include "tools/servoscope/estimating_pieces.h"
#include "tools/servoscope/estimating_sequence.h"
#include "tools/servoscope/options.h"
#include "tools/servoscope/outputs.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/// A model by itself is no measurement: the page shows it beside the lines that it was fitted to.
static int estimate_by(const struct estimating_request *request, const struct periodic *recording, struct frf *out_frf,
                       struct estimating_summary *io_summary, struct error *out_error)
{
    struct estimate_options tuning = request->tuning;
    if (strcmp(request->method->name, "parametric") == 0) {
        io_summary->parametric = calloc(1, sizeof *io_summary->parametric);
        if (!io_summary->parametric) {
            return error_set(out_error, error_refused, "memory is short");
        }
        tuning.parametric = io_summary->parametric;
    }
    int status = request->method->estimate(recording, &tuning, out_frf, out_error);
    if (!status && io_summary->parametric) {
        status = frf_mean_estimate(recording, NULL, &io_summary->measured, out_error);
    }
    return status;
}

static int estimate_without_period(const struct run *run, const struct estimating_request *request, struct frf *out_frf,
                                   struct estimating_summary *out_summary, struct error *out_error)
{
    const struct arbitrary_options options = {
        .input = request->cut.input, .output = request->cut.output, .reference = request->cut.reference};
    struct arbitrary recording;
    if (request->cut.settle == periodic_settle_given && request->cut.settle_periods > 0) {
        return error_set(out_error, error_usage, "--settle: %s has no periods to leave out", run->path);
    }
    int status = arbitrary_cut(run, &options, &recording, out_error);
    if (status) {
        return status;
    }
    *out_summary =
        (struct estimating_summary){.without_period = true, .rows = recording.rows, .lost_rows = recording.lost};
    estimate_advise_arbitrary(&recording, &out_summary->advice);
    return request->method->estimate_arbitrary(&recording, &request->tuning, out_frf, out_error);
}

static int estimate_periods(const struct run *run, const struct estimating_request *request,
                            const struct inputs *inputs, struct frf *out_frf, struct estimating_summary *out_summary,
                            struct error *out_error)
{
    struct clocked clocked;
    const struct periodic *recording = &clocked.recording;
    int status = clocked_cut(run, &request->cut, false, &clocked, out_error);
    if (status && recording->aperiodic && request->method->estimate_arbitrary) {
        return estimate_without_period(run, request, out_frf, out_summary, out_error);
    }
    if (!status && request->tuning.segment_samples > 0) {
        status = error_set(out_error, error_usage,
                           "--segment: %s repeats every %zu samples and is taken period by period: expected no "
                           "--segment, which is for recordings without a period",
                           run->path, recording->period_samples);
        clocked_free(&clocked);
    }
    if (status) {
        return status;
    }
    status = estimating_summary_make(recording, out_summary)
                 ? estimate_by(request, recording, out_frf, out_summary, out_error)
                 : error_set(out_error, error_refused, "memory is short");
    if (!status && (!estimating_findings_measure(recording, inputs, out_frf, &out_summary->findings) ||
                    !estimating_checks_measure(&clocked, out_frf, &out_summary->checks) ||
                    !estimating_summary_excite(out_summary, recording))) {
        status = estimate_refuse_memory(out_frf, out_error);
    }
    clocked_free(&clocked);
    return status;
}

static int estimate_run(const char *path, const struct estimating_options *arguments, struct estimating_request request,
                        struct frf *out_frf, struct estimating_summary *out_summary, struct error *out_error)
{
    const struct run_options run_options = {.map = arguments->map,
                                            .rate_hz = arguments->rate_hz,
                                            .guess = true,
                                            .keep = {arguments->input, arguments->output, arguments->reference}};
    const char *needs_whole = strcmp(request.method->name, "mean") != 0 ? request.method->name : NULL;
    struct estimating_pieces pieces;
    struct design_lines lines = {0};
    struct inputs inputs = {0};
    int status = estimating_matrix_read(request.matrix, path, &run_options, needs_whole, request.cut.period_samples,
                                        &pieces, out_error);
    if (status) {
        return status;
    }
    const struct run *run = &pieces.run;
    pieces.context = request.context;
    status = estimating_matrix_begin(request.matrix, run, out_error);
    status = status ? status : estimating_options_lines(arguments, run, &request.cut, &lines, out_error);
    status = status ? status : estimating_matrix_lines(request.matrix, run, &request.cut, &inputs, out_error);
    if (!status && request.segment) {
        status = estimating_check_table(run, request.segment, out_error);
    }
    const struct inputs *several = inputs.count > 0 ? &inputs : NULL;
    if (!status && pieces.stream) {
        status = estimating_pieces_estimate(&pieces, &request.cut, several, out_frf, out_summary, out_error);
    } else if (!status) {
        status = estimate_periods(run, &request, several, out_frf, out_summary, out_error);
    }
    if (!status && run_key(run, "columns_named") &&
        !estimate_set_key(out_frf, "columns_named", "%s", run_key(run, "columns_named"))) {
        status = estimate_refuse_memory(out_frf, out_error);
    }
    design_lines_free(&lines);
    inputs_free(&inputs);
    estimating_matrix_give_back(request.matrix, &pieces);
    return status;
}

/// The runs of a sequence on their way through estimate_run().
struct segments_context {
    const struct estimating_options *arguments;
    const struct estimating_request *request;
    struct estimating_summary *whole;
};

static int estimate_segment(void *context, const char *path, const struct run_sequence_segment *segment,
                            struct frf *out_frf, struct error *out_error)
{
    const struct segments_context *self = context;
    struct estimating_request request = *self->request;
    struct estimating_summary one = {.used = 0};
    request.segment = segment;
    int status = estimate_run(path, self->arguments, request, out_frf, &one, out_error);
    const bool excited = status || excitations_move(&one.excitations, &self->whole->excitations);
    estimating_summary_drop(&one);
    status = excited ? status : estimate_refuse_memory(out_frf, out_error);
    if (!status) {
        estimating_summary_merge(self->whole, &one);
        status = estimating_findings_merge(&self->whole->findings, &one.findings)
                     ? 0
                     : estimate_refuse_memory(out_frf, out_error);
    }
    estimating_findings_free(&one.findings);
    return status;
}

/// A run, or all runs of the manifest of a sequence as one.
static int estimate_source(const char *path, const struct estimating_options *arguments,
                           const struct estimating_request *request, struct frf *out_frf,
                           struct estimating_summary *out_summary, struct error *out_error)
{
    if (!manifest_is(path)) {
        return estimate_run(path, arguments, *request, out_frf, out_summary, out_error);
    }
    if (arguments->lines) {
        return error_set(out_error, error_usage, "--lines: '%s': each run of the sequence %s says its lines itself",
                         arguments->lines, path);
    }
    struct estimating_segments segments;
    struct segments_context context = {arguments, request, out_summary};
    int status = estimating_sequence(path, estimate_segment, &context, out_frf, &segments, out_error);
    out_summary->segments = segments;
    return status;
}

static int print_json(cJSON *object, struct error *out_error)
{
    int status = json_print_stdout(object, out_error);
    cJSON_Delete(object);
    return status;
}

/// The model of method parametric, for --model-out.
static int write_model(const struct estimating_options *arguments, const struct estimating_outcome *outcome,
                       struct error *out_error)
{
    const struct parametric_outcome *found = outcome->runs[0].parametric;
    if (!arguments->model_out || !found || !found->made) {
        return 0;
    }
    cJSON *object = parametric_outcome_json(found, true);
    int status = object ? json_write(arguments->model_out, object, out_error)
                        : error_set(out_error, error_refused, "%s: memory is short", arguments->model_out);
    cJSON_Delete(object);
    return status;
}

/// Writes everything that was asked for. The page, which is the largest, is put in place last, once the rest is there.
static int write_files(const struct estimating_options *arguments, const struct estimating_page_item *items,
                       size_t count, struct error *out_error)
{
    struct atomic_file page = {NULL, NULL, NULL};
    int status = 0;
    if (arguments->report) {
        status = estimating_page_write(arguments->report, items, count, &page, out_error);
    }
    for (size_t i = 0; i < count && !status; i++) {
        status = frf_write(items[i].out, &items[i].outcome->frf, out_error);
    }
    status = status ? status : write_model(arguments, items[0].outcome, out_error);
    if (status || !arguments->report) {
        atomic_file_discard(&page);
        return status;
    }
    return atomic_file_commit(&page, out_error);
}

static int say_outcome(const struct estimating_options *arguments, const struct estimating_outcome *outcome,
                       const struct comparing *compared, const struct command_context *context, struct error *out_error)
{
    if (context->json) {
        cJSON *object = estimating_outcome_json(outcome, &arguments->runs, arguments->out);
        int status = comparing_add_json(compared, &outcome->frf, object, out_error);
        status = status ? status : json_print_stdout(object, out_error);
        cJSON_Delete(object);
        return status;
    }
    if (context->quiet) {
        return 0;
    }
    estimating_outcome_print(outcome, &arguments->runs, arguments->out);
    return comparing_print(compared, &outcome->frf, arguments->out, out_error);
}

static int write_and_report(const struct estimating_options *arguments, const struct estimating_outcome *outcome,
                            const struct comparing *compared, const struct command_context *context,
                            struct error *out_error)
{
    const struct estimating_page_item item = {outcome, &arguments->runs, arguments->out, compared};
    int status = comparing_check(compared, &outcome->frf, arguments->out, out_error);
    status = status ? status : write_files(arguments, &item, 1, out_error);
    return status ? status : say_outcome(arguments, outcome, compared, context, out_error);
}

/// Passes on why runs cannot be taken together: "run 2" becomes "run 2 (other.csv)".
static int refuse_by_name(const struct error *reason, const struct option_values *runs, struct error *out_error)
{
    char message[sizeof reason->message] = "";
    size_t used = 0;
    const char *at = reason->message;
    while (*at && used + 1 < sizeof message) {
        char *end = NULL;
        const bool counts = strncmp(at, "run ", 4) == 0 && isdigit((unsigned char)at[4]);
        const unsigned long number = counts ? strtoul(at + 4, &end, 10) : 0;
        if (number < 1 || number > runs->count) {
            message[used++] = *at++;
            continue;
        }
        const int length =
            snprintf(message + used, sizeof message - used, "run %lu (%s)", number, runs->items[number - 1]);
        used += length > 0 && (size_t)length < sizeof message - used ? (size_t)length : sizeof message - used - 1;
        at = end;
    }
    message[used] = '\0';
    return error_set(out_error, reason->status, "%s", message);
}

/// Several runs are realisations, but for those of the same excitation.
static int combine(const struct estimating_options *arguments, struct frf *responses,
                   struct estimating_outcome *io_outcome, struct error *out_error)
{
    const size_t count = arguments->runs.count;
    if (count == 1) {
        io_outcome->frf = responses[0];
        responses[0] = (struct frf){0};
        return 0;
    }
    struct excitations *excitations = malloc(count * sizeof *excitations);
    if (!excitations) {
        return error_set(out_error, error_refused, "memory is short");
    }
    for (size_t r = 0; r < count; r++) {
        excitations[r] = io_outcome->runs[r].excitations;
    }
    struct error reason = {0, ""};
    int status =
        realisations_combine(responses, excitations, count, &io_outcome->frf, &io_outcome->findings.agreed, &reason);
    free(excitations);
    return status ? refuse_by_name(&reason, &arguments->runs, out_error) : 0;
}

/// What the response is one of, and what its runs show beside it, as its keys.
static int finish(const struct estimating_options *arguments, const struct estimating_request *request,
                  struct estimating_outcome *io_outcome, struct error *out_error)
{
    bool done = true;
    for (size_t r = 0; r < arguments->runs.count && done; r++) {
        done = estimating_findings_merge(&io_outcome->findings, &io_outcome->runs[r].findings);
    }
    for (size_t r = 0; r < arguments->runs.count && done; r++) {
        done = estimating_checks_carry(&io_outcome->runs[r].checks, &io_outcome->frf);
    }
    setup_remove_delay(&io_outcome->frf, arguments->delay_s);
    for (size_t r = 0; r < io_outcome->run_count; r++) {
        struct frf *measured = &io_outcome->runs[r].measured;
        setup_remove_delay(measured, arguments->delay_s);
        done = done && (measured->count == 0 || setup_set_keys(measured, request->hold, arguments->delay_s));
        if (io_outcome->responses) {
            setup_remove_delay(&io_outcome->responses[r], arguments->delay_s);
        }
    }
    done = done && setup_set_keys(&io_outcome->frf, request->hold, arguments->delay_s) &&
           estimating_findings_judge(&io_outcome->findings, &io_outcome->frf) &&
           estimating_findings_set_keys(&io_outcome->findings, &io_outcome->frf);
    return done ? 0 : estimate_refuse_memory(&io_outcome->frf, out_error);
}

/// Runs of a sequence or realisations have one model, of the response that they give together.
static bool fits_afterwards(const struct estimating_options *arguments, const struct estimating_request *request)
{
    return strcmp(request->method->name, "parametric") == 0 &&
           (arguments->runs.count > 1 || manifest_is(arguments->runs.items[0]));
}

/// Replaces the response by that of the model fitted to it, which is kept with the first run.
static int fit_afterwards(const struct estimating_options *arguments, const struct estimating_request *request,
                          struct estimating_outcome *io_outcome, struct error *out_error)
{
    struct estimating_summary *first = &io_outcome->runs[0];
    struct estimate_options tuning = request->tuning;
    first->parametric = calloc(1, sizeof *first->parametric);
    if (!first->parametric) {
        return error_set(out_error, error_refused, "memory is short");
    }
    tuning.parametric = first->parametric;
    first->measured = io_outcome->frf;
    io_outcome->frf = (struct frf){0};
    return frf_parametric_fit(&first->measured, arguments->runs.items[0], &tuning, &io_outcome->frf, out_error);
}

static int estimate_all(const struct estimating_options *arguments, const struct estimating_request *asked,
                        struct estimating_outcome *out, struct error *out_error)
{
    const bool afterwards = fits_afterwards(arguments, asked);
    struct estimating_request of_runs = *asked;
    const struct estimating_request *request = &of_runs;
    if (afterwards) {
        of_runs.method = estimate_method_find("mean", NULL);
    }
    const size_t count = arguments->runs.count;
    struct frf *responses = calloc(count, sizeof *responses);
    *out = (struct estimating_outcome){.runs = calloc(count, sizeof *out->runs)};
    int status = responses && out->runs ? 0 : error_set(out_error, error_refused, "memory is short");
    out->run_count = out->runs ? count : 0;
    for (size_t r = 0; r < count && !status; r++) {
        status = estimate_source(arguments->runs.items[r], arguments, request, &responses[r], &out->runs[r], out_error);
    }
    out->responses = responses;
    status = status ? status : combine(arguments, responses, out, out_error);
    if (!status && afterwards) {
        status = fit_afterwards(arguments, asked, out, out_error);
    }
    return status ? status : finish(arguments, request, out, out_error);
}

/// One output from one input of a machine with several.
static int estimate_pair(const struct estimating_options *arguments, const struct estimating_request *request,
                         size_t pair, struct estimating_options *out_pair, struct estimating_outcome *out,
                         struct error *out_error)
{
    const struct estimating_matrix *matrix = request->matrix;
    const size_t output = pair / matrix->input_count;
    const size_t input = pair % matrix->input_count;
    struct estimating_request one = *request;
    char *path = estimating_matrix_path(matrix, arguments->out, output, input);
    *out_pair = *arguments;
    out_pair->out = path;
    one.cut.input = matrix->inputs[input];
    one.cut.output = matrix->outputs[output];
    if (!path) {
        return error_set(out_error, error_refused, "memory is short");
    }
    const char *const outputs[] = {path};
    int status = outputs_check(arguments->runs.items, arguments->runs.count, outputs, 1, out_error);
    return status ? status : estimate_all(out_pair, &one, out, out_error);
}

static cJSON *json_of_pairs(const struct estimating_options *arguments, const struct estimating_matrix *matrix,
                            const struct estimating_options *pairs, const struct estimating_outcome *outcomes)
{
    cJSON *object = cJSON_CreateObject();
    cJSON_AddStringToObject(object, "out", arguments->out);
    cJSON *inputs = cJSON_AddArrayToObject(object, "inputs");
    for (size_t i = 0; i < matrix->input_count; i++) {
        cJSON_AddItemToArray(inputs, cJSON_CreateString(matrix->inputs[i]));
    }
    cJSON *outputs = cJSON_AddArrayToObject(object, "outputs");
    for (size_t i = 0; i < matrix->output_count; i++) {
        cJSON_AddItemToArray(outputs, cJSON_CreateString(matrix->outputs[i]));
    }
    cJSON *responses = cJSON_AddArrayToObject(object, "responses");
    for (size_t i = 0; i < matrix->input_count * matrix->output_count; i++) {
        cJSON_AddItemToArray(responses, estimating_outcome_json(&outcomes[i], &pairs[i].runs, pairs[i].out));
    }
    return object;
}

static int report_pairs(const struct estimating_options *arguments, const struct estimating_matrix *matrix,
                        const struct estimating_options *pairs, const struct estimating_outcome *outcomes,
                        const struct command_context *context, struct error *out_error)
{
    const size_t count = matrix->input_count * matrix->output_count;
    struct estimating_page_item *items = malloc(count * sizeof *items);
    for (size_t i = 0; i < count && items; i++) {
        items[i] = (struct estimating_page_item){&outcomes[i], &pairs[i].runs, pairs[i].out, NULL};
    }
    int status = items ? write_files(arguments, items, count, out_error)
                       : error_set(out_error, error_refused, "memory is short");
    free(items);
    if (!status && context->json) {
        return print_json(json_of_pairs(arguments, matrix, pairs, outcomes), out_error);
    }
    for (size_t i = 0; i < count && !status && !context->quiet; i++) {
        estimating_outcome_print(&outcomes[i], &pairs[i].runs, pairs[i].out);
    }
    return status;
}

static int estimate_matrix(const struct estimating_options *arguments, const struct estimating_request *request,
                           const struct command_context *context, struct error *out_error)
{
    const size_t count = request->matrix->input_count * request->matrix->output_count;
    if (arguments->model_out || arguments->compare.count > 0) {
        return error_set(out_error, error_usage,
                         "--%s: there are %zu responses, expected --input COLUMN and --output COLUMN too",
                         arguments->model_out ? "model-out" : "compare", count);
    }
    struct estimating_options *pairs = calloc(count, sizeof *pairs);
    struct estimating_outcome *outcomes = calloc(count, sizeof *outcomes);
    int status = pairs && outcomes ? 0 : error_set(out_error, error_refused, "memory is short");
    for (size_t i = 0; i < count && !status; i++) {
        status = estimate_pair(arguments, request, i, &pairs[i], &outcomes[i], out_error);
    }
    status = status ? status : report_pairs(arguments, request->matrix, pairs, outcomes, context, out_error);
    for (size_t i = 0; i < count && pairs && outcomes; i++) {
        free((char *)pairs[i].out);
        estimating_outcome_free(&outcomes[i]);
    }
    free(pairs);
    free(outcomes);
    return status;
}

static int estimate_and_report(const struct estimating_options *arguments, const struct estimating_request *request,
                               const struct command_context *context, struct error *out_error)
{
    struct estimating_outcome outcome = {.run_count = 0};
    struct comparing compared = {0};
    int status = comparing_read(&arguments->compare, &compared, out_error);
    status = status ? status : estimate_all(arguments, request, &outcome, out_error);
    if (status == estimating_is_matrix) {
        status = estimate_matrix(arguments, request, context, out_error);
    } else if (!status) {
        status = write_and_report(arguments, &outcome, &compared, context, out_error);
    }
    estimating_outcome_free(&outcome);
    comparing_free(&compared);
    return status;
}

/// The outputs against everything that is read.
static int check_outputs(const struct estimating_options *arguments, struct error *out_error)
{
    const char *outputs[] = {arguments->out, arguments->report, arguments->model_out};
    int status = outputs_check(arguments->runs.items, arguments->runs.count, outputs, 3, out_error);
    return status ? status : outputs_check(arguments->compare.items, arguments->compare.count, outputs, 3, out_error);
}

/// Responses in the place of runs: nothing is to be estimated.
static int compare_saved(const struct estimating_options *arguments, const struct command_context *context,
                         struct error *out_error)
{
    const struct comparing_request request = {&arguments->runs, &arguments->compare, arguments->report};
    if (arguments->out) {
        return error_set(out_error, error_usage, "--out: %s is a response already, expected --report alone",
                         arguments->runs.items[0]);
    }
    return comparing_run(&request, context, out_error);
}

static int run(int argc, char **argv, const struct command_context *context, struct error *out_error)
{
    struct estimating_options arguments = {.method = "mean"};
    struct estimating_matrix matrix = {.allowed = false};
    struct estimating_request request;
    int status = estimating_options_read(argc, argv, &arguments, out_error);
    status = status ? status : estimating_request_make(&arguments, &request, out_error);
    status = status ? status : check_outputs(&arguments, out_error);
    if (!status && frf_file_is(arguments.runs.items[0])) {
        return compare_saved(&arguments, context, out_error);
    }
    if (!status && !arguments.out) {
        status = error_set(out_error, error_usage, "--out is missing; see 'servoscope frf --help'");
    }
    const struct estimating_matrix_request asked = {arguments.design, arguments.input, arguments.output,
                                                    arguments.lines};
    status = status ? status : estimating_matrix_open(&asked, &matrix, out_error);
    if (!status) {
        request.matrix = &matrix;
        request.context = context;
        status = estimate_and_report(&arguments, &request, context, out_error);
    }
    estimating_matrix_free(&matrix);
    return status;
}

const struct command command_cmd_frf = {
    .name = "frf",
    .summary = "frequency response of a periodic recording, with its standard deviation",
    .help =
        "servoscope frf: frequency response of a periodic recording, with its standard deviation\n"
        "\n"
        "usage: servoscope frf RUN.csv [more.csv] [options] --out FRF.csv\n"
        "       servoscope frf FRF.csv [more.csv] --report FILE.html\n"
        "\n"
        "  --method mean        mean over periods, variance from their scatter (default)\n"
        "  --method hann        Hann window over all periods: robust to what is left of a transient, 1.8 dB more "
        "noise\n"
        "  --method lpm         local polynomials: takes the transient out, so that no period is left out; works "
        "without\n"
        "                       a period too\n"
        "  --method h1          cross spectrum over the input's power (Welch), for arbitrary signals; biased in a "
        "closed loop\n"
        "  --method indirect    output and input against the reference: arbitrary signals in a closed loop\n"
        "  --method parametric  transfer function by maximum likelihood, its orders chosen from the data\n"
        "  --domain DOMAIN      parametric: discrete (default with --hold zoh) or continuous; of held input that is "
        "the\n"
        "                       model in 1/z turned into s without the hold\n"
        "  --delay-free         parametric: a delay of any length is estimated (default: found if there is one)\n"
        "  --model-out M.json   parametric: coefficients, poles, zeros, gain, with standard deviations\n"
        "  --settle S           leading periods to leave out; auto: found from the decay of the transient\n"
        "                       (default: the run's settle_periods, else auto; for lpm none)\n"
        "  --input COLUMN       default torque_Nm, else force_N, current_A, voltage_V\n"
        "  --output COLUMN      default velocity_rad_per_s, velocity_m_per_s, else position\n"
        "  --reference COLUMN   what excites the loop, for indirect and lpm (default: set-point of velocity or "
        "position, else\n"
        "                       torque_ref_Nm)\n"
        "  --order R|auto       lpm: order of the polynomials (default: 2, 4, ... until the variance stops "
        "falling)\n"
        "  --half-width LINES   lpm: lines on each side (default: what leaves 9 degrees of freedom)\n"
        "  --segment SAMPLES    without a period: lines are one over so many samples apart\n"
        "  --period SAMPLES     for a recording that does not say it (default: found by its repetition)\n"
        "  --lines SPEC         as for servoscope design, e.g. linear:1:100:1 (default: the run's excited_bins, "
        "else found\n"
        "                       by their power)\n"
        "  --map NAME=COLUMN[*SCALE],...  --rate HZ    for recordings of others (default: columns are named by the "
        "units "
        "in\n"
        "                       their names, and what was taken is said)\n"
        "  --design D.json      several inputs: the manifest of design --inputs that says which lines are whose "
        "(default:\n"
        "                       found by their power)\n"
        "  --hold HOLD          zoh (default): the input stays between samples; band-limited: it is measured behind "
        "an\n"
        "                       anti-alias filter. Said in the file; the numbers are the same\n"
        "  --delay S            a known delay, taken out of the response\n"
        "  --out FRF.csv        frequency_hz,real,imag,std,noise_std,...,valid\n"
        "  --report FILE.html   a page: what was found, Bode diagram with 95 % regions, residuals, distortion, "
        "settling\n"
        "  --compare FRF.csv... saved responses, drawn into the same figure and held against this one\n",
    .more_help =
        "\n"
        "The manifest that measure writes for a sequence (octaves, dwell) stands for all of its runs: each segment "
        "is\n"
        "estimated by itself, and their lines are put together.\n"
        "Several runs are realisations: same lines, other phases. Their mean is the best linear approximation, std "
        "its total\n"
        "standard deviation (noise and nonlinear distortion), noise_std that of the noise alone.\n"
        "Periods with lost samples (valid = 0) do not count. 95 % of errors lie within confidence_95_factor times "
        "std, which\n"
        "is more than 2 for few periods. The response includes the hold: torque held between samples.\n"
        "Free bins between the lines (design odd:, random-odd:) show odd and even distortion, a dwell its harmonics. A "
        "run with\n"
        "torque_1_Nm, torque_2_Nm, ... gives a response for each output and input: FRF-OUTPUT-INPUT.csv. A response "
        "that\n"
        "repeats only after several periods is a warning: std does not hold then.\n"
        "Of long recordings mean keeps only sums, so that memory does not grow. Where a true period is no whole number "
        "of "
        "samples,\n"
        "or drifts, the recording is resampled to it.\n"
        "\n"
        "Saved responses in the place of runs are compared with the first of them, in sentences and with --report on a "
        "page.\n"
        "\n"
        "examples:\n"
        "  servoscope frf run.csv --out frf.csv\n"
        "  servoscope frf run.csv --out after.csv --compare before.csv --report after.html\n",
    .run = run,
};
