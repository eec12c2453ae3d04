/* SPDX-License-Identifier: MIT */
#include "lab/design/projection.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/// Measured on the testbed and on flat spectra: 0.80 to 0.85 and 0.65 to 0.75 do about as well, 0.7 and 0.9 do worse.
static const double relaxation = 0.82;
static const double first_level = 0.68; ///< of the best peak; ends at 1, where the sets may meet

struct projection {
    struct design_search *search;
    double *x;       ///< the iterate, packed
    double *reflect; ///< 2 p - x, packed
    double *y;       ///< 2 lines
    double *c;       ///< 2 lines
    double *fit;     ///< lines: y times this is the least-squares fit; with a tolerance
    double *best;    ///< 2 lines
    double best_score;
};

static double clipped(double value, double level)
{
    value = value > level ? level : value;
    return value < -level ? -level : value;
}

/// Tries c, and keeps it if it is the best of this call.
static void evaluate(struct projection *self)
{
    struct design_search *search = self->search;
    const double score = design_search_try(search, self->c);
    if (score < self->best_score) {
        self->best_score = score;
        memcpy(self->best, self->c, 2 * search->spectrum->line_count * sizeof(double));
    }
}

/// Lengths of the fit within the tolerance. Where the limits take away power, all lengths shrink alike: the common
/// factor is brought back to unit power first.
static void keep_lengths(struct projection *self)
{
    const struct design_search *search = self->search;
    const size_t lines = search->spectrum->line_count;
    const double longest = exp(search->tolerance);
    for (size_t k = 0; k < lines; k++) {
        self->y[2 * k] *= self->fit[k];
        self->y[2 * k + 1] *= self->fit[k];
    }
    const double power_root = design_search_power_root(search, self->y);
    design_search_keep_directions(lines, self->y, self->c);
    for (size_t k = 0; k < lines; k++) {
        double length = hypot(self->y[2 * k], self->y[2 * k + 1]) / power_root;
        length = length > 1 / longest ? fmin(length, longest) : 1 / longest;
        self->c[2 * k] *= length;
        self->c[2 * k + 1] *= length;
    }
}

/// x <- beta (x + u - p) + (1 - beta) p with u in search->packed and p = clip(x, level), then reflects the new x at
/// next_level.
static void average(struct projection *self, double level, double next_level)
{
    const double *u = self->search->packed;
    for (size_t n = 0; n < self->search->waveform.packed_length; n++) {
        double p = clipped(self->x[n], level);
        double x = relaxation * (self->x[n] + u[n]) + (1 - 2 * relaxation) * p;
        self->x[n] = x;
        self->reflect[n] = 2 * clipped(x, next_level) - x;
    }
}

static void iterate(struct projection *self, size_t iterations)
{
    struct design_search *search = self->search;
    const size_t length = search->waveform.packed_length;
    double level = first_level * self->best_score;
    memcpy(self->x, search->packed, length * sizeof(double));
    for (size_t n = 0; n < length; n++) {
        self->reflect[n] = 2 * clipped(self->x[n], level) - self->x[n];
    }
    for (size_t i = 0; i < iterations && design_search_goes_on(search); i++) {
        design_waveform_gather(&search->waveform, self->reflect, self->y);
        if (search->share) {
            keep_lengths(self);
        } else {
            design_search_keep_directions(search->spectrum->line_count, self->y, self->c);
        }
        evaluate(self);
        double rise = (1 - first_level) * (double)(i + 1) / (double)iterations;
        double next_level = (first_level + rise) * self->best_score;
        average(self, level, next_level);
        level = next_level;
    }
}

bool design_projection_run(struct design_search *search, size_t iterations, double *inout_c)
{
    const struct design_waveform *waveform = &search->waveform;
    const size_t length = waveform->packed_length;
    const size_t lines = search->spectrum->line_count;
    double *memory = calloc(2 * length + 5 * lines, sizeof *memory);
    if (!memory) {
        return false;
    }
    struct projection self = {.search = search, .x = memory, .best = inout_c, .best_score = INFINITY};
    self.reflect = self.x + length;
    self.y = self.reflect + length;
    self.c = self.y + 2 * lines;
    self.fit = self.c + 2 * lines;
    for (size_t k = 0; k < lines; k++) {
        double square = 0;
        for (size_t s = 0; s < waveform->signal_count; s++) {
            square += waveform->gain[s][k] * waveform->gain[s][k];
        }
        self.fit[k] = 2 / ((double)waveform->grid * square);
    }
    memcpy(self.c, inout_c, 2 * lines * sizeof *memory);
    evaluate(&self);
    iterate(&self, iterations);
    free(memory);
    return true;
}
