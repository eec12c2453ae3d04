/* SPDX-License-Identifier: MIT */
#include "lab/design/search.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { search_points = 40 }; ///< per highest line

static size_t grid_of(const struct design_request *request, const struct design_spectrum *spectrum,
                      size_t points_per_highest_line)
{
    if (request->grid == design_grid_samples) {
        return request->period_samples;
    }
    return design_waveform_smooth_length(points_per_highest_line * (size_t)spectrum->bins[spectrum->line_count - 1]);
}

/// Shares of the power, which |c_k|^2 multiplies.
static bool create_shares(const struct design_request *request, struct design_search *self)
{
    const struct design_spectrum *spectrum = self->spectrum;
    const double rms = design_spectrum_rms(spectrum, design_acceleration);
    self->tolerance = request->amplitude_tolerance_db * log(10) / 20;
    self->share = calloc(spectrum->line_count, sizeof *self->share);
    for (size_t k = 0; self->share && k < spectrum->line_count; k++) {
        double amplitude = design_spectrum_amplitude(spectrum, design_acceleration, k) / rms;
        self->share[k] = amplitude * amplitude / 2;
    }
    return self->share != NULL;
}

bool design_search_create_on(const struct design_request *request, const struct design_spectrum *spectrum, size_t grid,
                             size_t fold, struct design_search *out_search)
{
    struct design_search self = {.spectrum = spectrum, .best_score = INFINITY};
    if (!design_waveform_create_folded(spectrum, design_waveform_limited, grid, fold, &self.waveform)) {
        return false;
    }
    self.packed = calloc(self.waveform.packed_length, sizeof(double));
    self.best = calloc(2 * spectrum->line_count, sizeof(double));
    bool shares = !(request->amplitude_tolerance_db > 0) || create_shares(request, &self);
    if (!self.packed || !self.best || !shares) {
        design_search_free(&self);
        return false;
    }
    *out_search = self;
    return true;
}

bool design_search_create(const struct design_request *request, const struct design_spectrum *spectrum,
                          struct design_search *out_search)
{
    struct design_request prescribed = *request;
    prescribed.amplitude_tolerance_db = 0;
    return design_search_create_on(&prescribed, spectrum, grid_of(request, spectrum, search_points), 1, out_search);
}

void design_search_free(struct design_search *self)
{
    design_waveform_free(&self->waveform);
    free(self->packed);
    free(self->best);
    free(self->share);
    self->packed = NULL;
    self->best = NULL;
    self->share = NULL;
}

double design_search_peak(struct design_search *self, const double *c)
{
    design_waveform_synthesise(&self->waveform, c, self->packed);
    return design_waveform_peak_all(&self->waveform, self->packed);
}

void design_search_offer(struct design_search *self, const double *c, double score)
{
    if (score < self->best_score) {
        self->best_score = score;
        memcpy(self->best, c, 2 * self->spectrum->line_count * sizeof(double));
        if (self->watch && !self->silent) {
            design_watch_offer(self->watch, score);
        }
    }
}

double design_search_try(struct design_search *self, const double *c)
{
    const double score = design_search_peak(self, c) / design_search_power_root(self, c);
    design_search_offer(self, c, score);
    return score;
}

void design_search_plan(struct design_search *self, size_t evaluations)
{
    if (self->watch) {
        design_watch_plan(self->watch, evaluations);
    }
}

bool design_search_goes_on(struct design_search *self)
{
    return !self->watch || design_watch_goes_on(self->watch);
}

double design_search_power_root(const struct design_search *self, const double *c)
{
    if (!self->share) {
        return 1;
    }
    double power = 0;
    for (size_t k = 0; k < self->spectrum->line_count; k++) {
        power += self->share[k] * (c[2 * k] * c[2 * k] + c[2 * k + 1] * c[2 * k + 1]);
    }
    return sqrt(power);
}

void design_search_keep_directions(size_t line_count, const double *y, double *inout_c)
{
    for (size_t k = 0; k < line_count; k++) {
        double length = sqrt(y[2 * k] * y[2 * k] + y[2 * k + 1] * y[2 * k + 1]);
        if (length > 0) {
            inout_c[2 * k] = y[2 * k] / length;
            inout_c[2 * k + 1] = y[2 * k + 1] / length;
        }
    }
}
