/* SPDX-License-Identifier: MIT */
#include "lab/estimate/period_search.h"

#include "lab/numeric/fft.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

enum { shortest_period = 8 };

static const double least_correlation = 0.5;
static const double equal_peaks = 0.02;
static const double share_of_missing = 0.1;
/// Samples by which the last period may have moved against the first before the estimate says so.
static const double tolerated_drift_samples = 0.25;
static const double rounding_power = 1e-24;
/// A period that somebody said may be this far from a multiple of the one found: a clock of its own moves it so much.
static const double tolerated_distance_samples = 0.5;
/// It is refuted if it misses this many times as much of a perfect correlation as the one found, and a little more.
static const double clearly_worse = 2.0;
static const double smallest_difference = 1e-6;

static size_t power_of_two_from(size_t least)
{
    size_t length = 1;
    while (length < least) {
        length *= 2;
    }
    return length;
}

/// out_r[L] = sum_n x[n] x[n+L] for L < rows, through a transform padded so that nothing wraps round.
static bool autocorrelate(const double *x, size_t rows, double *out_r)
{
    size_t length = power_of_two_from(2 * rows);
    double *in = calloc(2 * length, sizeof *in);
    double *out = malloc(2 * length * sizeof *out);
    struct fft_plan *plan = fft_plan_create(length);
    bool done = in && out && plan;
    if (done) {
        for (size_t n = 0; n < rows; n++) {
            in[2 * n] = x[n];
        }
        fft_forward(plan, in, out);
        for (size_t k = 0; k < length; k++) {
            in[2 * k] = out[2 * k] * out[2 * k] + out[2 * k + 1] * out[2 * k + 1];
            in[2 * k + 1] = 0.0;
        }
        fft_inverse(plan, in, out);
        for (size_t n = 0; n < rows; n++) {
            out_r[n] = out[2 * n] / (double)length;
        }
    }
    free(in);
    free(out);
    fft_plan_destroy(plan);
    return done;
}

/// Divides each r[L] by the geometric mean of the energies of the two stretches that it compares.
static void normalise(const double *x, size_t rows, double *io_r)
{
    double energy = io_r[0];
    double early = energy;
    double late = energy;
    for (size_t lag = 0; lag < rows; lag++) {
        double product = early * late;
        bool enough = early > 1e-9 * energy && late > 1e-9 * energy;
        io_r[lag] = enough ? io_r[lag] / sqrt(product) : 0.0;
        early -= x[rows - 1 - lag] * x[rows - 1 - lag];
        late -= x[lag] * x[lag];
    }
}

static bool is_peak(const double *r, size_t lag)
{
    return r[lag] >= r[lag - 1] && r[lag] > r[lag + 1];
}

/// Where the parabola through three points around a peak is highest.
static double refined(const double *r, size_t lag)
{
    double curvature = r[lag - 1] - 2.0 * r[lag] + r[lag + 1];
    return curvature < 0.0 ? (double)lag + 0.5 * (r[lag - 1] - r[lag + 1]) / curvature : (double)lag;
}

static size_t first_high_peak(const double *r, size_t rows)
{
    double highest = 0.0;
    for (size_t lag = shortest_period; lag <= rows / 2; lag++) {
        highest = is_peak(r, lag) && r[lag] > highest ? r[lag] : highest;
    }
    double floor = highest - equal_peaks - share_of_missing * (1.0 - highest);
    for (size_t lag = shortest_period; lag <= rows / 2 && highest >= least_correlation; lag++) {
        if (is_peak(r, lag) && r[lag] >= floor) {
            return lag;
        }
    }
    return 0;
}

/// Follows the peak from repetition to repetition, as far as half a period of overlap is left, and divides.
static double exact_period(const double *r, size_t rows, size_t first)
{
    double period = refined(r, first);
    for (size_t m = 2;; m++) {
        size_t lag = (size_t)llround(period * (double)m);
        if (lag + first / 2 + 2 >= rows) {
            return period;
        }
        /* The estimate so far is off by a fraction of a sample per period: one step either way finds the peak again. */
        for (int step = 0; step < 3 && r[lag + 1] > r[lag]; step++) {
            lag++;
        }
        for (int step = 0; step < 3 && r[lag - 1] > r[lag]; step++) {
            lag--;
        }
        period = refined(r, lag) / (double)m;
    }
}

/// Normalised autocorrelation of `rows` values, owned by the caller; all 0 for a constant, NULL if memory is short.
static double *correlations_of(const double *signal, size_t rows)
{
    double *x = malloc(2 * rows * sizeof *x);
    if (!x) {
        return NULL;
    }
    double *r = x + rows;
    double mean = 0.0;
    for (size_t n = 0; n < rows; n++) {
        mean += signal[n] / (double)rows;
    }
    for (size_t n = 0; n < rows; n++) {
        x[n] = signal[n] - mean;
    }
    if (!autocorrelate(x, rows, r)) {
        free(x);
        return NULL;
    }
    /* What is left of a constant after its mean is taken out is rounding, which repeats perfectly. */
    const bool constant = !(r[0] > rounding_power * (r[0] + mean * mean * (double)rows));
    normalise(x, rows, r);
    for (size_t lag = 0; lag < rows; lag++) {
        x[lag] = constant ? 0.0 : r[lag];
    }
    return x;
}

static enum period_search_status search(const double *r, size_t rows, struct period_search *out_search)
{
    const size_t peak = first_high_peak(r, rows);
    if (peak == 0) {
        return period_search_err_none;
    }
    out_search->exact_samples = exact_period(r, rows, peak);
    out_search->period_samples = (size_t)llround(out_search->exact_samples);
    out_search->correlation = r[peak];
    const double drift = fabs(out_search->exact_samples - (double)out_search->period_samples) * (double)(rows / peak);
    return drift > tolerated_drift_samples ? period_search_err_fraction : period_search_ok;
}

enum period_search_status period_search_run(const double *signal, size_t rows, struct period_search *out_search)
{
    *out_search = (struct period_search){0};
    if (rows < 2 * shortest_period) {
        return period_search_err_none;
    }
    double *r = correlations_of(signal, rows);
    const enum period_search_status status = r ? search(r, rows, out_search) : period_search_err_memory;
    free(r);
    return status;
}

static bool is_multiple(size_t given, double period)
{
    const double times = round((double)given / period);
    return times >= 1.0 && fabs((double)given - times * period) <= tolerated_distance_samples;
}

enum period_search_status period_search_check(const double *signal, size_t rows, size_t given,
                                              struct period_check *out_check)
{
    *out_check = (struct period_check){.refuted = false};
    if (rows < 2 * shortest_period || given == 0 || given >= rows) {
        return period_search_err_none;
    }
    double *r = correlations_of(signal, rows);
    enum period_search_status status = r ? search(r, rows, &out_check->found) : period_search_err_memory;
    if (status == period_search_ok || status == period_search_err_fraction) {
        out_check->correlation = r[given];
        const double missing = 1.0 - out_check->found.correlation;
        out_check->refuted = !is_multiple(given, out_check->found.exact_samples) &&
                             1.0 - r[given] > clearly_worse * missing + smallest_difference;
    }
    free(r);
    return status;
}
