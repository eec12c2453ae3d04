/* SPDX-License-Identifier: MIT */
/// Whether a recording keeps what a response takes for granted: one clock, periods that are independent of each other,
/// columns that count in one direction.
#ifndef SERVOSCOPE_TOOLS_ESTIMATING_CHECKS_H
#define SERVOSCOPE_TOOLS_ESTIMATING_CHECKS_H

#include "lab/estimate/clocked.h"
#include "lab/estimate/direction.h"
#include "lab/estimate/succession.h"
#include "lab/record/frf_file.h"
#include "tools/servoscope/remarks.h"

#include <cjson/cJSON.h>
#include <stdbool.h>
#include <stddef.h>

/// Of one recording. Zero-initialised: nothing was checked.
struct estimating_checks {
    struct clock clock;
    bool resampled;
    size_t period_samples;
    struct succession succession;
    char direction[200]; ///< which columns count the other way round; "" if none does
};

/// Checks a recording whose response has been estimated. Where successive periods are alike, the standard deviation of
/// method mean is enlarged. Adds the keys of docs/files.md. Errors: false if memory is short.
bool estimating_checks_measure(const struct clocked *recording, struct frf *io_frf, struct estimating_checks *out);

/// Puts what one recording's checks add to another response of the same lines: keys, and the enlarged std.
bool estimating_checks_apply(const struct estimating_checks *self, struct frf *io_frf);

/// What of several recordings a response of them all has to say: the keys of the first that says something.
bool estimating_checks_carry(const struct estimating_checks *self, struct frf *io_frf);

/// Says it to a person: lines of the run that remarks_about() has set.
void estimating_checks_say(const struct estimating_checks *self, struct remarks *io_remarks);
void estimating_checks_add_json(const struct estimating_checks *self, cJSON *io_object);

#endif
