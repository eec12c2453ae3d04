/* SPDX-License-Identifier: MIT */
/// The result of tuning as JSON; keys in docs/files.md, "Tuning".
#ifndef SERVOSCOPE_TUNE_TUNE_JSON_H
#define SERVOSCOPE_TUNE_TUNE_JSON_H

#include "lab/tune/tune.h"

#include <cjson/cJSON.h>

/// Returns a tree for the caller to delete; `path` is the response's file.
cJSON *tune_json(const char *path, const struct tune_result *result);

#endif
