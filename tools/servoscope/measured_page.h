/* SPDX-License-Identifier: MIT */
/// measure --report: the page of a measured run, or of a sequence of them. Internal to tools/servoscope/measuring*.
#ifndef SERVOSCOPE_TOOLS_MEASURED_PAGE_H
#define SERVOSCOPE_TOOLS_MEASURED_PAGE_H

#include "lab/measure/report.h"
#include "lab/record/error.h"
#include "tools/servoscope/measured.h"

/// Writes the page of one run, whole or not at all. Errors: error_refused with path and reason
int measured_page_write(const char *path, const struct measured *measured, const struct measure_plan *plan,
                        struct error *out_error);

/// The same of a sequence; `source` names the drive.
int measured_page_write_sequence(const char *path, const char *out, const char *source,
                                 const struct measure_page_sequence *sequence, struct error *out_error);

#endif
