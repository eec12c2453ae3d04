/* SPDX-License-Identifier: MIT */
#include "lab/tune/tune.h"

#include "lab/tune/gap.h"
#include "lab/tune/say.h"
#include "lab/tune/solution.h"

#include <ctype.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { figures_size = 256 };

void tune_options_default(struct tune_options *out_options)
{
    *out_options = (struct tune_options){.structure = "pi", .damping = 0.9, .delay_samples = 1.0};
}

static int check_options(const struct tune_options *options, const struct tune_plant *plant, struct error *out_error)
{
    // Beyond it 1 - z^-1 has few digits left at the lowest lines.
    const double rate_most_hz = 1e7;
    if (!(plant->rate_hz <= rate_most_hz)) {
        return error_set(out_error, error_usage, "--rate: %.6g Hz, expected at most %.6g Hz", plant->rate_hz,
                         rate_most_hz);
    }
    // Above a quarter of the rate a sampled M of this form no longer has the bandwidth that it is named after.
    const double bandwidth_most_hz = 0.25 * plant->rate_hz;
    if (!(options->bandwidth_hz > 0.0 && options->bandwidth_hz <= bandwidth_most_hz)) {
        return error_set(out_error, error_usage,
                         "--bandwidth: %.6g Hz, expected above 0 and at most %.6g Hz (a "
                         "quarter of the rate)",
                         options->bandwidth_hz, bandwidth_most_hz);
    }
    if (!(options->damping >= 0.1 && options->damping <= 10.0)) {
        return error_set(out_error, error_usage, "--damping: %.6g, expected .1 to 10", options->damping);
    }
    if (!(options->delay_samples >= 0.0 && options->delay_samples <= 100.0)) {
        return error_set(out_error, error_usage, "--delay: %.6g samples, expected 0 to 100", options->delay_samples);
    }
    return 0;
}

static int check_structure(const char *path, const struct tune_structure *structure, const struct tune_plant *plant,
                           struct error *out_error)
{
    if (plant->output == tune_output_velocity || structure->leads) {
        return 0;
    }
    return error_set(out_error, error_refused,
                     "%s is a response to position, whose phase starts at -180 degrees for an inertia: a %s controller "
                     "has no phase lead to hold it; expected a response to velocity, or "
                     "--controller pid or lead, which is a position controller then",
                     path, structure->name);
}

// ---- Refusals with advice

static bool is_stable(const struct tune_result *self, const struct tune_structure *structure,
                      const struct tune_options *options)
{
    struct tune_solution solution;
    return solution_find(&self->plant, &self->resonance, structure, options, &solution, NULL) == 0 &&
           solution.nyquist.verdict == nyquist_stable;
}

/// The nearest bandwidth that would be stable, below or, if it is the lines that cannot tell, above; 0: none.
static double find_bandwidth(const struct tune_result *self, const struct tune_options *options)
{
    enum { steps = 12 };
    const double step = 0.8;
    const struct tune_structure *structure = self->solution.controller.structure;
    const bool undecided = self->solution.nyquist.verdict == nyquist_undecided;
    struct tune_options lower = *options, higher = *options;
    for (int i = 0; i < steps; i++) {
        lower.bandwidth_hz *= step;
        higher.bandwidth_hz /= step;
        if (is_stable(self, structure, &lower)) {
            return lower.bandwidth_hz;
        }
        if (undecided && higher.bandwidth_hz <= 0.25 * self->plant.rate_hz && is_stable(self, structure, &higher)) {
            return higher.bandwidth_hz;
        }
    }
    return 0.0;
}

/// What can be tried instead, tried out: another bandwidth, a filter at the resonance.
static void advise(const struct tune_result *self, const struct tune_options *options, char out_text[figures_size])
{
    const struct tune_structure *structure = self->solution.controller.structure;
    const double bandwidth_hz = find_bandwidth(self, options);
    int used = 0;
    out_text[0] = '\0';
    if (bandwidth_hz > 0.0) {
        used = snprintf(out_text, figures_size, "--bandwidth %.3g is stable", bandwidth_hz);
    }
    for (const struct tune_structure *other = tune_structures; other->name; other++) {
        const bool worth = other->filter != tune_filter_none && structure->filter == tune_filter_none &&
                           self->plant.output == tune_output_velocity;
        if (worth && is_stable(self, other, options)) {
            used += snprintf(out_text + used, figures_size - (size_t)used, "%s--controller %s is stable at %.4g Hz",
                             used ? ", " : "", other->name, options->bandwidth_hz);
        }
    }
    if (used == 0) {
        snprintf(out_text, figures_size, "another --controller or less delay, no other bandwidth nearby is stable");
    }
}

static bool has_gain(const struct tune_controller *controller)
{
    bool any = false;
    for (size_t i = 0; i < controller->structure->gains; i++) {
        any = any || controller->gain[i] > 0.0;
    }
    return any;
}

static int refuse(const char *path, const struct tune_result *self, const struct tune_options *options,
                  struct error *out_error)
{
    char gains[say_size], advice[figures_size];
    const struct nyquist *nyquist = &self->solution.nyquist;
    if (!has_gain(&self->solution.controller)) {
        return error_set(out_error, error_refused,
                         "%s: every gain of the %s controller would be negative: expected a response with the sign of "
                         "its input (does the %s count the other way round? frf --map NAME=COLUMN*-1), less delay in "
                         "the loop (%.4g s are known) or a reference with more delay",
                         path, options->structure, self->plant.output == tune_output_velocity ? "velocity" : "position",
                         self->plant.loop_delay_s);
    }
    say_gains(&self->plant, &self->solution.controller, gains);
    advise(self, options, advice);
    const char *mind = self->file_warning_count > 0 ? "; mind: " : "";
    const char *warning = self->file_warning_count > 0 ? self->warnings[0] : "";
    if (nyquist->verdict == nyquist_undecided) {
        return error_set(out_error, error_refused,
                         "%s: whether the %s loop for %.4g Hz (%s) is stable cannot be told: %s; try: %s%s%s", path,
                         options->structure, options->bandwidth_hz, gains, nyquist->reason, advice, mind, warning);
    }
    return error_set(out_error, error_refused,
                     "%s: the %s loop for %.4g Hz would be unstable: %d poles outside the unit circle with %s, by the "
                     "turns of the open loop round -1, which it passes at a distance of %.3g at %.4g Hz; try: %s%s%s",
                     path, options->structure, options->bandwidth_hz, nyquist->unstable_poles, gains,
                     nyquist->worst_distance, nyquist->worst_hz, advice, mind, warning);
}

// ---- Warnings

#if defined(__GNUC__)
__attribute__((format(printf, 2, 3)))
#endif
static void
warn(struct tune_result *io_result, const char *format, ...)
{
    if (io_result->warning_count < tune_warnings_max) {
        va_list arguments;
        va_start(arguments, format);
        vsnprintf(io_result->warnings[io_result->warning_count++], tune_warning_size, format, arguments);
        va_end(arguments);
    }
}

static void warn_about_margins(struct tune_result *io_result)
{
    const struct margins *margins = &io_result->margins;
    const double modulus_usual = 2.0, cutoff_share = 0.7, near = 0.5;
    const struct resonance *resonance = &io_result->resonance;
    const double reference_hz = tune_reference_cutoff_hz(&io_result->solution.reference);
    // A reference that never falls below -3 dB has at least the bandwidth it is named after.
    const double cutoff_hz = isfinite(reference_hz) ? reference_hz : io_result->solution.reference.bandwidth_hz;
    if (margins->modulus > modulus_usual) {
        warn(io_result, "max |S| is %.3g at %.4g Hz, above the usual limit of 2: little is left for drives that differ",
             margins->modulus, margins->modulus_hz);
    }
    if (margins->cutoff_hz < cutoff_share * cutoff_hz) {
        const bool dips = resonance->has_antiresonance &&
                          fabs(margins->cutoff_hz / resonance->antiresonance_hz - 1.0) < near &&
                          margins->last_cutoff_hz > resonance->antiresonance_hz;
        warn(io_result,
             "the closed loop first falls below -3 dB at %.4g Hz, the reference at %.4g Hz%s: this controller cannot "
             "reach the reference on this drive",
             margins->cutoff_hz, cutoff_hz, dips ? " (a dip at the antiresonance)" : "");
    }
}

static void warn_about_gains(struct tune_result *io_result)
{
    const struct tune_controller *controller = &io_result->solution.controller;
    for (size_t i = 0; i < controller->structure->gains; i++) {
        if (!(controller->gain[i] > 0.0)) {
            warn(io_result, "%s would be negative and is held at 0: the %s part does not help towards this reference",
                 tune_term_symbol(controller->structure->terms[i]), tune_term_name(controller->structure->terms[i]));
        }
    }
    if (!io_result->solution.reweighted) {
        warn(io_result, "the reweighted fit did no better than the linear one, whose gains these are");
    }
}

/// Keys by which a response's file speaks against itself.
static bool is_warning(const char *key)
{
    static const char start[] = "warning_", end[] = "_warning";
    const size_t length = strlen(key), tail = sizeof end - 1;
    return strcmp(key, "warning") == 0 || strncmp(key, start, sizeof start - 1) == 0 ||
           (length > tail && strcmp(key + length - tail, end) == 0);
}

/// Says them all before anything is certified. Refused is what no standard deviation covers and a better method avoids:
/// a response drawn towards minus the inverse of the controller looks stable with it.
static int heed_file(const char *path, const struct frf *frf, struct tune_result *io_result, struct error *out_error)
{
    static const char biased[] = "biased: ";
    for (size_t i = 0; i < frf->key_count; i++) {
        const char *key = frf->keys[i].key, *value = frf->keys[i].value;
        if (strcmp(key, "warning") == 0 && strncmp(value, biased, sizeof biased - 1) == 0) {
            return error_set(out_error, error_refused, "%s: its key warning says of the response: %.400s", path, value);
        }
        if (is_warning(key)) {
            warn(io_result, "the response's file says (%.40s): %.450s", key, value);
        } else if (strcmp(key, "clock") == 0 && strcmp(value, "apart") == 0) {
            warn(io_result,
                 "the response's file says (clock): input and output do not repeat after the same time; its phase "
                 "drifts through the recording");
        }
    }
    io_result->file_warning_count = io_result->warning_count;
    return 0;
}

static void warn_about_lines(struct tune_result *io_result)
{
    const struct tune_plant *plant = &io_result->plant;
    const struct nyquist *nyquist = &io_result->solution.nyquist;
    const double last_hz = plant->frequency_hz[plant->count - 1];
    const double last_gain_usual_db = -20.0, last_share_usual = 0.8;
    char left_out[160];
    size_t gaps = 0, gap = 0;
    tune_plant_name_left_out(plant, 0.0, INFINITY, sizeof left_out, left_out);
    if (left_out[0]) {
        warn(io_result, "left out as not valid: %s", left_out);
    }
    for (size_t k = plant->count - 1; k-- > 0 && plant->frequency_hz[k] > io_result->margins.crossover_hz;) {
        if (plant->frequency_hz[k + 1] > GAP_RATIO_MOST * plant->frequency_hz[k]) {
            gaps++;
            gap = k;
        }
    }
    if (gaps > 0) {
        warn(io_result,
             "there is no line between %.4g and %.4g Hz%s, where the open loop is at %.0f and %.0f dB: no margin is "
             "looked for there",
             plant->frequency_hz[gap], plant->frequency_hz[gap + 1], gaps > 1 ? " and in gaps above" : "",
             20.0 * log10(cabs(io_result->loop[gap])), 20.0 * log10(cabs(io_result->loop[gap + 1])));
    }
    if (nyquist->last_gain_db > last_gain_usual_db && last_hz < 0.5 * last_share_usual * plant->rate_hz) {
        warn(io_result,
             "the lines end at %.4g Hz, where the open loop is at %.1f dB: a resonance above that raises it by %.0f dB "
             "may make it unstable unseen; lines up to near %.4g Hz would show it",
             last_hz, nyquist->last_gain_db, -nyquist->last_gain_db, 0.5 * plant->rate_hz);
    }
}

static void warn_about_hold(struct tune_result *io_result)
{
    const struct tune_plant *plant = &io_result->plant;
    if (!(plant->response_rate_hz > 0.0)) {
        warn(io_result,
             "the response's file has no sample_rate_hz: its hold is taken for that of the controller at %.6g Hz",
             plant->rate_hz);
    }
    if (plant->carried) {
        warn(io_result,
             "the response, measured %s%.6g Hz, is carried over to the controller's hold at %.6g Hz; what folding "
             "leaves unknown is %.2g %% of it at the crossover",
             plant->band_limited ? "band-limited at " : "with a hold at ", plant->response_rate_hz, plant->rate_hz,
             100.0 * io_result->doubt_at_crossover);
    }
}

/// The number in a column's name, as in torque_2_Nm; 0 if it has none.
static long column_number(const char *name)
{
    for (const char *at = strchr(name, '_'); at; at = strchr(at + 1, '_')) {
        char *end;
        const long number = strtol(at + 1, &end, 10);
        if (end > at + 1 && *end == '_' && isdigit((unsigned char)at[1])) {
            return number;
        }
    }
    return 0;
}

static void warn_about_data(const struct frf *frf, struct tune_result *io_result)
{
    const struct tune_plant *plant = &io_result->plant;
    const struct tune_deviation *deviation = &io_result->deviation;
    if (!strstr(frf->input, "_ref_") && !(plant->loop_delay_s > 0.0)) {
        warn(io_result,
             "the response begins at %s, as measured: delay and lag between the controller and it are not in this loop "
             "(frf --input with a _ref_ column has them, --loop-delay adds them)",
             frf->input);
    }
    const long input = column_number(frf->input), output = column_number(frf->output);
    if (input > 0) {
        warn(io_result, "%s is one of several inputs: its loop is judged with those of the others open%s", frf->input,
             output > 0 && output != input ? ", and the output is another one's" : "");
    }
    if (!plant->std_known) {
        warn(io_result, "the response has no standard deviations: what noise does to gains and margins is not known");
        return;
    }
    if (plant->std_unknown > 0) {
        warn(io_result, "%zu of %zu lines have no standard deviation and count as exact", plant->std_unknown,
             plant->count);
    }
    if (deviation->stable < tune_draws) {
        warn(io_result,
             "of %d responses drawn from the measured one and its standard deviation %zu are not shown to be stable "
             "with these gains",
             (int)tune_draws, tune_draws - deviation->stable);
    }
}

/// The plant's doubt, relative, at the line next above the crossover.
static double find_doubt(const struct tune_plant *plant, double crossover_hz)
{
    size_t k = 0;
    while (k + 1 < plant->count && plant->frequency_hz[k] < crossover_hz) {
        k++;
    }
    return plant->doubt[k] / cabs(plant->response[k]);
}

// ---- All of it

static int finish(struct tune_result *io_result, struct error *out_error)
{
    const struct tune_plant *plant = &io_result->plant;
    const struct tune_solution *solution = &io_result->solution;
    io_result->loop = malloc(plant->count * sizeof *io_result->loop);
    io_result->reference = malloc(plant->count * sizeof *io_result->reference);
    if (!io_result->loop || !io_result->reference ||
        !solution_deviation(plant, solution, io_result->weighting, &io_result->deviation)) {
        return error_set(out_error, error_refused, "memory is short");
    }
    solution_loop(plant, &solution->controller, plant->response, io_result->loop);
    for (size_t k = 0; k < plant->count; k++) {
        io_result->reference[k] = tune_reference_at(&solution->reference, plant->frequency_hz[k]);
    }
    margins_find(plant->count, plant->frequency_hz, io_result->loop, &io_result->margins);
    io_result->doubt_at_crossover = find_doubt(plant, io_result->margins.crossover_hz);
    return 0;
}

static int find_solution(const char *path, const struct tune_options *options, struct tune_result *io_result,
                         struct error *out_error)
{
    const struct tune_structure *structure = tune_structure_find(options->structure, out_error);
    if (!structure) {
        return error_usage;
    }
    int status = check_options(options, &io_result->plant, out_error);
    status = status ? status : check_structure(path, structure, &io_result->plant, out_error);
    if (!status && !resonance_find(&io_result->plant, &io_result->resonance)) {
        status = error_set(out_error, error_refused, "memory is short");
    }
    if (status) {
        return status;
    }
    status =
        solution_find(&io_result->plant, &io_result->resonance, structure, options, &io_result->solution, out_error);
    if (!status && io_result->solution.nyquist.verdict != nyquist_stable) {
        status = refuse(path, io_result, options, out_error);
    }
    return status;
}

int tune_run(const char *path, const struct frf *frf, const struct tune_options *options,
             struct tune_result *out_result, struct error *out_error)
{
    *out_result = (struct tune_result){.weighting = options->weighting};
    int status = tune_plant_take(path, frf, options->rate_hz, options->loop_delay_s, &out_result->plant, out_error);
    status = status ? status : heed_file(path, frf, out_result, out_error);
    status = status ? status : find_solution(path, options, out_result, out_error);
    status = status ? status : finish(out_result, out_error);
    if (status) {
        tune_result_free(out_result);
        return status;
    }
    warn_about_margins(out_result);
    warn_about_gains(out_result);
    warn_about_lines(out_result);
    warn_about_hold(out_result);
    warn_about_data(frf, out_result);
    return 0;
}

void tune_result_free(struct tune_result *self)
{
    tune_plant_free(&self->plant);
    free(self->loop);
    free(self->reference);
    *self = (struct tune_result){0};
}
