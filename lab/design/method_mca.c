/* SPDX-License-Identifier: MIT */
/// Modified clipping (first paper, 3.3): in each iteration the one signal that is nearest to its limit is clipped.
#include "lab/design/clipping.h"
#include "lab/design/method.h"
#include "lab/design/phases.h"

#include <stdlib.h>
#include <string.h>

/// Evaluates c, offers it, and returns the most critical signal; *out_peak in units of its limit.
static size_t find_critical(struct design_search *search, const double *c, double *out_peak)
{
    const struct design_waveform *waveform = &search->waveform;
    size_t critical = 0;
    *out_peak = 0;
    design_waveform_synthesise(waveform, c, search->packed);
    for (size_t s = 0; s < waveform->signal_count; s++) {
        double peak = design_waveform_peak(waveform, search->packed, s);
        if (peak > *out_peak) {
            *out_peak = peak;
            critical = s;
        }
    }
    design_search_offer(search, c, *out_peak);
    return critical;
}

int design_method_mca_run(const struct design_request *request, struct design_search *search,
                          size_t out_clipped[design_signal_count], struct error *out_error)
{
    const size_t iterations = design_method_iterations(request, &design_method_mca);
    const size_t lines = search->spectrum->line_count;
    double *c = calloc(4 * lines, sizeof *c);
    if (!c) {
        return design_method_out_of_memory(out_error);
    }
    memset(out_clipped, 0, design_signal_count * sizeof *out_clipped);
    design_phases_newman(lines, c);
    double peak = 0;
    size_t critical = find_critical(search, c, &peak);
    design_search_plan(search, iterations);
    for (size_t i = 0; i < iterations && design_search_goes_on(search); i++) {
        double level = design_clipping_factor(i, iterations) * peak;
        out_clipped[search->waveform.signals[critical]]++;
        design_clipping_step(&search->waveform, critical, level, search->packed, &c[2 * lines], c);
        critical = find_critical(search, c, &peak);
    }
    free(c);
    return 0;
}

static int run(const struct design_request *request, struct design_search *search, struct error *out_error)
{
    size_t clipped[design_signal_count];
    return design_method_mca_run(request, search, clipped, out_error);
}

const struct design_method design_method_mca = {
    .name = "mca",
    .summary = "modified clipping of the first paper: clips the most critical signal, 400 iterations",
    .iterations = design_clipping_iterations,
    .run = run,
};
