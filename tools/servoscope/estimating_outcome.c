/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/estimating_outcome.h"

#include "lab/estimate/method.h"
#include "lab/estimate/report.h"
#include "lab/numeric/statistics.h"
#include "lab/page/page.h"
#include "lab/record/atomic_file.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

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

static void print_periods(const char *path, const struct estimating_summary *run)
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
    if (run->leading_periods > 0) {
        printf("  read piece by piece: what else is said of it is of its first %zu periods\n", run->leading_periods);
    }
}

static void print_segments(const char *path, const struct estimating_summary *run)
{
    printf("%s: %s, %zu of %zu segments, %zu to %zu periods of %zu samples count", path, run->segments.kind,
           run->segments.used, run->segments.planned, run->used, run->used_most, run->period_samples);
    if (run->lost > 0) {
        printf(", %zu were left out for lost samples", run->lost);
    }
    putchar('\n');
    if (run->segments.missing[0] != '\0') {
        printf("  segments %s are missing: the measurement ended early\n", run->segments.missing);
    }
    printf("  output differs from the later half by at most %.3g of its size in a segment's last period%s\n",
           run->last_level, run->transient.settled ? "" : "; that one has not settled or is not repeatable");
}

static void print_run(const char *path, const struct estimating_summary *run)
{
    if (run->segments.planned > 0) {
        print_segments(path, run);
    } else if (run->without_period) {
        printf("%s: no period; %zu rows in one piece", path, run->rows);
        if (run->lost_rows > 0) {
            printf(", %zu rows lost", run->lost_rows);
        }
        putchar('\n');
    } else {
        print_periods(path, run);
    }
    estimating_checks_print(&run->checks);
    printf("  %s\n", run->advice.sentence);
}

static void print_summary(const char *path, const struct estimating_outcome *outcome)
{
    const struct frf *frf = &outcome->frf;
    printf("%s: %s to %s by method %s, %zu of %zu lines valid, %.6g..%.6g Hz\n", path, frf->input, frf->output,
           frf->method, valid_lines(frf), frf->count, frf->frequency_hz[0], frf->frequency_hz[frf->count - 1]);
    printf("  std/|G| %.3g (median); 95 %% of errors lie within %s std (%.3g degrees of freedom)\n",
           median_relative_std(frf), estimate_key(frf, "confidence_95_factor"), frf->degrees_of_freedom);
    double coherence = median_coherence(frf);
    if (coherence >= 0.0) {
        printf("  coherence %.4g (median)\n", coherence);
    }
    if (estimate_key(frf, "lpm_order")[0]) {
        printf("  polynomials of order %s over %s lines on each side\n", estimate_key(frf, "lpm_order"),
               estimate_key(frf, "lpm_half_width"));
    }
    if (estimate_key(frf, "warning")[0]) {
        printf("  warning: %s\n", estimate_key(frf, "warning"));
    }
    estimating_findings_print(&outcome->findings, frf);
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
    estimating_findings_add_json(&outcome->findings, frf, object);
    cJSON *list = cJSON_AddArrayToObject(object, "runs");
    for (size_t r = 0; r < sources->count; r++) {
        cJSON_AddItemToArray(list, json_of_run(sources->items[r], &runs[r]));
    }
    return object;
}

int estimating_outcome_write_page(const char *path, const struct estimating_outcome *outcomes, size_t count,
                                  struct error *out_error)
{
    struct atomic_file file;
    struct page page;
    FILE *stream = atomic_file_open(&file, path, out_error);
    if (!stream) {
        return error_refused;
    }
    page_start(&page, stream, "Frequency response", NULL);
    for (size_t i = 0; i < count; i++) {
        frf_report_section(&page, &outcomes[i].frf, NULL);
        estimating_findings_add_page(&outcomes[i].findings, &outcomes[i].frf, &page);
    }
    page_end(&page, NULL);
    return atomic_file_commit(&file, out_error);
}

void estimating_outcome_print(const struct estimating_outcome *outcome, const struct option_values *sources,
                              const char *out)
{
    for (size_t r = 0; r < sources->count; r++) {
        print_run(sources->items[r], &outcome->runs[r]);
    }
    print_summary(out, outcome);
}

void estimating_outcome_free(struct estimating_outcome *self)
{
    for (size_t r = 0; r < self->run_count; r++) {
        estimating_findings_free(&self->runs[r].findings);
    }
    free(self->runs);
    estimating_findings_free(&self->findings);
    frf_free(&self->frf);
}
