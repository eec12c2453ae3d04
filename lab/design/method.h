/* SPDX-License-Identifier: MIT */
/// The methods: one file each, collected in methods.c.
#ifndef SERVOSCOPE_DESIGN_METHOD_H
#define SERVOSCOPE_DESIGN_METHOD_H

#include "lab/design/search.h"

extern const struct design_method design_method_newman;
extern const struct design_method design_method_schroeder;
extern const struct design_method design_method_random;
extern const struct design_method design_method_clip;
extern const struct design_method design_method_mca;
extern const struct design_method design_method_linf;
extern const struct design_method design_method_fast;

/// Iterations asked for, or the method's own.
size_t design_method_iterations(const struct design_request *request, const struct design_method *method);

/// Modified clipping, and in how many iterations each signal was the one that was clipped (first paper, figure 5).
int design_method_mca_run(const struct design_request *request, struct design_search *search,
                          size_t out_clipped[design_signal_count], struct error *out_error);

/// Says that memory is short; returns error_refused.
int design_method_out_of_memory(struct error *out_error);

#endif
