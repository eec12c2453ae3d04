/* SPDX-License-Identifier: MIT */
#include "lab/estimate/clock.h"

#include "lab/numeric/cmplx.h"
#include "lab/numeric/statistics.h"

#include <complex.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { fewest_for_drift = 8, passes = 6, smoothed_lines = 3 };

static const double two_pi = 6.283185307179586476925;

static const double chance_of_false_alarm = 1e-4;
/// Consecutive periods are looked for within so many samples.
static const double searched_samples = 2.0;
/// Steps of that search, in turns of the highest line: its parabola is met well within one.
static const double search_step_turns = 0.125;
/// Rounding, and what a sampled recording loses anyhow, leave scatter of about this share of a line's power.
static const double rounding_power = 1e-24;
/// Delays that are known to fewer samples are as good as none; a digital signal that repeats exactly has no scatter at
/// all.
static const double smallest_delay = 1e-9;
/// A fit whose correction turns no line by more has arrived.
static const double arrived_rad = 1e-6;
/// Leakage below this share of the standard deviation, and turns below this angle, change no result.
static const double negligible_share = 0.1;
static const double negligible_slip_rad = 0.05;
/// Input and output may differ by this share of what both are off by.
static const double tolerated_difference = 0.1;
/// One period's correlation with the next, below which they are not the same signal.
static const double least_coherence = 0.5;

/// One signal's spectra on the way.
struct work {
    const struct periodic *recording;
    const double complex *spectra; ///< used x bin_count
    double complex *turned;        ///< the same, delays known so far taken back
    double complex *mean;          ///< bin_count
    double *scatter;               ///< bin_count: variance of one period, smoothed over lines
    double *delays;                ///< used: what is left, samples
    double *x;                     ///< used: number of the period less the mean of all
    double offset, drift;          ///< taken back
};

static bool make_work(const struct periodic *recording, struct work *out)
{
    const size_t lines = recording->bin_count;
    *out = (struct work){.recording = recording};
    out->turned = malloc(recording->used * lines * sizeof *out->turned);
    out->mean = malloc(lines * sizeof *out->mean);
    out->scatter = malloc(2 * lines * sizeof *out->scatter);
    out->delays = malloc(2 * recording->used * sizeof *out->delays);
    if (!out->turned || !out->mean || !out->scatter || !out->delays) {
        return false;
    }
    double middle = 0.0;
    for (size_t m = 0; m < recording->used; m++) {
        middle += (double)recording->used_periods[m] / (double)recording->used;
    }
    out->x = out->delays + recording->used;
    for (size_t m = 0; m < recording->used; m++) {
        out->x[m] = (double)recording->used_periods[m] - middle;
    }
    return true;
}

static void free_work(struct work *self)
{
    free(self->turned);
    free(self->mean);
    free(self->scatter);
    free(self->delays);
}

static double radians_per_sample(const struct periodic *recording, size_t b)
{
    return two_pi * (double)recording->bins[b] / (double)recording->period_samples;
}

/// sum X_{p+1} conj X_p over consecutive periods, line by line; returns the correlation that their sizes would allow.
static double correlate_consecutive(const struct work *self, double complex *out_product)
{
    const struct periodic *recording = self->recording;
    const size_t lines = recording->bin_count;
    double size = 0.0;
    memset(out_product, 0, lines * sizeof *out_product);
    for (size_t m = 1; m < recording->used; m++) {
        if (recording->used_periods[m] != recording->used_periods[m - 1] + 1) {
            continue;
        }
        const double complex *before = self->spectra + (m - 1) * lines;
        const double complex *after = self->spectra + m * lines;
        for (size_t b = 0; b < lines; b++) {
            out_product[b] += after[b] * conj(before[b]);
            size += 0.5 * (cmplx_power(before[b]) + cmplx_power(after[b]));
        }
    }
    return size;
}

static double correlation_at(const struct periodic *recording, const double complex *product, double delay)
{
    double sum = 0.0;
    for (size_t b = 0; b < recording->bin_count; b++) {
        sum += creal(product[b] * cexp(I * radians_per_sample(recording, b) * delay));
    }
    return sum;
}

/// Delay from one period to the next, to a small part of the highest line's turn; *out_coherent: whether there is one.
static double coarse_offset(struct work *self, bool *out_coherent)
{
    const struct periodic *recording = self->recording;
    const double size = correlate_consecutive(self, self->mean);
    const double step = search_step_turns * two_pi / radians_per_sample(recording, recording->bin_count - 1);
    double best = correlation_at(recording, self->mean, 0.0);
    double found = 0.0;
    for (double delay = step; delay <= searched_samples; delay += step) {
        for (int sign = -1; sign <= 1; sign += 2) {
            const double value = correlation_at(recording, self->mean, sign * delay);
            if (value > best) {
                best = value;
                found = sign * delay;
            }
        }
    }
    *out_coherent = best > least_coherence * size;
    return found;
}

/// Takes back the delays known so far, and the mean of what that gives.
static void turn_back(struct work *self)
{
    const struct periodic *recording = self->recording;
    const size_t lines = recording->bin_count;
    const bool as_it_is = self->offset == 0.0 && self->drift == 0.0;
    memset(self->mean, 0, lines * sizeof *self->mean);
    for (size_t m = 0; m < recording->used; m++) {
        const double delay = self->offset * self->x[m] + 0.5 * self->drift * self->x[m] * self->x[m];
        for (size_t b = 0; b < lines; b++) {
            double complex value = self->spectra[m * lines + b];
            value *= as_it_is ? 1.0 : cexp(I * radians_per_sample(recording, b) * delay);
            self->turned[m * lines + b] = value;
            self->mean[b] += value / (double)recording->used;
        }
    }
}

static void measure_scatter(struct work *self)
{
    const struct periodic *recording = self->recording;
    const size_t lines = recording->bin_count;
    double *own = self->scatter + lines;
    memset(own, 0, lines * sizeof *own);
    for (size_t m = 0; m < recording->used; m++) {
        for (size_t b = 0; b < lines; b++) {
            own[b] += cmplx_power(self->turned[m * lines + b] - self->mean[b]) / (double)(recording->used - 1);
        }
    }
    for (size_t b = 0; b < lines; b++) {
        const size_t first = b > smoothed_lines ? b - smoothed_lines : 0;
        const size_t end = b + smoothed_lines + 1 < lines ? b + smoothed_lines + 1 : lines;
        self->scatter[b] = rounding_power * cmplx_power(self->mean[b]);
        for (size_t other = first; other < end; other++) {
            self->scatter[b] += own[other] / (double)(end - first);
        }
    }
}

/// What each line says of a delay: Fisher's information, 2 w^2 |X|^2 / s^2 of one period.
static double information_of(const struct work *self, size_t b)
{
    const double w = radians_per_sample(self->recording, b);
    return self->scatter[b] > 0.0 ? 2.0 * w * w * cmplx_power(self->mean[b]) / self->scatter[b] : 0.0;
}

/// Returns the information of one period.
static double measure_delays(struct work *self)
{
    const struct periodic *recording = self->recording;
    const size_t lines = recording->bin_count;
    double information = 0.0;
    for (size_t b = 0; b < lines; b++) {
        information += information_of(self, b);
    }
    for (size_t m = 0; m < recording->used; m++) {
        double sum = 0.0;
        for (size_t b = 0; b < lines; b++) {
            const double complex turned = self->turned[m * lines + b] * conj(self->mean[b]);
            const double weight = self->scatter[b] > 0.0 ? 2.0 / self->scatter[b] : 0.0;
            sum -= weight * radians_per_sample(recording, b) * cimag(turned);
        }
        self->delays[m] = information > 0.0 ? sum / information : 0.0;
    }
    return information;
}

/// Least squares of the delays on x, and on x^2 with what x and a constant leave of it.
struct fit {
    double offset, offset_std, drift, drift_std;
    double residual; ///< sum of squares
    bool offset_certain, drift_certain;
};

static bool is_certain(double value, double std, double dof)
{
    return std > 0.0 && statistics_f_tail(value * value / (std * std), 1.0, dof) < chance_of_false_alarm;
}

/// x^2 less the constant and the multiple of x that fit it: sums over it and the delays.
static void fit_parabola(const struct work *self, double x2, struct fit *io_fit)
{
    const size_t count = self->recording->used;
    double x3 = 0.0;
    double square = 0.0;
    double product = 0.0;
    for (size_t m = 0; m < count; m++) {
        x3 += self->x[m] * self->x[m] * self->x[m];
    }
    for (size_t m = 0; m < count; m++) {
        const double rest = self->x[m] * self->x[m] - x2 / (double)count - x3 / x2 * self->x[m];
        square += rest * rest;
        product += rest * self->delays[m];
    }
    const double dof = (double)(count - 3);
    const double residual = fmax(0.0, io_fit->residual - product * product / square);
    io_fit->drift = 2.0 * product / square;
    io_fit->drift_std = 2.0 * sqrt(residual / dof / square);
    io_fit->drift_certain = is_certain(io_fit->drift, io_fit->drift_std, dof);
    if (io_fit->drift_certain) {
        io_fit->residual = residual;
        io_fit->offset -= 0.5 * io_fit->drift * x3 / x2;
    }
}

static struct fit fit_delays(const struct work *self)
{
    const size_t count = self->recording->used;
    struct fit fit = {.offset = 0.0};
    double x2 = 0.0;
    double mean = 0.0;
    for (size_t m = 0; m < count; m++) {
        x2 += self->x[m] * self->x[m];
        mean += self->delays[m] / (double)count;
        fit.offset += self->x[m] * self->delays[m];
    }
    fit.offset /= x2;
    for (size_t m = 0; m < count; m++) {
        const double rest = self->delays[m] - mean - fit.offset * self->x[m];
        fit.residual += rest * rest + smallest_delay * smallest_delay;
    }
    if (count >= fewest_for_drift) {
        fit_parabola(self, x2, &fit);
    }
    const double dof = (double)(count - (fit.drift_certain ? 3 : 2));
    fit.offset_std = sqrt(fit.residual / dof / x2);
    fit.offset_certain = is_certain(fit.offset, fit.offset_std, dof);
    return fit;
}

/// Largest number of periods between the middle and an end.
static double reach_of(const struct work *self)
{
    return fmax(fabs(self->x[0]), fabs(self->x[self->recording->used - 1]));
}

static struct clock_signal conclude(const struct work *self, const struct fit *fit, double information)
{
    const double dof = (double)(self->recording->used - (fit->drift_certain ? 3 : 2));
    const double expected = information > 0.0 ? 1.0 / information : 0.0;
    double lines = 0.0;
    for (size_t b = 0; b < self->recording->bin_count; b++) {
        lines += self->scatter[b] > 0.0 ? 2.0 * cmplx_power(self->mean[b]) / self->scatter[b] : 0.0;
    }
    /* Radians per sample, RMS over lines by what they say of a delay. */
    const double slope = lines > 0.0 ? sqrt(information / lines) : 0.0;
    const double reach = reach_of(self);
    struct clock_signal out = {
        .offset_samples = self->offset + fit->offset,
        .offset_std = fit->offset_std,
        .drift_std = fit->drift_std,
    };
    out.drift_samples = fit->drift_certain || self->drift != 0.0 ? self->drift + fit->drift : 0.0;
    const bool offset_certain = is_certain(out.offset_samples, out.offset_std, dof);
    const bool drift_certain = out.drift_samples != 0.0 && is_certain(out.drift_samples, out.drift_std, dof);
    out.off = offset_certain || drift_certain;
    out.slip_rad = slope * (2.0 * reach * fabs(out.offset_samples) + reach * reach * fabs(out.drift_samples));
    if (expected > 0.0 && statistics_chi2_tail(fit->residual / expected, dof) < chance_of_false_alarm) {
        out.wander = sqrt(fit->residual / dof - expected);
    }
    return out;
}

static struct clock_signal measure_signal(struct work *self, const double complex *spectra, bool *out_coherent)
{
    const struct periodic *recording = self->recording;
    const double highest = radians_per_sample(recording, recording->bin_count - 1);
    struct fit fit = {.offset = 0.0};
    double information = 0.0;
    self->spectra = spectra;
    self->drift = 0.0;
    self->offset = coarse_offset(self, out_coherent);
    for (int pass = 0; pass < passes; pass++) {
        turn_back(self);
        measure_scatter(self);
        information = measure_delays(self);
        fit = fit_delays(self);
        const double reach = reach_of(self);
        const double moved = fabs(fit.offset) * reach + 0.5 * fabs(fit.drift_certain ? fit.drift : 0.0) * reach * reach;
        /* Small turns are as good as linear: a fit of them needs no second pass. */
        if (moved * highest < arrived_rad || pass == passes - 1 ||
            (moved * highest < negligible_slip_rad && self->offset == 0.0 && !fit.offset_certain &&
             !fit.drift_certain)) {
            break;
        }
        self->offset += fit.offset;
        self->drift += fit.drift_certain ? fit.drift : 0.0;
    }
    return conclude(self, &fit, information);
}

/// Standard deviation of the response over the response, median over lines, from scatter that delays do not add to.
static double relative_std_of(const struct periodic *recording, const double *input, const double *output)
{
    const size_t lines = recording->bin_count;
    double *values = malloc(lines * sizeof *values);
    for (size_t b = 0; b < lines && values; b++) {
        values[b] = sqrt((input[b] + output[b]) / (double)recording->used);
    }
    const double median = values ? statistics_median(values, lines) : NAN;
    free(values);
    return median;
}

static void note_relative_scatter(const struct work *self, double *out)
{
    for (size_t b = 0; b < self->recording->bin_count; b++) {
        const double signal = cmplx_power(self->mean[b]);
        out[b] = signal > 0.0 ? self->scatter[b] / signal : 0.0;
    }
}

/// Whether the two say the same, as far as each knows it. Leakage moves what they say by a share of it.
static bool agree(const struct clock *self, double dof)
{
    const struct clock_signal *a = &self->input;
    const struct clock_signal *b = &self->output;
    const double difference = fabs(a->offset_samples - b->offset_samples);
    return difference <= tolerated_difference * fmin(fabs(a->offset_samples), fabs(b->offset_samples)) ||
           !is_certain(difference, hypot(a->offset_std, b->offset_std), dof);
}

static void judge(const struct periodic *recording, struct clock *self)
{
    const double dof = (double)(recording->used - 2);
    const double length = (double)recording->period_samples;
    const double half = 0.5 * (double)recording->total;
    self->both = self->input.offset_std <= self->output.offset_std ? self->input : self->output;
    self->state = clock_steady;
    if (self->input.off || self->output.off) {
        self->state = agree(self, dof) ? clock_off : clock_apart;
    }
    const double off = fabs(self->both.offset_samples) + half * fabs(self->both.drift_samples);
    self->leakage = (double)recording->bins[recording->bin_count - 1] * off / length;
    const double slip = fmax(self->input.slip_rad, self->output.slip_rad);
    self->matters = (self->state == clock_off || self->state == clock_apart) &&
                    (self->leakage > negligible_share * self->relative_std || slip > negligible_slip_rad);
}

bool clock_measure(const struct periodic *recording, struct clock *out)
{
    struct work work;
    bool input_coherent = false;
    bool output_coherent = false;
    *out = (struct clock){.state = clock_untested, .coherent = true};
    if (recording->used < clock_fewest_periods) {
        return true;
    }
    double *relative = malloc(2 * recording->bin_count * sizeof *relative);
    bool done = make_work(recording, &work) && relative;
    if (done) {
        out->input = measure_signal(&work, recording->input_spectra, &input_coherent);
        note_relative_scatter(&work, relative);
        out->output = measure_signal(&work, recording->output_spectra, &output_coherent);
        note_relative_scatter(&work, relative + recording->bin_count);
        out->coherent = input_coherent;
        out->relative_std = relative_std_of(recording, relative, relative + recording->bin_count);
        done = !isnan(out->relative_std);
    }
    if (done && out->coherent) {
        out->middle_period = (double)recording->used_periods[0] - work.x[0] + 0.5;
        judge(recording, out);
    }
    free(relative);
    free_work(&work);
    return done;
}
