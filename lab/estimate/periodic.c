/* SPDX-License-Identifier: MIT */
#include "lab/estimate/periodic.h"

#include "lab/estimate/columns.h"
#include "lab/estimate/line_search.h"
#include "lab/estimate/period_search.h"
#include "lab/estimate/ramp.h"
#include "lab/estimate/spectra.h"
#include "lab/numeric/cmplx.h"
#include "lab/numeric/large.h"
#include "lab/numeric/vector.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/// Rounding of sums and transforms against the largest number that takes part in them, with a margin.
static const double rounding = 1e-12;
/// Lines that hold less of the input's RMS than this hold what writing it with a few digits leaves.
static const double nothing_of_signal = 1e-6;
/// A ramp's own numbers may have been rounded to a few digits.
static const double rounding_of_ramp = 1e-6;

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
    double *owned;
    const double *filled = columns_filled(run, self->input, &owned);
    const enum period_search_status status =
        filled ? period_search_run(filled, run->rows, &found) : period_search_err_memory;
    free(owned);
    switch (status) {
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

static size_t first_lost_row_of(const struct periodic *self, size_t period)
{
    return columns_first_lost_row(self->run, period * self->period_samples, self->period_samples);
}

static int search_lines(struct periodic *self, const struct line_search *search, struct error *out_error)
{
    const struct run *run = self->run;
    struct line_search_result found;
    if (!line_search_run(search, &found)) {
        line_search_result_free(&found);
        return refuse_memory(run, out_error);
    }
    self->bins = found.bins;
    self->bin_count = found.count;
    self->doubtful = found.doubtful;
    self->doubtful_count = found.doubtful_count;
    self->bins_found = true;
    if (self->bin_count > 0) {
        return 0;
    }
    return error_set(out_error, error_refused,
                     "%s: the file has no key excited_bins, and no line of %s repeats from period to period of %zu "
                     "samples: expected an excited input, see --input, or --lines",
                     run->path, self->input, self->period_samples);
}

static int find_bins(struct periodic *self, struct error *out_error)
{
    const struct run *run = self->run;
    struct line_search search;
    int status = 0;
    if (!line_search_transform(run, self->input, self->period_samples, self->total, &search)) {
        status = refuse_memory(run, out_error);
    } else if (search.periods < 2) {
        status = error_set(out_error, error_refused,
                           "%s: %zu of %zu periods count (%zu left out for lost samples): expected at least 2, to find "
                           "the lines by their power and for the standard deviation",
                           run->path, search.periods, self->total, self->total - search.periods);
    } else {
        status = search_lines(self, &search, out_error);
    }
    line_search_free(&search);
    return status;
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

/// Lost rows that no period pays for: they are in what is left out anyway.
static void count_lost_outside(struct periodic *self)
{
    const size_t rows = self->run->rows;
    const size_t settled = self->settle < self->total ? self->settle * self->period_samples : rows;
    const size_t end = self->total * self->period_samples;
    size_t row = columns_first_lost_row(self->run, 0, rows);
    while (row > 0) {
        if (row <= settled || row > end) {
            self->first_lost_outside = self->lost_outside == 0 ? row : self->first_lost_outside;
            self->lost_outside++;
        }
        row = columns_first_lost_row(self->run, row, rows - row);
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
    count_lost_outside(self);
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

/// Sums of the periods that count, as spectra with one bin each; NULL if memory is short.
static double complex *sum_periods(const struct periodic *self, const double *signal)
{
    double complex *sums = calloc(self->used, sizeof *sums);
    for (size_t i = 0; i < self->used && sums; i++) {
        const double *x = signal + self->used_periods[i] * self->period_samples;
        sums[i] = vector_sum(self->period_samples, x);
    }
    return sums;
}

/// An integrating output drifts when the speed has a mean: a ramp, which is not periodic and leaks into every line in
/// the same way in every period, so that no scatter betrays it. Its transform is known: sum_n n exp(-jwn) = N /
/// (exp(-jw) - 1).
static int take_out_trend(struct periodic *self, struct error *out_error)
{
    if (!columns_is_position(self->output)) {
        return 0;
    }
    double complex *sums = sum_periods(self, run_column(self->run, self->output));
    if (!sums) {
        return refuse_memory(self->run, out_error);
    }
    self->trend_per_sample = ramp_slope(sums, 1, self->used_periods, self->used, self->period_samples);
    free(sums);
    for (size_t b = 0; b < self->bin_count; b++) {
        double complex ramp = ramp_transform(self->bins[b], self->period_samples);
        for (size_t i = 0; i < self->used; i++) {
            self->output_spectra[i * self->bin_count + b] -= self->trend_per_sample * ramp;
        }
    }
    return 0;
}

static double larger(double a, double b)
{
    return a > b ? a : b;
}

/// Mean spectra of the input, a ramp taken out that the periods' sums show, and what rounding may leave of each line.
static void mean_input(const struct periodic *self, const double complex *sums, double complex *out_mean,
                       double *out_limit)
{
    const double slope = ramp_slope(sums, 1, self->used_periods, self->used, self->period_samples);
    double largest = 0.0;
    double largest_power = 0.0;
    memset(out_mean, 0, self->bin_count * sizeof *out_mean);
    for (size_t i = 0; i < self->used; i++) {
        largest = fmax(largest, cabs(sums[i]));
        for (size_t b = 0; b < self->bin_count; b++) {
            out_mean[b] += self->input_spectra[i * self->bin_count + b];
        }
    }
    for (size_t b = 0; b < self->bin_count; b++) {
        out_mean[b] /= (double)self->used;
        largest_power = larger(largest_power, cmplx_power(out_mean[b]));
    }
    largest = fmax(largest, sqrt(largest_power));
    const double length = (double)self->period_samples;
    for (size_t b = 0; b < self->bin_count; b++) {
        /* sin(w/2) >= w/pi; most lines stand so far above any ramp that it need not be worked out. */
        const double most = fabs(slope) * length * length / (4.0 * (double)self->bins[b]);
        const double clear = 4.0 * most + rounding * largest;
        out_limit[b] = rounding * largest;
        if (cmplx_power(out_mean[b]) > clear * clear) {
            continue;
        }
        const double complex ramp = slope * ramp_transform(self->bins[b], self->period_samples);
        out_mean[b] -= ramp;
        out_limit[b] = larger(rounding * largest, rounding_of_ramp * sqrt(cmplx_power(ramp)));
    }
}

/// Sets lines to 0 that hold nothing but rounding. Returns how many do not; *out_strongest is the strongest of all.
static size_t silence_lines(struct periodic *self, const double complex *mean, const double *limit,
                            size_t *out_strongest)
{
    size_t powered = 0;
    double strongest = 0.0;
    *out_strongest = 0;
    for (size_t b = 0; b < self->bin_count; b++) {
        const double magnitude = sqrt(cmplx_power(mean[b]));
        *out_strongest = magnitude > strongest ? b : *out_strongest;
        strongest = larger(strongest, magnitude);
        powered += magnitude > limit[b];
        for (size_t i = 0; i < self->used && !(magnitude > limit[b]); i++) {
            self->input_spectra[i * self->bin_count + b] = 0.0;
        }
    }
    return powered;
}

static int refuse_silence(const struct periodic *self, size_t strongest, double magnitude, double limit,
                          struct error *out_error)
{
    const double to_amplitude = 2.0 / (double)self->period_samples;
    const double step_hz = self->run->sample_rate_hz / (double)self->period_samples;
    return error_set(out_error, error_refused,
                     "%s: %s has no power on any of %zu lines: the strongest, %.6g Hz, has an amplitude of %.2g, and "
                     "rounding alone may leave %.2g: expected a signal that excites the drive, see --input, --lines",
                     self->run->path, self->input, self->bin_count, (double)self->bins[strongest] * step_hz,
                     magnitude * to_amplitude, limit * to_amplitude);
}

/// RMS of the input in the first period that counts, without its mean.
static double rms_of_input(const struct periodic *self, double sum)
{
    const double length = (double)self->period_samples;
    const double *x = run_column(self->run, self->input) + self->used_periods[0] * self->period_samples;
    double square = 0.0;
    for (size_t n = 0; n < self->period_samples; n++) {
        square += (x[n] - sum / length) * (x[n] - sum / length);
    }
    return sqrt(square / length);
}

/// Lines that were said, of which the input holds nothing.
static int check_lines(const struct periodic *self, size_t strongest, double magnitude, double rms,
                       struct error *out_error)
{
    const double length = (double)self->period_samples;
    const double amplitude = 2.0 * magnitude / length;
    if (self->bins_found || !(amplitude < nothing_of_signal * rms)) {
        return 0;
    }
    return error_set(out_error, error_refused,
                     "%s: %s has no power on any of %zu lines: the strongest, %.6g Hz, has an amplitude of %.2g "
                     "(%.0f dB of its RMS, %.3g): expected the lines that are excited, see --lines, --input",
                     self->run->path, self->input, self->bin_count,
                     (double)self->bins[strongest] * self->run->sample_rate_hz / length, amplitude,
                     20.0 * log10(fmax(amplitude / rms, 1e-20)), rms);
}

/// What rounding makes of a constant or a ramp is the same in all periods: scatter does not tell it from a line.
static int check_power(struct periodic *self, struct error *out_error)
{
    double complex *sums = sum_periods(self, run_column(self->run, self->input));
    double complex *mean = malloc(self->bin_count * sizeof *mean);
    double *limit = malloc(self->bin_count * sizeof *limit);
    int status = sums && mean && limit ? 0 : refuse_memory(self->run, out_error);
    if (!status) {
        size_t strongest;
        mean_input(self, sums, mean, limit);
        if (silence_lines(self, mean, limit, &strongest) == 0) {
            status = refuse_silence(self, strongest, cabs(mean[strongest]), limit[strongest], out_error);
        } else {
            const double rms = rms_of_input(self, creal(sums[0]));
            status = check_lines(self, strongest, cabs(mean[strongest]), rms, out_error);
        }
    }
    free(sums);
    free(mean);
    free(limit);
    return status;
}

static int transform_and_select(struct periodic *self, const struct periodic_options *options, struct error *out_error)
{
    const struct run *run = self->run;
    size_t size = self->total * self->bin_count;
    self->input_spectra = large_allocate(size * sizeof *self->input_spectra);
    self->output_spectra = large_allocate(size * sizeof *self->output_spectra);
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
        status = take_out_trend(self, out_error);
        status = status ? status : check_power(self, out_error);
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

double periodic_first_level(const struct periodic *self)
{
    size_t p = 0;
    while (p + 1 < self->total && isnan(self->output_level[p])) {
        p++;
    }
    return self->output_level[p];
}

double periodic_last_level(const struct periodic *self)
{
    size_t p = self->total - 1;
    while (p > 0 && isnan(self->output_level[p])) {
        p--;
    }
    return self->output_level[p];
}

void periodic_free(struct periodic *self)
{
    free(self->bins);
    free(self->doubtful);
    free(self->used_periods);
    free(self->input_level);
    free(self->output_level);
    free(self->owned_spectra[0]);
    free(self->owned_spectra[1]);
    *self = (struct periodic){0};
}
