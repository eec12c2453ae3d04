/* SPDX-License-Identifier: MIT */
#include "lab/design/method.h"

const struct design_method *const design_methods[] = {
    &design_method_fast,   &design_method_mca,       &design_method_linf,   &design_method_clip,
    &design_method_newman, &design_method_schroeder, &design_method_random, NULL,
};

size_t design_method_iterations(const struct design_request *request, const struct design_method *method)
{
    return request->iterations > 0 ? request->iterations : method->iterations;
}

int design_method_out_of_memory(struct error *out_error)
{
    return error_set(out_error, error_refused, "memory is short for this number of lines and samples");
}
