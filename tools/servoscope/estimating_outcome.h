/* SPDX-License-Identifier: MIT */
/// A response as `frf` writes it, what its runs say of it, and how a person and --json are told.
#ifndef SERVOSCOPE_TOOLS_ESTIMATING_OUTCOME_H
#define SERVOSCOPE_TOOLS_ESTIMATING_OUTCOME_H

#include "lab/estimate/advise.h"
#include "lab/estimate/excitation.h"
#include "lab/estimate/parametric_frf.h"
#include "lab/estimate/settle.h"
#include "lab/record/error.h"
#include "lab/record/frf_file.h"
#include "tools/servoscope/estimating_checks.h"
#include "tools/servoscope/estimating_findings.h"
#include "tools/servoscope/estimating_sequence.h"
#include "tools/servoscope/options.h"
#include "tools/servoscope/remarks.h"

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
    size_t lost_outside; ///< lost rows in what is left out anyway
    size_t first_lost_outside;
    size_t used;
    bool period_found;
    bool bins_found;
    size_t doubtful;        ///< where lines were found: bins that may be lines too
    size_t leading_periods; ///< of a recording that was read piece by piece: what findings and advice are of; else 0
    struct settle transient;
    double first_level;
    double last_level;
    struct estimating_segments segments; ///< of a sequence; `planned` is 0 for a run by itself
    size_t used_most;                    ///< of a sequence; then `used` is that of the segment with the fewest
    struct estimating_findings findings;
    struct estimating_checks checks;
    struct excitations excitations;        ///< of the run, or of each segment
    double *levels;                        ///< of the output, for each of `total` periods; NULL: not kept
    struct parametric_outcome *parametric; ///< of all runs, with the first; NULL: another method
    struct frf measured;                   ///< with `parametric`, for the page: the lines that the model was fitted to
};

/// A response as it is written, and what its runs say of it.
struct estimating_outcome {
    struct frf frf;
    struct estimating_summary *runs;
    size_t run_count;
    struct estimating_findings findings; ///< of all runs
    struct frf *responses;               ///< of each run, for the page; that of a single one is `frf`
};

/// What a recording says of itself. Errors: false if memory is short.
bool estimating_summary_make(const struct periodic *recording, struct estimating_summary *out_summary);

/// Adds a further segment of a sequence: the one that settled worst speaks for all.
void estimating_summary_merge(struct estimating_summary *whole, const struct estimating_summary *one);

/// Keeps what excited a recording, so that further runs can be compared with it. Errors: false if memory is short.
bool estimating_summary_excite(struct estimating_summary *io_summary, const struct periodic *recording);

/// Frees what a summary owns beside its findings.
void estimating_summary_drop(struct estimating_summary *self);

/// Everything that was found, as sentences: of each run, then of the response.
/// `sources` are the runs as they were named, run_count of them; `out` is the response's file.
void estimating_outcome_say(const struct estimating_outcome *outcome, const struct option_values *sources,
                            const char *out, struct remarks *io_remarks);

/// The same on standard output, and with all figures as one object for --json.
void estimating_outcome_print(const struct estimating_outcome *outcome, const struct option_values *sources,
                              const char *out);
cJSON *estimating_outcome_json(const struct estimating_outcome *outcome, const struct option_values *sources,
                               const char *out);

void estimating_outcome_free(struct estimating_outcome *self);

#endif
