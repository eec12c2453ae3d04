/* SPDX-License-Identifier: MIT */
/// servoscope tune: a controller from a measured frequency response.
#include "lab/page/page.h"
#include "lab/record/atomic_file.h"
#include "lab/record/frf_file.h"
#include "lab/record/json_out.h"
#include "lab/tune/report.h"
#include "lab/tune/say.h"
#include "lab/tune/tune.h"
#include "lab/tune/tune_json.h"
#include "tools/servoscope/command.h"
#include "tools/servoscope/options.h"
#include "tools/servoscope/outputs.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#ifndef SERVOSCOPE_VERSION
#define SERVOSCOPE_VERSION "0.1.0"
#endif

struct arguments {
    struct option_values files;
    struct tune_options tune;
    const char *weighting;
    const char *notch;
    const char *biquad;
    const char *out;
    const char *report;
};

/// Reads "A:B:..." into numbers above 0.
static int read_numbers(const char *name, const char *text, const char *form, size_t least, size_t most,
                        double *out_numbers, struct error *out_error)
{
    char part[64];
    size_t count = 0;
    for (const char *at = text; at; count++) {
        const char *colon = strchr(at, ':');
        const size_t length = colon ? (size_t)(colon - at) : strlen(at);
        if (count == most || length >= sizeof part) {
            count = 0;
            break;
        }
        memcpy(part, at, length);
        part[length] = '\0';
        if (options_parse_number(name, part, &out_numbers[count], NULL) || !(out_numbers[count] > 0.0)) {
            count = 0;
            break;
        }
        at = colon ? colon + 1 : NULL;
    }
    return count >= least ? 0
                          : error_set(out_error, error_usage, "%s: '%s', expected %s, all above 0", name, text, form);
}

static int read_filter(const struct arguments *arguments, struct tune_filter *out_filter, struct error *out_error)
{
    double n[4] = {0.0};
    const bool biquad = strcmp(arguments->tune.structure, "pi+biquad") == 0;
    const bool notch = strcmp(arguments->tune.structure, "pi+notch") == 0;
    if ((arguments->notch && !notch) || (arguments->biquad && !biquad)) {
        return error_set(out_error, error_usage, "--%s is for --controller pi+%s, not %s",
                         arguments->notch ? "notch" : "biquad", arguments->notch ? "notch" : "biquad",
                         arguments->tune.structure);
    }
    if (arguments->notch) {
        int status = read_numbers("--notch", arguments->notch, "HZ:DAMPING[:POLE_DAMPING]", 2, 3, n, out_error);
        *out_filter = (struct tune_filter){.zero_hz = n[0], .zero_damping = n[1]};
        if (n[2] > 0.0) {
            out_filter->pole_hz = n[0];
            out_filter->pole_damping = n[2];
        }
        return status;
    }
    if (arguments->biquad) {
        int status = read_numbers("--biquad", arguments->biquad, "HZ:DAMPING:POLE_HZ:POLE_DAMPING", 4, 4, n, out_error);
        *out_filter =
            (struct tune_filter){.zero_hz = n[0], .zero_damping = n[1], .pole_hz = n[2], .pole_damping = n[3]};
        return status;
    }
    return 0;
}

static int read_options(int argc, char **argv, struct arguments *out, struct error *out_error)
{
    double loop_delay_s = 0.0;
    const struct option options[] = {
        {.name = "controller", .kind = option_text, .target = &out->tune.structure},
        {.name = "bandwidth", .kind = option_positive, .target = &out->tune.bandwidth_hz, .required = true},
        {.name = "damping", .kind = option_number, .target = &out->tune.damping, .lowest = 0.1, .highest = 10.0},
        {.name = "delay", .kind = option_number, .target = &out->tune.delay_samples, .lowest = 0.0, .highest = 100.0},
        {.name = "rate", .kind = option_positive, .target = &out->tune.rate_hz},
        {.name = "loop-delay", .kind = option_number, .target = &loop_delay_s, .lowest = 0.0, .highest = 1.0},
        {.name = "weighting", .kind = option_text, .target = &out->weighting},
        {.name = "corner", .kind = option_positive, .target = &out->tune.corner_hz},
        {.name = "notch", .kind = option_text, .target = &out->notch},
        {.name = "biquad", .kind = option_text, .target = &out->biquad},
        {.name = "out", .kind = option_text, .target = &out->out},
        {.name = "report", .kind = option_text, .target = &out->report},
    };
    const struct option_operands operands = {"FRF.csv", 1, 1, &out->files};
    int status = options_parse(argc, argv, options, sizeof options / sizeof options[0], &operands, out_error);
    out->tune.loop_delay_s = loop_delay_s;
    if (!status && strcmp(out->weighting, "log") != 0 && strcmp(out->weighting, "flat") != 0) {
        status = error_set(out_error, error_usage, "--weighting: '%s', expected log or flat", out->weighting);
    }
    out->tune.weighting = strcmp(out->weighting, "flat") == 0 ? tune_weighting_flat : tune_weighting_log;
    return status ? status : read_filter(out, &out->tune.filter, out_error);
}

static void print_margin(const struct say_margin *margin)
{
    if (!isfinite(margin->value)) {
        printf("%s: %s", margin->name, margin->none);
        return;
    }
    printf("%s %.4g%s%s", margin->name, margin->value, margin->unit[0] ? " " : "", margin->unit);
    if (isfinite(margin->std)) {
        printf(" +- %.2g", margin->std);
    }
    if (isfinite(margin->at_hz)) {
        printf(" at %.4g Hz", margin->at_hz);
    }
}

static void print_margins(const struct tune_result *result)
{
    enum { per_line = 2 };
    struct say_margin margins[say_margins_max];
    const size_t count = say_margins(result, margins);
    size_t printed = 0;
    for (size_t i = 0; i < count; i++) {
        const struct say_margin *m = &margins[i];
        const bool repeats =
            m->value == result->margins.last_cutoff_hz && m->value == result->margins.cutoff_hz && i + 1 == count;
        if ((isfinite(m->value) || m->none) && !repeats) {
            printf("%s", printed == 0 ? "  " : printed % per_line ? "; " : "\n  ");
            print_margin(m);
            printed++;
        }
    }
    putchar('\n');
}

static void print_warnings(const struct tune_result *result, size_t first, size_t end)
{
    for (size_t i = first; i < end; i++) {
        printf("  mind: %s\n", result->warnings[i]);
    }
}

static void print_summary(const char *path, const struct frf *frf, const struct tune_result *result)
{
    char text[say_size];
    const struct tune_solution *solution = &result->solution;
    const struct tune_controller *controller = &solution->controller;
    const struct say_model_controller model = say_model_controller(result);
    const double reference_hz = tune_reference_cutoff_hz(&solution->reference);
    printf("%s: %s controller at %.6g Hz for %s to %s, reference of %.5g Hz", path, controller->structure->name,
           controller->rate_hz, frf->input, frf->output, solution->reference.bandwidth_hz);
    if (isfinite(reference_hz)) {
        printf(" (-3 dB at %.4g Hz)", reference_hz);
    }
    putchar('\n');
    print_warnings(result, 0, result->file_warning_count);
    for (size_t i = 0; i < controller->structure->gains; i++) {
        say_gain(result, i, "+-", text);
        printf("  %s = %s\n", tune_term_symbol(controller->structure->terms[i]), text);
    }
    printf("  K(z) = %s\n", controller->structure->form);
    if (controller->filter.on) {
        say_filter(&controller->filter, text);
        printf("  C(z): %s\n", text);
    }
    if (model.exists) {
        printf("  in a model file: \"controller\": {\"%s\": %.6g, \"velocity_integral_time_s\": %.6g}\n",
               model.gain_name, model.gain, model.integral_time_s);
    }
    printf("  stable by Nyquist's criterion on %zu lines, %.4g..%.4g Hz (open loop %.1f and %.1f dB there)\n",
           result->plant.count, result->plant.frequency_hz[0], result->plant.frequency_hz[result->plant.count - 1],
           solution->nyquist.first_gain_db, solution->nyquist.last_gain_db);
    print_margins(result);
    if (result->resonance.found) {
        printf("  resonance of the drive at %.4g Hz, damping %.3g, %.3g dB high\n", result->resonance.frequency_hz,
               result->resonance.damping, result->resonance.prominence_db);
    }
    print_warnings(result, result->file_warning_count, result->warning_count);
}

static int write_page(const struct arguments *arguments, const struct frf *frf, const struct tune_result *result,
                      struct error *out_error)
{
    struct atomic_file file;
    struct page page;
    char title[160];
    char subtitle[320];
    FILE *stream = atomic_file_open(&file, arguments->report, out_error);
    if (!stream) {
        return error_refused;
    }
    snprintf(title, sizeof title, "A %s controller of %.4g Hz", arguments->tune.structure,
             arguments->tune.bandwidth_hz);
    snprintf(subtitle, sizeof subtitle, "%s%s%s, as measured in %s", frf->input, frf->input[0] ? " to " : "A response",
             frf->output, arguments->files.items[0]);
    page_start(&page, stream, title, subtitle);
    tune_report_sections(&page, frf, result);
    // A write error is kept by the stream, and commit reports it with the path and the reason.
    (void)page_end(&page, "servoscope " SERVOSCOPE_VERSION);
    return atomic_file_commit(&file, out_error);
}

static int give_out(const struct arguments *arguments, const struct frf *frf, const struct tune_result *result,
                    const struct command_context *context, struct error *out_error)
{
    const char *path = arguments->files.items[0];
    cJSON *object = tune_json(path, result);
    int status = arguments->out ? json_write(arguments->out, object, out_error) : 0;
    if (!status && arguments->report) {
        status = write_page(arguments, frf, result, out_error);
    }
    if (!status && context->json) {
        status = json_print_stdout(object, out_error);
    } else if (!status && !context->quiet) {
        print_summary(path, frf, result);
    }
    cJSON_Delete(object);
    return status;
}

static int run(int argc, char **argv, const struct command_context *context, struct error *out_error)
{
    struct arguments arguments = {.weighting = "log"};
    struct frf frf;
    struct tune_result result;
    tune_options_default(&arguments.tune);
    int status = read_options(argc, argv, &arguments, out_error);
    const char *outputs[] = {arguments.out, arguments.report};
    status = status ? status : outputs_check(arguments.files.items, arguments.files.count, outputs, 2, out_error);
    status = status ? status : frf_read(arguments.files.items[0], &frf, out_error);
    if (status) {
        return status;
    }
    status = tune_run(arguments.files.items[0], &frf, &arguments.tune, &result, out_error);
    if (!status) {
        status = give_out(&arguments, &frf, &result, context, out_error);
        tune_result_free(&result);
    }
    frf_free(&frf);
    return status;
}

const struct command command_cmd_tune = {
    .name = "tune",
    .summary = "a controller from a measured frequency response, with its margins",
    .help =
        "servoscope tune: a controller from a measured frequency response, with its margins\n"
        "\n"
        "usage: servoscope tune FRF.csv --bandwidth HZ [options]\n"
        "\n"
        "  --bandwidth HZ       natural frequency of the closed loop that is asked for, a second-order system; its -3 "
        "dB "
        "lie at about\n"
        "                       2.3 times that\n"
        "  --controller NAME    p, pi (default), pid, lead, pi+notch or pi+biquad\n"
        "  --damping D          of the closed loop that is asked for (default 0.9)\n"
        "  --delay SAMPLES      delay that it may have (default 1)\n"
        "  --rate HZ            of the controller (default: the file's sample_rate_hz); at another rate the response "
        "is carried over\n"
        "                       to the controller's hold\n"
        "  --loop-delay S       delay of the loop that the response does not contain (default 0)\n"
        "  --weighting log      each octave counts the same (default); flat: each Hz\n"
        "  --corner HZ          of the derivative's filter (default: 10 times the bandwidth, of lead 3 times)\n"
        "  --notch HZ:DAMPING[:POLE_DAMPING]             instead of the resonance found in the response\n"
        "  --biquad HZ:DAMPING:POLE_HZ:POLE_DAMPING      the same for pi+biquad\n"
        "  --out TUNE.json      gains, margins, what stability rests on\n"
        "  --report FILE.html   a page: closed loop beside the reference, open loop, Nyquist plot, response\n"
        "\n"
        "The gains are those whose closed loop on the measured lines is nearest to the one asked for; they are never "
        "negative. The\n"
        "loop's stability is judged on the same lines before anything is printed: an unstable loop, or lines that "
        "cannot tell, end\n"
        "with status 1 and what to try. A response from torque to velocity gives Kp in Nm s/rad and Ki in Nm/rad; one "
        "to position\n"
        "takes pid or lead. Lines that are not valid are left out. Where lines are so far apart that a resonance may "
        "hide "
        "between them and\n"
        "reach -1, the gap is named and nothing is given out.\n"
        "\n"
        "example:\n"
        "  servoscope tune frf.csv --bandwidth 30 --out tune.json --report tune.html\n",
    .run = run,
};
