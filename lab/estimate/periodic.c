/* SPDX-License-Identifier: MIT */
#include "lab/estimate/periodic.h"

#include "lab/estimate/period_search.h"
#include "lab/estimate/spectra.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;

static const char *const usual_inputs[] = {"torque_Nm", "force_N", "current_A", "voltage_V", NULL};
static const char *const usual_outputs[] = {"velocity_rad_per_s", "velocity_m_per_s", "position_rad", "position_m",
                                            NULL};

static int refuse_memory(const struct run *run, struct error *out_error)
{
    return error_set(out_error, error_refused, "%s: not enough memory for the spectra of %zu rows", run->path,
                     run->rows);
}

/// The run's own spelling of a column name, so that the result does not borrow from the caller.
static const char *own_name(const struct run *run, const char *name)
{
    for (size_t c = 0; c < run->column_count; c++) {
        if (strcmp(run->columns[c].name, name) == 0) {
            return run->columns[c].name;
        }
    }
    return NULL;
}

static int choose_column(const struct run *run, const char *what, const char *wanted, const char *const *usual,
                         const char **out_name, struct error *out_error)
{
    *out_name = wanted ? own_name(run, wanted) : NULL;
    for (size_t i = 0; !wanted && !*out_name && usual[i]; i++) {
        *out_name = own_name(run, usual[i]);
    }
    if (*out_name) {
        return 0;
    }
    if (wanted) {
        return error_set(out_error, error_refused, "%s: no column '%s' to take as the %s", run->path, wanted, what);
    }
    return error_set(out_error, error_refused, "%s: no %s column: expected %s, %s, %s or %s, or --%s COLUMN", run->path,
                     what, usual[0], usual[1], usual[2], usual[3], what);
}

static bool finite_column(const struct run *run, const char *name, struct error *out_error)
{
    const double *values = run_column(run, name);
    for (size_t n = 0; n < run->rows; n++) {
        if (!isfinite(values[n])) {
            error_set(out_error, error_refused, "%s: row %zu of %s is not a finite number", run->path, n + 1, name);
            return false;
        }
    }
    return true;
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
        return error_set(
            out_error, error_refused,
            "%s: %s repeats every %.3f samples, which is no whole number of samples: resample the recording, or "
            "say --period SAMPLES if you know better",
            run->path, self->input, found.exact_samples);
    case period_search_err_none:
        return error_set(out_error, error_refused,
                         "%s: the file has no key period_samples, and %s does not repeat itself: say --period SAMPLES",
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

/// Row of the first lost sample of a period, counted from 1; 0 if it has none.
static size_t first_lost_row_of(const struct periodic *self, size_t period)
{
    const double *valid = run_column(self->run, "valid");
    for (size_t n = 0; valid && n < self->period_samples; n++) {
        size_t row = period * self->period_samples + n;
        if (!(valid[row] > 0.5)) {
            return row + 1;
        }
    }
    return 0;
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
    if (options->settle == periodic_settle_default) {
        self->settle_source = self->run->has_settle_periods ? periodic_settle_key : periodic_settle_auto;
    }
    switch (self->settle_source) {
    case periodic_settle_given:
        self->settle = options->settle_periods;
        break;
    case periodic_settle_key:
        self->settle = self->run->settle_periods;
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

/// Moves the spectra of the periods that count to the front.
static void keep_used(const struct periodic *self, double complex *io_spectra)
{
    for (size_t i = 0; i < self->used; i++) {
        memmove(io_spectra + i * self->bin_count, io_spectra + self->used_periods[i] * self->bin_count,
                self->bin_count * sizeof *io_spectra);
    }
}

static bool ends_with(const char *text, const char *end)
{
    size_t length = strlen(text);
    size_t end_length = strlen(end);
    return length >= end_length && strcmp(text + length - end_length, end) == 0;
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
    if (!ends_with(self->output, "_rad") && !ends_with(self->output, "_m")) {
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
    bool *usable = malloc(self->total * sizeof *usable);
    int status = 0;
    if (!self->input_spectra || !self->output_spectra || !usable ||
        !spectra_transform_periods(run_column(run, self->input), self->period_samples, self->total, self->bins,
                                   self->bin_count, self->input_spectra) ||
        !spectra_transform_periods(run_column(run, self->output), self->period_samples, self->total, self->bins,
                                   self->bin_count, self->output_spectra)) {
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
        keep_used(self, self->input_spectra);
        keep_used(self, self->output_spectra);
        take_out_trend(self);
    }
    return status;
}

static int check_output(const struct run *run, const char *output, struct error *out_error)
{
    const double *values = run_column(run, output);
    for (size_t n = 1; n < run->rows; n++) {
        if (values[n] != values[0]) {
            return 0;
        }
    }
    return error_set(out_error, error_refused, "%s: %s does not change: expected an axis that moves, see --output",
                     run->path, output);
}

int periodic_cut(const struct run *run, const struct periodic_options *options, struct periodic *out_self,
                 struct error *out_error)
{
    *out_self = (struct periodic){.run = run};
    int status = choose_column(run, "input", options->input, usual_inputs, &out_self->input, out_error);
    status =
        status ? status : choose_column(run, "output", options->output, usual_outputs, &out_self->output, out_error);
    if (!status &&
        !(finite_column(run, out_self->input, out_error) && finite_column(run, out_self->output, out_error))) {
        status = error_refused;
    }
    status = status ? status : check_output(run, out_self->output, out_error);
    status = status ? status : choose_period(out_self, options->period_samples, out_error);
    status = status ? status : count_periods(out_self, out_error);
    status = status ? status : choose_bins(out_self, options, out_error);
    status = status ? status : transform_and_select(out_self, options, out_error);
    if (status) {
        periodic_free(out_self);
    }
    return status;
}

void periodic_free(struct periodic *self)
{
    free(self->bins);
    free(self->used_periods);
    free(self->input_level);
    free(self->output_level);
    free(self->input_spectra);
    free(self->output_spectra);
    *self = (struct periodic){0};
}
