/* SPDX-License-Identifier: MIT */
/// The default: projections, which find a good valley in few transforms, then a p-norm descent, which finds its bottom.
/// The first start is Newman's and has no randomness in it; further ones are disturbed by the seed.
#include "lab/design/method.h"
#include "lab/design/phases.h"
#include "lab/design/polish.h"
#include "lab/design/projection.h"

#include "sim/random.h"

#include <math.h>
#include <stdlib.h>

enum { projection_iterations = 400 };

static const double disturbance_rad = 0.3;

/// p = 128, 512, 2048: the projections have already done what a small p would.
static const struct design_polish_plan after_projections = {
    .first_exponent = 7, .last_exponent = 11, .step = 2, .iterations = 60};

static void disturb(size_t line_count, uint64_t state[4], double *inout_c)
{
    for (size_t k = 0; k < line_count; k++) {
        double angle = disturbance_rad * sim_random_normal(state);
        double re = inout_c[2 * k];
        double im = inout_c[2 * k + 1];
        inout_c[2 * k] = re * cos(angle) - im * sin(angle);
        inout_c[2 * k + 1] = re * sin(angle) + im * cos(angle);
    }
}

static int run(const struct design_request *request, struct design_search *search, struct error *out_error)
{
    const size_t lines = search->spectrum->line_count;
    const size_t starts = request->starts > 0 ? request->starts : 1;
    double *c = calloc(2 * lines, sizeof *c);
    uint64_t state[4];
    sim_random_seed(state, request->seed);
    bool enough_memory = c != NULL;
    for (size_t start = 0; enough_memory && start < starts; start++) {
        design_phases_newman(lines, c);
        if (start > 0) {
            disturb(lines, state, c);
        }
        enough_memory = design_projection_run(search, design_method_iterations(request, &design_method_fast), c) &&
                        design_polish_run(search, &after_projections, c);
    }
    free(c);
    return enough_memory ? 0 : design_method_out_of_memory(out_error);
}

const struct design_method design_method_fast = {
    .name = "fast",
    .summary = "projections (400 iterations), then p-norm descent; more --starts find a little more",
    .iterations = projection_iterations,
    .run = run,
};
