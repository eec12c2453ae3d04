/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/design_options.h"

#include "lab/record/table_file.h"
#include "tools/servoscope/options.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const double rate_min_hz = 1e-3;
static const double rate_max_hz = 4e6;

int design_options_read(int argc, char **argv, struct design_options *out, struct error *out_error)
{
    *out = (struct design_options){
        .grid = "continuous",
        .start = "paper",
        .mode = "cascade",
        .amplitude = "constraint",
        .seed = 1,
        .inputs = 1,
        .periods = 10,
        .settle_time_s = NAN,
        .nats = 20,
    };
    const struct option options[] = {
        {.name = "rate", .kind = option_text, .target = &out->rate, .required = true},
        {.name = "period",
         .kind = option_integer,
         .target = &out->period_samples,
         .required = true,
         .lowest = 4,
         .highest = design_period_samples_max},
        {.name = "lines", .kind = option_text, .target = &out->lines, .required = true},
        {.name = "out", .kind = option_text, .target = &out->out, .required = true},
        {.name = "report", .kind = option_text, .target = &out->report},
        {.name = "dft-header", .kind = option_text, .target = &out->dft_header},
        {.name = "method", .kind = option_text, .target = &out->method},
        {.name = "keep", .kind = option_text, .target = &out->keep},
        {.name = "grid", .kind = option_text, .target = &out->grid},
        {.name = "start", .kind = option_text, .target = &out->start},
        {.name = "mode", .kind = option_text, .target = &out->mode},
        {.name = "amplitude", .kind = option_text, .target = &out->amplitude},
        {.name = "amplitude-tolerance",
         .kind = option_number,
         .target = &out->amplitude_tolerance_db,
         .lowest = 0,
         .highest = 20},
        {.name = "iterations", .kind = option_integer, .target = &out->iterations, .lowest = 1, .highest = 1e7},
        {.name = "starts", .kind = option_integer, .target = &out->starts, .lowest = 1, .highest = 1e6},
        {.name = "time-budget", .kind = option_positive, .target = &out->time_budget_s},
        {.name = "threads", .kind = option_integer, .target = &out->threads, .lowest = 1, .highest = 256},
        {.name = "seed", .kind = option_integer, .target = &out->seed, .lowest = 0, .highest = 9.2e18},
        {.name = "limit-position", .kind = option_positive, .target = &out->rotary.position_rad},
        {.name = "limit-velocity", .kind = option_positive, .target = &out->rotary.velocity_rad_per_s},
        {.name = "limit-acceleration", .kind = option_positive, .target = &out->rotary.acceleration_rad_per_s2},
        {.name = "limit-torque", .kind = option_positive, .target = &out->rotary.torque_Nm},
        {.name = "inertia", .kind = option_positive, .target = &out->inertia_kgm2},
        {.name = "limit-position-m", .kind = option_positive, .target = &out->position_limit_m},
        {.name = "limit-velocity-m-per-s", .kind = option_positive, .target = &out->velocity_limit_m_per_s},
        {.name = "limit-acceleration-m-per-s2", .kind = option_positive, .target = &out->acceleration_limit_m_per_s2},
        {.name = "limit-force-n", .kind = option_positive, .target = &out->force_limit_N},
        {.name = "mass", .kind = option_positive, .target = &out->mass_kg},
        {.name = "pulley-radius", .kind = option_positive, .target = &out->pulley_radius_m},
        {.name = "minimum-effective", .kind = option_positive, .target = &out->minimum_effective},
        {.name = "stroke", .kind = option_text, .target = &out->stroke},
        {.name = "stroke-m", .kind = option_text, .target = &out->stroke_m},
        {.name = "bias-velocity", .kind = option_number, .target = &out->bias_velocity_rad_per_s},
        {.name = "bias-velocity-m-per-s", .kind = option_number, .target = &out->bias_velocity_m_per_s},
        {.name = "inputs", .kind = option_integer, .target = &out->inputs, .lowest = 1, .highest = 16},
        {.name = "periods", .kind = option_integer, .target = &out->periods, .lowest = 1, .highest = 1e9},
        {.name = "settle-time", .kind = option_number, .target = &out->settle_time_s, .lowest = 0, .highest = 1e9},
        {.name = "predict", .kind = option_text, .target = &out->predict},
        {.name = "separate", .kind = option_text, .target = &out->separate},
        {.name = "model", .kind = option_text, .target = &out->model},
        {.name = "nats", .kind = option_positive, .target = &out->nats},
    };
    return options_parse(argc, argv, options, sizeof options / sizeof options[0], NULL, out_error);
}

/// Reads "1000", "2.5e3" or "8000/3" as a fraction of whole numbers, which is what a table carries.
static int read_rate(const char *text, struct design_request *request, struct error *out_error)
{
    struct table table = {0};
    char numerator_text[64] = "";
    double numerator = 0;
    double denominator = 1;
    const char *slash = strchr(text, '/');
    snprintf(numerator_text, sizeof numerator_text, "%.*s", slash ? (int)(slash - text) : 63, text);
    if (options_parse_number("--rate", numerator_text, &numerator, NULL) ||
        (slash && options_parse_number("--rate", slash + 1, &denominator, NULL))) {
        return error_set(out_error, error_usage, "--rate: '%s' is not a number, expected HZ or a fraction, 8000/3",
                         text);
    }
    double rate_hz = numerator / denominator;
    if (!(numerator > 0 && denominator > 0 && rate_hz >= rate_min_hz && rate_hz <= rate_max_hz)) {
        return error_set(out_error, error_usage, "--rate: '%s', expected %g to %g Hz", text, rate_min_hz, rate_max_hz);
    }
    if (table_set_rate(&table, rate_hz, out_error)) {
        return error_usage;
    }
    request->rate_num_hz = table.rate_num_hz;
    request->rate_den = table.rate_den;
    return 0;
}

/// Both limits hold if both are given; 0 is absent.
static double tighter(double a, double b)
{
    if (a > 0 && b > 0) {
        return fmin(a, b);
    }
    return a > 0 ? a : b;
}

static bool any_rotary(const struct design_options *options)
{
    const struct design_limits *rotary = &options->rotary;
    return rotary->position_rad > 0 || rotary->velocity_rad_per_s > 0 || rotary->acceleration_rad_per_s2 > 0 ||
           rotary->torque_Nm > 0 || options->inertia_kgm2 > 0;
}

static bool any_linear(const struct design_options *options)
{
    return options->position_limit_m > 0 || options->velocity_limit_m_per_s > 0 ||
           options->acceleration_limit_m_per_s2 > 0 || options->force_limit_N > 0 || options->mass_kg > 0;
}

/// Brings all limits to one kind of axis: rotary through the pulley, or all as they are.
static int resolve_axis(const struct design_options *options, struct design_request *request, struct error *out_error)
{
    const bool pulley = options->pulley_radius_m > 0;
    if (any_rotary(options) && any_linear(options) && !pulley) {
        return error_set(out_error, error_usage,
                         "rotary and linear limits are mixed; give --pulley-radius M to convert the linear ones");
    }
    const double radius = pulley ? options->pulley_radius_m : 1;
    const struct design_limits *rotary = &options->rotary;
    request->linear = any_linear(options) && !pulley;
    request->limits = (struct design_limits){
        .position_rad = tighter(rotary->position_rad, options->position_limit_m / radius),
        .velocity_rad_per_s = tighter(rotary->velocity_rad_per_s, options->velocity_limit_m_per_s / radius),
        .acceleration_rad_per_s2 =
            tighter(rotary->acceleration_rad_per_s2, options->acceleration_limit_m_per_s2 / radius),
        .torque_Nm = tighter(rotary->torque_Nm, options->force_limit_N * radius),
    };
    if (options->inertia_kgm2 > 0 && options->mass_kg > 0) {
        return error_set(out_error, error_usage,
                         "--inertia and --mass are both given, expected one: all that is moved");
    }
    request->inertia_kgm2 = options->inertia_kgm2 > 0 ? options->inertia_kgm2 : options->mass_kg * radius * radius;
    if (!(request->inertia_kgm2 > 0)) {
        return error_set(out_error, error_usage, "%s is missing: the table's %s",
                         request->linear ? "--mass" : "--inertia",
                         request->linear ? "force is mass times acceleration" : "torque is inertia times acceleration");
    }
    return 0;
}

/// Finds a word in a NULL-terminated list; its place, or -1 with the list in the message.
static int find_word(const char *option, const char *word, const char *const *words, struct error *out_error)
{
    char expected[200] = "";
    for (int i = 0; words[i]; i++) {
        if (strcmp(words[i], word) == 0) {
            return i;
        }
        strncat(expected, i > 0 ? " or " : "", sizeof expected - strlen(expected) - 1);
        strncat(expected, words[i], sizeof expected - strlen(expected) - 1);
    }
    error_set(out_error, error_usage, "--%s: '%s', expected %s", option, word, expected);
    return -1;
}

/// Options that belong to one method alone.
static int check_method_options(const struct design_options *options, struct error *out_error)
{
    const char *method = options->method ? options->method : "fast";
    const bool fast = strcmp(method, "fast") == 0;
    if (options->keep && strcmp(method, "clip") != 0) {
        return error_set(out_error, error_usage, "--keep: '%s' is for --method clip, not %s", options->keep, method);
    }
    if (options->starts > 1 && !fast) {
        return error_set(out_error, error_usage, "--starts: %lld is for --method fast, not %s", options->starts,
                         method);
    }
    if (options->time_budget_s > 0 && !fast) {
        return error_set(out_error, error_usage, "--time-budget: %g is for --method fast, not %s",
                         options->time_budget_s, method);
    }
    if (options->amplitude_tolerance_db > 0 && !fast) {
        return error_set(out_error, error_usage, "--amplitude-tolerance: %g is for --method fast, not %s",
                         options->amplitude_tolerance_db, method);
    }
    return 0;
}

static int read_start(const struct design_options *options, struct design_request *request, struct error *out_error)
{
    static const char *const starts[] = {"paper", "none", "bank", "model:FILE", NULL};
    if (strncmp(options->start, "model:", 6) == 0 && options->start[6] != '\0') {
        request->start = design_start_model;
        return 0;
    }
    int start = find_word("start", options->start, starts, out_error);
    if (start < 0 || start == 3) {
        return start < 0
                   ? error_usage
                   : error_set(out_error, error_usage, "--start: 'model:FILE', expected the name of a model file");
    }
    static const enum design_start meaning[] = {design_start_paper, design_start_none, design_start_bank};
    request->start = meaning[start];
    return 0;
}

static int read_choices(const struct design_options *options, struct design_request *request, struct error *out_error)
{
    static const char *const grids[] = {"continuous", "samples", NULL};
    static const char *const keeps[] = {"all", "acceleration", NULL};
    static const char *const modes[] = {"cascade", "torque", NULL};
    int grid = find_word("grid", options->grid, grids, out_error);
    int keep = grid < 0 ? -1 : find_word("keep", options->keep ? options->keep : "all", keeps, out_error);
    int mode = keep < 0 ? -1 : find_word("mode", options->mode, modes, out_error);
    if (mode < 0 || check_method_options(options, out_error)) {
        return error_usage;
    }
    request->grid = grid == 0 ? design_grid_continuous : design_grid_samples;
    request->keep = keep == 0 ? design_keep_all : design_keep_acceleration;
    request->torque_mode = mode == 1;
    return read_start(options, request, out_error);
}

int design_options_resolve(const struct design_options *options, struct design_request *out_request,
                           struct error *out_error)
{
    *out_request = (struct design_request){
        .period_samples = (size_t)options->period_samples,
        .method = options->method,
        .amplitude_tolerance_db = options->amplitude_tolerance_db,
        .iterations = (size_t)options->iterations,
        .starts = (size_t)options->starts,
        .time_budget_s = options->time_budget_s,
        .threads = (size_t)options->threads,
        .seed = (uint64_t)options->seed,
    };
    int status = read_rate(options->rate, out_request, out_error);
    status = status ? status : read_choices(options, out_request, out_error);
    return status ? status : resolve_axis(options, out_request, out_error);
}

/// The factor that brings a length of the option's unit to the axis': linear options of a rotary axis need the pulley.
static int length_factor(const char *option, bool option_is_linear, const struct design_options *options,
                         const struct design_request *request, double *out_factor, struct error *out_error)
{
    *out_factor = 1;
    if (option_is_linear == request->linear) {
        return 0;
    }
    if (option_is_linear && options->pulley_radius_m > 0) {
        *out_factor = 1 / options->pulley_radius_m;
        return 0;
    }
    return error_set(out_error, error_usage, "--%s is of a %s axis, the limits are of a %s one", option,
                     option_is_linear ? "linear" : "rotary", request->linear ? "linear" : "rotary");
}

/// Reads "LENGTH:PERIODS".
static int read_stroke(const char *option, const char *text, double factor, struct design_offset *out_offset,
                       struct error *out_error)
{
    char length_text[64] = "";
    char what[32];
    double length = 0;
    double periods = 0;
    const char *colon = strchr(text, ':');
    snprintf(what, sizeof what, "--%s", option);
    snprintf(length_text, sizeof length_text, "%.*s", colon ? (int)(colon - text) : 63, text);
    if (!colon || options_parse_number(what, length_text, &length, NULL) ||
        options_parse_number(what, colon + 1, &periods, NULL) || !(length > 0) ||
        !(periods >= 2 && periods <= 1e6 && periods == floor(periods))) {
        return error_set(out_error, error_usage,
                         "%s: '%s', expected AMPLITUDE:PERIODS, a positive amplitude and a whole number of at least 2 "
                         "periods of the multisine, as in 0.5:8",
                         what, text);
    }
    out_offset->stroke_rad = length * factor;
    out_offset->stroke_periods = (size_t)periods;
    return 0;
}

int design_options_offset(const struct design_options *options, const struct design_request *request,
                          struct design_offset *out_offset, struct error *out_error)
{
    *out_offset = (struct design_offset){0};
    if (options->stroke && options->stroke_m) {
        return error_set(out_error, error_usage, "--stroke and --stroke-m are both given, expected one");
    }
    const bool linear_stroke = options->stroke_m != NULL;
    const char *stroke = linear_stroke ? options->stroke_m : options->stroke;
    const char *name = linear_stroke ? "stroke-m" : "stroke";
    double factor = 1;
    int status = 0;
    if (stroke) {
        status = length_factor(name, linear_stroke, options, request, &factor, out_error);
        status = status ? status : read_stroke(name, stroke, factor, out_offset, out_error);
    }
    const bool linear_speed = fabs(options->bias_velocity_m_per_s) > 0;
    const double speed = linear_speed ? options->bias_velocity_m_per_s : options->bias_velocity_rad_per_s;
    if (!status && fabs(speed) > 0) {
        status = length_factor(linear_speed ? "bias-velocity-m-per-s" : "bias-velocity", linear_speed, options, request,
                               &factor, out_error);
        out_offset->bias_velocity_rad_per_s = speed * factor;
    }
    return status;
}
