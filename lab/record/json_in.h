/* SPDX-License-Identifier: MIT */
/// JSON in: a document that knows its file and lines, so that a wrong value is reported like in every other file:
/// `model.json:7: effects.cogging.amplitude_Nm: "0.03": a number was expected`.
#ifndef SERVOSCOPE_RECORD_JSON_IN_H
#define SERVOSCOPE_RECORD_JSON_IN_H

#include "lab/record/error.h"

#include <cjson/cJSON.h>
#include <stdbool.h>
#include <stddef.h>

enum { json_path_size = 256 };

struct json_document {
    char *path;
    char *text;
    cJSON *root; ///< an object
};

/// Reads a file whose value is one object, up to 4 MiB.
/// Errors: error_refused with file and line: not JSON, not an object, a key twice in one object, binary zeros.
///         *out_document is empty then.
/// Test:   tests/unit/test_model_file.c
int json_document_read(const char *path, struct json_document *out_document, struct error *out_error);

void json_document_free(struct json_document *self);

/// "parent.name", or "name" for the root (parent NULL or ""); too long a path ends in dots.
void json_path_join(char out_path[json_path_size], const char *parent, const char *name);

/// Line of a member, named by its keys from the root joined by dots and by indices from 0 ("effects.cogging",
/// "segments[2].periods"); 0 if there is none.
size_t json_document_line(const struct json_document *self, const char *member);

/// Fills in "FILE:LINE: MEMBER: VALUE: expectation" and returns error_refused; `value` is NULL for a missing member.
int json_document_error(const struct json_document *self, const char *member, const cJSON *value,
                        const char *expectation, struct error *out_error);

/// Reads member `name` of `object`, a finite number. `parent` is the object's place, "" for the root. If it is not
/// there, *io_value keeps its value and *out_found (may be NULL) is false.
int json_document_number(const struct json_document *self, const cJSON *object, const char *parent, const char *name,
                         double *io_value, bool *out_found, struct error *out_error);

#endif
