/* SPDX-License-Identifier: MIT */
#include "lab/estimate/frf_hann.h"

#include "lab/estimate/circle.h"
#include "lab/estimate/method.h"
#include "lab/estimate/spectra.h"

#include <math.h>
#include <stdlib.h>

enum { fewest_periods = 4 };

/// Neighbours at distance 1 and 2 share noise: squares of the window's correlations 2/3 and 1/6.
static const double shared_one_apart = 4.0 / 9.0;
static const double shared_two_apart = 1.0 / 36.0;

/// By how much that correlation widens the scatter of a mean of powers over `lines` lines in a row.
static double correlation_loss(double lines)
{
    double two_apart = lines > 2.0 ? lines - 2.0 : 0.0;
    return 1.0 + 2.0 * ((lines - 1.0) * shared_one_apart + two_apart * shared_two_apart) / lines;
}

struct stretch {
    size_t first;
    size_t periods;
};

static struct stretch longest_stretch(const struct periodic *recording)
{
    struct stretch best = {0, 0};
    struct stretch now = {0, 0};
    for (size_t i = 0; i < recording->used; i++) {
        if (now.periods > 0 && recording->used_periods[i] == now.first + now.periods) {
            now.periods++;
        } else {
            now = (struct stretch){recording->used_periods[i], 1};
        }
        best = now.periods > best.periods ? now : best;
    }
    return best;
}

static double power(double complex z)
{
    return creal(z) * creal(z) + cimag(z) * cimag(z);
}

static double complex windowed(const double complex *x)
{
    return 0.5 * x[0] - 0.25 * (x[-1] + x[1]);
}

/// Transforms one column around every excited bin: `width` lines on each side, 2 width + 1 values per bin.
static double complex *transform_around(const struct periodic *recording, const struct stretch *stretch,
                                        const char *column, double trend_per_sample, size_t width)
{
    size_t lines = recording->bin_count * (2 * width + 1);
    size_t rows = stretch->periods * recording->period_samples;
    const double *signal = run_column(recording->run, column) + stretch->first * recording->period_samples;
    uint32_t *bins = malloc(lines * sizeof *bins);
    double *level = malloc(rows * sizeof *level);
    double complex *spectra = malloc(lines * sizeof *spectra);
    bool done = bins && level && spectra;
    for (size_t i = 0; i < lines && done; i++) {
        size_t centre = recording->bins[i / (2 * width + 1)] * stretch->periods;
        bins[i] = (uint32_t)(centre + i % (2 * width + 1) - width);
    }
    for (size_t n = 0; n < rows && done; n++) {
        level[n] = signal[n] - trend_per_sample * (double)n;
    }
    done = done && spectra_transform_periods(level, rows, 1, bins, lines, spectra);
    free(bins);
    free(level);
    if (!done) {
        free(spectra);
        return NULL;
    }
    return spectra;
}

/// `input` and `output` point at the excited line itself.
static void estimate_line(const double complex *input, const double complex *output, long width, size_t line,
                          struct frf *io_frf)
{
    double complex centre = windowed(input);
    double complex response = windowed(output) / centre;
    double residual = 0.0;
    double input_scatter = 0.0;
    double count = 0.0;
    for (long m = -width; m <= width; m++) {
        if (m < -1 || m > 1) {
            residual += power(windowed(output + m) - response * windowed(input + m));
            input_scatter += power(windowed(input + m));
            count += 1.0;
        }
    }
    /* A variance from `count` correlated lines takes the place of the scatter of that many fewer periods. */
    struct circle input_line = {(size_t)(count / correlation_loss(count / 2.0)) + 1, centre, 0.0};
    input_line.variance = input_scatter / count * (double)input_line.count;
    if (circle_chance_of_zero(&input_line) < estimate_chance_of_dead_line) {
        estimate_set_line(io_frf, line, response, sqrt(residual / count / power(centre)));
    }
}

int frf_hann_estimate(const struct periodic *recording, struct frf *out_frf, struct error *out_error)
{
    struct stretch stretch = longest_stretch(recording);
    if (stretch.periods < fewest_periods) {
        return error_set(
            out_error, error_refused,
            "%s: the longest stretch without a gap has %zu periods: method hann needs %d, use --method mean",
            recording->run->path, stretch.periods, fewest_periods);
    }
    size_t width = stretch.periods / 2;
    double side = (double)(width - 1);
    double dof = 2.0 * 2.0 * side / correlation_loss(side);
    int status = estimate_begin(recording, "hann", dof, out_frf, out_error);
    if (status) {
        return status;
    }
    /* One line more on each side than is used, for the window's own neighbours. */
    size_t reach = width + 1;
    double complex *input = transform_around(recording, &stretch, recording->input, 0.0, reach);
    double complex *output =
        transform_around(recording, &stretch, recording->output, recording->trend_per_sample, reach);
    for (size_t line = 0; line < recording->bin_count && input && output; line++) {
        size_t centre = line * (2 * reach + 1) + reach;
        estimate_line(input + centre, output + centre, (long)width, line, out_frf);
    }
    if (!input || !output) {
        status = error_set(out_error, error_refused, "%s: not enough memory for method hann", recording->run->path);
        frf_free(out_frf);
    } else {
        out_frf->periods = stretch.periods;
        status = estimate_end(recording, out_frf, out_error);
    }
    free(input);
    free(output);
    return status;
}
