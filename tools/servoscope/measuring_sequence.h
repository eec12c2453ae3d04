/* SPDX-License-Identifier: MIT */
/// The tables of a sequence one after the other through one door, each as a run of its own, and the manifest of the
/// runs. Internal to tools/servoscope/measuring.c.
#ifndef SERVOSCOPE_TOOLS_MEASURING_SEQUENCE_H
#define SERVOSCOPE_TOOLS_MEASURING_SEQUENCE_H

#include "tools/servoscope/measuring.h"

/// Reads the manifest and every table of it; checks each plan and each output before anything moves.
/// Errors: error_usage, error_refused, among them several inputs at once; *self is freed then
int measuring_sequence_prepare(struct measuring *self, struct error *out_error);

/// Measures segment after segment; the axis is brought to rest in between, and the limits on the position stay where
/// they were at the first. Ends early as a single measurement does; what was measured is kept, and the manifest says
/// what is missing.
/// Errors: error_refused if not every segment is complete and written
int measuring_sequence_run(struct measuring *self, const struct drive *drive, const char *source,
                           const struct command_context *context, struct error *out_error);

#endif
