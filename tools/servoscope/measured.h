/* SPDX-License-Identifier: MIT */
/// What `measure` and `simulate` keep and say of one measured run. Internal to tools/servoscope/measuring*.
#ifndef SERVOSCOPE_TOOLS_MEASURED_H
#define SERVOSCOPE_TOOLS_MEASURED_H

#include "lab/measure/measure.h"
#include "lab/record/error.h"
#include "lab/record/run.h"
#include "tools/servoscope/door.h"

#include <cjson/cJSON.h>

struct measured {
    const char *path;
    const char *source; ///< names the drive in the run (key `drive`)
    struct run *run;
    const struct measure_report *report;
    double rate_per_s;       ///< samples per second of wall-clock time
    const struct door *door; ///< whose bus is reported; NULL: there is none
};

/// Adds the keys that only the caller knows and writes the run.
/// Errors: error_refused with path and reason
int measured_keep(const struct measured *self, struct error *out_error);

/// What --json says of a run.
cJSON *measured_json(const struct measured *self);

/// What a person reads of it.
void measured_print(const struct measured *self);

/// What the bus has carried since the door was opened, for --json and for a person.
void measured_add_bus(const struct door *door, cJSON *io_object);
void measured_print_bus(const struct door *door);

/// "complete", "interrupted", "limit" or "drive".
const char *measured_end_str(enum measure_end end);

#endif
