/* SPDX-License-Identifier: MIT */
/// Everything in a MATLAB file that may be a signal: vectors, columns of matrices (data:1, data:2, ...) and fields of
/// structures (log.speed), each with the name that --map uses. Internal to this folder.
#ifndef SERVOSCOPE_RECORD_MATIO_MAT_SOURCES_H
#define SERVOSCOPE_RECORD_MATIO_MAT_SOURCES_H

#include "lab/record/matio/mat_library.h"

#include <stdbool.h>
#include <stddef.h>

struct mat_source {
    char *name;
    char shape[64]; ///< "24841 x 1 double"
    double *data;   ///< NULL if it cannot be a signal
    size_t count;
};

struct mat_sources {
    size_t count;
    struct mat_source *items;
};

/// Adds what a variable holds. Returns false if memory is short.
bool mat_sources_add(struct mat_sources *self, const struct mat_library *library, matvar_t *variable);

void mat_sources_free(struct mat_sources *self);

/// The source of a name that may be a signal; NULL if there is none.
const struct mat_source *mat_sources_find(const struct mat_sources *self, const char *name);

/// What there is, "t (24841 x 1 double), vir (24841 x 1 double)", cut with dots where it does not fit.
void mat_sources_list(const struct mat_sources *self, size_t size, char *out_text);

#endif
