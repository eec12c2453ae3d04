/* SPDX-License-Identifier: MIT */
/// servoscope design: from the limits of an axis to the table that a drive plays.
#include "lab/design/amplitude.h"
#include "lab/design/design.h"
#include "lab/design/lines.h"
#include "lab/design/offset.h"
#include "lab/design/predict.h"
#include "lab/design/sequence.h"
#include "lab/record/dft_header.h"
#include "lab/record/json_out.h"
#include "lab/record/model_file.h"
#include "tools/servoscope/command.h"
#include "tools/servoscope/design_options.h"
#include "tools/servoscope/design_summary.h"
#include "tools/servoscope/designing.h"
#include "tools/servoscope/interrupt.h"
#include "tools/servoscope/outputs.h"
#include "tools/servoscope/separating.h"
#include "tools/servoscope/sequences.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/// Everything that one call works with.
struct work {
    const struct design_options *options;
    struct design_request request;
    struct design_limits limits; ///< as given; the request's are what an offset leaves of them
    struct design_offset offset;
    struct sim_model start_model;
    struct sim_model predict_model;
    struct separating separating; ///< with --separate
    const struct command_context *context;
    struct terminal_line line;
    unsigned dft_kinds; ///< with --dft-header
};

static void show_progress(void *context, double share_done, double effective)
{
    struct work *self = context;
    terminal_line_show(&self->line, share_done, "%.4f %s", effective, self->request.linear ? "N" : "Nm");
}

/// A model has to be of the kind of axis that is designed for.
static int read_model(const char *option, const char *path, const struct design_request *request,
                      struct sim_model *out_model, struct error *out_error)
{
    int status = model_file_read(path, out_model, out_error);
    if (!status && out_model->linear != request->linear) {
        status = error_set(out_error, error_refused, "--%s: %s is of a %s axis, the limits are of a %s one", option,
                           path, out_model->linear ? "linear" : "rotary", request->linear ? "linear" : "rotary");
    }
    return status;
}

static int read_models(struct work *self, struct error *out_error)
{
    const struct design_options *options = self->options;
    int status = 0;
    if (self->request.start == design_start_model) {
        status = read_model("start", options->start + strlen("model:"), &self->request, &self->start_model, out_error);
        self->request.start_model = &self->start_model;
    }
    if (!status && options->predict) {
        status = read_model("predict", options->predict, &self->request, &self->predict_model, out_error);
    }
    return status;
}

/// The files of the prefix and the page, against the list of lines and against each other.
static int check_outputs(const struct design_options *options, struct error *out_error)
{
    static const char list[] = "list:";
    static const char *const endings[] = {".mst", ".csv", ".h", "-dft.h"};
    enum { endings_count = 4 };
    const char *input = strncmp(options->lines, list, sizeof list - 1) == 0 ? options->lines + sizeof list - 1 : NULL;
    const char *outputs[endings_count + 1] = {NULL};
    char *names[endings_count];
    const size_t size = strlen(options->out) + sizeof "-dft.h";
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

static double table_period_s(const struct work *self, size_t period_samples)
{
    return (double)period_samples * self->request.rate_den / self->request.rate_num_hz;
}

static double settle_time_s(const struct work *self, size_t period_samples)
{
    return isnan(self->options->settle_time_s) ? table_period_s(self, period_samples) : self->options->settle_time_s;
}

/// The periods of the table that will be played: settling ones are whole.
static size_t played_periods(const struct work *self, size_t period_samples)
{
    double settle_periods = ceil(settle_time_s(self, period_samples) / table_period_s(self, period_samples) - 1e-9);
    return (size_t)self->options->periods + (size_t)settle_periods;
}

static int check_minimum(void *context, const struct design_request *request, const struct design_result *result,
                         struct error *out_error)
{
    const struct work *self = context;
    const double least = self->options->minimum_effective;
    if (least > 0 && result->effective_torque_Nm < least) {
        const char *unit = request->linear ? "N" : "Nm";
        return error_set(out_error, error_refused,
                         "--minimum-effective: the limits allow %.6g %s with %s, expected at least %.6g %s: relax a "
                         "limit or excite fewer lines; nothing was written",
                         result->effective_torque_Nm, unit, result->method, least, unit);
    }
    return 0;
}

static int predict(const struct work *self, const struct design_result *result, double **out_std,
                   struct error *out_error)
{
    if (!self->options->predict) {
        return 0;
    }
    const struct design_predict_plan plan = {
        .periods = (size_t)self->options->periods,
        .torque_mode = self->request.torque_mode,
    };
    *out_std = calloc(result->bin_count, sizeof **out_std);
    if (!*out_std) {
        return error_set(out_error, error_refused, "memory is short for the prediction");
    }
    return design_predict_std(&self->predict_model, &self->request, result, &plan, *out_std, out_error);
}

/// An unfinished search is told like an unfinished diagnosis: what there is was written, and the exit status is 1.
static int interrupted(struct error *out_error)
{
    return error_set(out_error, error_refused, "interrupted: the best so far was written, the search was not finished");
}

/// PREFIX-dft.h, for the firmware that measures with this table.
static int write_dft_header(const struct work *self, const struct design_result *result, struct error *out_error)
{
    const size_t size = strlen(self->options->out) + sizeof "-dft.h";
    if (self->dft_kinds == 0) {
        return 0;
    }
    char *path = malloc(size);
    if (!path) {
        return error_set(out_error, error_refused, "memory is short for the file names");
    }
    snprintf(path, size, "%s-dft.h", self->options->out);
    int status = dft_header_write(path, result->bins, (uint32_t)result->bin_count, (uint32_t)result->period_samples,
                                  self->dft_kinds, out_error);
    free(path);
    return status;
}

static int deliver(const struct work *self, const struct design_request *played, const struct design_result *result,
                   const double *predicted_std, struct error *out_error)
{
    const struct design_options *options = self->options;
    const struct design_summary summary = {
        .prefix = options->out,
        .request = played,
        .result = result,
        .test_time_s = (double)options->periods * table_period_s(self, result->period_samples) +
                       settle_time_s(self, result->period_samples),
        .predicted_std = predicted_std,
    };
    int status = write_dft_header(self, result, out_error);
    status = status ? status : designing_write(options->out, played, result, out_error);
    if (!status && options->report) {
        status = designing_report(options->report, options->out, played, result, out_error);
    }
    if (!status && self->context->json) {
        cJSON *object = design_summary_json(&summary);
        status = json_print_stdout(object, out_error);
        cJSON_Delete(object);
    } else if (!status && !self->context->quiet) {
        design_summary_print(&summary);
    }
    return !status && result->interrupted ? interrupted(out_error) : status;
}

/// From the request, its lines and amplitudes set, to the files.
static int design_one(struct work *self, struct error *out_error)
{
    struct design_result result;
    double *predicted_std = NULL;
    int status = design_offset_reduce(&self->offset, &self->request, &self->request.limits, out_error);
    status = status ? status : design_run(&self->request, &result, out_error);
    terminal_line_clear(&self->line);
    if (status) {
        return status;
    }
    struct design_request played = self->request;
    played.limits = self->limits;
    status = check_minimum(self, &played, &result, out_error);
    status = status ? status : design_offset_add(&self->offset, &played, &result, out_error);
    status = status ? status : predict(self, &result, &predicted_std, out_error);
    status = status ? status : deliver(self, &played, &result, predicted_std, out_error);
    free(predicted_std);
    design_result_free(&result);
    return status;
}

static int design_multisine(struct work *self, struct error *out_error)
{
    struct design_request *request = &self->request;
    struct design_lines lines;
    double *shape = NULL;
    const struct design_line_grid grid = {
        .rate_hz = (double)request->rate_num_hz / request->rate_den,
        .period_samples = request->period_samples,
    };
    const bool separate = self->options->separate != NULL;
    int status = separate ? 0 : check_outputs(self->options, out_error); // it has names of its own
    status = status ? status : design_lines_parse(self->options->lines, &grid, request->seed, &lines, out_error);
    if (status) {
        return status;
    }
    request->bins = lines.bins;
    request->bin_count = lines.count;
    status = design_amplitude_shape(self->options->amplitude, request, &shape, out_error);
    request->torque_shape = shape;
    if (!status)
        status = separate ? separating_run(&self->separating, out_error) : design_one(self, out_error);
    free(shape);
    design_lines_free(&lines);
    return status;
}

static cJSON *describe(void *context, const char *prefix, const struct design_request *request,
                       const struct design_result *result, double test_time_s)
{
    (void)context;
    const struct design_summary summary = {
        .prefix = prefix,
        .request = request,
        .result = result,
        .test_time_s = test_time_s,
    };
    return design_summary_json(&summary);
}

/// What makes sense for one table only.
static int check_sequence_options(const struct design_options *options, struct error *out_error)
{
    const char *refused = options->predict                       ? "predict"
                          : options->dft_header                  ? "dft-header"
                          : options->stroke || options->stroke_m ? "stroke"
                          : fabs(options->bias_velocity_rad_per_s) > 0 || fabs(options->bias_velocity_m_per_s) > 0
                              ? "bias-velocity"
                              : NULL;
    return refused ? error_set(out_error, error_usage, "--%s is for a single table, not for a sequence of them (%s)",
                               refused, options->lines)
                   : 0;
}

static int design_sequence(struct work *self, struct error *out_error)
{
    const struct design_options *options = self->options;
    const struct sequences_request request = {
        .specification = options->lines,
        .inputs = (size_t)options->inputs,
        .periods = (uint64_t)options->periods,
        .settle_time_s = options->settle_time_s,
        .amplitude = options->amplitude,
        .prefix = options->out,
        .report = options->report,
        .design = &self->request,
        .judge = check_minimum,
        .describe = describe,
        .context = self,
    };
    struct sequences_summary summary = {0};
    int status = check_sequence_options(options, out_error);
    status = status ? status : sequences_design_and_write(&request, &summary, out_error);
    terminal_line_clear(&self->line);
    if (!status && self->context->json) {
        cJSON *object = sequences_json(&summary);
        status = json_print_stdout(object, out_error);
        cJSON_Delete(object);
    } else if (!status && !self->context->quiet) {
        sequences_print(&request, &summary);
    }
    status = !status && summary.interrupted ? interrupted(out_error) : status;
    sequences_summary_free(&summary);
    return status;
}

static int run(int argc, char **argv, const struct command_context *context, struct error *out_error)
{
    struct design_options options;
    struct work work = {.options = &options, .context = context};
    int status = design_options_read(argc, argv, &options, out_error);
    status = status ? status : design_options_resolve(&options, &work.request, out_error);
    status = status ? status : design_options_offset(&options, &work.request, &work.offset, out_error);
    if (!status && options.dft_header) {
        status = dft_header_parse("--dft-header", options.dft_header, &work.dft_kinds, out_error);
    }
    status = status ? status : read_models(&work, out_error);
    if (!status && (options.separate || options.model)) {
        status = separating_prepare(&options, &work.request, &work.separating, out_error);
        work.separating.offset = &work.offset;
        work.separating.context = context;
    }
    if (status) {
        return status;
    }
    struct interrupt signals;
    work.limits = work.request.limits;
    const size_t stroke_periods = work.offset.stroke_periods > 0 ? work.offset.stroke_periods : 1;
    work.offset.played_periods = played_periods(&work, stroke_periods * work.request.period_samples);
    work.request.stop_requested = interrupt_flag();
    work.request.progress = show_progress;
    work.request.progress_context = &work;
    terminal_line_start(&work.line, context);
    interrupt_catch(&signals, true);
    // With several inputs any specification makes a sequence.
    const bool sequence = options.inputs > 1 || design_sequence_is(options.lines);
    status = sequence ? design_sequence(&work, out_error) : design_multisine(&work, out_error);
    interrupt_release(&signals);
    return status;
}

const struct command command_cmd_design = {
    .name = "design",
    .summary = "multisine table within the limits of an axis, as strong as they allow",
    .help = "servoscope design: a multisine table within the limits of an axis, as strong as they allow\n"
            "\n"
            "usage: servoscope design --rate HZ --period SAMPLES --lines SPEC [limits] [options] --out PREFIX\n"
            "\n"
            "Writes PREFIX.mst (the table), PREFIX.csv (one period) and PREFIX.h (the table as C source); a sequence\n"
            "PREFIX-1, PREFIX-2, ... and PREFIX.json, which measure and simulate take as --table.\n"
            "\n"
            "  --rate HZ            also as a fraction: 8000/3\n"
            "  --period SAMPLES     4 to 1048576; lines lie on multiples of rate / period\n"
            "  --lines SPEC         linear:FMIN:FMAX:STEP      every STEP Hz\n"
            "                       odd:FMIN:FMAX:STEP         odd multiples of STEP\n"
            "                       random-odd:FMIN:FMAX:STEP  the same, one of four left out by --seed\n"
            "                       quasilog:FMIN:FMAX:RATIO   each line RATIO times the one before\n"
            "                       list:FILE                  one frequency in Hz per line\n"
            "                       octaves:FMIN:FMAX:STEP     a sequence of multisines, one per octave\n"
            "                       dwell:FMIN:FMAX:STEP       a sequence of sines\n"
            "  --inputs P           inputs at once, each on its own lines (default 1)\n"
            "\n"
            "Limits; what is not given does not limit, one at least is needed, and the inertia (or mass) always is:\n"
            "  --limit-position RAD --limit-velocity RAD_PER_S --limit-acceleration RAD_PER_S2 --limit-torque NM\n"
            "  --inertia KGM2       everything that moves, seen from the motor\n"
            "  --limit-position-m M --limit-velocity-m-per-s V --limit-acceleration-m-per-s2 A --limit-force-n N\n"
            "  --mass KG            the same for a linear axis\n"
            "  --pulley-radius M    converts the linear ones to the motor's side; both kinds may then be given\n"
            "  --minimum-effective T  refuse less than this (Nm, N)\n"
            "\n"
            "Amplitudes of the lines, relative to each other:\n"
            "  --amplitude constraint  each line alone just reaches a limit (default)\n"
            "              flat        equal torque; one-over-f: torque power falls with frequency\n"
            "              d-optimal:MODEL.json,ALPHA  for the model's parameters, the share ALPHA spread evenly\n"
            "              FILE        rows frequency_hz,amplitude\n"
            "  --amplitude-tolerance DB  of fast: each line may be stronger or weaker by this much\n"
            "\n"
            "Phases:\n"
            "  --method METHOD      fast (default): projections, then p-norm descent\n"
            "                       linf: p-norms to 512 by least squares, slow; mca: modified clipping\n"
            "                       clip: standard clipping (--keep all or acceleration)\n"
            "                       newman, schroeder (default of sequences), random: not optimised\n"
            "  --iterations I       of fast, mca, clip, linf\n"
            "  --starts S           of fast: the first is always the same, further ones are drawn by --seed\n"
            "  --time-budget S      of fast: starts for so many seconds\n"
            "  --threads T          default: all processors; the result does not depend on it\n"
            "  --grid continuous    limits hold at every instant, guaranteed (default)\n"
            "  --grid samples       limits hold at the samples of the table only\n"
            "  --seed S             default 1\n"
            "\n"
            "Start, and what is played under the multisine:\n"
            "  --start paper        at the zero crossing of velocity with the least acceleration (default)\n"
            "          bank         least transient of a bank of nominal drives; model:FILE: of that drive\n"
            "          none         at sample 0\n"
            "  --mode cascade       references for position, velocity and torque (default), or torque alone\n"
            "  --stroke RAD:P       a slow sinusoidal travel of P periods of the multisine (--stroke-m M:P)\n"
            "  --bias-velocity V    a constant speed in rad/s against stiction (--bias-velocity-m-per-s V)\n",
    .more_help =
        "\n"
        "What to expect of a measurement:\n"
        "  --periods P          counted periods (default 10; of a sequence: averaging factor)\n"
        "  --settle-time S      for settling (default one period)\n"
        "  --predict MODEL.json expected standard deviation of the response, with the model's noise\n"
        "\n"
        "  --report FILE.html   a page: the period against its limits, the spectrum, the figures\n"
        "  --dft-header KINDS   PREFIX-dft.h, const tables for a firmware that measures with this table: block or\n"
        "                       folded (the period folded where the lines allow it), q15, q23, q31,\n"
        "                       quarter-q15, quarter-q23, quarter-q31; several with commas\n"
        "\n"
        "Telling two causes apart that a diagnosis could not:\n"
        "  --separate A,B       cause ids, as in diagnose: tries the excitation as given, other levels, higher lines,\n"
        "                       a slow stroke, constant speed both ways and more periods on the simulated drive, with\n"
        "                       A and with B, and writes the cheapest one that separates them (PREFIX, or PREFIX-1\n"
        "                       and PREFIX-2 if it takes two tables); nothing where none does\n"
        "  --model MODEL.json   the drive: what diagnose was given, or the model it wrote; sizes of A and B are its\n"
        "                       effects', or such that the excitation as given shows them clearly\n"
        "  --nats N             log likelihood by which the wrong one has to lose (default 20; 6 is a tie)\n"
        "\n"
        "example, the belt drive of the first paper:\n"
        "  servoscope design --rate 1000 --period 2000 --lines linear:0.5:100:0.5 --limit-torque 1 \\\n"
        "      --inertia 0.00516 --limit-velocity-m-per-s 0.05 --pulley-radius 0.0159 --out belt\n"
        "the same drive, after a diagnosis that ended in a tie:\n"
        "  servoscope design --rate 1000 --period 2000 --lines odd:0.5:60:1 --limit-torque 1 --limit-velocity 15 \\\n"
        "      --inertia 0.00516 --separate load_bias,asymmetric_friction --model m.json --out apart\n",
    .run = run,
};
