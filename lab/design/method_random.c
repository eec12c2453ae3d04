/* SPDX-License-Identifier: MIT */
#include "lab/design/method.h"
#include "lab/design/phases.h"

static int run(const struct design_request *request, struct design_search *search, struct error *out_error)
{
    (void)out_error;
    design_phases_random(search->spectrum->line_count, request->seed, search->best);
    return 0;
}

const struct design_method design_method_random = {
    .name = "random",
    .summary = "random phases by --seed, not optimised",
    .iterations = 0,
    .run = run,
};
