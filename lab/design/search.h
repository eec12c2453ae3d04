/* SPDX-License-Identifier: MIT */
/// What a method works with: the limited signals on its grid, buffers, and the best phases so far.
/// Phases are kept as unit complex numbers c_k = exp(j phi_k): no angle is needed between start and result.
#ifndef SERVOSCOPE_DESIGN_SEARCH_H
#define SERVOSCOPE_DESIGN_SEARCH_H

#include "lab/design/waveform.h"

struct design_search {
    const struct design_spectrum *spectrum;
    struct design_waveform waveform; ///< design_waveform_limited on the method's grid
    double *packed;                  ///< one buffer of waveform.packed_length doubles
    double *best;                    ///< 2 line_count doubles: the phases to be returned
    double best_score;               ///< what was smallest: by default the largest signal in units of its limit
};

/// Grid of the search: the samples themselves, or at least 40 points per highest line.
/// Returns false if memory is short (nothing is held then).
bool design_search_create(const struct design_request *request, const struct design_spectrum *spectrum,
                          struct design_search *out_search);
void design_search_free(struct design_search *self);

/// Makes c the best if its score is smaller than the best so far; the first always is.
void design_search_offer(struct design_search *self, const double *c, double score);

/// Scales each of line_count complex numbers to length 1; one without direction keeps its old value.
void design_search_keep_directions(size_t line_count, const double *y, double *inout_c);

#endif
