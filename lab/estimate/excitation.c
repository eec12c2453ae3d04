/* SPDX-License-Identifier: MIT */
#include "lab/estimate/excitation.h"

#include "lab/estimate/circle.h"
#include "lab/numeric/cmplx.h"
#include "lab/numeric/fft.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { fewest_lines = 6, fine_steps = 16 }; ///< steps to either side of a whole sample, half a sample in all

static const double two_pi = 6.283185307179586476925;
static const double tolerated_difference = 0.01;
/// Multiples of what noise explains on average; the fewer the lines the more it scatters, by 1/sqrt of their number.
static const double scatter_of_noise = 5.0;
/// What other phases' likeness misses may be as little as this for each line, with the best of all shifts; at most.
static const double missing_per_line = 0.01;
static const double largest_missing = 0.3;
static const double same_level = 0.1;
/// Standard deviations that noise may move the level by.
static const double level_stds = 4.0;

bool excitation_take(const struct periodic *recording, struct excitation *out)
{
    const size_t count = recording->bin_count;
    *out = (struct excitation){.has_table_crc32 = recording->run->has_table_crc32,
                               .table_crc32 = recording->run->table_crc32,
                               .period_samples = recording->period_samples,
                               .count = count,
                               .bins = malloc(count * sizeof *out->bins),
                               .mean = malloc(count * sizeof *out->mean)};
    if (!out->bins || !out->mean) {
        return false;
    }
    memcpy(out->bins, recording->bins, count * sizeof *out->bins);
    for (size_t b = 0; b < count; b++) {
        const struct circle line = circle_of_column(recording->input_spectra, recording->used, count, b);
        out->mean[b] = line.mean;
        out->noise += line.variance / (double)recording->used;
    }
    return true;
}

void excitation_free(struct excitation *self)
{
    free(self->bins);
    free(self->mean);
    *self = (struct excitation){.count = 0};
}

static double size_of(const struct excitation *self)
{
    double sum = 0.0;
    for (size_t b = 0; b < self->count; b++) {
        sum += cmplx_power(self->mean[b]);
    }
    return sum;
}

static double correlation_at(const struct excitation *a, const struct excitation *b, double shift)
{
    double sum = 0.0;
    for (size_t k = 0; k < a->count; k++) {
        const double angle = two_pi * (double)a->bins[k] * shift / (double)a->period_samples;
        sum += creal(a->mean[k] * conj(b->mean[k]) * cexp(-I * angle));
    }
    return sum;
}

/// The whole shift with the largest correlation, of all at once through a transform.
static bool best_shift(const struct excitation *a, const struct excitation *b, size_t *out_shift)
{
    const size_t length = a->period_samples;
    double *products = calloc(2 * length, sizeof *products);
    double *correlation = malloc(2 * length * sizeof *correlation);
    struct fft_plan *plan = fft_plan_create(length);
    const bool done = products && correlation && plan;
    *out_shift = 0;
    for (size_t k = 0; k < a->count && done; k++) {
        const double complex product = a->mean[k] * conj(b->mean[k]);
        products[2 * (size_t)a->bins[k]] = creal(product);
        products[2 * (size_t)a->bins[k] + 1] = cimag(product);
    }
    if (done) {
        fft_forward(plan, products, correlation);
    }
    for (size_t shift = 1; shift < length && done; shift++) {
        *out_shift = correlation[2 * shift] > correlation[2 * *out_shift] ? shift : *out_shift;
    }
    fft_plan_destroy(plan);
    free(products);
    free(correlation);
    return done;
}

static bool largest_correlation(const struct excitation *a, const struct excitation *b, double *out_largest)
{
    size_t shift;
    *out_largest = -INFINITY;
    if (!best_shift(a, b, &shift)) {
        return false;
    }
    for (int step = -fine_steps; step <= fine_steps; step++) {
        const double at = (double)shift + 0.5 * (double)step / (double)fine_steps;
        *out_largest = fmax(*out_largest, correlation_at(a, b, at));
    }
    return true;
}

static bool has_same_lines(const struct excitation *a, const struct excitation *b)
{
    return a->count > 0 && a->count == b->count && a->period_samples == b->period_samples &&
           memcmp(a->bins, b->bins, a->count * sizeof *a->bins) == 0;
}

/// How much of a likeness of 1 may be missing; false if other phases miss as little by chance.
static bool tolerated_missing(double lines, double noise, double *out_tolerated)
{
    *out_tolerated = tolerated_difference + noise * (1.0 + scatter_of_noise / sqrt(lines));
    return lines >= fewest_lines && *out_tolerated <= fmin(missing_per_line * lines, largest_missing);
}

bool excitation_compare(const struct excitation *a, const struct excitation *b, enum excitation_match *out_match,
                        double *out_level)
{
    const bool same_table = a->has_table_crc32 && b->has_table_crc32 && a->table_crc32 == b->table_crc32;
    *out_match = excitation_unknown;
    *out_level = 1.0;
    if (!has_same_lines(a, b)) {
        return true;
    }
    const double a_size = size_of(a);
    const double b_size = size_of(b);
    const double lines = (double)a->count;
    const double noise = 0.5 * (a->noise / a_size + b->noise / b_size);
    double tolerated;
    if (!tolerated_missing(lines, noise, &tolerated) && !same_table) {
        return true;
    }
    double largest = sqrt(a_size * b_size);
    if (!same_table && !largest_correlation(a, b, &largest)) {
        return false;
    }
    *out_level = sqrt(b_size / a_size);
    const bool alike = 1.0 - largest / sqrt(a_size * b_size) <= tolerated || same_table;
    const bool as_strong = !(fabs(*out_level - 1.0) > same_level + level_stds * sqrt(noise / lines));
    *out_match = !alike ? excitation_other : as_strong ? excitation_same : excitation_other_level;
    return true;
}

bool excitations_add(struct excitations *self, struct excitation *one)
{
    struct excitation *grown = realloc(self->items, (self->count + 1) * sizeof *grown);
    if (!grown) {
        return false;
    }
    grown[self->count++] = *one;
    self->items = grown;
    *one = (struct excitation){.count = 0};
    return true;
}

bool excitations_move(struct excitations *io_from, struct excitations *io_to)
{
    bool done = true;
    for (size_t i = 0; i < io_from->count && done; i++) {
        done = excitations_add(io_to, &io_from->items[i]);
    }
    excitations_free(io_from);
    return done;
}

bool excitations_compare(const struct excitations *a, const struct excitations *b, enum excitation_match *out_match,
                         double *out_level)
{
    *out_match = excitation_unknown;
    *out_level = 1.0;
    for (size_t i = 0; i < a->count && a->count == b->count; i++) {
        enum excitation_match one;
        double level;
        if (!excitation_compare(&a->items[i], &b->items[i], &one, &level)) {
            return false;
        }
        if (one != excitation_unknown) {
            *out_match = one;
            *out_level = level;
        }
        if (one == excitation_other) {
            break;
        }
    }
    return true;
}

void excitations_free(struct excitations *self)
{
    for (size_t i = 0; i < self->count; i++) {
        excitation_free(&self->items[i]);
    }
    free(self->items);
    *self = (struct excitations){.count = 0};
}
