/* SPDX-License-Identifier: MIT */
/// servoscope design: from the limits of an axis to the table that a drive plays.
#include "tools/servoscope/command.h"
#include "tools/servoscope/design_options.h"
#include "tools/servoscope/designing.h"
#include "tools/servoscope/outputs.h"

#include "lab/design/design.h"
#include "lab/design/lines.h"
#include "lab/record/json_out.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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

static void print_summary(const struct design_options *options, const struct design_request *request,
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
    printf("written: %s.mst, %s.csv, %s.h\n", options->out, options->out, options->out);
}

static int report(const struct design_options *options, const struct design_request *request,
                  const struct design_result *result, const struct command_context *context, struct error *out_error)
{
    if (context->json) {
        return print_json(request, result, out_error);
    }
    if (!context->quiet) {
        print_summary(options, request, result);
    }
    return 0;
}

/// The three files of the prefix and the page, against the list of lines and against each other.
static int check_outputs(const struct design_options *options, struct error *out_error)
{
    static const char list[] = "list:";
    static const char *const endings[] = {".mst", ".csv", ".h"};
    enum { endings_count = 3 };
    const char *input = strncmp(options->lines, list, sizeof list - 1) == 0 ? options->lines + sizeof list - 1 : NULL;
    const char *outputs[endings_count + 1] = {NULL};
    char *names[endings_count];
    const size_t size = strlen(options->out) + sizeof ".mst";
    bool memory = true;
    for (size_t i = 0; i < endings_count; i++) {
        outputs[i] = names[i] = malloc(size);
        memory = memory && names[i];
        if (names[i]) {
            snprintf(names[i], size, "%s%s", options->out, endings[i]);
        }
    }
    outputs[endings_count] = options->report;
    int status = memory ? outputs_check(&input, 1, outputs, endings_count + 1, out_error)
                        : error_set(out_error, error_refused, "memory is short");
    for (size_t i = 0; i < endings_count; i++) {
        free(names[i]);
    }
    return status;
}

static int design_and_write(const struct design_options *options, struct design_request *request,
                            const struct command_context *context, struct error *out_error)
{
    struct design_lines lines;
    struct design_result result;
    const struct design_line_grid grid = {
        .rate_hz = (double)request->rate_numerator_hz / request->rate_denominator,
        .period_samples = request->period_samples,
    };
    int status = design_lines_parse(options->lines, &grid, request->seed, &lines, out_error);
    if (status) {
        return status;
    }
    request->bins = lines.bins;
    request->bin_count = lines.count;
    status = design_run(request, &result, out_error);
    if (!status) {
        status = designing_write(options->out, request, &result, out_error);
        if (!status && options->report) {
            status = designing_report(options->report, request, &result, out_error);
        }
        status = status ? status : report(options, request, &result, context, out_error);
        design_result_free(&result);
    }
    design_lines_free(&lines);
    return status;
}

static int run(int argc, char **argv, const struct command_context *context, struct error *out_error)
{
    struct design_options options;
    struct design_request request;
    int status = design_options_read(argc, argv, &options, out_error);
    status = status ? status : design_options_resolve(&options, &request, out_error);
    status = status ? status : check_outputs(&options, out_error);
    return status ? status : design_and_write(&options, &request, context, out_error);
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
