/* SPDX-License-Identifier: MIT */
/// Saved responses beside one that was just estimated, or beside each other: `frf --compare`, and `frf` of saved ones.
#ifndef SERVOSCOPE_TOOLS_COMPARING_H
#define SERVOSCOPE_TOOLS_COMPARING_H

#include "lab/record/error.h"
#include "lab/record/frf_file.h"
#include "tools/servoscope/command.h"
#include "tools/servoscope/options.h"

#include <cjson/cJSON.h>
#include <stdbool.h>
#include <stddef.h>

/// Responses that were read from files. Zero-initialise; comparing_free() in every case.
struct comparing {
    size_t count;
    struct frf *responses;
    const char **names; ///< of their files, without folders where that is enough to tell them apart; point into argv
};

/// Reads the named files. Errors: error_refused with file and reason; memory is short
int comparing_read(const struct option_values *paths, struct comparing *out, struct error *out_error);

/// Refuses responses of other units than the first's. Errors: error_refused with file, units and what was expected
int comparing_check(const struct comparing *self, const struct frf *first, const char *first_name,
                    struct error *out_error);

/// The difference of each from the first, as sentences on standard output or as the array `differences` of --json.
/// Errors: error_refused if memory is short
int comparing_print(const struct comparing *self, const struct frf *first, const char *first_name,
                    struct error *out_error);
int comparing_add_json(const struct comparing *self, const struct frf *first, cJSON *io_object,
                       struct error *out_error);

/// Names of files for a page: without folders, unless two of them are alike then.
/// Shapes: out_names: paths->count, pointing into the paths
void comparing_short_names(const struct option_values *paths, const char **out_names);

/// What is asked of saved responses: nothing is estimated.
struct comparing_request {
    const struct option_values *first; ///< one or more: those after the first are compared with it too
    const struct option_values *others;
    const char *report; ///< NULL: no page
};

/// Compares saved responses: sentences or --json, and a page with all of them.
/// Errors: error_usage if there is only one and no page is asked for; error_refused as above, or with the page's path
int comparing_run(const struct comparing_request *request, const struct command_context *context,
                  struct error *out_error);

void comparing_free(struct comparing *self);

#endif
