/* SPDX-License-Identifier: MIT */
#include "lab/design/search.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { points_per_highest_line = 40 };

bool design_search_create(const struct design_request *request, const struct design_spectrum *spectrum,
                          struct design_search *out_search)
{
    struct design_search self = {.spectrum = spectrum, .best_score = INFINITY};
    size_t grid = request->period_samples;
    if (request->grid == design_grid_continuous) {
        grid =
            design_waveform_smooth_length(points_per_highest_line * (size_t)spectrum->bins[spectrum->line_count - 1]);
    }
    if (!design_waveform_create(spectrum, design_waveform_limited, grid, &self.waveform)) {
        return false;
    }
    self.packed = calloc(self.waveform.packed_length, sizeof(double));
    self.best = calloc(2 * spectrum->line_count, sizeof(double));
    if (!self.packed || !self.best) {
        design_search_free(&self);
        return false;
    }
    *out_search = self;
    return true;
}

void design_search_free(struct design_search *self)
{
    design_waveform_free(&self->waveform);
    free(self->packed);
    free(self->best);
    self->packed = NULL;
    self->best = NULL;
}

void design_search_offer(struct design_search *self, const double *c, double score)
{
    if (score < self->best_score) {
        self->best_score = score;
        memcpy(self->best, c, 2 * self->spectrum->line_count * sizeof(double));
    }
}

void design_search_keep_directions(size_t line_count, const double *y, double *inout_c)
{
    for (size_t k = 0; k < line_count; k++) {
        double length = hypot(y[2 * k], y[2 * k + 1]);
        if (length > 0) {
            inout_c[2 * k] = y[2 * k] / length;
            inout_c[2 * k + 1] = y[2 * k + 1] / length;
        }
    }
}
