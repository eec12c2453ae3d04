/* SPDX-License-Identifier: MIT */
/// What the two manifests have in common (sequence_file.h, run_sequence.h): JSON that names other files beside it.
/// The readers below take one member each and refuse it with file, line, place, value and expectation; `parent` is the
/// place of `object`, "" for the root. Internal to lab/record, except manifest_is and manifest_beside.
#ifndef SERVOSCOPE_RECORD_MANIFEST_H
#define SERVOSCOPE_RECORD_MANIFEST_H

#include "lab/record/error.h"
#include "lab/record/json_in.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// Whether a file's content, not its name, looks like JSON: it begins with '{'. A table begins with "MST", a text table
/// with '#' or a name, a compressed one with 0x1f. False for what cannot be read: its own reader says why.
bool manifest_is(const char *path);

/// Path of `file`, named relative to the folder of `manifest_path`; to be freed, NULL if memory is short.
char *manifest_beside(const char *manifest_path, const char *file);

/// The last part of a path, which is how files beside a manifest are named in it.
const char *manifest_name_of(const char *path);

/// Reads "holds", which says what kind of manifest it is, and refuses any but `expected` ("tables", "runs").
int manifest_check_holds(const struct json_document *document, const char *expected, struct error *out_error);

/// Reads a text that is one of the NULL-terminated list; *out_text points into the list.
int manifest_read_word(const struct json_document *document, const cJSON *object, const char *parent, const char *name,
                       const char *const *words, const char **out_text, struct error *out_error);

/// Reads the name of a file: not empty, not absolute, in the manifest's folder or below; *out_file is to be freed.
int manifest_read_file(const struct json_document *document, const cJSON *object, const char *parent, const char *name,
                       char **out_file, struct error *out_error);

/// Reads a whole number from lowest to highest, at most 2^53.
int manifest_read_whole(const struct json_document *document, const cJSON *object, const char *parent, const char *name,
                        uint64_t lowest, uint64_t highest, uint64_t *out_value, struct error *out_error);

/// Reads a number that is finite and not below `lowest`.
int manifest_read_number(const struct json_document *document, const cJSON *object, const char *parent,
                         const char *name, double lowest, double *out_value, struct error *out_error);

/// Reads a CRC-32 as text: 0x and up to eight hexadecimal digits.
int manifest_read_crc32(const struct json_document *document, const cJSON *object, const char *parent, const char *name,
                        uint32_t *out_crc32, struct error *out_error);

/// Reads an array of 1 to `highest` elements.
int manifest_read_array(const struct json_document *document, const cJSON *object, const char *parent, const char *name,
                        size_t highest, const cJSON **out_array, struct error *out_error);

/// "parent.name[index]" for the readers above.
void manifest_element(char out_path[json_path_size], const char *parent, const char *name, size_t index);

/// Adds a CRC-32 as manifest_read_crc32 takes it.
void manifest_add_crc32(cJSON *object, const char *name, uint32_t crc32);

#endif
