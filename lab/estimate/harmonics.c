/* SPDX-License-Identifier: MIT */
#include "lab/estimate/harmonics.h"

#include "lab/estimate/circle.h"
#include "lab/estimate/spectra.h"
#include "lab/numeric/cmplx.h"
#include "lab/numeric/statistics.h"

#include <complex.h>
#include <math.h>
#include <stdlib.h>

static const double two_pi = 6.283185307179586476925;

static const double false_alarms = 0.05;
/// Rounding leaves about this share of the line's power in every bin, the same in every period.
static const double rounding_power = 1e-28;

/// spectra: periods x count, the line itself first, then its harmonics.
static double distortion_db(const double complex *spectra, size_t periods, size_t count)
{
    const double m = (double)periods;
    const struct circle line = circle_of_column(spectra, periods, count, 0);
    double strength = 0.0;
    double noise = 0.0;
    for (size_t h = 1; h < count; h++) {
        const struct circle harmonic = circle_of_column(spectra, periods, count, h);
        strength += cmplx_power(harmonic.mean);
        noise += harmonic.variance / m + rounding_power * cmplx_power(line.mean);
    }
    const double dof = 2.0 * (double)(count - 1);
    if (!(noise > 0.0) || !(cmplx_power(line.mean) > 0.0) ||
        !(statistics_f_tail(strength / noise, dof, dof * (m - 1.0)) < false_alarms)) {
        return NAN;
    }
    return 10.0 * log10((strength - noise) / (cmplx_power(line.mean) - line.variance / m));
}

static void take_out_trend(const struct periodic *recording, const uint32_t *bins, size_t count,
                           double complex *io_spectra)
{
    const double length = (double)recording->period_samples;
    for (size_t b = 0; b < count; b++) {
        const double complex ramp = length / (cexp(-I * two_pi * (double)bins[b] / length) - 1.0);
        for (size_t m = 0; m < recording->used; m++) {
            io_spectra[m * count + b] -= recording->trend_per_sample * ramp;
        }
    }
}

bool harmonics_measure(const struct periodic *recording, struct harmonics *out)
{
    *out = (struct harmonics){.output_db = NAN, .input_db = NAN};
    if (recording->bin_count != 1) {
        return true;
    }
    uint32_t line = recording->bins[0];
    const size_t count = (recording->period_samples - 1) / 2 / line;
    out->frequency_hz = (double)line * recording->run->sample_rate_hz / (double)recording->period_samples;
    out->count = count - 1;
    if (out->count == 0) {
        return true;
    }
    uint32_t *bins = malloc(count * sizeof *bins);
    double complex *spectra = malloc(recording->used * count * sizeof *spectra);
    struct periodic all = *recording;
    all.bins = bins;
    all.bin_count = count;
    bool done = bins && spectra;
    for (size_t h = 0; h < count && done; h++) {
        bins[h] = (uint32_t)(h + 1) * line;
    }
    done = done && periodic_transform_used(&all, recording->input, spectra);
    if (done) {
        out->input_db = distortion_db(spectra, recording->used, count);
        done = periodic_transform_used(&all, recording->output, spectra);
    }
    if (done) {
        take_out_trend(recording, bins, count, spectra);
        out->output_db = distortion_db(spectra, recording->used, count);
    }
    free(bins);
    free(spectra);
    return done;
}
