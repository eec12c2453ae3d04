/* SPDX-License-Identifier: MIT */
/// JSON out: cJSON trees printed so that numbers read back bit for bit (cJSON's own printer may lose the last bits) and
/// a number that is not finite becomes null, because JSON has no NaN.
#ifndef SERVOSCOPE_RECORD_JSON_OUT_H
#define SERVOSCOPE_RECORD_JSON_OUT_H

#include "lab/record/error.h"

#include <cjson/cJSON.h>
#include <stdio.h>

/// Prints a tree, indented, with a newline at its end. Short arrays of numbers stay on one line.
void json_print(FILE *stream, const cJSON *root);

/// Prints a tree to standard output and flushes it.
/// Errors: error_refused if standard output does not take it (a full disk, a closed pipe).
int json_print_stdout(const cJSON *root, struct error *out_error);

/// Writes a tree to a file that is whole or as it was (lab/record/atomic_file.h).
int json_write(const char *path, const cJSON *root, struct error *out_error);

#endif
