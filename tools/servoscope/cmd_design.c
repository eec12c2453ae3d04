/* SPDX-License-Identifier: MIT */
/// servoscope design: from the limits of an axis to the table that a drive plays.
#include "tools/servoscope/command.h"
#include "tools/servoscope/designing.h"
#include "tools/servoscope/options.h"
#include "tools/servoscope/outputs.h"

#include "lab/design/design.h"
#include "lab/design/lines.h"
#include "lab/record/json_out.h"
#include "lab/record/table_file.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double rate_min_hz = 1e-3;
static const double rate_max_hz = 4e6;

/// What the options say, before it is understood.
struct arguments {
    const char *rate;
    long long period_samples;
    const char *lines;
    const char *out;
    const char *report;
    const char *method;
    const char *keep;
    const char *grid;
    const char *start;
    long long iterations;
    long long starts;
    long long seed;
    struct design_limits rotary;
    double inertia_kgm2;
    double position_limit_m;
    double velocity_limit_m_per_s;
    double acceleration_limit_m_per_s2;
    double force_limit_N;
    double mass_kg;
    double pulley_radius_m;
};

static int read_options(int argc, char **argv, struct arguments *out, struct error *out_error)
{
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
        {.name = "method", .kind = option_text, .target = &out->method},
        {.name = "keep", .kind = option_text, .target = &out->keep},
        {.name = "grid", .kind = option_text, .target = &out->grid},
        {.name = "start", .kind = option_text, .target = &out->start},
        {.name = "iterations", .kind = option_integer, .target = &out->iterations, .lowest = 1, .highest = 1e7},
        {.name = "starts", .kind = option_integer, .target = &out->starts, .lowest = 1, .highest = 1e6},
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
    int status = options_parse_number("--rate", numerator_text, &numerator, out_error);
    if (!status && slash) {
        status = options_parse_number("--rate", slash + 1, &denominator, out_error);
    }
    if (status) {
        return status;
    }
    double rate_hz = numerator / denominator;
    if (!(numerator > 0 && denominator > 0 && rate_hz >= rate_min_hz && rate_hz <= rate_max_hz)) {
        return error_set(out_error, error_usage, "--rate: '%s', expected %g to %g Hz", text, rate_min_hz, rate_max_hz);
    }
    if (table_set_rate(&table, rate_hz, out_error)) {
        return error_usage;
    }
    request->rate_numerator_hz = table.rate_num_hz;
    request->rate_denominator = table.rate_den;
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

static bool any_rotary(const struct arguments *arguments)
{
    const struct design_limits *rotary = &arguments->rotary;
    return rotary->position_rad > 0 || rotary->velocity_rad_per_s > 0 || rotary->acceleration_rad_per_s2 > 0 ||
           rotary->torque_Nm > 0 || arguments->inertia_kgm2 > 0;
}

static bool any_linear(const struct arguments *arguments)
{
    return arguments->position_limit_m > 0 || arguments->velocity_limit_m_per_s > 0 ||
           arguments->acceleration_limit_m_per_s2 > 0 || arguments->force_limit_N > 0 || arguments->mass_kg > 0;
}

/// Brings all limits to one kind of axis: rotary through the pulley, or all as they are.
static int resolve_axis(const struct arguments *arguments, struct design_request *request, struct error *out_error)
{
    const bool pulley = arguments->pulley_radius_m > 0;
    if (any_rotary(arguments) && any_linear(arguments) && !pulley) {
        return error_set(out_error, error_usage,
                         "rotary and linear limits are mixed; give --pulley-radius M to convert the linear ones");
    }
    const double radius = pulley ? arguments->pulley_radius_m : 1;
    const struct design_limits *rotary = &arguments->rotary;
    request->linear = any_linear(arguments) && !pulley;
    request->limits = (struct design_limits){
        .position_rad = tighter(rotary->position_rad, arguments->position_limit_m / radius),
        .velocity_rad_per_s = tighter(rotary->velocity_rad_per_s, arguments->velocity_limit_m_per_s / radius),
        .acceleration_rad_per_s2 =
            tighter(rotary->acceleration_rad_per_s2, arguments->acceleration_limit_m_per_s2 / radius),
        .torque_Nm = tighter(rotary->torque_Nm, arguments->force_limit_N * radius),
    };
    if (arguments->inertia_kgm2 > 0 && arguments->mass_kg > 0) {
        return error_set(out_error, error_usage,
                         "--inertia and --mass are both given, expected one: all that is moved");
    }
    request->inertia_kgm2 =
        arguments->inertia_kgm2 > 0 ? arguments->inertia_kgm2 : arguments->mass_kg * radius * radius;
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

static int read_choices(const struct arguments *arguments, struct design_request *request, struct error *out_error)
{
    static const char *const grids[] = {"continuous", "samples", NULL};
    static const char *const keeps[] = {"all", "acceleration", NULL};
    static const char *const starts[] = {"paper", "none", NULL};
    if (strcmp(arguments->start, "bank") == 0 || strncmp(arguments->start, "model:", 6) == 0) {
        return error_set(out_error, error_usage, "--start: '%s' is not available yet, expected paper or none",
                         arguments->start);
    }
    int grid = find_word("grid", arguments->grid, grids, out_error);
    int keep = grid < 0 ? -1 : find_word("keep", arguments->keep ? arguments->keep : "all", keeps, out_error);
    int start = keep < 0 ? -1 : find_word("start", arguments->start, starts, out_error);
    if (start < 0) {
        return error_usage;
    }
    if (arguments->keep && strcmp(arguments->method, "clip") != 0) {
        return error_set(out_error, error_usage, "--keep: '%s' is for --method clip, not %s", arguments->keep,
                         arguments->method);
    }
    if (arguments->starts > 1 && strcmp(arguments->method, "fast") != 0) {
        return error_set(out_error, error_usage, "--starts: %lld is for --method fast, not %s", arguments->starts,
                         arguments->method);
    }
    request->grid = grid == 0 ? design_grid_continuous : design_grid_samples;
    request->keep = keep == 0 ? design_keep_all : design_keep_acceleration;
    request->start = start == 0 ? design_start_paper : design_start_none;
    request->method = arguments->method;
    request->iterations = (size_t)arguments->iterations;
    request->starts = (size_t)arguments->starts;
    request->seed = (uint64_t)arguments->seed;
    return 0;
}

static cJSON *json_of_peaks(const struct design_peaks *peaks, bool linear)
{
    cJSON *object = cJSON_CreateObject();
    cJSON_AddNumberToObject(object, linear ? "position_m" : "position_rad", peaks->position_rad);
    cJSON_AddNumberToObject(object, linear ? "velocity_m_per_s" : "velocity_rad_per_s", peaks->velocity_rad_per_s);
    cJSON_AddNumberToObject(object, linear ? "acceleration_m_per_s2" : "acceleration_rad_per_s2",
                            peaks->acceleration_rad_per_s2);
    cJSON_AddNumberToObject(object, linear ? "force_N" : "torque_Nm", peaks->torque_Nm);
    return object;
}

static double period_seconds(const struct design_request *request)
{
    return (double)request->period_samples * request->rate_denominator / request->rate_numerator_hz;
}

static int print_json(const struct design_request *request, const struct design_result *result, struct error *out_error)
{
    const bool linear = request->linear;
    cJSON *object = cJSON_CreateObject();
    cJSON_AddStringToObject(object, "method", result->method);
    cJSON_AddNumberToObject(object, "lines", (double)result->bin_count);
    cJSON_AddNumberToObject(object, linear ? "effective_force_N" : "effective_torque_Nm", result->effective_torque_Nm);
    cJSON_AddNumberToObject(object, linear ? "effective_force_continuous_N" : "effective_torque_continuous_Nm",
                            result->effective_torque_continuous_Nm);
    cJSON_AddNumberToObject(object, "crest_factor", result->crest_factor);
    cJSON_AddItemToObject(object, "peak", json_of_peaks(&result->peak, linear));
    cJSON_AddItemToObject(object, "peak_continuous", json_of_peaks(&result->peak_continuous, linear));
    cJSON_AddNumberToObject(object, linear ? "bound_N" : "bound_Nm", result->bound_Nm);
    cJSON_AddNumberToObject(object, "start_index", (double)result->start_index);
    cJSON_AddNumberToObject(object, "cpu_s", result->cpu_s);
    cJSON_AddNumberToObject(object, "test_time_s", period_seconds(request));
    // Needs a plant and a noise level, which design is not given: not known is null, not zero.
    cJSON_AddNullToObject(object, "predicted_std");
    int status = json_print_stdout(object, out_error);
    cJSON_Delete(object);
    return status;
}

static void print_peak(const char *name, const char *unit, double at_samples, double between, double limit)
{
    printf("  %-13s %11.5g %11.5g %-7s", name, at_samples, between, unit);
    if (limit > 0) {
        printf(" limit %.5g", limit);
    }
    putchar('\n');
}

static void print_summary(const struct arguments *arguments, const struct design_request *request,
                          const struct design_result *result)
{
    const bool linear = request->linear;
    const char *unit = linear ? "N" : "Nm";
    const struct design_limits *limits = &request->limits;
    const struct design_peaks *peak = &result->peak;
    const struct design_peaks *fine = &result->peak_continuous;
    const double line_hz = 1 / period_seconds(request);
    printf("%s: %zu lines, %.6g to %.6g Hz, period %zu samples (%.6g s), start at sample %zu\n", result->method,
           result->bin_count, result->bins[0] * line_hz, result->bins[result->bin_count - 1] * line_hz,
           result->period_samples, period_seconds(request), result->start_index);
    printf("effective %s %.4f %s, crest factor %.3f; no phases give more than %.4f %s (reached: %.0f %%)\n",
           linear ? "force" : "torque", result->effective_torque_Nm, unit, result->crest_factor, result->bound_Nm, unit,
           100 * result->effective_torque_Nm / result->bound_Nm);
    if (result->effective_torque_continuous_Nm < result->effective_torque_Nm) {
        printf("between the samples a limit is exceeded; held there too, the effective value would be %.4f %s\n",
               result->effective_torque_continuous_Nm, unit);
    }
    printf("  peaks          at samples    in between\n");
    print_peak("position", linear ? "m" : "rad", peak->position_rad, fine->position_rad, limits->position_rad);
    print_peak("velocity", linear ? "m/s" : "rad/s", peak->velocity_rad_per_s, fine->velocity_rad_per_s,
               limits->velocity_rad_per_s);
    print_peak("acceleration", linear ? "m/s2" : "rad/s2", peak->acceleration_rad_per_s2, fine->acceleration_rad_per_s2,
               limits->acceleration_rad_per_s2);
    print_peak(linear ? "force" : "torque", unit, peak->torque_Nm, fine->torque_Nm, limits->torque_Nm);
    printf("written: %s.mst, %s.csv, %s.h\n", arguments->out, arguments->out, arguments->out);
}

static int report(const struct arguments *arguments, const struct design_request *request,
                  const struct design_result *result, const struct command_context *context, struct error *out_error)
{
    if (context->json) {
        return print_json(request, result, out_error);
    }
    if (!context->quiet) {
        print_summary(arguments, request, result);
    }
    return 0;
}

/// The three files of the prefix and the page, against the list of lines and against each other.
static int check_outputs(const struct arguments *arguments, struct error *out_error)
{
    static const char list[] = "list:";
    static const char *const endings[] = {".mst", ".csv", ".h"};
    enum { endings_count = 3 };
    const char *input =
        strncmp(arguments->lines, list, sizeof list - 1) == 0 ? arguments->lines + sizeof list - 1 : NULL;
    const char *outputs[endings_count + 1] = {NULL};
    char *names[endings_count];
    const size_t size = strlen(arguments->out) + sizeof ".mst";
    bool memory = true;
    for (size_t i = 0; i < endings_count; i++) {
        outputs[i] = names[i] = malloc(size);
        memory = memory && names[i];
        if (names[i]) {
            snprintf(names[i], size, "%s%s", arguments->out, endings[i]);
        }
    }
    outputs[endings_count] = arguments->report;
    int status = memory ? outputs_check(&input, 1, outputs, endings_count + 1, out_error)
                        : error_set(out_error, error_refused, "memory is short");
    for (size_t i = 0; i < endings_count; i++) {
        free(names[i]);
    }
    return status;
}

static int design_and_write(const struct arguments *arguments, struct design_request *request,
                            const struct command_context *context, struct error *out_error)
{
    struct design_lines lines;
    struct design_result result;
    const struct design_line_grid grid = {
        .rate_hz = (double)request->rate_numerator_hz / request->rate_denominator,
        .period_samples = request->period_samples,
    };
    int status = design_lines_parse(arguments->lines, &grid, request->seed, &lines, out_error);
    if (status) {
        return status;
    }
    request->bins = lines.bins;
    request->bin_count = lines.count;
    status = design_run(request, &result, out_error);
    if (!status) {
        status = designing_write(arguments->out, request, &result, out_error);
        if (!status && arguments->report) {
            status = designing_report(arguments->report, request, &result, out_error);
        }
        status = status ? status : report(arguments, request, &result, context, out_error);
        design_result_free(&result);
    }
    design_lines_free(&lines);
    return status;
}

static int run(int argc, char **argv, const struct command_context *context, struct error *out_error)
{
    struct arguments arguments = {.method = "fast", .grid = "continuous", .start = "paper", .seed = 1};
    struct design_request request = {0};
    int status = read_options(argc, argv, &arguments, out_error);
    status = status ? status : read_rate(arguments.rate, &request, out_error);
    status = status ? status : read_choices(&arguments, &request, out_error);
    status = status ? status : resolve_axis(&arguments, &request, out_error);
    status = status ? status : check_outputs(&arguments, out_error);
    if (status) {
        return status;
    }
    request.period_samples = (size_t)arguments.period_samples;
    return design_and_write(&arguments, &request, context, out_error);
}

const struct command command_cmd_design = {
    .name = "design",
    .summary = "multisine table within the limits of an axis, as strong as they allow",
    .help =
        "servoscope design: a multisine table within the limits of an axis, as strong as they allow\n"
        "\n"
        "usage: servoscope design --rate HZ --period SAMPLES --lines SPEC [limits] [options] --out PREFIX\n"
        "\n"
        "Writes PREFIX.mst (the table), PREFIX.csv (one period of torque, position, velocity, acceleration) and\n"
        "PREFIX.h (the table as C source).\n"
        "\n"
        "  --rate HZ            sample rate, also as a fraction: 8000/3\n"
        "  --period SAMPLES     samples in one period, 4 to 1048576; the lines lie on multiples of rate / period\n"
        "  --lines SPEC         linear:FMIN:FMAX:STEP      every STEP Hz\n"
        "                       odd:FMIN:FMAX:STEP         odd multiples of STEP\n"
        "                       random-odd:FMIN:FMAX:STEP  the same, one of four neighbours left out by --seed\n"
        "                       quasilog:FMIN:FMAX:RATIO   each line RATIO times the one before, on the grid\n"
        "                       list:FILE                  one frequency in Hz per line\n"
        "\n"
        "Limits; what is not given does not limit, one at least is needed, and the inertia (or mass) always is:\n"
        "  --limit-position RAD --limit-velocity RAD_PER_S --limit-acceleration RAD_PER_S2 --limit-torque NM\n"
        "  --inertia KGM2       everything that moves, seen from the motor\n"
        "  --limit-position-m M --limit-velocity-m-per-s V --limit-acceleration-m-per-s2 A --limit-force-n N\n"
        "  --mass KG            the same for a linear axis\n"
        "  --pulley-radius M    converts the linear ones to the motor's side; both kinds may then be given\n"
        "\n"
        "  --method METHOD      fast (default): projections, then p-norm descent\n"
        "                       mca: modified clipping; clip: standard clipping (--keep all or acceleration)\n"
        "                       newman, schroeder, random: phases by formula or by --seed, not optimised\n"
        "  --iterations I       of fast (projections), mca, clip; 400 if not given\n"
        "  --starts S           of fast: the first is always the same, further ones are drawn by --seed (default 1)\n"
        "  --grid continuous    limits hold at every instant, guaranteed (default)\n"
        "  --grid samples       limits hold at the samples of the table only\n"
        "  --start paper        begin at the zero crossing of velocity with the least acceleration (default)\n"
        "  --start none         begin at sample 0\n"
        "  --seed S             default 1\n"
        "  --report FILE.html   a page: the period against its limits, the spectrum, the figures\n"
        "\n"
        "example, the belt drive of the first paper:\n"
        "  servoscope design --rate 1000 --period 2000 --lines linear:0.5:100:0.5 --limit-torque 1 --inertia 0.00516 "
        "\\\n"
        "      --limit-velocity-m-per-s 0.05 --pulley-radius 0.0159 --out belt\n",
    .run = run,
};
