/* SPDX-License-Identifier: MIT */
/// servoscope frf: from a recording to a frequency response with its standard deviation.
#include "lab/design/lines.h"
#include "lab/estimate/method.h"
#include "lab/estimate/periodic.h"
#include "lab/estimate/report.h"
#include "lab/numeric/statistics.h"
#include "lab/page/page.h"
#include "lab/record/atomic_file.h"
#include "lab/record/frf_file.h"
#include "lab/record/json_out.h"
#include "lab/record/run.h"
#include "tools/servoscope/command.h"
#include "tools/servoscope/options.h"
#include "tools/servoscope/outputs.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct arguments {
    struct option_values runs;
    const char *method;
    const char *settle;
    const char *input;
    const char *output;
    const char *reference;
    const char *lines;
    const char *map;
    const char *out;
    const char *report;
    double rate_hz;
    long long period_samples;
};

/// What one run gave, kept for the summary.
struct summary {
    size_t period_samples;
    size_t total;
    size_t settle;
    size_t lost;
    size_t first_lost_row;
    size_t used;
    bool period_found;
    bool bins_found;
    struct settle transient;
    double first_level;
    double last_level;
};

static int read_options(int argc, char **argv, struct arguments *out, struct error *out_error)
{
    const struct option options[] = {
        {.name = "method", .kind = option_text, .target = &out->method},
        {.name = "settle", .kind = option_text, .target = &out->settle},
        {.name = "input", .kind = option_text, .target = &out->input},
        {.name = "output", .kind = option_text, .target = &out->output},
        {.name = "reference", .kind = option_text, .target = &out->reference},
        {.name = "lines", .kind = option_text, .target = &out->lines},
        {.name = "map", .kind = option_text, .target = &out->map},
        {.name = "rate", .kind = option_positive, .target = &out->rate_hz},
        {.name = "period", .kind = option_integer, .target = &out->period_samples, .lowest = 3, .highest = 1e9},
        {.name = "out", .kind = option_text, .target = &out->out, .required = true},
        {.name = "report", .kind = option_text, .target = &out->report},
    };
    const struct option_operands operands = {"RUN.csv", 1, option_values_max, &out->runs};
    return options_parse(argc, argv, options, sizeof options / sizeof options[0], &operands, out_error);
}

static int read_settle(const struct arguments *arguments, struct periodic_options *io_options, struct error *out_error)
{
    if (!arguments->settle) {
        return 0;
    }
    if (strcmp(arguments->settle, "auto") == 0) {
        io_options->settle = periodic_settle_auto;
        return 0;
    }
    double periods = 0.0;
    if (options_parse_number("--settle", arguments->settle, &periods, NULL) ||
        !(periods >= 0.0 && periods <= 1e9 && periods == floor(periods))) {
        return error_set(out_error, error_usage, "--settle: '%s', expected a whole number of periods or auto",
                         arguments->settle);
    }
    io_options->settle = periodic_settle_given;
    io_options->settle_periods = (size_t)periods;
    return 0;
}

static int read_request(const struct arguments *arguments, struct periodic_options *out_options,
                        const struct estimate_method **out_method, struct error *out_error)
{
    *out_options = (struct periodic_options){
        .input = arguments->input,
        .output = arguments->output,
        .period_samples = (size_t)arguments->period_samples,
    };
    if (arguments->reference) {
        return error_set(
            out_error, error_usage,
            "--reference: '%s' is for method indirect, which is not in this build (the mean over periods needs "
            "none, in closed loop either)",
            arguments->reference);
    }
    *out_method = estimate_method_find(arguments->method, out_error);
    return *out_method ? read_settle(arguments, out_options, out_error) : error_usage;
}

/// --lines needs the run's rate and period, so that it is read once per run.
static int read_lines(const struct arguments *arguments, const struct run *run, struct periodic_options *io_options,
                      struct design_lines *out_lines, struct error *out_error)
{
    *out_lines = (struct design_lines){0};
    if (!arguments->lines) {
        return 0;
    }
    const struct design_line_grid grid = {
        .rate_hz = run->sample_rate_hz,
        .period_samples = io_options->period_samples ? io_options->period_samples : run->period_samples,
    };
    if (grid.period_samples == 0) {
        return error_set(out_error, error_usage, "--lines: %s does not say its period, give --period SAMPLES too",
                         run->path);
    }
    int status = design_lines_parse(arguments->lines, &grid, 1, out_lines, out_error);
    io_options->bins = out_lines->bins;
    io_options->bin_count = out_lines->count;
    return status;
}

static void summarise(const struct periodic *recording, struct summary *out_summary)
{
    *out_summary = (struct summary){
        .period_samples = recording->period_samples,
        .total = recording->total,
        .settle = recording->settle,
        .lost = recording->lost,
        .first_lost_row = recording->first_lost_row,
        .used = recording->used,
        .period_found = recording->period_found,
        .bins_found = recording->bins_found,
        .transient = recording->transient,
        .first_level = recording->output_level[0],
        .last_level = recording->output_level[recording->total - 1],
    };
}

static int estimate_run(const char *path, const struct arguments *arguments, struct periodic_options options,
                        const struct estimate_method *method, struct frf *out_frf, struct summary *out_summary,
                        struct error *out_error)
{
    const struct run_options run_options = {.map = arguments->map, .rate_hz = arguments->rate_hz};
    struct run run;
    struct design_lines lines;
    struct periodic recording;
    int status = run_read(path, &run_options, &run, out_error);
    if (status) {
        return status;
    }
    status = read_lines(arguments, &run, &options, &lines, out_error);
    status = status ? status : periodic_cut(&run, &options, &recording, out_error);
    if (!status) {
        status = method->estimate(&recording, out_frf, out_error);
        summarise(&recording, out_summary);
        periodic_free(&recording);
    }
    design_lines_free(&lines);
    run_free(&run);
    return status;
}

static size_t valid_lines(const struct frf *frf)
{
    size_t count = 0;
    for (size_t line = 0; line < frf->count; line++) {
        count += frf->valid[line];
    }
    return count;
}

/// Median over the valid lines of std / |G|.
static double median_relative_std(const struct frf *frf)
{
    double best = NAN;
    double *values = malloc(frf->count * sizeof *values);
    size_t count = 0;
    for (size_t line = 0; values && line < frf->count; line++) {
        double magnitude = hypot(frf->real[line], frf->imag[line]);
        if (frf->valid[line] && magnitude > 0.0) {
            values[count++] = frf->std[line] / magnitude;
        }
    }
    if (count > 0) {
        best = statistics_median(values, count);
    }
    free(values);
    return best;
}

static const char *key_of(const struct frf *frf, const char *key)
{
    for (size_t i = 0; i < frf->key_count; i++) {
        if (strcmp(frf->keys[i].key, key) == 0) {
            return frf->keys[i].value;
        }
    }
    return "";
}

static void print_run(const char *path, const struct summary *run)
{
    printf("%s: %zu of %zu periods of %zu samples count, %zu left out for settling", path, run->used, run->total,
           run->period_samples, run->settle);
    if (run->lost > 0) {
        printf(", %zu for lost samples (the first in row %zu)", run->lost, run->first_lost_row);
    }
    printf("%s%s\n", run->period_found ? "; period found by its repetition" : "",
           run->bins_found ? "; lines found by their power" : "");
    printf("  output differs from the later half by %.3g of its size in the first period, by %.3g in the last",
           run->first_level, run->last_level);
    if (run->transient.decay_per_period > 0.0) {
        printf("; a transient falls to %.3g per period", run->transient.decay_per_period);
    }
    if (!run->transient.settled) {
        printf(run->total < 4 ? "; too few periods to judge the settling"
                              : "; the first half has not settled or is not repeatable");
    }
    putchar('\n');
}

static void print_summary(const char *path, const struct frf *frf)
{
    printf("%s: %s to %s by method %s, %zu of %zu lines valid, %.6g..%.6g Hz\n", path, frf->input, frf->output,
           frf->method, valid_lines(frf), frf->count, frf->frequency_hz[0], frf->frequency_hz[frf->count - 1]);
    printf("  std/|G| %.3g (median); 95 %% of errors lie within %s std (%.3g degrees of freedom)\n",
           median_relative_std(frf), key_of(frf, "confidence_95_factor"), frf->degrees_of_freedom);
}

static cJSON *json_of_run(const char *path, const struct summary *run)
{
    cJSON *object = cJSON_CreateObject();
    cJSON_AddStringToObject(object, "run", path);
    cJSON_AddNumberToObject(object, "period_samples", (double)run->period_samples);
    cJSON_AddBoolToObject(object, "period_found", run->period_found);
    cJSON_AddBoolToObject(object, "lines_found", run->bins_found);
    cJSON_AddNumberToObject(object, "periods_total", (double)run->total);
    cJSON_AddNumberToObject(object, "settle_periods", (double)run->settle);
    cJSON_AddNumberToObject(object, "lost_periods", (double)run->lost);
    cJSON_AddNumberToObject(object, "periods", (double)run->used);
    cJSON_AddBoolToObject(object, "settled", run->transient.settled);
    cJSON_AddNumberToObject(object, "transient_first_period", run->first_level);
    cJSON_AddNumberToObject(object, "transient_decay_per_period",
                            run->transient.decay_per_period > 0.0 ? run->transient.decay_per_period : NAN);
    return object;
}

static int print_json(const struct arguments *arguments, const struct frf *frf, const struct summary *runs,
                      struct error *out_error)
{
    cJSON *object = cJSON_CreateObject();
    cJSON_AddStringToObject(object, "out", arguments->out);
    cJSON_AddStringToObject(object, "method", frf->method);
    cJSON_AddStringToObject(object, "input", frf->input);
    cJSON_AddStringToObject(object, "output", frf->output);
    cJSON_AddStringToObject(object, "units", frf->units);
    cJSON_AddNumberToObject(object, "lines", (double)frf->count);
    cJSON_AddNumberToObject(object, "lines_valid", (double)valid_lines(frf));
    cJSON_AddNumberToObject(object, "periods", (double)frf->periods);
    cJSON_AddNumberToObject(object, "degrees_of_freedom", frf->degrees_of_freedom);
    cJSON_AddNumberToObject(object, "confidence_95_factor", atof(key_of(frf, "confidence_95_factor")));
    cJSON_AddNumberToObject(object, "median_relative_std", median_relative_std(frf));
    cJSON *list = cJSON_AddArrayToObject(object, "runs");
    for (size_t r = 0; r < arguments->runs.count; r++) {
        cJSON_AddItemToArray(list, json_of_run(arguments->runs.items[r], &runs[r]));
    }
    int status = json_print_stdout(object, out_error);
    cJSON_Delete(object);
    return status;
}

static int write_page(const char *path, const struct frf *frf, struct error *out_error)
{
    struct atomic_file file;
    struct page page;
    FILE *stream = atomic_file_open(&file, path, out_error);
    if (!stream) {
        return error_refused;
    }
    page_start(&page, stream, "Frequency response", NULL);
    frf_report_section(&page, frf, NULL);
    page_end(&page, NULL);
    return atomic_file_commit(&file, out_error);
}

static int write_and_report(const struct arguments *arguments, const struct frf *frf, const struct summary *runs,
                            const struct command_context *context, struct error *out_error)
{
    int status = frf_write(arguments->out, frf, out_error);
    if (!status && arguments->report) {
        status = write_page(arguments->report, frf, out_error);
    }
    if (status) {
        return status;
    }
    if (context->json) {
        return print_json(arguments, frf, runs, out_error);
    }
    if (context->quiet) {
        return 0;
    }
    for (size_t r = 0; r < arguments->runs.count; r++) {
        print_run(arguments->runs.items[r], &runs[r]);
    }
    print_summary(arguments->out, frf);
    return 0;
}

static int estimate_all(const struct arguments *arguments, const struct periodic_options *options,
                        const struct estimate_method *method, struct frf *responses, struct summary *runs,
                        const struct command_context *context, struct error *out_error)
{
    int status = 0;
    for (size_t r = 0; r < arguments->runs.count && !status; r++) {
        status =
            estimate_run(arguments->runs.items[r], arguments, *options, method, &responses[r], &runs[r], out_error);
    }
    if (status) {
        return status;
    }
    if (arguments->runs.count == 1) {
        return write_and_report(arguments, &responses[0], runs, context, out_error);
    }
    struct frf average;
    status = estimate_average(responses, arguments->runs.count, &average, out_error);
    if (!status) {
        status = write_and_report(arguments, &average, runs, context, out_error);
        frf_free(&average);
    }
    return status;
}

static int run(int argc, char **argv, const struct command_context *context, struct error *out_error)
{
    struct arguments arguments = {.method = "mean"};
    struct periodic_options options;
    const struct estimate_method *method = NULL;
    int status = read_options(argc, argv, &arguments, out_error);
    status = status ? status : read_request(&arguments, &options, &method, out_error);
    const char *outputs[] = {arguments.out, arguments.report};
    status = status ? status : outputs_check(arguments.runs.items, arguments.runs.count, outputs, 2, out_error);
    if (status) {
        return status;
    }
    struct frf *responses = calloc(arguments.runs.count, sizeof *responses);
    struct summary *runs = calloc(arguments.runs.count, sizeof *runs);
    if (!responses || !runs) {
        status = error_set(out_error, error_refused, "memory is short");
    } else {
        status = estimate_all(&arguments, &options, method, responses, runs, context, out_error);
    }
    for (size_t r = 0; r < arguments.runs.count && responses; r++) {
        frf_free(&responses[r]);
    }
    free(responses);
    free(runs);
    return status;
}

const struct command command_cmd_frf = {
    .name = "frf",
    .summary = "frequency response of a periodic recording, with its standard deviation",
    .help = "servoscope frf: frequency response of a periodic recording, with its standard deviation\n"
            "\n"
            "usage: servoscope frf RUN.csv [more.csv] [options] --out FRF.csv\n"
            "\n"
            "  --method mean        mean over periods, variance from their scatter (default)\n"
            "  --method hann        Hann window over all periods: robust to what is left of a transient, 1.8 dB more "
            "noise\n"
            "  --settle S           leading periods to leave out; auto: found from the decay of the transient\n"
            "                       (default: the run's settle_periods, else auto)\n"
            "  --input COLUMN       default torque_Nm, else force_N, current_A, voltage_V\n"
            "  --output COLUMN      default velocity_rad_per_s, velocity_m_per_s, else position\n"
            "  --period SAMPLES     for a recording that does not say it (default: found by its repetition)\n"
            "  --lines SPEC         as for servoscope design, e.g. linear:1:100:1 (default: the run's excited_bins, "
            "else found\n"
            "                       by their power)\n"
            "  --map NAME=COLUMN[*SCALE],...  --rate HZ    for recordings of others\n"
            "  --out FRF.csv        frequency_hz,real,imag,std,noise_std,...,valid\n"
            "  --report FILE.html   a page: Bode diagram with its uncertainty\n"
            "\n"
            "Several runs are realisations: same lines, other phases. Their mean is the best linear approximation, std "
            "its total\n"
            "standard deviation (noise and nonlinear distortion), noise_std that of the noise alone.\n"
            "Periods with lost samples (valid = 0) do not count. 95 % of errors lie within confidence_95_factor times "
            "std, which\n"
            "is more than 2 for few periods. The response includes the hold: torque held between samples.\n"
            "\n"
            "example:\n"
            "  servoscope frf run.csv --out frf.csv\n",
    .run = run,
};
