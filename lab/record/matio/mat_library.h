/* SPDX-License-Identifier: MIT */
/// The functions of matio, looked up when the first MATLAB file is asked for. Internal to this folder.
#ifndef SERVOSCOPE_RECORD_MATIO_MAT_LIBRARY_H
#define SERVOSCOPE_RECORD_MATIO_MAT_LIBRARY_H

#include "lab/record/error.h"

#include <matio.h>
#include <stdbool.h>

/// One pointer for each function, named as in matio.h without its prefix.
struct mat_library {
    mat_t *(*open)(const char *, int);
    mat_t *(*create)(const char *, const char *, enum mat_ft);
    int (*close)(mat_t *);
    matvar_t *(*var_create)(const char *, enum matio_classes, enum matio_types, int, size_t *, void *, int);
    matvar_t *(*var_create_struct)(const char *, int, size_t *, const char **, unsigned);
    int (*var_add_field)(matvar_t *, const char *);
    matvar_t *(*var_set_field)(matvar_t *, const char *, size_t, matvar_t *);
    matvar_t *(*var_field)(matvar_t *, const char *, size_t);
    unsigned (*var_field_count)(matvar_t *);
    char *const *(*var_field_names)(const matvar_t *);
    int (*var_write)(mat_t *, matvar_t *, enum matio_compression);
    matvar_t *(*var_read)(mat_t *, const char *);
    matvar_t *(*var_read_next)(mat_t *);
    void (*var_free)(matvar_t *);
};

/// Loads matio, once.
/// Errors: error_refused with what to install; returns NULL then. `path` begins the message.
const struct mat_library *mat_library_load(const char *path, struct error *out_error);

/// What matio said last, since the last call; "" if nothing.
const char *mat_library_said(void);

/// Number of values of a variable; 0 if it has none or the product of its sizes is no size.
size_t mat_value_count(const matvar_t *variable);

/// Whether a variable holds real numbers, as many as its sizes say; logical ones count.
bool mat_is_numeric(const matvar_t *variable);

/// Value `i` of a numeric variable, as a double.
double mat_value(const matvar_t *variable, size_t i);

/// A variable's text as UTF-8, to be freed; NULL if it holds no text or memory is short.
char *mat_text(const matvar_t *variable);

#endif
