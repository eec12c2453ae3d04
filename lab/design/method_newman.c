/* SPDX-License-Identifier: MIT */
#include "lab/design/method.h"
#include "lab/design/phases.h"

static int run(const struct design_request *request, struct design_search *search, struct error *out_error)
{
    (void)request;
    (void)out_error;
    design_phases_newman(search->spectrum->line_count, search->best);
    return 0;
}

const struct design_method design_method_newman = {
    .name = "newman",
    .summary = "Newman's quadratic phases, not optimised",
    .iterations = 0,
    .run = run,
};
