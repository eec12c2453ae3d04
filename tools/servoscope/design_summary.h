/* SPDX-License-Identifier: MIT */
/// What `servoscope design` says of a finished design: one JSON object, or some lines for a person.
#ifndef SERVOSCOPE_TOOLS_DESIGN_SUMMARY_H
#define SERVOSCOPE_TOOLS_DESIGN_SUMMARY_H

#include "lab/design/design.h"

#include <cjson/cJSON.h>

struct design_summary {
    const char *prefix; ///< of the files that were written
    const struct design_request *request;
    const struct design_result *result;
    double test_time_s;
    const double *predicted_std; ///< result->bin_count values; NULL: nobody asked
};

/// One object; keys as in DESIGN's `design --json`, those of a linear axis end in its units. To be deleted.
cJSON *design_summary_json(const struct design_summary *self);

void design_summary_print(const struct design_summary *self);

#endif
