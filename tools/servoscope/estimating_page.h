/* SPDX-License-Identifier: MIT */
/// The page of `frf --report`: what was found in sentences, the response, its distortion, how the recordings settled.
#ifndef SERVOSCOPE_TOOLS_ESTIMATING_PAGE_H
#define SERVOSCOPE_TOOLS_ESTIMATING_PAGE_H

#include "lab/record/atomic_file.h"
#include "lab/record/error.h"
#include "tools/servoscope/comparing.h"
#include "tools/servoscope/estimating_outcome.h"
#include "tools/servoscope/options.h"

#include <stddef.h>

/// One response of the page; `sources` are the names of its runs, `out` its file.
struct estimating_page_item {
    const struct estimating_outcome *outcome;
    const struct option_values *sources;
    const char *out;
    const struct comparing *compared; ///< saved responses to be drawn beside it; NULL: none
};

/// Writes one page with the sections of each response, beside its place: atomic_file_commit() puts it there.
/// Errors: error_refused with path and reason; nothing is left then
int estimating_page_write(const char *path, const struct estimating_page_item *items, size_t count,
                          struct atomic_file *out_file, struct error *out_error);

#endif
