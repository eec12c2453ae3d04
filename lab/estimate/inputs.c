/* SPDX-License-Identifier: MIT */
#include "lab/estimate/inputs.h"

#include "lab/estimate/columns.h"
#include "lab/estimate/line_search.h"
#include "lab/estimate/period_search.h"
#include "lab/estimate/spectra.h"

#include <complex.h>
#include <ctype.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct quantity {
    const char *stem;
    const char *unit;
};

static const struct quantity usual_inputs[] = {{"torque", "Nm"}, {"force", "N"},       {"current", "A"},
                                               {"voltage", "V"}, {"torque_ref", "Nm"}, {"force_ref", "N"}};
static const struct quantity usual_outputs[] = {
    {"velocity", "rad_per_s"}, {"velocity", "m_per_s"}, {"position", "rad"}, {"position", "m"}};

/// Two inputs share a line if the weaker one has more than this of the stronger one's share.
static const double same_strength = 0.5;

/// The number in STEM_NUMBER_UNIT, 0 for STEM_UNIT, -1 for any other name.
static long number_in(const char *name, const struct quantity *quantity)
{
    const size_t stem = strlen(quantity->stem);
    if (strncmp(name, quantity->stem, stem) != 0 || name[stem] != '_') {
        return -1;
    }
    const char *rest = name + stem + 1;
    if (strcmp(rest, quantity->unit) == 0) {
        return 0;
    }
    char *end;
    const long number = isdigit((unsigned char)*rest) ? strtol(rest, &end, 10) : -1;
    return number > 0 && *end == '_' && strcmp(end + 1, quantity->unit) == 0 ? number : -1;
}

/// Columns of a quantity, ascending by number; those without one only if `plain`.
static size_t list_columns(const struct run *run, const struct quantity *quantity, bool plain,
                           const char *out_names[inputs_max])
{
    size_t count = 0;
    long last = plain ? -1 : 0;
    while (count < inputs_max) {
        long next = -1;
        for (size_t c = 0; c < run->column_count; c++) {
            const long number = number_in(run->columns[c].name, quantity);
            if (number > last && (next < 0 || number < next)) {
                next = number;
                out_names[count] = run->columns[c].name;
            }
        }
        if (next < 0) {
            break;
        }
        last = next;
        count++;
    }
    return count;
}

size_t inputs_list(const struct run *run, const char *out_names[inputs_max])
{
    for (size_t i = 0; i < sizeof usual_inputs / sizeof usual_inputs[0]; i++) {
        const size_t count = list_columns(run, &usual_inputs[i], false, out_names);
        if (count >= 2) {
            return count;
        }
    }
    return 0;
}

size_t inputs_list_outputs(const struct run *run, const char *out_names[inputs_max])
{
    for (size_t i = 0; i < sizeof usual_outputs / sizeof usual_outputs[0]; i++) {
        const size_t count = list_columns(run, &usual_outputs[i], true, out_names);
        if (count > 0) {
            return count;
        }
    }
    return 0;
}

static int refuse_memory(const struct run *run, struct error *out_error)
{
    return error_set(out_error, error_refused, "%s: not enough memory for the spectra of %zu rows", run->path,
                     run->rows);
}

static int check_finite(const struct run *run, const char *name, struct error *out_error)
{
    const double *values = run_column(run, name);
    for (size_t n = 0; n < run->rows; n++) {
        if (!isfinite(values[n])) {
            return error_set(out_error, error_refused, "%s: row %zu of %s is not a finite number", run->path, n + 1,
                             name);
        }
    }
    return 0;
}

static bool set_bins(struct inputs *self, size_t input, const uint32_t *bins, size_t count)
{
    self->bins[input] = malloc((count + 1) * sizeof *self->bins[input]);
    if (self->bins[input] && count > 0) {
        memcpy(self->bins[input], bins, count * sizeof *bins);
        self->bin_count[input] = count;
    }
    return self->bins[input] != NULL;
}

/// Which segment a run is of: its key says "2 of 8".
static int find_segment(const struct run *run, const struct sequence_file *design, size_t *out_segment,
                        struct error *out_error)
{
    const char *text = run_key(run, "segment");
    unsigned long number = 1;
    unsigned long of = design->segment_count;
    *out_segment = 0;
    if (!text && design->segment_count == 1) {
        return 0;
    }
    if (!text || sscanf(text, "%lu of %lu", &number, &of) != 2 || of != design->segment_count || number < 1 ||
        number > of) {
        return error_set(out_error, error_refused,
                         "%s: segment: '%.40s': expected which of the %zu segments of %s it is", run->path,
                         text ? text : "", design->segment_count, design->path);
    }
    *out_segment = number - 1;
    return 0;
}

static int take_from_design(const struct run *run, const struct inputs_known *known, struct inputs *self,
                            struct error *out_error)
{
    const struct sequence_file *design = known->design;
    const size_t period = known->period_samples ? known->period_samples : run->period_samples;
    size_t segment;
    if (design->inputs != self->count) {
        return error_set(out_error, error_refused, "%s: %zu inputs, %s to %s: expected the %zu of %s", run->path,
                         self->count, self->names[0], self->names[self->count - 1], design->inputs, design->path);
    }
    if (period != 0 && period != design->period_samples) {
        return error_set(out_error, error_refused, "%s: period of %zu samples: expected the %zu of %s", run->path,
                         period, design->period_samples, design->path);
    }
    int status = find_segment(run, design, &segment, out_error);
    for (size_t p = 0; p < self->count && !status; p++) {
        const struct sequence_table *table = &design->segments[segment].tables[p];
        status = set_bins(self, p, table->bins, table->bin_count) ? 0 : refuse_memory(run, out_error);
    }
    return status;
}

static int choose_period(const struct run *run, const struct inputs_known *known, const struct inputs *self,
                         size_t *out_period, struct error *out_error)
{
    *out_period = known->period_samples ? known->period_samples
                  : known->design       ? known->design->period_samples
                                        : run->period_samples;
    struct period_search found;
    double *owned;
    const double *filled = *out_period == 0 ? columns_filled(run, self->names[0], &owned) : NULL;
    if (filled) {
        *out_period = period_search_run(filled, run->rows, &found) == period_search_ok ? found.period_samples : 0;
        free(owned);
    }
    if (*out_period < 3 || run->rows / *out_period < 2) {
        return error_set(out_error, error_refused,
                         "%s: %zu rows are no two periods of several inputs: expected the key period_samples or "
                         "--period SAMPLES, and two periods of it",
                         run->path, run->rows);
    }
    return 0;
}

/// Magnitudes of the mean spectra, all inputs, and which bins repeat with power.
struct strengths {
    size_t period, bins; ///< of one period: 0 .. bins - 1
    double *magnitude;   ///< count x bins
    double strongest[inputs_max];
    bool *excited; ///< by anybody
};

/// Magnitudes of the mean spectrum.
static void measure_magnitudes(const struct line_search *search, size_t input, struct strengths *io)
{
    const size_t all = search->period_samples / 2 + 1;
    for (size_t k = 1; k < io->bins; k++) {
        double complex mean = 0.0;
        for (size_t m = 0; m < search->periods; m++) {
            mean += search->spectra[m * all + k] / (double)search->periods;
        }
        io->magnitude[input * io->bins + k] = cabs(mean);
        io->strongest[input] = fmax(io->strongest[input], cabs(mean));
    }
}

static int measure_input(const struct run *run, size_t input, const char *name, struct strengths *io,
                         struct error *out_error)
{
    struct line_search search;
    struct line_search_result found = {.count = 0};
    int status = 0;
    if (!line_search_transform(run, name, io->period, run->rows / io->period, &search)) {
        status = refuse_memory(run, out_error);
    } else if (search.periods < 2) {
        status =
            error_set(out_error, error_refused,
                      "%s: %zu of %zu periods have no lost sample: expected at least 2 for the lines of each input",
                      run->path, search.periods, run->rows / io->period);
    } else if (!line_search_run(&search, &found)) {
        status = refuse_memory(run, out_error);
    } else {
        measure_magnitudes(&search, input, io);
    }
    for (size_t b = 0; b < found.count && !status; b++) {
        io->excited[found.bins[b]] = true;
    }
    line_search_result_free(&found);
    line_search_free(&search);
    return status;
}

static int measure_strengths(const struct run *run, const struct inputs *self, size_t period, struct strengths *out,
                             struct error *out_error)
{
    *out = (struct strengths){.period = period, .bins = (period + 1) / 2};
    out->magnitude = calloc(self->count * out->bins, sizeof *out->magnitude);
    out->excited = calloc(out->bins, sizeof *out->excited);
    int status = out->magnitude && out->excited ? 0 : refuse_memory(run, out_error);
    for (size_t p = 0; p < self->count && !status; p++) {
        status = measure_input(run, p, self->names[p], out, out_error);
    }
    if (!status && run->bins && run->period_samples == period) {
        memset(out->excited, 0, out->bins * sizeof *out->excited);
        for (size_t b = 0; b < run->bin_count && run->bins[b] < out->bins; b++) {
            out->excited[run->bins[b]] = true;
        }
    }
    return status;
}

static double share_of(const struct strengths *strengths, size_t input, size_t bin)
{
    const double strongest = strengths->strongest[input];
    return strongest > 0.0 ? strengths->magnitude[input * strengths->bins + bin] / strongest : 0.0;
}

/// Whose line a bin is.
static int find_owner(const struct run *run, const struct inputs *self, const struct strengths *strengths, size_t bin,
                      size_t *out_owner, struct error *out_error)
{
    size_t best = 0;
    size_t second = 1;
    for (size_t p = 1; p < self->count; p++) {
        if (share_of(strengths, p, bin) > share_of(strengths, best, bin)) {
            second = best;
            best = p;
        } else if (p != second && share_of(strengths, p, bin) > share_of(strengths, second, bin)) {
            second = p;
        }
    }
    *out_owner = best;
    if (share_of(strengths, second, bin) > same_strength * share_of(strengths, best, bin)) {
        return error_set(out_error, error_refused,
                         "%s: both %s and %s are excited on bin %zu: expected lines of its own for each input "
                         "(design --inputs), or one run for each input",
                         run->path, self->names[best < second ? best : second],
                         self->names[best < second ? second : best], bin);
    }
    return 0;
}

static int divide_by_power(const struct run *run, const struct strengths *strengths, struct inputs *self,
                           struct error *out_error)
{
    int status = 0;
    for (size_t p = 0; p < self->count && !status; p++) {
        self->bins[p] = malloc(strengths->bins * sizeof *self->bins[p]);
        status = self->bins[p] ? 0 : refuse_memory(run, out_error);
    }
    for (size_t k = 1; k < strengths->bins && !status; k++) {
        size_t owner;
        if (strengths->excited[k]) {
            status = find_owner(run, self, strengths, k, &owner, out_error);
            if (!status) {
                self->bins[owner][self->bin_count[owner]++] = (uint32_t)k;
            }
        }
    }
    for (size_t p = 0; p < self->count && !status; p++) {
        if (self->bin_count[p] == 0) {
            status = error_set(out_error, error_refused,
                               "%s: %s has no line of its own: expected an input that is excited, or --input COLUMN",
                               run->path, self->names[p]);
        }
    }
    return status;
}

static void find_foreign_share(const struct strengths *strengths, struct inputs *self)
{
    for (size_t p = 0; p < self->count; p++) {
        for (size_t b = 0; b < self->bin_count[p]; b++) {
            const size_t bin = self->bins[p][b];
            for (size_t q = 0; q < self->count && bin < strengths->bins; q++) {
                const double own = strengths->magnitude[p * strengths->bins + bin];
                const double other = strengths->magnitude[q * strengths->bins + bin];
                self->foreign_share =
                    q != p && own > 0.0 ? fmax(self->foreign_share, other / own) : self->foreign_share;
            }
        }
    }
}

int inputs_find(const struct run *run, const struct inputs_known *known, struct inputs *out_self,
                struct error *out_error)
{
    struct strengths strengths = {0};
    size_t period = 0;
    *out_self = (struct inputs){0};
    out_self->count = inputs_list(run, out_self->names);
    int status = 0;
    if (out_self->count < 2) {
        return error_set(out_error, error_refused,
                         "%s: no two inputs: expected columns like torque_1_Nm and torque_2_Nm", run->path);
    }
    for (size_t p = 0; p < out_self->count && !status; p++) {
        status = check_finite(run, out_self->names[p], out_error);
    }
    status = status ? status : choose_period(run, known, out_self, &period, out_error);
    status = status ? status : measure_strengths(run, out_self, period, &strengths, out_error);
    if (!status) {
        status = known->design ? take_from_design(run, known, out_self, out_error)
                               : divide_by_power(run, &strengths, out_self, out_error);
    }
    if (!status) {
        find_foreign_share(&strengths, out_self);
    }
    free(strengths.magnitude);
    free(strengths.excited);
    if (status) {
        inputs_free(out_self);
    }
    return status;
}

static int compare_bins(const void *a, const void *b)
{
    const uint32_t left = *(const uint32_t *)a;
    const uint32_t right = *(const uint32_t *)b;
    return (left > right) - (left < right);
}

uint32_t *inputs_others(const struct inputs *self, size_t own, size_t *out_count)
{
    size_t most = 1;
    for (size_t p = 0; p < self->count; p++) {
        most += self->bin_count[p];
    }
    uint32_t *others = malloc(most * sizeof *others);
    *out_count = 0;
    for (size_t p = 0; others && p < self->count; p++) {
        for (size_t b = 0; p != own && b < self->bin_count[p]; b++) {
            others[(*out_count)++] = self->bins[p][b];
        }
    }
    if (others) {
        qsort(others, *out_count, sizeof *others, compare_bins);
    }
    return others;
}

void inputs_free(struct inputs *self)
{
    for (size_t p = 0; p < inputs_max; p++) {
        free(self->bins[p]);
    }
    *self = (struct inputs){0};
}
