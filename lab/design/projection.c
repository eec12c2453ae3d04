/* SPDX-License-Identifier: MIT */
#include "lab/design/projection.h"

#include <stdlib.h>
#include <string.h>

static const double relaxation = 0.9;
static const double first_level = 0.75; ///< of the best peak; ends at 1, where the sets may meet

static double clipped(double value, double level)
{
    value = value > level ? level : value;
    return value < -level ? -level : value;
}

struct projection {
    double *x;       ///< the iterate, packed
    double *reflect; ///< 2 p - x, packed
    double *y;
    double *c;
    double *best;
    double best_peak;
};

static void evaluate(struct design_search *search, struct projection *self)
{
    const size_t lines = search->spectrum->line_count;
    design_waveform_synthesise(&search->waveform, self->c, search->packed);
    double peak = design_waveform_peak_all(&search->waveform, search->packed);
    design_search_offer(search, self->c, peak);
    if (peak < self->best_peak) {
        self->best_peak = peak;
        memcpy(self->best, self->c, 2 * lines * sizeof(double));
    }
}

static void iterate(struct design_search *search, struct projection *self, double level)
{
    const size_t length = search->waveform.packed_length;
    for (size_t n = 0; n < length; n++) {
        self->reflect[n] = 2 * clipped(self->x[n], level) - self->x[n];
    }
    design_waveform_gather(&search->waveform, self->reflect, self->y);
    design_search_keep_directions(search->spectrum->line_count, self->y, self->c);
    evaluate(search, self);
    for (size_t n = 0; n < length; n++) {
        double p = clipped(self->x[n], level);
        self->x[n] = relaxation * (self->x[n] + search->packed[n] - p) + (1 - relaxation) * p;
    }
}

bool design_projection_run(struct design_search *search, size_t iterations, double *inout_c)
{
    const size_t length = search->waveform.packed_length;
    const size_t lines = search->spectrum->line_count;
    double *memory = calloc(2 * length + 4 * lines, sizeof *memory);
    if (!memory) {
        return false;
    }
    struct projection self = {.x = memory,
                              .reflect = memory + length,
                              .y = memory + 2 * length,
                              .c = memory + 2 * length + 2 * lines,
                              .best = inout_c};
    memcpy(self.c, inout_c, 2 * lines * sizeof *memory);
    design_waveform_synthesise(&search->waveform, self.c, search->packed);
    memcpy(self.x, search->packed, length * sizeof *memory);
    self.best_peak = design_waveform_peak_all(&search->waveform, search->packed);
    design_search_offer(search, self.c, self.best_peak);
    for (size_t i = 0; i < iterations; i++) {
        double level = first_level + (1 - first_level) * (double)i / (double)iterations;
        iterate(search, &self, level * self.best_peak);
    }
    free(memory);
    return true;
}
