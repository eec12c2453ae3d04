/* SPDX-License-Identifier: MIT */
#include "lab/estimate/segments.h"

#include "lab/estimate/columns.h"
#include "lab/estimate/spectra.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>

enum { fewest_segments = 4, shortest_segment = 16, longest_usual_segment = 16384, usual_share = 8 };

static const double two_pi = 6.283185307179586476925;
/// |sum w(n) w(n + N/2)|^2 / (sum w^2)^2 of a Hann window.
static const double shared_with_next = 1.0 / 36.0;

static size_t usual_length(size_t rows)
{
    size_t length = shortest_segment;
    while (2 * length <= rows / usual_share && length < longest_usual_segment) {
        length *= 2;
    }
    return length;
}

/// Constant and slope of the line through a segment; no slope unless `with_slope`.
static void take_out_line(const double *x, size_t count, bool with_slope, double *out_level)
{
    double middle = ((double)count - 1.0) / 2.0;
    double mean = 0.0;
    double product = 0.0;
    double square = 0.0;
    for (size_t n = 0; n < count; n++) {
        mean += x[n] / (double)count;
    }
    for (size_t n = 0; n < count && with_slope; n++) {
        double distance = (double)n - middle;
        product += distance * (x[n] - mean);
        square += distance * distance;
    }
    double slope = square > 0.0 ? product / square : 0.0;
    for (size_t n = 0; n < count; n++) {
        double window = 0.5 - 0.5 * cos(two_pi * (double)n / (double)count);
        out_level[n] = window * (x[n] - mean - slope * ((double)n - middle));
    }
}

static bool transform_column(const struct arbitrary *recording, const struct segments *self, const char *column,
                             double complex *out_spectra)
{
    const double *signal = run_column(recording->run, column);
    size_t bins = self->samples / 2 + 1;
    double *level = malloc(2 * self->samples * sizeof *level);
    double complex *spectra = malloc(2 * bins * sizeof *spectra);
    bool done = level && spectra;
    size_t filled = 0;
    for (size_t row = recording->start; row + self->samples <= recording->run->rows && done; row += self->samples / 2) {
        if (columns_first_lost_row(recording->run, row, self->samples) > 0) {
            continue;
        }
        take_out_line(signal + row, self->samples, columns_is_position(column), level);
        done = spectra_transform_all(level, self->samples, 1, spectra);
        for (size_t k = 0; k < self->lines && done; k++) {
            out_spectra[filled * self->lines + k] = spectra[k + 1];
        }
        filled++;
    }
    free(level);
    free(spectra);
    return done;
}

static void count_segments(const struct arbitrary *recording, struct segments *io_self)
{
    for (size_t row = recording->start; row + io_self->samples <= recording->run->rows; row += io_self->samples / 2) {
        bool lost = columns_first_lost_row(recording->run, row, io_self->samples) > 0;
        io_self->lost += lost;
        io_self->count += !lost;
    }
}

int segments_transform(const struct arbitrary *recording, size_t segment_samples, struct segments *out_self,
                       struct error *out_error)
{
    *out_self = (struct segments){0};
    size_t rows = recording->run->rows - recording->start;
    out_self->samples = segment_samples ? segment_samples : usual_length(rows);
    out_self->lines = (out_self->samples - 1) / 2;
    if (out_self->samples >= shortest_segment) {
        count_segments(recording, out_self);
    }
    if (out_self->count < fewest_segments) {
        return error_set(out_error, error_refused,
                         "%s: %zu rows give %zu segments of %zu samples without lost ones: expected at least %d "
                         "segments of at least %d samples, see --segment",
                         recording->run->path, rows, out_self->count, out_self->samples, fewest_segments,
                         shortest_segment);
    }
    double count = (double)out_self->count;
    out_self->independent = count / (1.0 + 2.0 * shared_with_next * (count - 1.0) / count);
    size_t size = out_self->count * out_self->lines;
    out_self->input = malloc(size * sizeof *out_self->input);
    out_self->output = malloc(size * sizeof *out_self->output);
    out_self->reference = malloc(size * sizeof *out_self->reference);
    if (!out_self->input || !out_self->output || !out_self->reference ||
        !transform_column(recording, out_self, recording->input, out_self->input) ||
        !transform_column(recording, out_self, recording->output, out_self->output) ||
        (recording->reference && !transform_column(recording, out_self, recording->reference, out_self->reference))) {
        segments_free(out_self);
        return error_set(out_error, error_refused, "%s: not enough memory for the spectra of %zu rows",
                         recording->run->path, rows);
    }
    return 0;
}

void segments_free(struct segments *self)
{
    free(self->input);
    free(self->output);
    free(self->reference);
    *self = (struct segments){0};
}
