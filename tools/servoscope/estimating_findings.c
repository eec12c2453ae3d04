/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/estimating_findings.h"

#include "lab/estimate/method.h"
#include "lab/estimate/report_distortion.h"
#include "lab/numeric/statistics.h"
#include "lab/record/number.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const kind_names[distortion_kinds] = {"odd", "even", "mixed"};

/// Noise alone looks like distortion with less than this chance before a person is told so.
static const double believed = 1e-3;
/// What another input answers on a line, as a share of the line's own input, from which on the response is off by as
/// much.
static const double foreign_share_that_matters = 0.01;

static double decibel(double ratio)
{
    return 20.0 * log10(ratio);
}

static void note_load_column(const struct periodic *recording, struct estimating_findings *io)
{
    static const char *const names[] = {"load_velocity_rad_per_s", "load_velocity_m_per_s", "load_position_rad",
                                        "load_position_m"};
    for (size_t i = 0; i < sizeof names / sizeof names[0] && io->load_column[0] == '\0'; i++) {
        if (strncmp(recording->output, "load_", strlen("load_")) != 0 && run_column(recording->run, names[i])) {
            snprintf(io->load_column, sizeof io->load_column, "%s", names[i]);
        }
    }
}

static bool measure_distortion(const struct periodic *recording, const struct inputs *inputs, struct frf *io_frf,
                               struct estimating_findings *io)
{
    struct distortion_options options = {NULL, 0};
    uint32_t *others = NULL;
    for (size_t p = 0; inputs && p < inputs->count; p++) {
        if (strcmp(inputs->names[p], recording->input) == 0) {
            options.other_bins = others = inputs_others(inputs, p, &options.other_count);
            if (!others) {
                return false;
            }
        }
    }
    bool done = distortion_estimate(recording, &options, io_frf, &io->distortion);
    free(others);
    return done;
}

bool estimating_findings_measure(const struct periodic *recording, const struct inputs *inputs, struct frf *io_frf,
                                 struct estimating_findings *out)
{
    struct harmonics harmonics;
    const double step_hz = recording->run->sample_rate_hz / (double)recording->period_samples;
    *out = (struct estimating_findings){
        .recordings = 1,
        .late_first_hz = step_hz * (double)recording->bins[0],
        .late_last_hz = step_hz * (double)recording->bins[recording->bin_count - 1],
        .foreign_share = inputs ? inputs->foreign_share : 0.0,
    };
    note_load_column(recording, out);
    if (!repetition_test(recording, &out->repetition) || !oscillation_measure(recording, &out->oscillation) ||
        !harmonics_measure(recording, &harmonics) || !measure_distortion(recording, inputs, io_frf, out)) {
        return false;
    }
    out->late = out->repetition.multiple > 1;
    if (harmonics.count == 0) {
        return true;
    }
    out->harmonics = malloc(sizeof *out->harmonics);
    if (out->harmonics) {
        out->harmonics[0] = harmonics;
        out->harmonics_count = 1;
    }
    return out->harmonics != NULL;
}

bool estimating_findings_merge(struct estimating_findings *self, const struct estimating_findings *other)
{
    if (other->recordings == 0) {
        return true;
    }
    if (self->recordings == 0 || other->repetition.level > self->repetition.level) {
        self->repetition = other->repetition;
        self->late_first_hz = other->late_first_hz;
        self->late_last_hz = other->late_last_hz;
    }
    if (other->oscillation.found && !(self->oscillation.found && self->oscillation.level > other->oscillation.level)) {
        self->oscillation = other->oscillation;
    }
    if (self->load_column[0] == '\0') {
        memcpy(self->load_column, other->load_column, sizeof self->load_column);
    }
    self->recordings += other->recordings;
    self->late += other->late;
    self->foreign_share = fmax(self->foreign_share, other->foreign_share);
    distortion_merge(&self->distortion, &other->distortion);
    if (other->harmonics_count == 0) {
        return true;
    }
    const size_t count = self->harmonics_count + other->harmonics_count;
    struct harmonics *grown = realloc(self->harmonics, count * sizeof *grown);
    if (grown) {
        memcpy(grown + self->harmonics_count, other->harmonics, other->harmonics_count * sizeof *grown);
        self->harmonics = grown;
        self->harmonics_count = count;
    }
    return grown != NULL;
}

void estimating_findings_free(struct estimating_findings *self)
{
    free(self->harmonics);
    *self = (struct estimating_findings){0};
}

/// THD at a frequency, the mean of the powers of all recordings there; NaN if none is known.
static double thd_db(const struct estimating_findings *self, double frequency_hz, bool of_input)
{
    const double same = 1e-9;
    double sum = 0.0;
    double count = 0.0;
    for (size_t i = 0; i < self->harmonics_count; i++) {
        const struct harmonics *one = &self->harmonics[i];
        const double level = of_input ? one->input_db : one->output_db;
        if (fabs(one->frequency_hz - frequency_hz) <= same * frequency_hz && !isnan(level)) {
            sum += pow(10.0, 0.1 * level);
            count += 1.0;
        }
    }
    return count > 0.0 ? 10.0 * log10(sum / count) : NAN;
}

/// Values of any length: estimate_set_key() formats short ones only.
static bool set_long_key(struct frf *io_frf, const char *key, const char *text)
{
    if (!estimate_set_key(io_frf, key, "%s", "")) {
        return false;
    }
    for (size_t i = 0; i < io_frf->key_count; i++) {
        if (strcmp(io_frf->keys[i].key, key) == 0) {
            return frf_set_text(&io_frf->keys[i].value, text);
        }
    }
    return false;
}

/// One number for each line, `null` where harmonics are not above the noise.
static bool set_thd(const struct estimating_findings *self, const char *key, bool of_input, struct frf *io_frf)
{
    const size_t size = io_frf->count * (number_text_size + 2) + 3;
    char *text = malloc(size);
    if (!text) {
        return false;
    }
    size_t used = (size_t)snprintf(text, size, "[");
    for (size_t line = 0; line < io_frf->count; line++) {
        const double level = thd_db(self, io_frf->frequency_hz[line], of_input);
        used += (size_t)snprintf(text + used, size - used, "%s", line ? ", " : "");
        used += isnan(level) ? (size_t)snprintf(text + used, size - used, "null")
                             : (size_t)snprintf(text + used, size - used, "%.6g", level);
    }
    snprintf(text + used, size - used, "]");
    bool set = set_long_key(io_frf, key, text);
    free(text);
    return set;
}

/// Level over |G|, median of the lines of the final response that have one; of mixed bins what the recordings had.
static double median_level(const struct estimating_findings *self, int kind, const struct frf *frf)
{
    const double *const columns[distortion_kinds] = {frf->odd_distortion, frf->even_distortion, NULL};
    double *values = columns[kind] ? malloc(frf->count * sizeof *values) : NULL;
    size_t count = 0;
    if (!values) {
        return self->distortion.kind[kind].median;
    }
    for (size_t line = 0; line < frf->count; line++) {
        const double magnitude = hypot(frf->real[line], frf->imag[line]);
        if (frf->valid[line] && frf_known(columns[kind][line]) && magnitude > 0.0) {
            values[count++] = columns[kind][line] / magnitude;
        }
    }
    const double median = count > 0 ? statistics_median(values, count) : NAN;
    free(values);
    return median;
}

static bool set_decibel(struct frf *io_frf, const char *name, const char *what, double ratio)
{
    char key[64];
    snprintf(key, sizeof key, "%s_distortion_%s", name, what);
    return !(ratio > 0.0) || estimate_set_key(io_frf, key, "%.4g", decibel(ratio));
}

static bool set_distortion(const struct estimating_findings *self, struct frf *io_frf)
{
    bool set = true;
    for (int kind = 0; kind < distortion_kinds && set; kind++) {
        const struct distortion_level *level = &self->distortion.kind[kind];
        char bins[64];
        char chance[64];
        snprintf(bins, sizeof bins, "%s_distortion_free_bins", kind_names[kind]);
        snprintf(chance, sizeof chance, "%s_distortion_chance", kind_names[kind]);
        set = level->bins == 0 || (estimate_set_key(io_frf, bins, "%zu", level->bins) &&
                                   set_decibel(io_frf, kind_names[kind], "db", median_level(self, kind, io_frf)) &&
                                   set_decibel(io_frf, kind_names[kind], "limit_db", level->limit) &&
                                   estimate_set_key(io_frf, chance, "%.3g", distortion_chance(level)));
    }
    return set;
}

static bool set_repetition(const struct estimating_findings *self, struct frf *io_frf)
{
    const struct repetition *repetition = &self->repetition;
    if (self->late == 0) {
        return true;
    }
    return estimate_set_key(io_frf, "repeats_after_periods", "%u", repetition->multiple) &&
           estimate_set_key(io_frf, "repetition_level", "%.4g", repetition->level) &&
           estimate_set_key(io_frf, "warning_repetition",
                            "with %.6g..%.6g Hz excited the response repeats only after %u periods (%.3g of it, by "
                            "chance less than %.1g; %zu of %zu recordings): std does not hold. A nonlinear drive does "
                            "so, or a disturbance or slowly decaying oscillation between the lines",
                            self->late_first_hz, self->late_last_hz, repetition->multiple, repetition->level,
                            fmax(repetition->chance, 1e-99), self->late, self->recordings);
}

static bool set_oscillation(const struct oscillation *oscillation, struct frf *io_frf)
{
    return !oscillation->found ||
           (estimate_set_key(io_frf, "oscillation_hz", "%.6g", oscillation->frequency_hz) &&
            estimate_set_key(io_frf, "oscillation_level", "%.4g", oscillation->level) &&
            estimate_set_key(
                io_frf, "warning_oscillation",
                "the output oscillates by itself at %.6g Hz, %.2g times as much as the excitation moves it "
                "(RMS): a limit cycle, a loop close to instability, or a disturbance. It does not settle, "
                "and std takes it for noise",
                oscillation->frequency_hz, oscillation->level));
}

static bool set_agreement(const struct estimating_findings *self, struct frf *io_frf)
{
    const struct agreement *agreed = &self->agreed;
    return agreed->lines == 0 || (estimate_set_key(io_frf, "realisations_chance", "%.3g", agreed->chance) &&
                                  estimate_set_key(io_frf, "realisations_ratio", "%.4g", agreed->ratio) &&
                                  (!(agreed->level > 0.0) ||
                                   estimate_set_key(io_frf, "stochastic_level_db", "%.4g", decibel(agreed->level))));
}

static bool set_foreign(const struct estimating_findings *self, struct frf *io_frf)
{
    if (!(self->foreign_share > 0.0)) {
        return true;
    }
    bool set = estimate_set_key(io_frf, "other_inputs_db", "%.4g", decibel(self->foreign_share));
    if (set && self->foreign_share > foreign_share_that_matters) {
        set =
            estimate_set_key(io_frf, "warning_inputs",
                             "on a line of %s another input is up to %.2g times as strong: it answers, as in a closed "
                             "loop, and what it makes the output do passes for the response",
                             io_frf->input, self->foreign_share);
    }
    return set;
}

bool estimating_findings_judge(struct estimating_findings *self, const struct frf *frf)
{
    if (strcmp(frf->method, "parametric") == 0) {
        return true;
    }
    double *distances = malloc((frf->count + 1) * sizeof *distances);
    const bool done = distances && smoothness_measure(frf, distances, &self->smoothness);
    free(distances);
    return done;
}

static bool set_scatter(const struct estimating_findings *self, struct frf *io_frf)
{
    const struct smoothness *scatter = &self->smoothness;
    if (scatter->lines == 0) {
        return true;
    }
    bool set = estimate_set_key(io_frf, "line_scatter_ratio", "%.4g", scatter->ratio);
    if (set && smoothness_is_rough(scatter)) {
        set =
            estimate_set_key(io_frf, "line_scatter_db", "%.4g", decibel(scatter->level)) &&
            estimate_set_key(io_frf, "warning_scatter",
                             "lines lie %.3g times as far from a smooth curve as std explains (median), by %.1f dB of "
                             "the response: what repeats in every period, as nonlinear distortion and disturbances "
                             "on the lines do, moves them and is not in std; %s",
                             scatter->ratio, decibel(scatter->level),
                             self->agreed.lines > 0 ? "more runs with other phases would average it"
                                                    : "several runs with other phases would put it there");
    }
    return set;
}

bool estimating_findings_set_keys(const struct estimating_findings *self, struct frf *io_frf)
{
    bool set = set_distortion(self, io_frf) && set_repetition(self, io_frf) && set_agreement(self, io_frf) &&
               set_oscillation(&self->oscillation, io_frf) && set_foreign(self, io_frf) && set_scatter(self, io_frf);
    return set && (self->harmonics_count == 0 ||
                   (set_thd(self, "thd_db", false, io_frf) && set_thd(self, "input_thd_db", true, io_frf)));
}

static void say_distortion(const struct estimating_findings *self, const struct frf *frf, struct remarks *io_remarks)
{
    static const char *const what[distortion_kinds] = {"odd-order distortion", "even-order distortion",
                                                       "distortion of any order"};
    static const char *const ids[distortion_kinds] = {"odd_distortion", "even_distortion", "distortion"};
    for (int kind = 0; kind < distortion_kinds; kind++) {
        const struct distortion_level *level = &self->distortion.kind[kind];
        if (level->bins == 0) {
            continue;
        }
        const double chance = distortion_chance(level);
        const double median = median_level(self, kind, frf);
        if (chance < believed && median > 0.0) {
            remarks_add(io_remarks, remark_fact, ids[kind],
                        "%s at %zu free bins: %.1f dB of the response (median; noise alone stays below %.1f dB)%s",
                        what[kind], level->bins, decibel(median), decibel(level->limit),
                        kind == distortion_odd && self->agreed.lines == 0 ? "; not in std" : "");
        } else if (chance < believed) {
            remarks_add(io_remarks, remark_fact, ids[kind],
                        "%s at %zu free bins: there is some, at most lines below %.1f dB of the response", what[kind],
                        level->bins, decibel(level->limit));
        } else {
            remarks_add(io_remarks, remark_fact, ids[kind],
                        "%s at %zu free bins: none above the noise, which is below %.1f dB of the response (95 %%)",
                        what[kind], level->bins, decibel(level->limit));
        }
    }
}

/// The strongest harmonics of a dwell.
static void say_harmonics(const struct estimating_findings *self, const struct frf *frf, struct remarks *io_remarks)
{
    double highest = NAN;
    double where_hz = 0.0;
    for (size_t line = 0; line < frf->count; line++) {
        const double level = thd_db(self, frf->frequency_hz[line], false);
        if (level > highest || (isnan(highest) && !isnan(level))) {
            highest = level;
            where_hz = frf->frequency_hz[line];
        }
    }
    if (self->harmonics_count > 0 && isnan(highest)) {
        remarks_add(io_remarks, remark_fact, "harmonics", "no harmonics above the noise");
    } else if (self->harmonics_count > 0) {
        remarks_add(io_remarks, remark_fact, "harmonics",
                    "total harmonic distortion at most %.2f dB, at %.6g Hz (all lines: key thd_db)", highest, where_hz);
    }
}

static void say_agreement(const struct agreement *agreed, struct remarks *io_remarks)
{
    if (agreed->lines == 0) {
        return;
    }
    if (agreement_differs(agreed)) {
        char level[64] = "";
        if (agreed->level > 0.0) {
            snprintf(level, sizeof level, " of %.1f dB of the response in each", decibel(agreed->level));
        }
        remarks_add(
            io_remarks, remark_fact, "realisations",
            "the %zu realisations lie %.3g times as far apart as their noise explains (median of %zu lines; noise "
            "alone would do that with a chance below %.1g): nonlinear distortion%s, or a drive that changed "
            "between them",
            agreed->realisations, agreed->ratio, agreed->lines, fmax(agreed->chance, 1e-99), level);
    } else {
        remarks_add(io_remarks, remark_fact, "realisations",
                    "the %zu realisations agree within their noise (as much scatter by chance: %.2g)",
                    agreed->realisations, agreed->chance);
    }
}

/// Keys that are sentences a reader must not miss, and their kind.
static const struct {
    const char *key, *id;
} warnings[] = {
    {"warning_repetition", "repetition"},     {"warning_oscillation", "oscillation"}, {"warning_inputs", "inputs"},
    {"warning_realisations", "realisations"}, {"warning_scatter", "scatter"},
};

enum { warning_count = sizeof warnings / sizeof warnings[0] };

void estimating_findings_say(const struct estimating_findings *self, const struct frf *frf, struct remarks *io_remarks)
{
    say_agreement(&self->agreed, io_remarks);
    say_distortion(self, frf, io_remarks);
    say_harmonics(self, frf, io_remarks);
    for (size_t i = 0; i < warning_count; i++) {
        if (estimate_key(frf, warnings[i].key)[0]) {
            remarks_add(io_remarks, remark_warning, warnings[i].id, "%s", estimate_key(frf, warnings[i].key));
        }
    }
    if (self->load_column[0]) {
        remarks_add(io_remarks, remark_advice, "load", "the load is measured too: --output %s for its response",
                    self->load_column);
    }
}

static void add_distortion_json(const struct estimating_findings *self, const struct frf *frf, cJSON *io_object)
{
    cJSON *distortion = cJSON_AddObjectToObject(io_object, "distortion");
    for (int kind = 0; kind < distortion_kinds; kind++) {
        const struct distortion_level *level = &self->distortion.kind[kind];
        if (level->bins == 0) {
            continue;
        }
        const double median = median_level(self, kind, frf);
        cJSON *one = cJSON_AddObjectToObject(distortion, kind_names[kind]);
        cJSON_AddNumberToObject(one, "free_bins", (double)level->bins);
        cJSON_AddNumberToObject(one, "median_db", median > 0.0 ? decibel(median) : NAN);
        cJSON_AddNumberToObject(one, "limit_db", level->limit > 0.0 ? decibel(level->limit) : NAN);
        cJSON_AddNumberToObject(one, "chance", distortion_chance(level));
    }
}

static void add_agreement_json(const struct agreement *agreed, cJSON *io_object)
{
    cJSON *object = cJSON_AddObjectToObject(io_object, "realisations");
    cJSON_AddNumberToObject(object, "count", (double)agreed->realisations);
    cJSON_AddNumberToObject(object, "chance", agreed->chance);
    cJSON_AddNumberToObject(object, "lines", (double)agreed->lines);
    cJSON_AddNumberToObject(object, "lines_beyond", (double)agreed->lines_beyond);
    cJSON_AddNumberToObject(object, "ratio", agreed->ratio);
    cJSON_AddNumberToObject(object, "stochastic_level_db", agreed->level > 0.0 ? decibel(agreed->level) : NAN);
    cJSON_AddBoolToObject(object, "differ", agreement_differs(agreed));
}

void estimating_findings_add_json(const struct estimating_findings *self, const struct frf *frf, cJSON *io_object)
{
    static const char *const texts[] = {"hold", "actuator", "columns_named"};
    static const char *const numbers[] = {"delay_removed_s", "other_inputs_db", "line_scatter_ratio",
                                          "line_scatter_db", "oscillation_hz",  "oscillation_level"};
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
        if (estimate_key(frf, texts[i])[0]) {
            cJSON_AddStringToObject(io_object, texts[i], estimate_key(frf, texts[i]));
        }
    }
    for (size_t i = 0; i < warning_count; i++) {
        if (estimate_key(frf, warnings[i].key)[0]) {
            cJSON_AddStringToObject(io_object, warnings[i].key, estimate_key(frf, warnings[i].key));
        }
    }
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++) {
        double value;
        const char *text = estimate_key(frf, numbers[i]);
        if (number_parse(text, strlen(text), &value) == number_ok) {
            cJSON_AddNumberToObject(io_object, numbers[i], value);
        }
    }
    if (self->load_column[0]) {
        cJSON_AddStringToObject(io_object, "load_column", self->load_column);
    }
    if (self->agreed.lines > 0) {
        add_agreement_json(&self->agreed, io_object);
    }
    if (self->recordings == 0) {
        return;
    }
    cJSON *repetition = cJSON_AddObjectToObject(io_object, "repetition");
    cJSON_AddNumberToObject(repetition, "repeats_after_periods", self->repetition.multiple);
    cJSON_AddNumberToObject(repetition, "tested_up_to", self->repetition.tested);
    cJSON_AddNumberToObject(repetition, "chance", self->repetition.chance);
    cJSON_AddNumberToObject(repetition, "level", self->repetition.level);
    cJSON_AddNumberToObject(repetition, "recordings", (double)self->recordings);
    cJSON_AddNumberToObject(repetition, "recordings_late", (double)self->late);
    add_distortion_json(self, frf, io_object);
    if (self->harmonics_count > 0) {
        cJSON *output = cJSON_AddArrayToObject(io_object, "thd_db");
        cJSON *input = cJSON_AddArrayToObject(io_object, "input_thd_db");
        for (size_t line = 0; line < frf->count; line++) {
            cJSON_AddItemToArray(output, cJSON_CreateNumber(thd_db(self, frf->frequency_hz[line], false)));
            cJSON_AddItemToArray(input, cJSON_CreateNumber(thd_db(self, frf->frequency_hz[line], true)));
        }
    }
}

void estimating_findings_add_page(const struct estimating_findings *self, const struct frf *frf, struct page *page)
{
    double *levels = self->harmonics_count > 0 ? malloc(frf->count * sizeof *levels) : NULL;
    for (size_t line = 0; levels && line < frf->count; line++) {
        levels[line] = thd_db(self, frf->frequency_hz[line], false);
    }
    frf_report_distortion_section(page, frf, levels);
    free(levels);
}
