/* SPDX-License-Identifier: MIT */
#include "lab/estimate/online.h"

#include "lab/estimate/circle.h"
#include "lab/estimate/columns.h"
#include "lab/estimate/method.h"
#include "lab/estimate/spectra.h"
#include "lab/numeric/cmplx.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { batch_rows = 65536, fewest_periods = 4 };

static const double two_pi = 6.283185307179586476925;

/// Line through the means of periods over their numbers, for the drift of an integrating output.
struct trend {
    double count, period, mean; ///< means so far
    double product, square;     ///< sums of products of deviations from them
};

struct online {
    const struct periodic *leading;
    struct run run; ///< the leading part's, borrowed, with the final rate
    enum periodic_settle settle;
    size_t settle_given; ///< periods that neither the key nor the options count
    size_t limit;        ///< periods that the key counts, settling included
    size_t next;         ///< number of the first period in the buffer
    size_t lost;
    size_t first_lost_row;
    size_t lost_outside; ///< lost rows behind the leading part that cost no period
    bool has_last;
    bool is_position;
    struct trend trend;

    size_t batch;             ///< periods that the buffer holds
    size_t filled;            ///< rows
    double *input, *output;   ///< batch x period_samples
    size_t *lost_row;         ///< batch: first lost row of each period, from 1; 0: none
    double complex *spectra;  ///< 2 x batch x bin_count
    double complex *last;     ///< output of the last period that counted
    double complex *response; ///< G_0

    size_t count; ///< periods summed up; of each line:
    double complex *mean_input, *mean_error, *product;
    double *input_square, *error_square;
};

/// a conj(b)
static double complex times_conjugate(double complex a, double complex b)
{
    const double real = creal(a) * creal(b) + cimag(a) * cimag(b);
    return CMPLX(real, cimag(a) * creal(b) - creal(a) * cimag(b));
}

static double complex times(double complex a, double complex b)
{
    return times_conjugate(a, conj(b));
}

static int refuse_memory(const struct online *self, struct error *out_error)
{
    return error_set(out_error, error_refused, "%s: not enough memory for periods of %zu samples", self->run.path,
                     self->leading->period_samples);
}

static bool allocate(struct online *self)
{
    const size_t lines = self->leading->bin_count;
    const size_t rows = self->batch * self->leading->period_samples;
    self->input = malloc(rows * sizeof *self->input);
    self->output = malloc(rows * sizeof *self->output);
    self->lost_row = calloc(self->batch, sizeof *self->lost_row);
    self->spectra = malloc(2 * self->batch * lines * sizeof *self->spectra);
    self->last = calloc(lines, sizeof *self->last);
    self->response = calloc(lines, sizeof *self->response);
    self->mean_input = calloc(lines, sizeof *self->mean_input);
    self->mean_error = calloc(lines, sizeof *self->mean_error);
    self->product = calloc(lines, sizeof *self->product);
    self->input_square = calloc(lines, sizeof *self->input_square);
    self->error_square = calloc(lines, sizeof *self->error_square);
    return self->input && self->output && self->lost_row && self->spectra && self->last && self->response &&
           self->mean_input && self->mean_error && self->product && self->input_square && self->error_square;
}

void online_free(struct online *self)
{
    if (!self) {
        return;
    }
    free(self->input);
    free(self->output);
    free(self->lost_row);
    free(self->spectra);
    free(self->last);
    free(self->response);
    free(self->mean_input);
    free(self->mean_error);
    free(self->product);
    free(self->input_square);
    free(self->error_square);
    free(self);
}

/// The response of the leading part's later half: any value near the final one will do.
static void set_response(struct online *self)
{
    const struct periodic *leading = self->leading;
    const size_t lines = leading->bin_count;
    for (size_t b = 0; b < lines; b++) {
        double complex input = 0.0;
        double complex output = 0.0;
        for (size_t m = leading->used / 2; m < leading->used; m++) {
            input += leading->input_spectra[m * lines + b];
            output += leading->output_spectra[m * lines + b];
        }
        const double complex response = cmplx_power(input) > 0.0 ? output / input : 0.0;
        self->response[b] = isfinite(cmplx_power(response)) ? response : 0.0;
    }
}

static void set_settle(struct online *self, const struct periodic_options *options)
{
    const struct run *run = self->leading->run;
    self->settle = options->settle;
    if (options->settle == periodic_settle_default) {
        self->settle = run->has_settle_periods ? periodic_settle_key : periodic_settle_auto;
    }
    self->settle_given = self->settle == periodic_settle_given ? options->settle_periods
                         : self->settle == periodic_settle_key ? run->settle_periods
                                                               : 0;
    self->limit = SIZE_MAX;
    if (run->periods > 0 && self->leading->period_samples == run->period_samples) {
        self->limit = run->periods + (run->has_settle_periods ? run->settle_periods : 0);
    }
}

int online_begin(const struct periodic *leading, const struct periodic_options *options, struct online **out_self,
                 struct error *out_error)
{
    const size_t length = leading->period_samples;
    const struct run *run = leading->run;
    struct online *self = calloc(1, sizeof *self);
    *out_self = NULL;
    if (!self) {
        return error_set(out_error, error_refused, "%s: memory is short", run->path);
    }
    self->leading = leading;
    self->run = *run;
    self->batch = length < batch_rows ? batch_rows / length : 1;
    self->next = run->rows / length;
    self->is_position = columns_is_position(leading->output);
    set_settle(self, options);
    int status = allocate(self) ? 0 : refuse_memory(self, out_error);
    if (!status) {
        const size_t first = self->next * length;
        const double *valid = run_column(run, "valid");
        set_response(self);
        status = online_take(self, run_column(run, leading->input) + first, run_column(run, leading->output) + first,
                             valid ? valid + first : NULL, run->rows - first, out_error);
    }
    if (status) {
        online_free(self);
    } else {
        *out_self = self;
    }
    return status;
}

static void add_line(struct online *self, size_t b, double complex input, double complex output, double weight)
{
    const double rest = 1.0 - weight;
    const double complex error = output - times(self->response[b], input) - self->mean_error[b];
    input -= self->mean_input[b];
    self->mean_input[b] += input * weight;
    self->mean_error[b] += error * weight;
    self->input_square[b] += rest * cmplx_power(input);
    self->error_square[b] += rest * cmplx_power(error);
    self->product[b] += rest * times_conjugate(error, input);
}

static void add_trend(struct trend *self, double period, double mean)
{
    const double from_period = period - self->period;
    const double from_mean = mean - self->mean;
    self->count += 1.0;
    self->period += from_period / self->count;
    self->mean += from_mean / self->count;
    self->product += from_period * (mean - self->mean);
    self->square += from_period * (period - self->period);
}

static double mean_of(const double *x, size_t count)
{
    double mean = 0.0;
    for (size_t n = 0; n < count; n++) {
        mean += x[n] / (double)count;
    }
    return mean;
}

/// A period that counts; `output_rows`: its samples.
static void add_period(struct online *self, size_t number, const double complex *input, const double complex *output,
                       const double *output_rows)
{
    self->count++;
    const double weight = 1.0 / (double)self->count;
    for (size_t b = 0; b < self->leading->bin_count; b++) {
        add_line(self, b, input[b], output[b], weight);
    }
    if (self->is_position) {
        add_trend(&self->trend, (double)number, mean_of(output_rows, self->leading->period_samples));
    }
}

static void note_lost(struct online *self, size_t number, size_t row)
{
    if (number >= self->settle_given && number < self->limit) {
        self->first_lost_row = self->lost == 0 ? row : self->first_lost_row;
        self->lost++;
    }
}

/// Sums up the whole periods in the buffer, which is empty afterwards.
static int take_batch(struct online *self, struct error *out_error)
{
    const struct periodic *leading = self->leading;
    const size_t length = leading->period_samples;
    const size_t lines = leading->bin_count;
    const size_t periods = self->filled / length;
    double complex *input = self->spectra;
    double complex *output = self->spectra + periods * lines;
    if (periods > 0 &&
        !spectra_transform_both(self->input, self->output, length, periods, leading->bins, lines, input, output)) {
        return refuse_memory(self, out_error);
    }
    for (size_t p = 0; p < periods; p++, self->next++) {
        if (self->lost_row[p] > 0) {
            note_lost(self, self->next, self->lost_row[p]);
        } else if (self->next >= self->settle_given && self->next < self->limit) {
            add_period(self, self->next, input + p * lines, output + p * lines, self->output + p * length);
            memcpy(self->last, output + p * lines, lines * sizeof *self->last);
            self->has_last = true;
        }
    }
    memset(self->lost_row, 0, self->batch * sizeof *self->lost_row);
    self->filled = 0;
    return 0;
}

static void note_lost_rows(struct online *self, const double *valid, size_t rows)
{
    const size_t length = self->leading->period_samples;
    for (size_t n = 0; n < rows; n++) {
        const size_t row = self->filled + n;
        const size_t period = self->next + row / length;
        self->lost_outside += !(valid[n] > 0.5) && (period < self->settle_given || period >= self->limit);
        if (!(valid[n] > 0.5) && self->lost_row[row / length] == 0) {
            self->lost_row[row / length] = self->next * length + row + 1;
        }
    }
}

int online_take(struct online *self, const double *input, const double *output, const double *valid, size_t rows,
                struct error *out_error)
{
    const size_t room = self->batch * self->leading->period_samples;
    int status = 0;
    for (size_t taken = 0; taken < rows && !status;) {
        const size_t most = room - self->filled;
        const size_t part = rows - taken < most ? rows - taken : most;
        memcpy(self->input + self->filled, input + taken, part * sizeof *input);
        memcpy(self->output + self->filled, output + taken, part * sizeof *output);
        if (valid) {
            note_lost_rows(self, valid + taken, part);
        }
        self->filled += part;
        taken += part;
        status = self->filled == room ? take_batch(self, out_error) : 0;
    }
    return status;
}

/// The transform of a ramp of slope 1 at a line: sum_n n exp(-jwn) = N / (exp(-jw) - 1).
static double complex ramp_at(const struct periodic *leading, size_t b)
{
    const double length = (double)leading->period_samples;
    return length / (cexp(-I * two_pi * (double)leading->bins[b] / length) - 1.0);
}

/// Adds the leading part's periods first .. end - 1 that count; its outputs get back the trend that the cut took out.
static bool add_leading(struct online *self, size_t first, size_t end)
{
    const struct periodic *leading = self->leading;
    const double *rows = run_column(leading->run, leading->output);
    const size_t lines = leading->bin_count;
    double complex *output = malloc(lines * sizeof *output);
    for (size_t m = 0; m < leading->used && output; m++) {
        const size_t number = leading->used_periods[m];
        if (number < first || number >= end) {
            continue;
        }
        for (size_t b = 0; b < lines; b++) {
            output[b] = leading->output_spectra[m * lines + b];
            output[b] += leading->trend_per_sample != 0.0 ? leading->trend_per_sample * ramp_at(leading, b) : 0.0;
        }
        add_period(self, number, leading->input_spectra + m * lines, output, rows + number * leading->period_samples);
        if (!self->has_last) {
            memcpy(self->last, output, lines * sizeof *output);
        }
    }
    free(output);
    return output != NULL;
}

/// Means and scatter of input or output of the periods summed up so far.
static void reference_of(const struct online *self, bool of_output, double complex *out_mean, double *out_scatter)
{
    for (size_t b = 0; b < self->leading->bin_count; b++) {
        const double complex response = self->response[b];
        if (of_output) {
            out_mean[b] = self->mean_error[b] + times(response, self->mean_input[b]);
            out_scatter[b] = fmax(0.0, self->error_square[b] + cmplx_power(response) * self->input_square[b] +
                                           2.0 * creal(times_conjugate(self->product[b], response)));
        } else {
            out_mean[b] = self->mean_input[b];
            out_scatter[b] = self->input_square[b];
        }
    }
}

/// The leading part's periods against what was summed up, up to period `end`.
static struct settle judge_leading(const struct online *self, const double complex *spectra,
                                   const struct settle_reference *reference, size_t half, double *out_first_level)
{
    const struct periodic *leading = self->leading;
    const size_t end = half < leading->total ? half : leading->total;
    struct settle self_settle = {0};
    double excess[2] = {0.0, 0.0};
    bool unsettled = true;
    for (size_t p = 0, m = 0; p < end && (unsettled || p < 2); p++) {
        if (m == leading->used || leading->used_periods[m] != p) {
            continue; // lost samples
        }
        double level, above;
        unsettled = settle_differs(spectra + m * leading->bin_count, reference, &level, &above) && unsettled;
        if (p < 2) {
            excess[p] = above;
        }
        *out_first_level = m == 0 ? level : *out_first_level;
        self_settle.periods = unsettled ? p + 1 : self_settle.periods;
        m++;
    }
    self_settle.settled = self_settle.periods < end;
    if (excess[0] > 0.0 && excess[1] > 0.0) {
        self_settle.decay_per_period = sqrt(excess[1] / excess[0]);
    }
    return self_settle;
}

/// As measure_settling of the cut: the longer of input and output.
static bool measure_settling(const struct online *self, size_t total, struct online_result *io_result)
{
    const struct periodic *leading = self->leading;
    const size_t lines = leading->bin_count;
    if (total < fewest_periods || self->count < 2) {
        return true;
    }
    double complex *mean = malloc(lines * sizeof *mean);
    double *scatter = malloc(lines * sizeof *scatter);
    if (mean && scatter) {
        const struct settle_reference reference = {self->count, lines, mean, scatter};
        double ignored;
        reference_of(self, false, mean, scatter);
        const struct settle input = judge_leading(self, leading->input_spectra, &reference, total / 2, &ignored);
        reference_of(self, true, mean, scatter);
        (void)settle_differs(self->last, &reference, &io_result->last_level, &ignored);
        for (size_t b = 0; b < lines && leading->trend_per_sample != 0.0; b++) {
            mean[b] -= leading->trend_per_sample * ramp_at(leading, b);
        }
        io_result->transient =
            judge_leading(self, leading->output_spectra, &reference, total / 2, &io_result->first_level);
        if (input.periods > io_result->transient.periods) {
            io_result->transient.periods = input.periods;
            io_result->transient.settled = input.settled;
        }
    }
    free(mean);
    free(scatter);
    return mean && scatter;
}

/// Lost periods of the leading part that would have counted.
static void count_lost(const struct online *self, struct online_result *io_result)
{
    const struct periodic *leading = self->leading;
    size_t m = 0;
    io_result->lost = self->lost;
    io_result->first_lost_row = self->first_lost_row;
    size_t first = 0;
    for (size_t p = 0; p < leading->total; p++) {
        const bool usable = m < leading->used && leading->used_periods[m] == p;
        m += usable;
        if (!usable && p >= io_result->settle) {
            io_result->lost++;
            first = first > 0
                        ? first
                        : columns_first_lost_row(leading->run, p * leading->period_samples, leading->period_samples);
        }
    }
    io_result->first_lost_row = first > 0 ? first : io_result->first_lost_row;
}

/// Lost rows of the leading part that are left out for settling.
static size_t count_lost_outside(const struct periodic *leading, size_t settle)
{
    const size_t asked = settle * leading->period_samples;
    const size_t whole = leading->total * leading->period_samples;
    const size_t end = asked < whole ? asked : whole;
    size_t count = 0;
    size_t row = columns_first_lost_row(leading->run, 0, end);
    while (row > 0) {
        count++;
        row = columns_first_lost_row(leading->run, row, end - row);
    }
    return count;
}

/// Sums up what the leading part adds, in the order that lets the settled periods be told from the others.
static int select_periods(struct online *self, struct online_result *out, struct error *out_error)
{
    const size_t total = self->next < self->limit ? self->next : self->limit;
    const size_t leading = self->leading->total;
    const size_t half = total / 2 > self->settle_given ? total / 2 : self->settle_given;
    *out = (struct online_result){.total = total, .settle_source = self->settle, .settle = self->settle_given};
    if (!add_leading(self, half, leading) || !measure_settling(self, total, out)) {
        return refuse_memory(self, out_error);
    }
    if (self->settle == periodic_settle_auto) {
        out->settle = out->transient.periods;
    }
    if (!add_leading(self, out->settle, half)) {
        return refuse_memory(self, out_error);
    }
    count_lost(self, out);
    out->used = self->count;
    out->trend_per_sample = self->is_position && self->trend.square > 0.0
                                ? self->trend.product / self->trend.square / (double)self->leading->period_samples
                                : 0.0;
    if (out->used >= 2) {
        return 0;
    }
    return error_set(
        out_error, error_refused,
        "%s: %zu of %zu periods count (%zu left out for settling, %zu for lost samples): expected at least 2, "
        "because the standard deviation comes from the differences between periods",
        self->run.path, out->used, out->total, out->settle, out->lost);
}

/// F11, F12, as frf_mean_estimate: with D = G - G_0, sum |(E - Ebar) - D (U - Ubar)|^2 is S_ee + |D|^2 S_uu - 2 Re(conj
/// D S_eu), whose last two terms are small.
static void set_line(const struct online *self, const struct online_result *result, size_t b, double certain_ratio,
                     struct frf *io_frf)
{
    const double count = (double)self->count;
    const double complex input = self->mean_input[b];
    double complex error = self->mean_error[b];
    if (result->trend_per_sample != 0.0) {
        error -= result->trend_per_sample * ramp_at(self->leading, b);
    }
    if (!(count * cmplx_power(input) > certain_ratio * self->input_square[b] / (count - 1.0))) {
        return;
    }
    const double complex difference = error / input;
    const double residual = self->error_square[b] + cmplx_power(difference) * self->input_square[b] -
                            2.0 * creal(times_conjugate(self->product[b], difference));
    const double variance = fmax(0.0, residual) / (count * (count - 1.0) * cmplx_power(input));
    estimate_set_line(io_frf, b, self->response[b] + difference, sqrt(variance));
}

int online_end(struct online *self, double rate_hz, struct online_result *out_result, struct frf *out_frf,
               struct error *out_error)
{
    struct periodic whole = *self->leading;
    *out_frf = (struct frf){0};
    int status = take_batch(self, out_error);
    status = status ? status : select_periods(self, out_result, out_error);
    if (status) {
        return status;
    }
    self->run.sample_rate_hz = rate_hz;
    whole.run = &self->run;
    whole.total = out_result->total;
    whole.settle_source = out_result->settle_source;
    whole.settle = out_result->settle;
    whole.lost = out_result->lost;
    whole.lost_outside = self->lost_outside + count_lost_outside(self->leading, out_result->settle);
    whole.used = out_result->used;
    status = estimate_begin(&whole, "mean", 2.0 * (double)(whole.used - 1), out_frf, out_error);
    const double certain_ratio = circle_certain_ratio(estimate_chance_of_dead_line, whole.used);
    bool any = false;
    for (size_t b = 0; b < whole.bin_count && !status; b++) {
        set_line(self, out_result, b, certain_ratio, out_frf);
        any = any || out_frf->valid[b];
    }
    /* The figures of a refusal are those of the spectra that are there. */
    whole.used = any ? whole.used : self->leading->used;
    return status ? status : estimate_end(&whole, out_frf, out_error);
}
