/* SPDX-License-Identifier: MIT */
#include "lab/record/matio/mat_sources.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    name_size = 256,
    depth_max = 4,           /* structures in structures */
    matrix_columns_max = 64, /* a matrix with more on its short side is no list of signals */
};

static const char *class_name(const matvar_t *variable)
{
    static const char *const names[] = {"empty",  "cell array", "structure", "object", "text",     "sparse",
                                        "double", "single",     "int8",      "uint8",  "int16",    "uint16",
                                        "int32",  "uint32",     "int64",     "uint64", "function", "opaque"};
    size_t i = (size_t)variable->class_type;
    return variable->isLogical ? "logical" : i < sizeof names / sizeof names[0] ? names[i] : "unknown";
}

static void print_shape(const matvar_t *variable, size_t size, char *out_text)
{
    size_t used = 0;
    for (int d = 0; d < variable->rank && used < size; d++)
        used += (size_t)snprintf(out_text + used, size - used, "%s%zu", d ? " x " : "", variable->dims[d]);
    if (used < size)
        snprintf(out_text + used, size - used, " %s%s", variable->isComplex ? "complex " : "", class_name(variable));
}

static bool append(struct mat_sources *self, const char *name, const matvar_t *variable, double *data, size_t count)
{
    struct mat_source *items = realloc(self->items, (self->count + 1) * sizeof *items);
    if (items)
        self->items = items;
    struct mat_source source = {.name = strdup(name), .data = data, .count = count};
    if (!items || !source.name) {
        free(source.name);
        free(data);
        return false;
    }
    print_shape(variable, sizeof source.shape, source.shape);
    items[self->count++] = source;
    return true;
}

/* Signal `i` of a matrix: every `stride`th value from `first` on. */
static bool append_part(struct mat_sources *self, const char *name, const matvar_t *variable, size_t first,
                        size_t stride, size_t count)
{
    double *data = malloc(count * sizeof *data);
    for (size_t n = 0; data && n < count; n++)
        data[n] = mat_value(variable, first + n * stride);
    return data && append(self, name, variable, data, count);
}

/* A vector is a signal, a matrix one for each column, or for each row if it is wider than high. */
static bool add_numbers(struct mat_sources *self, const char *name, const matvar_t *variable)
{
    size_t rows = variable->dims[0], columns = variable->rank == 2 ? variable->dims[1] : 0;
    bool tall = rows >= columns;
    size_t signals = tall ? columns : rows, count = tall ? rows : columns;
    if (variable->rank != 2 || signals == 0 || count < 2 || signals > matrix_columns_max)
        return append(self, name, variable, NULL, 0);
    if (signals == 1)
        return append_part(self, name, variable, 0, 1, count);
    char part[name_size + 32];
    bool good = true;
    for (size_t i = 0; good && i < signals; i++) {
        snprintf(part, sizeof part, "%s:%zu", name, i + 1);
        good = append_part(self, part, variable, tall ? i * rows : i, tall ? 1 : rows, count);
    }
    return good;
}

static bool add_named(struct mat_sources *self, const struct mat_library *library, const char *name, matvar_t *variable,
                      int depth)
{
    if (mat_is_numeric(variable))
        return add_numbers(self, name, variable);
    bool opens = variable->class_type == MAT_C_STRUCT && mat_value_count(variable) == 1 && depth < depth_max;
    if (!opens)
        return append(self, name, variable, NULL, 0);
    unsigned count = library->var_field_count(variable);
    char *const *names = library->var_field_names(variable);
    bool good = true;
    for (unsigned i = 0; good && names && i < count; i++) {
        char field_name[name_size];
        matvar_t *field = library->var_field(variable, names[i], 0);
        snprintf(field_name, sizeof field_name, "%.120s.%.120s", name, names[i]);
        good = !field || add_named(self, library, field_name, field, depth + 1);
    }
    return good;
}

bool mat_sources_add(struct mat_sources *self, const struct mat_library *library, matvar_t *variable)
{
    return add_named(self, library, variable->name ? variable->name : "", variable, 0);
}

void mat_sources_free(struct mat_sources *self)
{
    for (size_t i = 0; i < self->count; i++) {
        free(self->items[i].name);
        free(self->items[i].data);
    }
    free(self->items);
    *self = (struct mat_sources){0};
}

const struct mat_source *mat_sources_find(const struct mat_sources *self, const char *name)
{
    for (size_t i = 0; i < self->count; i++)
        if (self->items[i].data && strcmp(self->items[i].name, name) == 0)
            return &self->items[i];
    return NULL;
}

void mat_sources_list(const struct mat_sources *self, size_t size, char *out_text)
{
    size_t used = 0;
    out_text[0] = '\0';
    for (size_t i = 0; i < self->count; i++) {
        char one[name_size + 128];
        int length = snprintf(one, sizeof one, "%s%s (%s)", i ? ", " : "", self->items[i].name, self->items[i].shape);
        if (used + (size_t)length + 5 > size) {
            snprintf(out_text + used, size - used, " ...");
            return;
        }
        memcpy(out_text + used, one, (size_t)length + 1);
        used += (size_t)length;
    }
}
