/* SPDX-License-Identifier: MIT */
/// What `design` and `demo` have in common: a design as the three files that a drive, a firmware and a person want.
#ifndef SERVOSCOPE_TOOLS_DESIGNING_H
#define SERVOSCOPE_TOOLS_DESIGNING_H

#include "lab/design/design.h"
#include "lab/record/error.h"
#include "lab/record/table_file.h"

/// One period as it was designed, and where in it to begin: the player starts at start_index.
/// Errors: error_refused if memory is short; *out_table is empty then
int designing_table(const struct design_request *request, const struct design_result *result, struct table *out_table,
                    struct error *out_error);

/// Writes PREFIX.csv, PREFIX.h and PREFIX.mst, the table last: where it is, the others are.
/// Errors: error_refused with the path and the reason; files already in place stay whole
int designing_write(const char *prefix, const struct design_request *request, const struct design_result *result,
                    struct error *out_error);

/// Writes the page of the design whose files begin with `prefix`.
/// Errors: error_refused with the path and the reason; `path` is as it was then
int designing_report(const char *path, const char *prefix, const struct design_request *request,
                     const struct design_result *result, struct error *out_error);

#endif
