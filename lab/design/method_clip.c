/* SPDX-License-Identifier: MIT */
/// Standard clipping (Van der Ouderaa 1988, as the first paper compares against it): the acceleration alone is clipped.
/// The paper's testbed figure needs the best iterate by all limits, its crest factors the best by acceleration: both
/// are offered (--keep).
#include "lab/design/clipping.h"
#include "lab/design/method.h"
#include "lab/design/phases.h"

#include <stdlib.h>

static void clip(const struct design_request *request, struct design_search *search,
                 const struct design_waveform *acceleration, double *packed, double *c)
{
    const size_t iterations = design_method_iterations(request, &design_method_clip);
    const size_t lines = search->spectrum->line_count;
    design_phases_newman(lines, c);
    design_search_plan(search, iterations);
    for (size_t i = 0; i <= iterations && (i == 0 || design_search_goes_on(search)); i++) {
        design_waveform_synthesise(acceleration, c, packed);
        double peak = design_waveform_peak(acceleration, packed, 0);
        design_search_offer(search, c, request->keep == design_keep_all ? design_search_peak(search, c) : peak);
        double level = design_clipping_factor(i, iterations) * peak;
        design_clipping_step(acceleration, 0, level, packed, &c[2 * lines], c);
    }
}

static int run(const struct design_request *request, struct design_search *search, struct error *out_error)
{
    struct design_waveform acceleration;
    if (!design_waveform_create(search->spectrum, design_waveform_acceleration, search->waveform.grid, &acceleration)) {
        return design_method_out_of_memory(out_error);
    }
    double *packed = calloc(acceleration.packed_length, sizeof *packed);
    double *c = calloc(4 * search->spectrum->line_count, sizeof *c);
    const bool memory = packed && c;
    if (memory) {
        clip(request, search, &acceleration, packed, c);
    }
    free(packed);
    free(c);
    design_waveform_free(&acceleration);
    return memory ? 0 : design_method_out_of_memory(out_error);
}

const struct design_method design_method_clip = {
    .name = "clip",
    .summary = "standard clipping of the acceleration, 400 iterations; --keep all or acceleration",
    .iterations = design_clipping_iterations,
    .run = run,
};
