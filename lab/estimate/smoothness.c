/* SPDX-License-Identifier: MIT */
#include "lab/estimate/smoothness.h"

#include "lab/estimate/complex_fit.h"
#include "lab/numeric/cmplx.h"
#include "lab/numeric/statistics.h"

#include <complex.h>
#include <math.h>
#include <stdlib.h>

enum { neighbours = 2 * smoothness_half_width, numerator_terms = 3, terms_max = 5, passes = 2, fewest_to_judge = 20 };

/// Median of |e| / (2 sigma), sigma^2 = E|e|^2, of a circular normal e: sqrt(log 2) / 2.
static const double median_of_noise = 0.41627730557884884;

/// Scatter does not care how many poles a curve has; what a curve cannot follow does, by much more than this.
static const double coarse_factor = 1.5;
static const double noticeable_ratio = 1.25;

/// The lines that can be compared, close together.
struct lines {
    size_t count;
    size_t *index; ///< in the response
    double *log_f;
    double *distance; ///< scratch for medians
    double *level;
    double *memory;
};

static bool take_lines(const struct frf *frf, struct lines *out)
{
    const size_t size = frf->count + 1;
    *out = (struct lines){.index = malloc(size * sizeof *out->index), .memory = malloc(3 * size * sizeof *out->memory)};
    if (!out->index || !out->memory) {
        return false;
    }
    out->log_f = out->memory;
    out->distance = out->log_f + size;
    out->level = out->distance + size;
    for (size_t line = 0; line < frf->count; line++) {
        if (frf->valid[line] && frf->std[line] > 0.0 && frf->frequency_hz[line] > 0.0) {
            out->index[out->count] = line;
            out->log_f[out->count++] = log(frf->frequency_hz[line]);
        }
    }
    return true;
}

/// One line's neighbours, x scaled to -1 .. 1.
struct window {
    double x[neighbours], std[neighbours];
    double complex response[neighbours];
    double denominator[neighbours]; ///< |1 + a1 x + a2 x^2|
};

static void fill_window(const struct frf *frf, const struct lines *lines, size_t k, struct window *out)
{
    const size_t most = lines->count - smoothness_fewest_lines;
    const size_t half = smoothness_half_width;
    const size_t first = k < half ? 0 : k - half > most ? most : k - half;
    const double reach =
        fmax(lines->log_f[k] - lines->log_f[first], lines->log_f[first + neighbours] - lines->log_f[k]);
    size_t n = 0;
    for (size_t i = first; i < first + smoothness_fewest_lines; i++) {
        if (i != k) {
            const size_t line = lines->index[i];
            out->x[n] = (lines->log_f[i] - lines->log_f[k]) / reach;
            out->std[n] = frf->std[line];
            out->response[n] = CMPLX(frf->real[line], frf->imag[line]);
            out->denominator[n++] = 1.0;
        }
    }
}

/// The columns of the fit, that of b0 last: complex_fit gives that unknown.
static void fill_columns(const struct window *window, size_t terms, double complex *out_columns,
                         double complex *out_values, double *out_weights)
{
    for (size_t n = 0; n < neighbours; n++) {
        const double weight = 1.0 / (window->std[n] * window->denominator[n]);
        const double x = window->x[n];
        const double complex value = weight * window->response[n];
        const double complex row[terms_max] = {-value * x, -value * x * x, weight * x, weight * x * x, weight};
        const size_t poles = terms - numerator_terms;
        for (size_t c = 0; c < terms; c++) {
            out_columns[c * neighbours + n] = row[c < poles ? c : c + terms_max - terms];
        }
        out_weights[n] = weight;
        out_values[n] = value;
    }
}

/// Solves R a = Q^H y for the denominator's coefficients by refitting with each of them last.
static bool find_denominator(const struct window *window, size_t terms, double complex out_a[2])
{
    double complex columns[terms_max * neighbours];
    double complex values[neighbours];
    double weights[neighbours];
    double lengths[terms_max];
    const size_t poles = terms - numerator_terms;
    for (size_t wanted = 0; wanted < poles; wanted++) {
        fill_columns(window, terms, columns, values, weights);
        for (size_t n = 0; n < neighbours; n++) {
            const double complex moved = columns[wanted * neighbours + n];
            columns[wanted * neighbours + n] = columns[(terms - 1) * neighbours + n];
            columns[(terms - 1) * neighbours + n] = moved;
        }
        if (!complex_fit_orthonormalise(neighbours, terms, columns, lengths)) {
            return false;
        }
        out_a[wanted] = complex_fit_last(neighbours, terms, columns, lengths[terms - 1], values);
    }
    return true;
}

/// What the neighbours say of the line between them, and the variance of that.
static bool predict(struct window *io_window, size_t terms, double complex *out_response, double *out_variance)
{
    double complex columns[terms_max * neighbours];
    double complex values[neighbours];
    double complex a[2] = {0.0, 0.0};
    double weights[neighbours];
    double lengths[terms_max];
    for (int pass = 0; pass < passes; pass++) {
        if (!find_denominator(io_window, terms, a)) {
            return false;
        }
        for (size_t n = 0; n < neighbours; n++) {
            const double x = io_window->x[n];
            io_window->denominator[n] = fmax(cabs(1.0 + a[0] * x + a[1] * x * x), 1e-9);
        }
    }
    fill_columns(io_window, terms, columns, values, weights);
    if (!complex_fit_orthonormalise(neighbours, terms, columns, lengths)) {
        return false;
    }
    *out_variance = 0.0;
    for (size_t n = 0; n < neighbours; n++) {
        const double complex share = conj(columns[(terms - 1) * neighbours + n]) * weights[n] / lengths[terms - 1];
        *out_variance += pow(cabs(share) * io_window->denominator[n] * io_window->std[n], 2.0);
    }
    *out_response = complex_fit_last(neighbours, terms, columns, lengths[terms - 1], values);
    return true;
}

/// Distances of all lines over 2 std, in `lines->distance`; returns how many there are.
static size_t measure_with(const struct frf *frf, const struct lines *lines, size_t terms, double *out_over_two_std,
                           struct smoothness *io_out)
{
    size_t count = 0;
    for (size_t k = 0; k < lines->count; k++) {
        const size_t line = lines->index[k];
        struct window window;
        double complex expected;
        double variance;
        fill_window(frf, lines, k, &window);
        if (!predict(&window, terms, &expected, &variance)) {
            continue;
        }
        const double complex own = CMPLX(frf->real[line], frf->imag[line]);
        const double own_variance = frf->std[line] * frf->std[line];
        const double distance = cabs(own - expected) / (2.0 * sqrt(own_variance + variance));
        if (!isfinite(distance)) {
            continue;
        }
        if (out_over_two_std) {
            out_over_two_std[line] = distance;
            io_out->beyond += distance > 1.0;
        }
        /* Its own std is the unit: what moves lines moves the neighbours too, as std does. */
        lines->level[count] = cabs(own) > 0.0 ? distance * frf->std[line] / (median_of_noise * cabs(own)) : 0.0;
        lines->distance[count++] = distance;
    }
    return count;
}

bool smoothness_measure(const struct frf *frf, double *out_over_two_std, struct smoothness *out)
{
    struct lines lines;
    *out = (struct smoothness){.ratio = NAN, .simpler_ratio = NAN, .level = NAN};
    for (size_t line = 0; line < frf->count; line++) {
        out_over_two_std[line] = NAN;
    }
    const bool done = take_lines(frf, &lines);
    if (done && lines.count >= smoothness_fewest_lines) {
        const size_t simpler = measure_with(frf, &lines, terms_max - 1, NULL, out);
        out->simpler_ratio = statistics_median(lines.distance, simpler) / median_of_noise;
        out->lines = measure_with(frf, &lines, terms_max, out_over_two_std, out);
        out->ratio = statistics_median(lines.distance, out->lines) / median_of_noise;
        out->level = statistics_median(lines.level, out->lines);
    }
    free(lines.index);
    free(lines.memory);
    return done;
}

bool smoothness_is_coarse(const struct smoothness *self)
{
    return self->lines > 0 && self->ratio > noticeable_ratio && self->simpler_ratio > coarse_factor * self->ratio;
}

bool smoothness_is_rough(const struct smoothness *self)
{
    return self->lines >= fewest_to_judge && self->ratio * median_of_noise > 1.0 && !smoothness_is_coarse(self);
}
