/* SPDX-License-Identifier: MIT */
/// What a subcommand may write, checked before it begins.
#ifndef SERVOSCOPE_TOOLS_OUTPUTS_H
#define SERVOSCOPE_TOOLS_OUTPUTS_H

#include "lab/record/error.h"

#include <stddef.h>

/// Refuses outputs that would take the place of an input or of each other, and those that cannot be written: no such
/// folder, no right, a full disk (less than 64 KiB free, or 4 KiB that are tried and taken away again), a device that
/// takes nothing. Hours of measuring or searching must not be lost to a name. Entries that are NULL do not count.
/// Errors: error_usage (would be overwritten), error_refused (cannot be written)
int outputs_check(const char *const *inputs, size_t input_count, const char *const *outputs, size_t output_count,
                  struct error *out_error);

#endif
