/* SPDX-License-Identifier: MIT */
/// What runs show beside their response: distortion, harmonics, a response that repeats later than its excitation, how
/// realisations agree. Kept from each run until the final response has its keys, and then said to a person and to
/// --json.
#ifndef SERVOSCOPE_TOOLS_ESTIMATING_FINDINGS_H
#define SERVOSCOPE_TOOLS_ESTIMATING_FINDINGS_H

#include "lab/estimate/agreement.h"
#include "lab/estimate/distortion.h"
#include "lab/estimate/harmonics.h"
#include "lab/estimate/inputs.h"
#include "lab/estimate/oscillation.h"
#include "lab/estimate/periodic.h"
#include "lab/estimate/repetition.h"
#include "lab/estimate/smoothness.h"
#include "lab/page/page.h"
#include "lab/record/frf_file.h"
#include "tools/servoscope/remarks.h"

#include <cjson/cJSON.h>
#include <stdbool.h>
#include <stddef.h>

/// Of one recording, or merged of several. Zero-initialise; estimating_findings_free() in every case.
struct estimating_findings {
    size_t recordings;            ///< with periods; 0: nothing below was looked at
    size_t late;                  ///< of these, recordings whose response repeats after several periods only
    struct repetition repetition; ///< of the one with the highest level
    double late_first_hz;         ///< lowest excited line of that one
    double late_last_hz;
    struct distortion distortion;
    size_t harmonics_count; ///< one for each recording with a single line
    struct harmonics *harmonics;
    struct oscillation oscillation; ///< the strongest one
    double foreign_share;           ///< inputs.h; 0 with one input
    struct agreement agreed;        ///< of realisations; lines 0: there is only one
    struct smoothness smoothness;   ///< of the final response; lines 0: not looked at
    char load_column[40];           ///< measured at the load, and not what was asked for; "" if there is none
};

/// Looks at one recording whose response has been estimated, and fills in the response's distortion columns. `inputs`
/// NULL: there is one. Errors: false if memory is short.
bool estimating_findings_measure(const struct periodic *recording, const struct inputs *inputs, struct frf *io_frf,
                                 struct estimating_findings *out);

/// Adds those of another recording. Errors: false if memory is short.
bool estimating_findings_merge(struct estimating_findings *self, const struct estimating_findings *other);

/// Looks at the final response: whether its lines scatter as its std says. A model's do not. Errors: false if memory is
/// short.
bool estimating_findings_judge(struct estimating_findings *self, const struct frf *frf);

/// Adds to the final response what docs/files.md calls the keys of distortion. Errors: false if memory is short.
bool estimating_findings_set_keys(const struct estimating_findings *self, struct frf *io_frf);

/// Says it to a person: lines of the response that remarks_about() has set.
void estimating_findings_say(const struct estimating_findings *self, const struct frf *frf, struct remarks *io_remarks);
void estimating_findings_add_json(const struct estimating_findings *self, const struct frf *frf, cJSON *io_object);

/// Adds the section of lab/estimate/report_distortion.h.
void estimating_findings_add_page(const struct estimating_findings *self, const struct frf *frf, struct page *page);

void estimating_findings_free(struct estimating_findings *self);

#endif
