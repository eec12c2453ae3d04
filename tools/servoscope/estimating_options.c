/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/estimating_options.h"

#include <math.h>
#include <string.h>

int estimating_options_read(int argc, char **argv, struct estimating_options *io_arguments, struct error *out_error)
{
    const struct option table[] = {
        {.name = "method", .kind = option_text, .target = &io_arguments->method},
        {.name = "settle", .kind = option_text, .target = &io_arguments->settle},
        {.name = "input", .kind = option_text, .target = &io_arguments->input},
        {.name = "output", .kind = option_text, .target = &io_arguments->output},
        {.name = "reference", .kind = option_text, .target = &io_arguments->reference},
        {.name = "lines", .kind = option_text, .target = &io_arguments->lines},
        {.name = "map", .kind = option_text, .target = &io_arguments->map},
        {.name = "rate", .kind = option_positive, .target = &io_arguments->rate_hz},
        {.name = "period",
         .kind = option_integer,
         .target = &io_arguments->period_samples,
         .lowest = 3,
         .highest = 1e9},
        {.name = "order", .kind = option_text, .target = &io_arguments->order},
        {.name = "half-width",
         .kind = option_integer,
         .target = &io_arguments->half_width,
         .lowest = 1,
         .highest = 1e6},
        {.name = "segment",
         .kind = option_integer,
         .target = &io_arguments->segment_samples,
         .lowest = 16,
         .highest = 1e9},
        {.name = "domain", .kind = option_text, .target = &io_arguments->domain},
        {.name = "delay-free", .kind = option_flag, .target = &io_arguments->delay_free},
        {.name = "model-out", .kind = option_text, .target = &io_arguments->model_out},
        {.name = "design", .kind = option_text, .target = &io_arguments->design},
        {.name = "hold", .kind = option_text, .target = &io_arguments->hold},
        {.name = "delay", .kind = option_number, .target = &io_arguments->delay_s, .highest = 1e6},
        {.name = "compare", .kind = option_list, .target = &io_arguments->compare},
        {.name = "out", .kind = option_text, .target = &io_arguments->out},
        {.name = "report", .kind = option_text, .target = &io_arguments->report},
    };
    const struct option_operands operands = {"RUN.csv", 1, option_values_max, &io_arguments->runs};
    return options_parse(argc, argv, table, sizeof table / sizeof table[0], &operands, out_error);
}

static int read_settle(const struct estimating_options *arguments, struct periodic_options *io_options,
                       struct error *out_error)
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

static int read_order(const struct estimating_options *arguments, struct estimate_options *io_options,
                      struct error *out_error)
{
    double order = estimate_order_auto;
    if (arguments->order && strcmp(arguments->order, "auto") != 0 &&
        (options_parse_number("--order", arguments->order, &order, NULL) ||
         !(order >= 0.0 && order <= estimate_order_max && order == floor(order)))) {
        return error_set(out_error, error_usage, "--order: '%s', expected a whole number from 0 to %d or auto",
                         arguments->order, estimate_order_max);
    }
    io_options->order = (int)order;
    return 0;
}

/// What would change nothing is refused, lest somebody believe that it did.
static int check_used(const struct estimating_options *arguments, struct error *out_error)
{
    const struct {
        const char *name;
        bool given;
        const char *methods;
    } options[] = {
        {"order", arguments->order != NULL, "lpm"},
        {"half-width", arguments->half_width > 0, "lpm"},
        {"segment", arguments->segment_samples > 0, "lpm, h1, indirect"},
        {"reference", arguments->reference != NULL, "lpm, h1, indirect"},
    };
    for (size_t i = 0; i < sizeof options / sizeof options[0]; i++) {
        if (options[i].given && !strstr(options[i].methods, arguments->method)) {
            return error_set(out_error, error_usage, "--%s is for --method %s, not %s", options[i].name,
                             options[i].methods, arguments->method);
        }
    }
    return 0;
}

/// What is for method parametric alone.
static int read_parametric(const struct estimating_options *arguments, enum setup_hold hold,
                           struct estimate_options *io_options, struct error *out_error)
{
    const char *given = arguments->domain       ? "domain"
                        : arguments->delay_free ? "delay-free"
                        : arguments->model_out  ? "model-out"
                                                : NULL;
    if (given && strcmp(arguments->method, "parametric") != 0) {
        return error_set(out_error, error_usage, "--%s is for --method parametric, not %s", given, arguments->method);
    }
    const char *usual = hold == setup_zoh ? "discrete" : "continuous";
    const char *domain = arguments->domain ? arguments->domain : usual;
    if (strcmp(domain, "discrete") != 0 && strcmp(domain, "continuous") != 0) {
        return error_set(out_error, error_usage, "--domain: '%s', expected discrete or continuous", domain);
    }
    io_options->continuous = strcmp(domain, "continuous") == 0;
    io_options->held = hold == setup_zoh;
    io_options->delay_free = arguments->delay_free;
    return 0;
}

int estimating_request_make(const struct estimating_options *arguments, struct estimating_request *out_request,
                            struct error *out_error)
{
    *out_request = (struct estimating_request){
        .method = estimate_method_find(arguments->method, out_error),
        .cut = {.input = arguments->input,
                .output = arguments->output,
                .reference = arguments->reference,
                .period_samples = (size_t)arguments->period_samples},
        .tuning = {.half_width = (size_t)arguments->half_width, .segment_samples = (size_t)arguments->segment_samples},
    };
    if (!out_request->method) {
        return error_usage;
    }
    out_request->cut.settle = out_request->method->models_transient ? periodic_settle_keep : periodic_settle_default;
    int status = arguments->hold ? setup_hold_parse(arguments->hold, &out_request->hold, out_error) : 0;
    status = status ? status : check_used(arguments, out_error);
    status = status ? status : read_order(arguments, &out_request->tuning, out_error);
    status = status ? status : read_parametric(arguments, out_request->hold, &out_request->tuning, out_error);
    return status ? status : read_settle(arguments, &out_request->cut, out_error);
}

int estimating_options_lines(const struct estimating_options *arguments, const struct run *run,
                             struct periodic_options *io_cut, struct design_lines *out_lines, struct error *out_error)
{
    *out_lines = (struct design_lines){0};
    if (!arguments->lines) {
        return 0;
    }
    const struct design_line_grid grid = {
        .rate_hz = run->sample_rate_hz,
        .period_samples = io_cut->period_samples ? io_cut->period_samples : run->period_samples,
    };
    if (grid.period_samples == 0) {
        return error_set(out_error, error_usage, "--lines: %s does not say its period, give --period SAMPLES too",
                         run->path);
    }
    int status = design_lines_parse(arguments->lines, &grid, 1, out_lines, out_error);
    io_cut->bins = out_lines->bins;
    io_cut->bin_count = out_lines->count;
    return status;
}
