/* SPDX-License-Identifier: MIT */
#include "lab/record/run_names.h"

#include "lab/record/number.h"
#include "lab/record/run_guess.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A known name is STEM_UNIT, or STEM_NUMBER_UNIT where a machine has several. */
static const struct {
    const char *stem;
    const char *unit;
    enum run_axis axis;
} known_names[] = {
    {"torque", "Nm", run_axis_rotary},
    {"torque_ref", "Nm", run_axis_rotary},
    {"position", "rad", run_axis_rotary},
    {"position_ref", "rad", run_axis_rotary},
    {"load_position", "rad", run_axis_rotary},
    {"velocity", "rad_per_s", run_axis_rotary},
    {"velocity_ref", "rad_per_s", run_axis_rotary},
    {"load_velocity", "rad_per_s", run_axis_rotary},
    {"force", "N", run_axis_linear},
    {"force_ref", "N", run_axis_linear},
    {"position", "m", run_axis_linear},
    {"position_ref", "m", run_axis_linear},
    {"load_position", "m", run_axis_linear},
    {"velocity", "m_per_s", run_axis_linear},
    {"velocity_ref", "m_per_s", run_axis_linear},
    {"load_velocity", "m_per_s", run_axis_linear},
    {"current", "A", run_axis_any},
    {"current_ref", "A", run_axis_any},
    {"voltage", "V", run_axis_any},
    {"voltage_ref", "V", run_axis_any},
};

static bool is_named(const char *name, const char *stem, const char *unit)
{
    size_t length = strlen(stem);
    if (strncmp(name, stem, length) != 0 || name[length] != '_')
        return false;
    const char *rest = name + length + 1;
    size_t digits = strspn(rest, "0123456789");
    if (digits > 0 && digits <= 3 && rest[digits] == '_')
        rest += digits + 1;
    return strcmp(rest, unit) == 0;
}

enum run_axis run_name_axis(const char *name)
{
    if (strcmp(name, "time_s") == 0 || strcmp(name, "valid") == 0)
        return run_axis_any;
    for (size_t i = 0; i < sizeof known_names / sizeof known_names[0]; i++)
        if (is_named(name, known_names[i].stem, known_names[i].unit))
            return known_names[i].axis;
    return run_axis_unknown;
}

static char *copy_range(const char *from, const char *to)
{
    while (from < to && *from == ' ')
        from++;
    while (to > from && to[-1] == ' ')
        to--;
    char *copy = malloc((size_t)(to - from) + 1);
    if (copy) {
        memcpy(copy, from, (size_t)(to - from));
        copy[to - from] = '\0';
    }
    return copy;
}

static int part_error(const char *at, const char *end, const char *what, struct error *out_error)
{
    return error_set(out_error, error_usage, "--map: '%.*s': %s", (int)(end - at), at, what);
}

/* One NAME=COLUMN[*SCALE] between at and end. */
static int parse_entry(const char *at, const char *end, struct run_map *map, struct error *out_error)
{
    const char *equals = memchr(at, '=', (size_t)(end - at));
    if (!equals)
        return part_error(at, end, "NAME=COLUMN or NAME=COLUMN*SCALE was expected", out_error);
    const char *star = memchr(equals, '*', (size_t)(end - equals));
    struct run_map_entry *entry = &map->entries[map->count];
    *entry =
        (struct run_map_entry){copy_range(at, equals), copy_range(equals + 1, star ? star : end), 1.0, star != NULL};
    map->count++;
    if (!entry->name || !entry->source)
        return error_set(out_error, error_refused, "--map: memory is short");
    if (entry->source[0] == '\0' || strchr(entry->source, '='))
        return part_error(at, end, "one column of the file was expected behind the '='", out_error);
    if (run_name_axis(entry->name) == run_axis_unknown)
        return part_error(at, end,
                          "the name in front of '=' is none that a run knows (time_s, torque_Nm, torque_ref_Nm, "
                          "position_rad, velocity_rad_per_s, force_N, position_m, velocity_m_per_s, current_A, "
                          "voltage_V, load_position_rad, valid, ...)",
                          out_error);
    for (size_t i = 0; i + 1 < map->count; i++)
        if (strcmp(map->entries[i].name, entry->name) == 0)
            return part_error(at, end, "the name is mapped twice", out_error);
    if (!star)
        return error_none;
    if (number_parse(star + 1, (size_t)(end - star - 1), &entry->scale) != number_ok || entry->scale == 0)
        return part_error(at, end, "a number other than 0 was expected behind the '*'", out_error);
    return error_none;
}

int run_map_parse(struct run_map *out_map, const char *text, struct error *out_error)
{
    *out_map = (struct run_map){0};
    if (!text || !*text)
        return error_none;
    size_t parts = 1;
    for (const char *c = text; *c; c++)
        parts += *c == ',';
    out_map->entries = calloc(parts, sizeof *out_map->entries);
    if (!out_map->entries)
        return error_set(out_error, error_refused, "--map: memory is short");
    const char *at = text;
    int status = error_none;
    for (size_t part = 0; part < parts && !status; part++) {
        const char *end = at + strcspn(at, ",");
        status = parse_entry(at, end, out_map, out_error);
        at = end + 1;
    }
    if (status)
        run_map_free(out_map);
    return status;
}

void run_map_free(struct run_map *self)
{
    for (size_t i = 0; i < self->count; i++) {
        free(self->entries[i].name);
        free(self->entries[i].source);
    }
    free(self->entries);
    *self = (struct run_map){0};
}

static bool is_target(const struct run_map *map, const char *name)
{
    for (size_t i = 0; i < map->count; i++)
        if (strcmp(map->entries[i].name, name) == 0)
            return true;
    return false;
}

enum text_cell run_map_judge(void *context, const char *name)
{
    const struct run_map *map = context;
    for (size_t i = 0; i < map->count; i++)
        if (strcmp(map->entries[i].source, name) == 0)
            return text_cell_number;
    bool replaced = is_target(map, name);
    return run_name_axis(name) != run_axis_unknown && !replaced ? text_cell_number : text_cell_free;
}

static int no_such_column(const struct text_table *table, const char *name, struct error *out_error)
{
    char list[600] = "";
    size_t used = 0;
    for (size_t c = 0; c < table->column_count && used < sizeof list - 1; c++)
        used += (size_t)snprintf(list + used, sizeof list - used, "%s%s", c ? ", " : "", table->columns[c].name);
    return error_set(out_error, error_refused, "%s:%zu: --map: there is no column '%s', only: %s%s", table->path,
                     table->names_line, name, list, used < sizeof list ? "" : " ...");
}

/* A name that ends in another unit than SI's asks for a factor: degrees are not taken for radians in silence. */
static int check_unit(const struct run_map_entry *entry, const struct text_table *table, struct error *out_error)
{
    double scale = 1.0;
    const bool known = strcmp(entry->name, "time_s") == 0 ? run_guess_time_scale(entry->source, &scale)
                                                          : run_guess_scale(entry->source, &scale);
    if (entry->scaled || !known || scale == 1.0)
        return error_none;
    return error_set(out_error, error_refused,
                     "%s:%zu: --map: %s=%s: the column's name says another unit; expected %s=%s*%.9g, or %s*1 if the "
                     "name is wrong",
                     table->path, table->names_line, entry->name, entry->source, entry->name, entry->source, scale,
                     entry->source);
}

/* One column of the table becomes what an entry says. `renamed` holds new names of the file's own columns. */
static int apply_entry(const struct run_map_entry *entry, struct text_table *table, char **renamed,
                       struct run_map_plan *io_plan, struct error *out_error)
{
    size_t source = 0;
    while (source < io_plan->own_count && strcmp(table->columns[source].name, entry->source) != 0)
        source++;
    if (source == io_plan->own_count)
        return no_such_column(table, entry->source, out_error);
    int status = check_unit(entry, table, out_error);
    if (status)
        return status;
    char *name = copy_range(entry->name, entry->name + strlen(entry->name));
    bool second = renamed[source] != NULL;
    double *copy = second && table->rows > 0 ? malloc(table->rows * sizeof *copy) : NULL;
    if (!name || (second && table->rows > 0 && !copy)) {
        free(name);
        free(copy);
        return error_set(out_error, error_refused, "%s: memory is short", table->path);
    }
    if (!second) {
        renamed[source] = name;
        io_plan->scales[source] = entry->scale;
        return error_none;
    }
    io_plan->sources[table->column_count] = source;
    io_plan->scales[table->column_count] = entry->scale;
    table->columns[table->column_count++] = (struct run_column){name, copy};
    return error_none;
}

static int scale_column(const struct text_table *table, size_t first, size_t column, double scale,
                        struct error *out_error)
{
    double *data = table->columns[column].data;
    for (size_t n = first; n < table->rows && scale != 1.0; n++) {
        data[n] *= scale;
        if (isinf(data[n]))
            return error_set(out_error, error_refused, "%s:%zu: %s: too large for a double once scaled by %g",
                             table->path, table->row_line[n], table->columns[column].name, scale);
    }
    return error_none;
}

/* A file's own column whose name now belongs to a mapped one steps aside. */
static char *name_aside(const char *name)
{
    size_t size = strlen(name) + sizeof "unmapped_";
    char *aside = malloc(size);
    if (aside)
        snprintf(aside, size, "unmapped_%s", name);
    return aside;
}

static int take_names(const struct run_map *map, struct text_table *table, size_t own_count, char **renamed,
                      struct error *out_error)
{
    for (size_t c = 0; c < own_count; c++) {
        if (!renamed[c] && is_target(map, table->columns[c].name)) {
            renamed[c] = name_aside(table->columns[c].name);
            if (!renamed[c])
                return error_set(out_error, error_refused, "%s: memory is short", table->path);
        }
        if (renamed[c]) {
            free(table->columns[c].name);
            table->columns[c].name = renamed[c];
            renamed[c] = NULL;
        }
    }
    return error_none;
}

static int make_plan(const struct run_map *map, struct text_table *table, char **renamed, struct run_map_plan *io_plan,
                     struct error *out_error)
{
    int status = error_none;
    for (size_t i = 0; i < map->count && !status; i++)
        status = apply_entry(&map->entries[i], table, renamed, io_plan, out_error);
    return status ? status : take_names(map, table, io_plan->own_count, renamed, out_error);
}

int run_map_rename(const struct run_map *map, struct text_table *io_table, struct run_map_plan *out_plan,
                   struct error *out_error)
{
    size_t own_count = io_table->column_count, most = own_count + map->count;
    struct run_column *columns = realloc(io_table->columns, most * sizeof *columns);
    if (columns)
        io_table->columns = columns;
    char **renamed = calloc(own_count, sizeof *renamed);
    *out_plan = (struct run_map_plan){.own_count = own_count,
                                      .sources = calloc(most, sizeof *out_plan->sources),
                                      .scales = malloc(most * sizeof *out_plan->scales)};
    int status = error_none;
    if (columns && renamed && out_plan->sources && out_plan->scales) {
        for (size_t i = 0; i < most; i++)
            out_plan->scales[i] = 1.0;
        status = make_plan(map, io_table, renamed, out_plan, out_error);
    } else {
        status = error_set(out_error, error_refused, "%s: memory is short", io_table->path);
    }
    for (size_t c = 0; renamed && c < own_count; c++)
        free(renamed[c]);
    free(renamed);
    if (status)
        run_map_plan_free(out_plan);
    return status;
}

int run_map_fill(const struct run_map_plan *plan, struct text_table *io_table, size_t first_row,
                 struct error *out_error)
{
    size_t rows = io_table->rows - first_row;
    for (size_t c = plan->own_count; c < io_table->column_count; c++)
        memcpy(io_table->columns[c].data + first_row, io_table->columns[plan->sources[c]].data + first_row,
               rows * sizeof(double));
    int status = error_none;
    for (size_t c = 0; c < io_table->column_count && !status; c++)
        status = scale_column(io_table, first_row, c, plan->scales[c], out_error);
    return status;
}

void run_map_plan_free(struct run_map_plan *self)
{
    free(self->sources);
    free(self->scales);
    *self = (struct run_map_plan){0};
}
