/* SPDX-License-Identifier: MIT */
#include "lab/estimate/assemble.h"

#include "lab/estimate/circle.h"
#include "lab/estimate/method.h"
#include "lab/record/number.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int refuse_memory(struct frf *io_frf, struct error *out_error)
{
    frf_free(io_frf);
    return error_set(out_error, error_refused, "not enough memory for the frequency response");
}

static int check_same(const struct frf *segments, size_t count, struct error *out_error)
{
    const struct frf *first = &segments[0];
    for (size_t s = 1; s < count; s++) {
        const struct frf *other = &segments[s];
        if (strcmp(first->input, other->input) != 0 || strcmp(first->output, other->output) != 0 ||
            strcmp(first->method, other->method) != 0) {
            return error_set(out_error, error_refused,
                             "segment %zu has %s to %s by %s: expected %s to %s by %s as in the first", s + 1,
                             other->input, other->output, other->method, first->input, first->output, first->method);
        }
    }
    return 0;
}

/// Where a line comes from.
struct origin {
    double frequency_hz;
    size_t segment;
    size_t line;
};

static int compare_origins(const void *a, const void *b)
{
    const struct origin *left = a;
    const struct origin *right = b;
    return (left->frequency_hz > right->frequency_hz) - (left->frequency_hz < right->frequency_hz);
}

static int sort_lines(const struct frf *segments, size_t count, struct origin *out_origins, size_t line_count,
                      struct error *out_error)
{
    size_t used = 0;
    for (size_t s = 0; s < count; s++) {
        for (size_t line = 0; line < segments[s].count; line++) {
            out_origins[used++] = (struct origin){segments[s].frequency_hz[line], s, line};
        }
    }
    qsort(out_origins, line_count, sizeof *out_origins, compare_origins);
    for (size_t k = 1; k < line_count; k++) {
        if (!(out_origins[k].frequency_hz > out_origins[k - 1].frequency_hz)) {
            return error_set(out_error, error_refused,
                             "segments %zu and %zu both have a line at %.9g Hz: expected each line once",
                             out_origins[k - 1].segment + 1, out_origins[k].segment + 1, out_origins[k].frequency_hz);
        }
    }
    return 0;
}

static void copy_line(const struct frf *segment, size_t from, struct frf *io_frf, size_t to)
{
    io_frf->frequency_hz[to] = segment->frequency_hz[from];
    io_frf->real[to] = segment->real[from];
    io_frf->imag[to] = segment->imag[from];
    io_frf->std[to] = segment->std[from];
    io_frf->noise_std[to] = segment->noise_std[from];
    io_frf->odd_distortion[to] = segment->odd_distortion[from];
    io_frf->even_distortion[to] = segment->even_distortion[from];
    io_frf->valid[to] = segment->valid[from];
    if (io_frf->coherence && segment->coherence) {
        io_frf->coherence[to] = segment->coherence[from];
    }
}

/// A number of each segment as "[1, 2.5, 3]" under a key.
static bool set_list(struct frf *io_frf, const char *key, const struct frf *segments, size_t count,
                     double (*number_of)(const struct frf *segment))
{
    const size_t size = count * (number_text_size + 2) + 3;
    char *text = malloc(size);
    if (!text) {
        return false;
    }
    size_t used = (size_t)snprintf(text, size, "[");
    for (size_t s = 0; s < count; s++) {
        char number[number_text_size];
        number_format(number_of(&segments[s]), number);
        used += (size_t)snprintf(text + used, size - used, "%s%s", s ? ", " : "", number);
    }
    snprintf(text + used, size - used, "]");
    const bool set = estimate_set_long_key(io_frf, key, text);
    free(text);
    return set;
}

static double first_hz(const struct frf *segment)
{
    return segment->frequency_hz[0];
}

static double periods_of(const struct frf *segment)
{
    return (double)segment->periods;
}

static double degrees_of(const struct frf *segment)
{
    return segment->degrees_of_freedom;
}

static bool describe(const struct frf *segments, size_t count, struct frf *io_frf)
{
    io_frf->periods = segments[0].periods;
    io_frf->degrees_of_freedom = segments[0].degrees_of_freedom;
    for (size_t s = 1; s < count; s++) {
        io_frf->periods = segments[s].periods < io_frf->periods ? segments[s].periods : io_frf->periods;
        io_frf->degrees_of_freedom = fmin(io_frf->degrees_of_freedom, segments[s].degrees_of_freedom);
    }
    const double factor = circle_confidence_factor(0.95, io_frf->degrees_of_freedom / 2.0);
    return frf_set_text(&io_frf->input, segments[0].input) && frf_set_text(&io_frf->output, segments[0].output) &&
           frf_set_text(&io_frf->units, segments[0].units) && frf_set_text(&io_frf->method, segments[0].method) &&
           estimate_set_common_keys(io_frf, segments, count) &&
           (!isfinite(factor) || estimate_set_key(io_frf, "confidence_95_factor", "%.6g", factor)) &&
           estimate_set_key(io_frf, "segments", "%zu", count) &&
           set_list(io_frf, "segment_first_hz", segments, count, first_hz) &&
           set_list(io_frf, "segment_periods", segments, count, periods_of) &&
           set_list(io_frf, "segment_degrees_of_freedom", segments, count, degrees_of);
}

int estimate_assemble(const struct frf *segments, size_t count, struct frf *out_frf, struct error *out_error)
{
    *out_frf = (struct frf){0};
    size_t line_count = 0;
    for (size_t s = 0; s < count; s++) {
        line_count += segments[s].count;
    }
    if (line_count == 0) {
        return error_set(out_error, error_refused, "no segment has a line: expected at least one");
    }
    struct origin *origins = malloc(line_count * sizeof *origins);
    if (!origins) {
        return refuse_memory(out_frf, out_error);
    }
    int status = check_same(segments, count, out_error);
    status = status ? status : sort_lines(segments, count, origins, line_count, out_error);
    status = status ? status : frf_alloc(out_frf, line_count, out_error);
    for (size_t k = 0; !status && k < line_count; k++) {
        copy_line(&segments[origins[k].segment], origins[k].line, out_frf, k);
    }
    free(origins);
    if (status) {
        return status;
    }
    return describe(segments, count, out_frf) ? 0 : refuse_memory(out_frf, out_error);
}
