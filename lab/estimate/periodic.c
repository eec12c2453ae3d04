/* SPDX-License-Identifier: MIT */
#include "lab/estimate/periodic.h"

#include "lab/estimate/columns.h"
#include "lab/estimate/period_search.h"
#include "lab/estimate/spectra.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;

static int refuse_memory(const struct run *run, struct error *out_error)
{
    return error_set(out_error, error_refused, "%s: not enough memory for the spectra of %zu rows", run->path,
                     run->rows);
}

static int choose_period(struct periodic *self, size_t wanted, struct error *out_error)
{
    const struct run *run = self->run;
    self->period_samples = wanted ? wanted : run->period_samples;
    if (self->period_samples > 0) {
        return 0;
    }
    struct period_search found;
    switch (period_search_run(run_column(run, self->input), run->rows, &found)) {
    case period_search_ok:
        self->period_samples = found.period_samples;
        self->period_found = true;
        return 0;
    case period_search_err_fraction:
        self->aperiodic = true;
        return error_set(
            out_error, error_refused,
            "%s: %s repeats every %.3f samples, which is no whole number of samples: resample the recording, or "
            "say --period SAMPLES if you know better, or --method lpm, h1 or indirect, which need no period",
            run->path, self->input, found.exact_samples);
    case period_search_err_none:
        self->aperiodic = true;
        return error_set(
            out_error, error_refused,
            "%s: the file has no key period_samples, and %s does not repeat itself: say --period SAMPLES, or "
            "--method lpm, h1 or indirect, which need none",
            run->path, self->input);
    case period_search_err_memory:
        break;
    }
    return refuse_memory(run, out_error);
}

static int count_periods(struct periodic *self, struct error *out_error)
{
    const struct run *run = self->run;
    if (self->period_samples < 3) {
        return error_set(out_error, error_refused, "%s: period of %zu samples: expected at least 3", run->path,
                         self->period_samples);
    }
    self->total = run->rows / self->period_samples;
    if (run->periods > 0 && self->period_samples == run->period_samples) {
        size_t said = run->periods + (run->has_settle_periods ? run->settle_periods : 0);
        self->total = said < self->total ? said : self->total;
    }
    if (self->total < 2) {
        return error_set(out_error, error_refused,
                         "%s: %zu rows are %zu whole periods of %zu samples: expected at least 2, because the standard "
                         "deviation comes from the differences between periods",
                         run->path, run->rows, self->total, self->period_samples);
    }
    return 0;
}

static int find_bins(struct periodic *self, struct error *out_error)
{
    const struct run *run = self->run;
    size_t all = self->period_samples / 2 + 1;
    double complex *spectra = malloc(self->total * all * sizeof *spectra);
    self->bins = malloc(all * sizeof *self->bins);
    /* The first period holds the transient: it would only add scatter. */
    size_t first = self->total > 2 ? 1 : 0;
    const double *signal = run_column(run, self->input) + first * self->period_samples;
    size_t counted = self->total - first;
    bool done = spectra && self->bins && spectra_transform_all(signal, self->period_samples, counted, spectra) &&
                period_search_bins(spectra, counted, (self->period_samples + 1) / 2, all, self->bins, &self->bin_count);
    free(spectra);
    if (!done) {
        return refuse_memory(run, out_error);
    }
    self->bins_found = true;
    if (self->bin_count == 0) {
        return error_set(
            out_error, error_refused,
            "%s: the file has no key excited_bins, and no line of %s repeats from period to period: say --lines",
            run->path, self->input);
    }
    return 0;
}

static int choose_bins(struct periodic *self, const struct periodic_options *options, struct error *out_error)
{
    const struct run *run = self->run;
    bool own_period = self->period_samples == run->period_samples;
    const uint32_t *bins = options->bins ? options->bins : own_period ? run->bins : NULL;
    size_t count = options->bins ? options->bin_count : own_period ? run->bin_count : 0;
    if (!bins || count == 0) {
        return find_bins(self, out_error);
    }
    for (size_t b = 0; b < count; b++) {
        if (bins[b] == 0 || bins[b] > (self->period_samples - 1) / 2 || (b > 0 && bins[b] <= bins[b - 1])) {
            return error_set(out_error, error_refused,
                             "%s: excited bin %u: expected ascending bins from 1 to %zu for a period of %zu samples",
                             run->path, (unsigned)bins[b], (self->period_samples - 1) / 2, self->period_samples);
        }
    }
    self->bins = malloc(count * sizeof *self->bins);
    if (!self->bins) {
        return refuse_memory(run, out_error);
    }
    memcpy(self->bins, bins, count * sizeof *self->bins);
    self->bin_count = count;
    return 0;
}

static size_t first_lost_row_of(const struct periodic *self, size_t period)
{
    return columns_first_lost_row(self->run, period * self->period_samples, self->period_samples);
}

static int measure_settling(struct periodic *self, const bool *usable, struct error *out_error)
{
    struct settle input;
    struct settle output;
    self->input_level = malloc(self->total * sizeof *self->input_level);
    self->output_level = malloc(self->total * sizeof *self->output_level);
    if (!self->input_level || !self->output_level ||
        !settle_measure(self->input_spectra, self->total, self->bin_count, usable, &input, self->input_level) ||
        !settle_measure(self->output_spectra, self->total, self->bin_count, usable, &output, self->output_level)) {
        return refuse_memory(self->run, out_error);
    }
    self->transient = output;
    if (input.periods > output.periods) {
        self->transient.periods = input.periods;
        self->transient.settled = input.settled;
    }
    return 0;
}

static void choose_settle(struct periodic *self, const struct periodic_options *options)
{
    self->settle_source = options->settle;
    if (options->settle == periodic_settle_default || options->settle == periodic_settle_keep) {
        bool keep = options->settle == periodic_settle_keep;
        self->settle_source = self->run->has_settle_periods ? periodic_settle_key
                              : keep                        ? periodic_settle_keep
                                                            : periodic_settle_auto;
    }
    switch (self->settle_source) {
    case periodic_settle_given:
        self->settle = options->settle_periods;
        break;
    case periodic_settle_key:
        self->settle = self->run->settle_periods;
        break;
    case periodic_settle_keep:
        self->settle = 0;
        break;
    case periodic_settle_auto:
    case periodic_settle_default:
        self->settle = self->transient.periods;
        break;
    }
}

static int select_periods(struct periodic *self, const bool *usable, struct error *out_error)
{
    self->used_periods = malloc(self->total * sizeof *self->used_periods);
    if (!self->used_periods) {
        return refuse_memory(self->run, out_error);
    }
    for (size_t p = self->settle; p < self->total; p++) {
        if (usable[p]) {
            self->used_periods[self->used++] = p;
        } else {
            self->first_lost_row = self->lost == 0 ? first_lost_row_of(self, p) : self->first_lost_row;
            self->lost++;
        }
    }
    if (self->used >= 2) {
        return 0;
    }
    return error_set(
        out_error, error_refused,
        "%s: %zu of %zu periods count (%zu left out for settling, %zu for lost samples): expected at least 2, "
        "because the standard deviation comes from the differences between periods",
        self->run->path, self->used, self->total, self->settle < self->total ? self->settle : self->total, self->lost);
}

/// Where the spectra of the periods that count begin; gaps among them are closed.
static double complex *keep_used(const struct periodic *self, double complex *io_spectra)
{
    double complex *first = io_spectra + self->used_periods[0] * self->bin_count;
    for (size_t i = 1; i < self->used; i++) {
        double complex *from = io_spectra + self->used_periods[i] * self->bin_count;
        double complex *to = first + i * self->bin_count;
        if (to != from) {
            memmove(to, from, self->bin_count * sizeof *to);
        }
    }
    return first;
}

/// Slope of the line through the means of the periods that count.
static double slope_of_means(const struct periodic *self, const double *signal)
{
    double mean_period = 0.0;
    for (size_t i = 0; i < self->used; i++) {
        mean_period += (double)self->used_periods[i] / (double)self->used;
    }
    double product = 0.0;
    double square = 0.0;
    for (size_t i = 0; i < self->used; i++) {
        const double *x = signal + self->used_periods[i] * self->period_samples;
        double mean = 0.0;
        for (size_t n = 0; n < self->period_samples; n++) {
            mean += x[n] / (double)self->period_samples;
        }
        double distance = (double)self->used_periods[i] - mean_period;
        product += distance * mean;
        square += distance * distance;
    }
    return product / square / (double)self->period_samples;
}

/// An integrating output drifts when the speed has a mean: a ramp, which is not periodic and leaks into every line in
/// the same way in every period, so that no scatter betrays it. Its transform is known: sum_n n exp(-jwn) = N /
/// (exp(-jw) - 1).
static void take_out_trend(struct periodic *self)
{
    if (!columns_is_position(self->output)) {
        return;
    }
    double length = (double)self->period_samples;
    self->trend_per_sample = slope_of_means(self, run_column(self->run, self->output));
    for (size_t b = 0; b < self->bin_count; b++) {
        double complex ramp = length / (cexp(-I * two_pi * (double)self->bins[b] / length) - 1.0);
        for (size_t i = 0; i < self->used; i++) {
            self->output_spectra[i * self->bin_count + b] -= self->trend_per_sample * ramp;
        }
    }
}

static int transform_and_select(struct periodic *self, const struct periodic_options *options, struct error *out_error)
{
    const struct run *run = self->run;
    size_t size = self->total * self->bin_count;
    self->input_spectra = malloc(size * sizeof *self->input_spectra);
    self->output_spectra = malloc(size * sizeof *self->output_spectra);
    self->owned_spectra[0] = self->input_spectra;
    self->owned_spectra[1] = self->output_spectra;
    bool *usable = malloc(self->total * sizeof *usable);
    int status = 0;
    if (!self->input_spectra || !self->output_spectra || !usable ||
        !spectra_transform_both(run_column(run, self->input), run_column(run, self->output), self->period_samples,
                                self->total, self->bins, self->bin_count, self->input_spectra, self->output_spectra)) {
        status = refuse_memory(run, out_error);
    }
    for (size_t p = 0; p < self->total && !status; p++) {
        usable[p] = first_lost_row_of(self, p) == 0;
    }
    status = status ? status : measure_settling(self, usable, out_error);
    if (!status) {
        choose_settle(self, options);
        status = select_periods(self, usable, out_error);
    }
    free(usable);
    if (!status) {
        self->input_spectra = keep_used(self, self->input_spectra);
        self->output_spectra = keep_used(self, self->output_spectra);
        take_out_trend(self);
    }
    return status;
}

int periodic_cut(const struct run *run, const struct periodic_options *options, struct periodic *out_self,
                 struct error *out_error)
{
    struct columns columns;
    const struct columns wanted = {options->input, options->output, options->reference};
    *out_self = (struct periodic){.run = run};
    int status = columns_choose(run, &wanted, &columns, out_error);
    if (status) {
        return status;
    }
    out_self->input = columns.input;
    out_self->output = columns.output;
    out_self->reference = columns.reference;
    status = choose_period(out_self, options->period_samples, out_error);
    status = status ? status : count_periods(out_self, out_error);
    status = status ? status : choose_bins(out_self, options, out_error);
    status = status ? status : transform_and_select(out_self, options, out_error);
    if (status) {
        bool aperiodic = out_self->aperiodic;
        periodic_free(out_self);
        out_self->aperiodic = aperiodic;
    }
    return status;
}

bool periodic_transform_used(const struct periodic *self, const char *column, double complex *out_spectra)
{
    const double *signal = run_column(self->run, column);
    for (size_t i = 0; i < self->used; i++) {
        if (!spectra_transform_periods(signal + self->used_periods[i] * self->period_samples, self->period_samples, 1,
                                       self->bins, self->bin_count, out_spectra + i * self->bin_count)) {
            return false;
        }
    }
    return true;
}

void periodic_free(struct periodic *self)
{
    free(self->bins);
    free(self->used_periods);
    free(self->input_level);
    free(self->output_level);
    free(self->owned_spectra[0]);
    free(self->owned_spectra[1]);
    *self = (struct periodic){0};
}
