/* SPDX-License-Identifier: MIT */
#include "lab/estimate/repetition.h"

#include "lab/estimate/stretch.h"
#include "lab/numeric/cmplx.h"
#include "lab/numeric/statistics.h"

#include <complex.h>
#include <math.h>
#include <stdlib.h>

enum { fewest_repetitions = 2 }; ///< of m periods, so that rows are left to take the scatter from

static const double two_pi = 6.283185307179586476925;

static const double chance_of_false_alarm = 1e-3;
/// Rounding leaves scatter of about this share of a line's power.
static const double rounding_power = 1e-28;
/// Digits that the difference of two powers loses.
static const double cancellation = 1e-15;

/// Consecutive periods: `index` of the first in the recording's spectra, `period` in its rows.
struct span {
    size_t index, period, count;
};

static struct span settled_span(const struct periodic *recording)
{
    const struct stretch stretch = stretch_longest(recording);
    struct span self = {.period = stretch.first, .count = stretch.periods};
    while (self.index < recording->used && recording->used_periods[self.index] < stretch.first) {
        self.index++;
    }
    const size_t settled = recording->transient.periods;
    if (settled > self.period && self.count >= settled - self.period + 2 * fewest_repetitions) {
        self.index += settled - self.period;
        self.count -= settled - self.period;
        self.period = settled;
    }
    return self;
}

/// The last whole repetitions of m periods.
static struct span last_repetitions(struct span span, unsigned multiple)
{
    const size_t count = span.count / multiple * multiple;
    return (struct span){span.index + span.count - count, span.period + span.count - count, count};
}

static bool prime_to(unsigned a, unsigned b)
{
    while (b != 0) {
        const unsigned rest = a % b;
        a = b;
        b = rest;
    }
    return a == 1;
}

/// What a line's rows hold, as sums of |B|^2.
struct rows {
    double wanted; ///< of the `wanted_count` rows that hold the part with m times the period
    double others; ///< of the rows that hold scatter alone
    size_t wanted_count, others_count;
};

/// The others' sum is what Parseval leaves.
static struct rows split_rows(const double complex *spectra, size_t stride, size_t periods, unsigned multiple)
{
    struct rows self = {.others_count = periods - multiple};
    double complex mean = 0.0;
    double total = 0.0;
    for (size_t p = 0; p < periods; p++) {
        mean += spectra[p * stride] / (double)periods;
    }
    for (size_t p = 0; p < periods; p++) {
        total += cmplx_power(spectra[p * stride] - mean) / (double)periods;
    }
    double taken = 0.0;
    for (unsigned j = 1; j < multiple; j++) {
        double complex row = 0.0;
        for (size_t p = 0; p < periods; p++) {
            const double complex turn = cexp(-I * two_pi * (double)(j * p % multiple) / multiple);
            row += (spectra[p * stride] - mean) * turn / (double)periods;
        }
        taken += cmplx_power(row);
        if (prime_to(j, multiple)) {
            self.wanted += cmplx_power(row);
            self.wanted_count++;
        }
    }
    const double rounding = rounding_power * cmplx_power(mean) + cancellation * total;
    self.others = fmax(total - taken, 0.0) + rounding * (double)self.others_count;
    return self;
}

/// Degrees of freedom of real numbers: what slow noise leaks into a line has one phase in all periods, so that row r is
/// the mirror of row P - r. For circular noise, which has twice as many, the chance is too large.
static double chance_of_line(const struct rows *rows)
{
    const double n = (double)rows->wanted_count;
    const double others = (double)rows->others_count;
    const double ratio = rows->wanted / n / (rows->others / others);
    return rows->others > 0.0 ? statistics_f_tail(ratio, n, others) : 1.0;
}

/// Chance at most that scatter alone makes the part with m times the period as strong as it is on any line. Slow noise
/// leaks into all lines alike, so that they are not independent: their chances add up (Bonferroni).
static double chance_of_multiple(const struct periodic *recording, struct span span, unsigned multiple)
{
    double smallest = 1.0;
    for (size_t b = 0; b < recording->bin_count; b++) {
        const double complex *line = recording->output_spectra + span.index * recording->bin_count + b;
        const struct rows rows = split_rows(line, recording->bin_count, span.count, multiple);
        smallest = fmin(smallest, chance_of_line(&rows));
    }
    return smallest * (double)recording->bin_count;
}

/// z: mean over the repetitions of m periods; a: mean over its m periods. RMS of z - a over that of a without its mean.
static bool measure_level(const struct periodic *recording, struct span span, unsigned multiple, double *out_level)
{
    const size_t length = recording->period_samples;
    const double *output = run_column(recording->run, recording->output) + span.period * length;
    double *repeated = calloc((multiple + 1) * length, sizeof *repeated);
    double *common = repeated ? repeated + multiple * length : NULL;
    if (!repeated) {
        return false;
    }
    for (size_t n = 0; n < span.count * length; n++) {
        const double value = output[n] - recording->trend_per_sample * (double)n;
        repeated[n % (multiple * length)] += value * (double)multiple / (double)span.count;
        common[n % length] += value / (double)span.count;
    }
    double mean = 0.0;
    double own = 0.0;
    double every = 0.0;
    for (size_t n = 0; n < length; n++) {
        mean += common[n] / (double)length;
    }
    for (size_t n = 0; n < multiple * length; n++) {
        const double difference = repeated[n] - common[n % length];
        own += difference * difference;
        every += (common[n % length] - mean) * (common[n % length] - mean);
    }
    free(repeated);
    *out_level = every > 0.0 ? sqrt(own / every) : 0.0;
    return true;
}

bool repetition_test(const struct periodic *recording, struct repetition *out)
{
    const struct span span = settled_span(recording);
    *out = (struct repetition){.multiple = 1, .chance = 1.0};
    double smallest[repetition_multiple_max + 1] = {0.0};
    for (unsigned m = 2; m <= repetition_multiple_max && span.count >= fewest_repetitions * m; m++) {
        smallest[m] = chance_of_multiple(recording, last_repetitions(span, m), m);
        out->tested = m;
    }
    for (unsigned m = 2; m <= out->tested; m++) {
        const double chance = fmin(1.0, smallest[m] * (double)(out->tested - 1));
        if (chance < chance_of_false_alarm) {
            out->multiple = m;
            out->chance = chance;
        } else if (out->multiple == 1) {
            out->chance = fmin(out->chance, chance);
        }
    }
    if (out->multiple == 1) {
        return true;
    }
    return measure_level(recording, last_repetitions(span, out->multiple), out->multiple, &out->level);
}
