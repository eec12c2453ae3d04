/* SPDX-License-Identifier: MIT */
#include "lab/record/matio/mat_library.h"

#include "lab/record/mat_file.h"

#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static char said[200];

bool mat_built_in(void)
{
    return true;
}

static void listen(int level, char *message)
{
    (void)level;
    snprintf(said, sizeof said, "%s", message);
}

const char *mat_library_said(void)
{
    static char last[sizeof said];
    memcpy(last, said, sizeof last);
    said[0] = '\0';
    return last;
}

/* ISO C has no conversion from an object's address to a function's; POSIX says that they have one form. */
static bool find(void *handle, const char *name, void *out_function, size_t size)
{
    void *address = dlsym(handle, name);
    memcpy(out_function, &address, size);
    return address != NULL;
}

/* HDF5 prints its own account of every refusal to standard error unless told not to; and at the end of the program it
 * writes once more to files that a full disk has kept it from closing, and crashes. Files that went well are closed. */
static void tame(void *handle)
{
    int (*set_auto)(int64_t, void *, void *), (*leave_alone)(void);
    int (*listen_to)(const char *, void (*)(int, char *));
    if (find(handle, "H5dont_atexit", &leave_alone, sizeof leave_alone))
        (void)leave_alone();
    if (find(handle, "H5Eset_auto2", &set_auto, sizeof set_auto))
        (void)set_auto(0, NULL, NULL);
    if (find(handle, "Mat_LogInitFunc", &listen_to, sizeof listen_to))
        (void)listen_to("matio", listen);
}

#define FIND(member, name) find(handle, name, &library->member, sizeof library->member)

static bool find_all(void *handle, struct mat_library *library)
{
    return FIND(open, "Mat_Open") && FIND(create, "Mat_CreateVer") && FIND(close, "Mat_Close") &&
           FIND(var_create, "Mat_VarCreate") && FIND(var_create_struct, "Mat_VarCreateStruct") &&
           FIND(var_add_field, "Mat_VarAddStructField") && FIND(var_set_field, "Mat_VarSetStructFieldByName") &&
           FIND(var_field, "Mat_VarGetStructFieldByName") && FIND(var_field_count, "Mat_VarGetNumberOfFields") &&
           FIND(var_field_names, "Mat_VarGetStructFieldnames") && FIND(var_write, "Mat_VarWrite") &&
           FIND(var_read, "Mat_VarRead") && FIND(var_read_next, "Mat_VarReadNext") && FIND(var_free, "Mat_VarFree");
}

#undef FIND

const struct mat_library *mat_library_load(const char *path, struct error *out_error)
{
    static struct mat_library library;
    static bool loaded;
    if (loaded)
        return &library;
    void *handle = dlopen(SERVOSCOPE_MATIO_LIBRARY, RTLD_NOW | RTLD_LOCAL);
    if (handle && find_all(handle, &library)) {
        tame(handle);
        loaded = true;
        return &library;
    }
    const char *reason = dlerror();
    error_set(out_error, error_refused,
              "%s: the library matio, which MATLAB files need, cannot be loaded (%s): install libmatio11 (Debian, "
              "Ubuntu; others: matio), or use --to uff or csv",
              path, reason ? reason : SERVOSCOPE_MATIO_LIBRARY);
    return NULL;
}

size_t mat_value_count(const matvar_t *variable)
{
    size_t count = 1;
    for (int d = 0; d < variable->rank; d++) {
        if (variable->dims[d] != 0 && count > SIZE_MAX / 16 / variable->dims[d])
            return 0;
        count *= variable->dims[d];
    }
    return variable->rank > 0 ? count : 0;
}

static size_t value_size(enum matio_types type)
{
    switch (type) {
    case MAT_T_INT8:
    case MAT_T_UINT8:
        return 1;
    case MAT_T_INT16:
    case MAT_T_UINT16:
        return 2;
    case MAT_T_INT32:
    case MAT_T_UINT32:
    case MAT_T_SINGLE:
        return 4;
    case MAT_T_INT64:
    case MAT_T_UINT64:
    case MAT_T_DOUBLE:
        return 8;
    default:
        return 0;
    }
}

bool mat_is_numeric(const matvar_t *variable)
{
    size_t size = value_size(variable->data_type);
    return variable->class_type >= MAT_C_DOUBLE && variable->class_type <= MAT_C_UINT64 && !variable->isComplex &&
           variable->data && size > 0 && variable->nbytes == mat_value_count(variable) * size;
}

double mat_value(const matvar_t *variable, size_t i)
{
    switch (variable->data_type) {
    case MAT_T_DOUBLE:
        return ((const double *)variable->data)[i];
    case MAT_T_SINGLE:
        return ((const float *)variable->data)[i];
    case MAT_T_INT8:
        return ((const int8_t *)variable->data)[i];
    case MAT_T_UINT8:
        return ((const uint8_t *)variable->data)[i];
    case MAT_T_INT16:
        return ((const int16_t *)variable->data)[i];
    case MAT_T_UINT16:
        return ((const uint16_t *)variable->data)[i];
    case MAT_T_INT32:
        return ((const int32_t *)variable->data)[i];
    case MAT_T_UINT32:
        return ((const uint32_t *)variable->data)[i];
    case MAT_T_INT64:
        return (double)((const int64_t *)variable->data)[i];
    default:
        return (double)((const uint64_t *)variable->data)[i];
    }
}

static char *put_utf8(char *to, uint32_t c)
{
    if (c < 0x80) {
        *to++ = (char)c;
    } else if (c < 0x800) {
        *to++ = (char)(0xc0 | c >> 6);
        *to++ = (char)(0x80 | (c & 0x3f));
    } else if (c < 0x10000) {
        *to++ = (char)(0xe0 | c >> 12);
        *to++ = (char)(0x80 | (c >> 6 & 0x3f));
        *to++ = (char)(0x80 | (c & 0x3f));
    } else {
        *to++ = (char)(0xf0 | c >> 18);
        *to++ = (char)(0x80 | (c >> 12 & 0x3f));
        *to++ = (char)(0x80 | (c >> 6 & 0x3f));
        *to++ = (char)(0x80 | (c & 0x3f));
    }
    return to;
}

static void utf16_to_utf8(const uint16_t *from, size_t count, char *to)
{
    for (size_t i = 0; i < count && from[i] != 0; i++) {
        uint32_t c = from[i];
        if (c >= 0xd800 && c < 0xdc00 && i + 1 < count && from[i + 1] >= 0xdc00 && from[i + 1] < 0xe000)
            c = 0x10000 + ((c - 0xd800) << 10) + (from[++i] - 0xdc00u);
        to = put_utf8(to, c);
    }
    *to = '\0';
}

char *mat_text(const matvar_t *variable)
{
    size_t count = variable->class_type == MAT_C_CHAR ? mat_value_count(variable) : 0;
    if (variable->class_type != MAT_C_CHAR)
        return NULL;
    char *text = calloc(4, count + 1);
    bool wide = variable->data_type == MAT_T_UINT16 || variable->data_type == MAT_T_UTF16;
    bool narrow =
        variable->data_type == MAT_T_UINT8 || variable->data_type == MAT_T_UTF8 || variable->data_type == MAT_T_INT8;
    if (!text || count == 0 || !variable->data)
        return text;
    if (wide && variable->nbytes >= 2 * count)
        utf16_to_utf8(variable->data, count, text);
    else if (narrow)
        memcpy(text, variable->data, count < variable->nbytes ? count : variable->nbytes);
    return text;
}
