/* SPDX-License-Identifier: MIT */
#include "lab/estimate/resample.h"

#include "lab/estimate/columns.h"
#include "lab/record/run_names.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

enum {
    half_width = 32,
    taps = 2 * half_width,
    phases = 1024, /* straight lines between them are off by 1.2e-6 of the steepest sinc */
};

static const double pi = 3.14159265358979323846;
static const double beta = 10.0;
static const double tolerated_lost_weight = 0.01;

/// Modified Bessel function of order 0, by its series.
static double bessel_i0(double x)
{
    double sum = 1.0;
    double term = 1.0;
    for (int k = 1; term > 1e-17 * sum; k++) {
        term *= x * x / (4.0 * k * k);
        sum += term;
    }
    return sum;
}

static double kernel_at(double distance)
{
    const double inside = 1.0 - distance * distance / (half_width * half_width);
    if (inside <= 0.0) {
        return 0.0;
    }
    const double sinc = distance == 0.0 ? 1.0 : sin(pi * distance) / (pi * distance);
    return sinc * bessel_i0(beta * sqrt(inside)) / bessel_i0(beta);
}

/// (phases + 1) x taps: weights of the samples -half_width + 1 .. half_width around the whole part of a position, whose
/// rest is phase/phases. They add up to 1, so that a constant stays one.
static double *make_kernel(void)
{
    double *kernel = malloc((phases + 1) * taps * sizeof *kernel);
    for (size_t phase = 0; phase <= phases && kernel; phase++) {
        double *weights = kernel + phase * taps;
        double sum = 0.0;
        for (int i = 0; i < taps; i++) {
            weights[i] = kernel_at((double)(i - half_width + 1) - (double)phase / phases);
            sum += weights[i];
        }
        for (int i = 0; i < taps; i++) {
            weights[i] /= sum;
        }
    }
    return kernel;
}

struct source {
    const double *x;
    size_t rows, period;
};

/// A sample that the recording may not have: of the next or the last period then.
static double sample_at(const struct source *self, long long index)
{
    const long long rows = (long long)self->rows;
    const long long period = (long long)self->period;
    while (index < 0) {
        index += period;
    }
    while (index >= rows) {
        index -= period;
    }
    return self->x[index];
}

/// Fills in the samples around `whole` that have weights; those inside are not copied.
static const double *samples_around(const struct source *self, long long whole, double *copy)
{
    const long long first = whole - half_width + 1;
    if (first >= 0 && first + taps <= (long long)self->rows) {
        return self->x + first;
    }
    for (int i = 0; i < taps; i++) {
        copy[i] = sample_at(self, first + i);
    }
    return copy;
}

static double position_of(const struct resample_warp *warp, size_t sample)
{
    const double m = (double)sample;
    return m + warp->stretch * m + warp->bend * m * m;
}

static double interpolate(const double *kernel, const struct source *source, double position)
{
    double copy[taps];
    const double whole = floor(position);
    const double place = (position - whole) * phases;
    const size_t phase = (size_t)place < phases ? (size_t)place : phases - 1;
    const double share = place - (double)phase;
    const double *low = kernel + phase * taps;
    const double *x = samples_around(source, (long long)whole, copy);
    double sums[2] = {0.0, 0.0};
    for (int i = 0; i < taps; i++) {
        sums[0] += low[i] * x[i];
        sums[1] += low[i + taps] * x[i];
    }
    return sums[0] + share * (sums[1] - sums[0]);
}

static double lost_weight(const double *kernel, const struct source *valid, double position)
{
    double copy[taps];
    const double whole = floor(position);
    const double *weights = kernel + (size_t)((position - whole) * phases) * taps;
    const double *flags = samples_around(valid, (long long)whole, copy);
    double sum = 0.0;
    for (int i = 0; i < taps; i++) {
        sum += flags[i] > 0.5 ? 0.0 : fabs(weights[i]);
    }
    return sum;
}

static bool is_kept(const char *name)
{
    return run_name_axis(name) != run_axis_unknown && strcmp(name, "time_s") != 0;
}

static size_t count_rows(const struct run *run, const struct resample_warp *warp)
{
    size_t rows = (size_t)((double)run->rows / (1.0 + warp->stretch)) + 2;
    const double most = (double)run->rows - 0.5;
    while (rows > 0 && position_of(warp, rows - 1) > most) {
        rows--;
    }
    while (position_of(warp, rows) <= most) {
        rows++;
    }
    return rows;
}

static bool resample_column(const double *kernel, const struct source *source, const struct resample_warp *warp,
                            const char *name, struct run *io_run)
{
    double *out = run_add_column(io_run, name);
    const bool flags = strcmp(name, "valid") == 0;
    for (size_t m = 0; m < io_run->rows && out; m++) {
        const double position = position_of(warp, m);
        if (flags) {
            out[m] = lost_weight(kernel, source, position) > tolerated_lost_weight ? 0.0 : 1.0;
        } else {
            out[m] = interpolate(kernel, source, position);
        }
    }
    return out != NULL;
}

static bool copy_keys(const struct run *run, struct run *io_run)
{
    bool done = true;
    for (size_t k = 0; k < run->key_count && done; k++) {
        done = run_set_key(io_run, run->keys[k].key, run->keys[k].value);
    }
    io_run->path = done ? strdup(run->path) : NULL;
    if (done && run->bins) {
        io_run->bins = malloc(run->bin_count * sizeof *io_run->bins);
        if (io_run->bins) {
            memcpy(io_run->bins, run->bins, run->bin_count * sizeof *io_run->bins);
        }
    }
    return io_run->path && (!run->bins || io_run->bins);
}

/// The last period may have got lost at the end.
static void fit_periods(struct run *io_run)
{
    const size_t whole = io_run->period_samples > 0 ? io_run->rows / io_run->period_samples : 0;
    if (io_run->periods > 0 && io_run->settle_periods + io_run->periods > whole) {
        io_run->periods = whole > io_run->settle_periods ? whole - io_run->settle_periods : 0;
    }
}

int resample_run(const struct run *run, const struct resample_warp *warp, size_t period_samples, struct run *out_run,
                 struct error *out_error)
{
    double *kernel = make_kernel();
    *out_run = *run;
    out_run->path = NULL;
    out_run->bins = NULL;
    out_run->columns = NULL;
    out_run->column_count = 0;
    out_run->keys = NULL;
    out_run->key_count = 0;
    out_run->rows = count_rows(run, warp);
    out_run->sample_rate_hz = run->sample_rate_hz / (1.0 + warp->stretch);
    fit_periods(out_run);
    bool done = kernel && run->rows > period_samples && period_samples > 0 && copy_keys(run, out_run);
    for (size_t c = 0; c < run->column_count && done; c++) {
        const char *name = run->columns[c].name;
        double *owned = NULL;
        /* What stands in lost samples would get into those around them. */
        const double *values = strcmp(name, "valid") == 0 ? run->columns[c].data : columns_filled(run, name, &owned);
        const struct source source = {values, run->rows, period_samples};
        done = values && (!is_kept(name) || resample_column(kernel, &source, warp, name, out_run));
        free(owned);
    }
    free(kernel);
    if (done) {
        return 0;
    }
    run_free(out_run);
    return error_set(out_error, error_refused, "%s: not enough memory to resample %zu rows", run->path, run->rows);
}
