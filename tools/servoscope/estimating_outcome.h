/* SPDX-License-Identifier: MIT */
/// A response as `frf` writes it, what its runs say of it, and how a person and --json are told.
#ifndef SERVOSCOPE_TOOLS_ESTIMATING_OUTCOME_H
#define SERVOSCOPE_TOOLS_ESTIMATING_OUTCOME_H

#include "lab/estimate/advise.h"
#include "lab/estimate/settle.h"
#include "lab/record/error.h"
#include "lab/record/frf_file.h"
#include "tools/servoscope/estimating_checks.h"
#include "tools/servoscope/estimating_findings.h"
#include "tools/servoscope/estimating_sequence.h"
#include "tools/servoscope/options.h"

#include <cjson/cJSON.h>
#include <stdbool.h>
#include <stddef.h>

/// What one run gave, kept for the summary.
struct estimating_summary {
    struct estimate_advice advice;
    bool without_period; ///< of what follows only the next two are filled in then
    size_t rows;
    size_t lost_rows;
    size_t period_samples;
    size_t total;
    size_t settle;
    size_t lost;
    size_t first_lost_row;
    size_t used;
    bool period_found;
    bool bins_found;
    size_t leading_periods; ///< of a recording that was read piece by piece: what findings and advice are of; else 0
    struct settle transient;
    double first_level;
    double last_level;
    struct estimating_segments segments; ///< of a sequence; `planned` is 0 for a run by itself
    size_t used_most;                    ///< of a sequence; then `used` is that of the segment with the fewest
    struct estimating_findings findings;
    struct estimating_checks checks;
};

/// A response as it is written, and what its runs say of it.
struct estimating_outcome {
    struct frf frf;
    struct estimating_summary *runs;
    size_t run_count;
    struct estimating_findings findings; ///< of all runs
};

/// `sources` are the runs as they were named, run_count of them; `out` is the response's file.
void estimating_outcome_print(const struct estimating_outcome *outcome, const struct option_values *sources,
                              const char *out);
cJSON *estimating_outcome_json(const struct estimating_outcome *outcome, const struct option_values *sources,
                               const char *out);

/// Writes one page with the sections of each outcome.
int estimating_outcome_write_page(const char *path, const struct estimating_outcome *outcomes, size_t count,
                                  struct error *out_error);

void estimating_outcome_free(struct estimating_outcome *self);

#endif
