/* SPDX-License-Identifier: MIT */
#include "lab/record/matio/mat_names.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>

const char mat_structure_name[] = "servoscope";

struct key_field {
    const char *name;
    enum mat_key kind;
};

/* Each list ends with NULL. */
static const struct key_field run_fields[] = {
    {"sample_rate_hz", mat_key_number},
    {"period_samples", mat_key_number},
    {"periods", mat_key_number},
    {"settle_periods", mat_key_number},
    {"excited_bins", mat_key_list},
    {"table_crc32", mat_key_text},
    {NULL, mat_key_other},
};

static const struct key_field frf_fields[] = {
    {"input", mat_key_text},  {"output", mat_key_text},    {"units", mat_key_text},
    {"method", mat_key_text}, {"periods", mat_key_number}, {"degrees_of_freedom", mat_key_number},
    {NULL, mat_key_other},
};

static const struct key_field *fields_of(enum record_kind holds)
{
    return holds == record_run ? run_fields : frf_fields;
}

/* Words that MATLAB does not take as names, and names of ours. */
static const char *const reserved[] = {
    "break", "case",      "catch",  "classdef",   "continue", "else", "elseif", "end", "for",   "function",   "global",
    "if",    "otherwise", "parfor", "persistent", "return",   "spmd", "switch", "try", "while", "servoscope", "frf"};

enum mat_key mat_key_kind(enum record_kind holds, const char *key)
{
    const struct key_field *fields = fields_of(holds);
    for (size_t i = 0; fields[i].name; i++)
        if (strcmp(fields[i].name, key) == 0)
            return fields[i].kind;
    return mat_key_other;
}

const char *mat_key_name(enum record_kind holds, size_t i)
{
    return fields_of(holds)[i].name;
}

static bool is_letter(char c)
{
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}

static bool is_name(const char *text)
{
    size_t length = strlen(text);
    if (length == 0 || length >= mat_name_size || !is_letter(text[0]))
        return false;
    for (size_t i = 1; i < length; i++)
        if (!is_letter(text[i]) && !(text[i] >= '0' && text[i] <= '9') && text[i] != '_')
            return false;
    for (size_t i = 0; i < sizeof reserved / sizeof reserved[0]; i++)
        if (strcmp(reserved[i], text) == 0)
            return false;
    return true;
}

void mat_name_variable(const char *column, size_t index, char out_name[mat_name_size])
{
    if (is_name(column))
        snprintf(out_name, mat_name_size, "%s", column);
    else
        snprintf(out_name, mat_name_size, "column_%zu", index + 1);
}
