/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/estimating_outcome.h"

#include "tools/servoscope/estimating_model.h"

#include "lab/estimate/method.h"
#include "lab/numeric/statistics.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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

/// Median over the lines that have one; NaN without any.
static double median_coherence(const struct frf *frf)
{
    double best = NAN;
    double *values = malloc(frf->count * sizeof *values);
    size_t count = 0;
    for (size_t line = 0; values && line < frf->count; line++) {
        if (frf->valid[line] && frf_known(frf->coherence[line])) {
            values[count++] = frf->coherence[line];
        }
    }
    if (count > 0) {
        best = statistics_median(values, count);
    }
    free(values);
    return best;
}

static void say_settling(const struct estimating_summary *run, struct remarks *io_remarks)
{
    char decay[80] = "";
    if (run->total < 4) {
        remarks_add(io_remarks, remark_fact, "settling", "%zu periods are too few to judge the settling", run->total);
        return;
    }
    if (run->transient.decay_per_period > 0.0) {
        snprintf(decay, sizeof decay, "; a transient falls to %.3g per period", run->transient.decay_per_period);
    }
    remarks_add(io_remarks, remark_fact, "settling",
                "output differs from the later half by %.3g of its size in the first period, by %.3g in the last%s%s",
                run->first_level, run->last_level, decay,
                run->transient.settled ? "" : "; the first half has not settled or is not repeatable");
}

static void say_periods(const struct estimating_summary *run, struct remarks *io_remarks)
{
    char lost[96] = "";
    if (run->lost > 0) {
        snprintf(lost, sizeof lost, ", %zu for lost samples (the first in row %zu)", run->lost, run->first_lost_row);
    }
    remarks_add(io_remarks, remark_fact, "periods",
                "%zu of %zu periods of %zu samples count, %zu left out for settling%s%s%s", run->used, run->total,
                run->period_samples, run->settle, lost, run->period_found ? "; period found by its repetition" : "",
                run->bins_found ? "; lines found by their power" : "");
    /* One bin in a hundred is by chance. */
    if (run->doubtful > run->period_samples / 64 + 2) {
        remarks_add(io_remarks, remark_fact, "doubtful_lines",
                    "%zu more bins may be lines, which noise or stronger ones hide: they count neither as lines nor as "
                    "distortion; --lines would say",
                    run->doubtful);
    }
    if (run->lost_outside > 0) {
        remarks_add(io_remarks, remark_fact, "lost_outside",
                    "%zu lost samples (the first in row %zu) cost no period that would count: they lie in what is left "
                    "out for settling or behind the last whole period",
                    run->lost_outside, run->first_lost_outside);
    }
    say_settling(run, io_remarks);
    if (run->leading_periods > 0) {
        remarks_add(io_remarks, remark_fact, "pieces",
                    "read piece by piece: what else is said of it is of its first %zu periods", run->leading_periods);
    }
}

static void say_segments(const struct estimating_summary *run, struct remarks *io_remarks)
{
    char lost[64] = "";
    if (run->lost > 0) {
        snprintf(lost, sizeof lost, ", %zu were left out for lost samples", run->lost);
    }
    remarks_add(io_remarks, remark_fact, "segments",
                "%s, %zu of %zu segments, %zu to %zu periods of %zu samples count%s", run->segments.kind,
                run->segments.used, run->segments.planned, run->used, run->used_most, run->period_samples, lost);
    if (run->segments.missing[0] != '\0') {
        remarks_add(io_remarks, remark_warning, "segments_missing",
                    "segments %s are missing: the measurement ended early", run->segments.missing);
    }
    remarks_add(io_remarks, remark_fact, "settling",
                "output differs from the later half by at most %.3g of its size in a segment's last period%s",
                run->last_level, run->transient.settled ? "" : "; that one has not settled or is not repeatable");
}

static void say_rows(const struct estimating_summary *run, struct remarks *io_remarks)
{
    char lost[48] = "";
    if (run->lost_rows > 0) {
        snprintf(lost, sizeof lost, ", %zu rows lost", run->lost_rows);
    }
    remarks_add(io_remarks, remark_fact, "rows", "no period; %zu rows in one piece%s", run->rows, lost);
}

static void say_run(const struct estimating_summary *run, struct remarks *io_remarks)
{
    if (run->segments.planned > 0) {
        say_segments(run, io_remarks);
    } else if (run->without_period) {
        say_rows(run, io_remarks);
    } else {
        say_periods(run, io_remarks);
    }
    estimating_checks_say(&run->checks, io_remarks);
    remarks_add(io_remarks, remark_advice, "method", "%s", run->advice.sentence);
}

/// What the response includes and what was taken out of it.
static void say_setup(const struct frf *frf, struct remarks *io_remarks)
{
    const double removed_s = atof(estimate_key(frf, "delay_removed_s"));
    const bool held = strcmp(estimate_key(frf, "hold"), "zoh") == 0;
    char delay[64] = "";
    if (removed_s != 0.0) {
        snprintf(delay, sizeof delay, "; a delay of %.6g ms is taken out", 1e3 * removed_s);
    }
    remarks_add(io_remarks, remark_fact, "setup", "%s; actuator %s%s",
                held ? "with the hold between samples (zoh)" : "input measured behind an anti-alias filter",
                estimate_key(frf, "actuator"), delay);
}

static void say_response(const struct estimating_outcome *outcome, struct remarks *io_remarks)
{
    const struct frf *frf = &outcome->frf;
    const double coherence = median_coherence(frf);
    remarks_add(io_remarks, remark_fact, "response", "%s to %s by method %s, %zu of %zu lines valid, %.6g..%.6g Hz",
                frf->input, frf->output, frf->method, valid_lines(frf), frf->count, frf->frequency_hz[0],
                frf->frequency_hz[frf->count - 1]);
    remarks_add(io_remarks, remark_fact, "uncertainty",
                "std/|G| %.3g (median); 95 %% of errors lie within %s std (%.0f degrees of freedom)",
                median_relative_std(frf), estimate_key(frf, "confidence_95_factor"), frf->degrees_of_freedom);
    if (coherence >= 0.0) {
        remarks_add(io_remarks, remark_fact, "coherence", "coherence %.4g (median)", coherence);
    }
    if (estimate_key(frf, "lpm_order")[0]) {
        remarks_add(io_remarks, remark_fact, "polynomials", "polynomials of order %s over %s lines on each side",
                    estimate_key(frf, "lpm_order"), estimate_key(frf, "lpm_half_width"));
    }
    if (estimate_key(frf, "warning")[0]) {
        remarks_add(io_remarks, remark_warning, "bias", "%s", estimate_key(frf, "warning"));
    }
    if (estimate_key(frf, "columns_named")[0]) {
        remarks_add(io_remarks, remark_fact, "columns", "columns were named by the units in their names: --map %s",
                    estimate_key(frf, "columns_named"));
    }
    say_setup(frf, io_remarks);
    estimating_model_say(outcome, io_remarks);
    estimating_findings_say(&outcome->findings, frf, io_remarks);
}

void estimating_outcome_say(const struct estimating_outcome *outcome, const struct option_values *sources,
                            const char *out, struct remarks *io_remarks)
{
    for (size_t r = 0; r < sources->count; r++) {
        remarks_about(io_remarks, sources->items[r]);
        say_run(&outcome->runs[r], io_remarks);
    }
    remarks_about(io_remarks, out);
    say_response(outcome, io_remarks);
}

static cJSON *json_of_run(const char *path, const struct estimating_summary *run)
{
    cJSON *object = cJSON_CreateObject();
    cJSON_AddStringToObject(object, "run", path);
    cJSON_AddStringToObject(object, "suited_method", run->advice.method);
    cJSON_AddStringToObject(object, "advice", run->advice.sentence);
    if (run->segments.planned > 0) {
        cJSON_AddStringToObject(object, "sequence", run->segments.kind);
        cJSON_AddNumberToObject(object, "segments_planned", (double)run->segments.planned);
        cJSON_AddNumberToObject(object, "segments", (double)run->segments.used);
        cJSON_AddStringToObject(object, "segments_missing", run->segments.missing);
    }
    cJSON_AddBoolToObject(object, "periodic", !run->without_period);
    if (run->without_period) {
        cJSON_AddNumberToObject(object, "rows", (double)run->rows);
        cJSON_AddNumberToObject(object, "lost_rows", (double)run->lost_rows);
        return object;
    }
    cJSON_AddNumberToObject(object, "period_samples", (double)run->period_samples);
    cJSON_AddBoolToObject(object, "period_found", run->period_found);
    cJSON_AddBoolToObject(object, "lines_found", run->bins_found);
    cJSON_AddNumberToObject(object, "periods_total", (double)run->total);
    if (run->leading_periods > 0) {
        cJSON_AddNumberToObject(object, "leading_periods", (double)run->leading_periods);
    }
    cJSON_AddNumberToObject(object, "settle_periods", (double)run->settle);
    cJSON_AddNumberToObject(object, "lost_periods", (double)run->lost);
    cJSON_AddNumberToObject(object, "lost_rows_outside", (double)run->lost_outside);
    cJSON_AddNumberToObject(object, "periods", (double)run->used);
    cJSON_AddBoolToObject(object, "settled", run->transient.settled);
    cJSON_AddNumberToObject(object, "transient_first_period", run->first_level);
    cJSON_AddNumberToObject(object, "transient_decay_per_period",
                            run->transient.decay_per_period > 0.0 ? run->transient.decay_per_period : NAN);
    estimating_checks_add_json(&run->checks, object);
    return object;
}

/// What only some methods say.
static void add_method_keys(const struct frf *frf, cJSON *io_object)
{
    static const char *const keys[] = {"reference", "lpm_order", "lpm_half_width", "warning"};
    double coherence = median_coherence(frf);
    if (coherence >= 0.0) {
        cJSON_AddNumberToObject(io_object, "median_coherence", coherence);
    }
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++) {
        if (estimate_key(frf, keys[i])[0]) {
            cJSON_AddStringToObject(io_object, keys[i], estimate_key(frf, keys[i]));
        }
    }
}

cJSON *estimating_outcome_json(const struct estimating_outcome *outcome, const struct option_values *sources,
                               const char *out)
{
    const struct frf *frf = &outcome->frf;
    const struct estimating_summary *runs = outcome->runs;
    cJSON *object = cJSON_CreateObject();
    cJSON_AddStringToObject(object, "out", out);
    cJSON_AddStringToObject(object, "method", frf->method);
    cJSON_AddStringToObject(object, "input", frf->input);
    cJSON_AddStringToObject(object, "output", frf->output);
    cJSON_AddStringToObject(object, "units", frf->units);
    cJSON_AddNumberToObject(object, "lines", (double)frf->count);
    cJSON_AddNumberToObject(object, "lines_valid", (double)valid_lines(frf));
    cJSON_AddNumberToObject(object, "periods", (double)frf->periods);
    cJSON_AddNumberToObject(object, "degrees_of_freedom", frf->degrees_of_freedom);
    cJSON_AddNumberToObject(object, "confidence_95_factor", atof(estimate_key(frf, "confidence_95_factor")));
    cJSON_AddNumberToObject(object, "median_relative_std", median_relative_std(frf));
    cJSON_AddStringToObject(object, "suited_method", runs[0].advice.method);
    cJSON_AddStringToObject(object, "advice", runs[0].advice.sentence);
    add_method_keys(frf, object);
    estimating_model_add_json(outcome, object);
    estimating_findings_add_json(&outcome->findings, frf, object);
    cJSON *list = cJSON_AddArrayToObject(object, "runs");
    for (size_t r = 0; r < sources->count; r++) {
        cJSON_AddItemToArray(list, json_of_run(sources->items[r], &runs[r]));
    }
    struct remarks remarks = {.count = 0};
    estimating_outcome_say(outcome, sources, out, &remarks);
    remarks_add_json(&remarks, object);
    remarks_free(&remarks);
    return object;
}

void estimating_outcome_print(const struct estimating_outcome *outcome, const struct option_values *sources,
                              const char *out)
{
    struct remarks remarks = {.count = 0};
    estimating_outcome_say(outcome, sources, out, &remarks);
    remarks_print(&remarks);
    remarks_free(&remarks);
}

bool estimating_summary_make(const struct periodic *recording, struct estimating_summary *out_summary)
{
    *out_summary = (struct estimating_summary){
        .period_samples = recording->period_samples,
        .total = recording->total,
        .settle = recording->settle,
        .lost = recording->lost,
        .first_lost_row = recording->first_lost_row,
        .lost_outside = recording->lost_outside,
        .first_lost_outside = recording->first_lost_outside,
        .used = recording->used,
        .period_found = recording->period_found,
        .bins_found = recording->bins_found,
        .doubtful = recording->doubtful_count,
        .transient = recording->transient,
        .first_level = periodic_first_level(recording),
        .last_level = periodic_last_level(recording),
    };
    estimate_advise(recording, &out_summary->advice);
    out_summary->levels = malloc(recording->total * sizeof *out_summary->levels);
    if (out_summary->levels) {
        memcpy(out_summary->levels, recording->output_level, recording->total * sizeof *out_summary->levels);
    }
    return out_summary->levels != NULL;
}

void estimating_summary_merge(struct estimating_summary *whole, const struct estimating_summary *one)
{
    struct estimating_summary before = *whole;
    if (before.used_most == 0 || one->last_level > before.last_level) {
        *whole = *one;
        whole->findings = before.findings;
        whole->excitations = before.excitations;
    }
    whole->used = before.used_most == 0 || one->used < before.used ? one->used : before.used;
    whole->used_most = one->used > before.used_most ? one->used : before.used_most;
    whole->lost = before.lost + one->lost;
    whole->first_lost_row = before.lost > 0 ? before.first_lost_row : one->first_lost_row;
}

bool estimating_summary_excite(struct estimating_summary *io_summary, const struct periodic *recording)
{
    struct excitation one;
    const bool done = excitation_take(recording, &one) && excitations_add(&io_summary->excitations, &one);
    excitation_free(&one);
    return done;
}

void estimating_summary_drop(struct estimating_summary *self)
{
    free(self->levels);
    free(self->parametric);
    frf_free(&self->measured);
    excitations_free(&self->excitations);
    self->levels = NULL;
    self->parametric = NULL;
}

void estimating_outcome_free(struct estimating_outcome *self)
{
    for (size_t r = 0; r < self->run_count; r++) {
        estimating_findings_free(&self->runs[r].findings);
        estimating_summary_drop(&self->runs[r]);
    }
    for (size_t r = 0; r < self->run_count && self->responses; r++) {
        frf_free(&self->responses[r]);
    }
    free(self->responses);
    free(self->runs);
    estimating_findings_free(&self->findings);
    frf_free(&self->frf);
}
