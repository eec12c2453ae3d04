/* SPDX-License-Identifier: MIT */
/// Finds the excited lines of a recording that does not say them, by their power in the input.
#ifndef SERVOSCOPE_ESTIMATE_LINE_SEARCH_H
#define SERVOSCOPE_ESTIMATE_LINE_SEARCH_H

#include "lab/record/run.h"

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// All bins of some periods of one input.
struct line_search {
    double complex *spectra; ///< periods x (period_samples/2 + 1), as spectra_transform_all gives them
    size_t *numbers;         ///< of the periods, ascending
    size_t periods;
    size_t period_samples;
};

/// Transforms those of the first `total` periods of a column that lost no sample; without the first one, which holds
/// the transient and would only add scatter, if there are others enough. Errors: false if memory is short;
/// line_search_free() in every case
bool line_search_transform(const struct run *run, const char *column, size_t period_samples, size_t total,
                           struct line_search *out);

void line_search_free(struct line_search *self);

struct line_search_result {
    uint32_t *bins; ///< excited, ascending; owned
    size_t count;
    uint32_t *doubtful; ///< not taken for excited, and yet with power that noise does not explain for certain; owned
    size_t doubtful_count;
};

/// Finds the excited bins from the input's spectra at all bins.
///
/// Drift:     the line through the periods' means is taken out first, because a ramp leaks into all bins of all periods
///            alike: D_k = slope N / (exp(-jw_k) - 1)
/// Noise:     the median variance of the 17 bins to either side, over what the median is of the mean; of the noisier
///            side where they differ by more than chance (1 %); at the lowest bins what those above show, drawn out by
///            their slope. Two periods tell little of one bin's noise, but its neighbours' is much the same
/// Certain:   P |mean|^2 / s^2 ~ F(2, 2 nu) with that noise and the bin's own together, chance below 1e-6; and, lest a
///            disturbance between the bins that happens to have like phases be taken for a line, the bin's own scatter
///            is that of its neighbours (chance above 1e-5), or cannot explain its mean (chance below 5e-3)
/// Excited:   certain bins of at least 1 % of the largest; where their sizes have a gap of a factor 3 or more, only
///            those above the widest one: in a loop other bins repeat too, as distortion. The mean (bin 0) is never one
/// Doubtful:  all others from 1e-6 of the largest where noise has less than 1 % chance. They may be lines of little
///            power or bins that a nonlinearity fills; nothing that looks between lines should build on them
/// Rounding:  what is below 1e-12 of the largest mean, drift or line is none
/// Needs:     two periods
/// Errors:    false if memory is short; line_search_result_free() in every case
/// Test:      tests/unit/test_line_search.c
bool line_search_run(const struct line_search *self, struct line_search_result *out);

void line_search_result_free(struct line_search_result *self);

#endif
