/* SPDX-License-Identifier: MIT */
#include "lab/estimate/oscillation.h"

#include "lab/estimate/spectra.h"
#include "lab/estimate/stretch.h"
#include "lab/numeric/cmplx.h"

#include <complex.h>
#include <math.h>
#include <stdlib.h>

enum { rows_max = 1 << 20, fewest_cycles = 5, peak_reach = 2, fewest_bins = 100 };

static const double two_pi = 6.283185307179586476925;
static const double least_share = 0.3;
static const double least_level = 0.02;
/// What falls below this share of itself from the first half to the second dies away: a transient.
static const double least_sustained = 0.4;

/// Mean period of `periods` from `signal` on, without its mean; returns its RMS.
static double mean_period(const double *signal, size_t periods, size_t length, double *out_mean)
{
    double offset = 0.0;
    double power = 0.0;
    for (size_t n = 0; n < length; n++) {
        out_mean[n] = 0.0;
        for (size_t p = 0; p < periods; p++) {
            out_mean[n] += signal[p * length + n] / (double)periods;
        }
        offset += out_mean[n] / (double)length;
    }
    for (size_t n = 0; n < length; n++) {
        power += (out_mean[n] - offset) * (out_mean[n] - offset) / (double)length;
    }
    return sqrt(power);
}

/// Slope per sample of the line through the periods' means.
static double slope_of(const double *signal, size_t periods, size_t length)
{
    const double middle = 0.5 * (double)(periods - 1);
    double product = 0.0;
    double square = 0.0;
    for (size_t p = 0; p < periods; p++) {
        double mean = 0.0;
        for (size_t n = 0; n < length; n++) {
            mean += signal[p * length + n] / (double)length;
        }
        product += ((double)p - middle) * mean;
        square += ((double)p - middle) * ((double)p - middle);
    }
    return product / square / (double)length;
}

/// What does not repeat, times a Hann window. A ramp within a period is part of the mean period: it comes off both.
static void take_rest(const double *signal, size_t periods, size_t length, const double *mean, double *out_rest)
{
    const size_t rows = periods * length;
    const double slope = slope_of(signal, periods, length);
    const double middle = 0.5 * (double)(periods - 1);
    for (size_t n = 0; n < rows; n++) {
        const double drift = slope * (double)length * ((double)(n / length) - middle);
        const double window = 0.5 - 0.5 * cos(two_pi * ((double)n + 0.5) / (double)rows);
        out_rest[n] = window * (signal[n] - mean[n % length] - drift);
    }
}

/// Centre of the peak in bins: the mean of the bins around it, weighed by their powers.
static void judge(const double complex *spectrum, size_t rows, double rate_hz, double repeating,
                  struct oscillation *out)
{
    const size_t bins = rows / 2;
    double total = 0.0;
    size_t peak = fewest_cycles;
    for (size_t k = fewest_cycles; k < bins; k++) {
        total += cmplx_power(spectrum[k]);
        peak = cmplx_power(spectrum[k]) > cmplx_power(spectrum[peak]) ? k : peak;
    }
    /* The skirt of a drift or a decay rises towards the bins that are not looked at. */
    if (cmplx_power(spectrum[peak]) < cmplx_power(spectrum[peak - 1])) {
        return;
    }
    double own = 0.0;
    double centre = 0.0;
    for (size_t k = peak - peak_reach; k <= peak + peak_reach && k < bins; k++) {
        own += cmplx_power(spectrum[k]);
        centre += (double)k * cmplx_power(spectrum[k]);
    }
    if (!(total > 0.0 && own > 0.0 && repeating > 0.0)) {
        return;
    }
    /* A Hann window lets 3/8 of the power through; both halves of the spectrum hold it. */
    const double rms = sqrt(2.0 * own / (0.375 * (double)rows * (double)rows));
    out->frequency_hz = centre / own * rate_hz / (double)rows;
    out->level = rms / repeating;
    out->share = fmin(own / total, 1.0);
    out->found = out->share >= least_share && out->level >= least_level;
}

/// Whether it is as strong late as early; the window is the same in both halves, mirrored.
static bool is_sustained(const double *rest, size_t rows, double cycles_per_sample)
{
    double complex half[2] = {0.0, 0.0};
    for (size_t n = 0; n < 2 * (rows / 2); n++) {
        half[n / (rows / 2)] += rest[n] * cexp(-I * two_pi * fmod(cycles_per_sample * (double)n, 1.0));
    }
    return cabs(half[1]) >= least_sustained * cabs(half[0]);
}

/// A transient bends the drift: what its slope changes by from period to period is a sawtooth of the period,
/// upwards early and downwards late, whose second harmonic has less than the least share.
static bool is_transient_sawtooth(const struct periodic *recording, double frequency_hz, size_t periods)
{
    const double bin = frequency_hz * (double)(recording->period_samples * periods) / recording->run->sample_rate_hz;
    const bool unsettled = !recording->transient.settled || recording->transient.periods > 0;
    return unsettled && fabs(bin - (double)periods) < (double)peak_reach;
}

bool oscillation_measure(const struct periodic *recording, struct oscillation *out)
{
    const struct stretch stretch = stretch_longest(recording);
    const size_t length = recording->period_samples;
    const double *signal = run_column(recording->run, recording->output) + stretch.first * length;
    size_t periods = stretch.periods;
    *out = (struct oscillation){.found = false};
    while (periods > 2 && periods * length > rows_max) {
        periods--;
    }
    const size_t rows = periods * length;
    if (periods < 2 || rows / 2 < fewest_bins) {
        return true;
    }
    double *mean = malloc(length * sizeof *mean);
    double *rest = malloc(rows * sizeof *rest);
    double complex *spectra = malloc(2 * (rows / 2 + 1) * sizeof *spectra);
    bool done = mean && rest && spectra;
    if (done) {
        const double repeating = mean_period(signal, periods, length, mean);
        take_rest(signal, periods, length, mean, rest);
        done = spectra_transform_two(rest, rest, rows, spectra, spectra + rows / 2 + 1);
        if (done) {
            judge(spectra, rows, recording->run->sample_rate_hz, repeating, out);
            out->found = out->found && !is_transient_sawtooth(recording, out->frequency_hz, periods) &&
                         is_sustained(rest, rows, out->frequency_hz / recording->run->sample_rate_hz);
        }
    }
    free(mean);
    free(rest);
    free(spectra);
    return done;
}
