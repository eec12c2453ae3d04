/* SPDX-License-Identifier: MIT */
#include "lab/record/uff_axis.h"

#include "lab/record/run_names.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

/* Units as columns and as people write them; a unit comes before one that it ends in. */
static const struct {
    const char *ending;
    const char *text;
} units[] = {{"rad_per_s", "rad/s"},
             {"m_per_s", "m/s"},
             {"Nm", "Nm"},
             {"rad", "rad"},
             {"N", "N"},
             {"m", "m"},
             {"A", "A"},
             {"V", "V"},
             {"s", "s"}};

/* Names that a run has for a quantity in a direction. */
static const struct {
    const char *column;
    int quantity;
    int direction;
    const char *units;
} known[] = {
    {"torque_Nm", uff_quantity_excitation_force, uff_rotation_z, "Nm"},
    {"force_N", uff_quantity_excitation_force, uff_translation_x, "N"},
    {"position_rad", uff_quantity_displacement, uff_rotation_z, "rad"},
    {"position_m", uff_quantity_displacement, uff_translation_x, "m"},
    {"velocity_rad_per_s", uff_quantity_velocity, uff_rotation_z, "rad/s"},
    {"velocity_m_per_s", uff_quantity_velocity, uff_translation_x, "m/s"},
};

enum { unit_count = sizeof units / sizeof units[0], known_count = sizeof known / sizeof known[0] };

/* The unit that a name ends in; *out_stem is the length of what is before its '_'. */
static const char *find_unit(const char *column, size_t *out_stem)
{
    size_t length = strlen(column);
    for (size_t i = 0; i < unit_count; i++) {
        size_t size = strlen(units[i].ending);
        if (length > size + 1 && column[length - size - 1] == '_' &&
            strcmp(column + length - size, units[i].ending) == 0) {
            *out_stem = length - size - 1;
            return units[i].text;
        }
    }
    *out_stem = length;
    return "";
}

/* Takes "_NUMBER" off a stem and returns the number, 1 if there is none. */
static long take_number(const char *column, size_t *io_stem)
{
    size_t at = *io_stem;
    while (at > 0 && column[at - 1] >= '0' && column[at - 1] <= '9')
        at--;
    if (at == *io_stem || at == 0 || column[at - 1] != '_')
        return 1;
    long number = strtol(column + at, NULL, 10);
    *io_stem = at - 1;
    return number;
}

static bool begins_with(const char *text, const char *beginning)
{
    return strncmp(text, beginning, strlen(beginning)) == 0;
}

static int quantity_of(const char *column)
{
    const char *stem = begins_with(column, "load_") ? column + strlen("load_") : column;
    if (strcmp(column, "time_s") == 0)
        return uff_quantity_time;
    if (begins_with(stem, "torque") || begins_with(stem, "force"))
        return uff_quantity_excitation_force;
    if (begins_with(stem, "position"))
        return uff_quantity_displacement;
    return begins_with(stem, "velocity") ? uff_quantity_velocity : uff_quantity_general;
}

static void copy_cut(char *to, size_t size, const char *from, size_t length)
{
    size_t kept = length < size - 1 ? length : size - 1;
    memcpy(to, from, kept);
    to[kept] = '\0';
}

void uff_describe(const char *column, struct uff_axis *out_axis, struct uff_dof *out_dof)
{
    *out_axis = (struct uff_axis){.quantity = uff_quantity_general};
    *out_dof = (struct uff_dof){0};
    enum run_axis axis = run_name_axis(column);
    if (axis == run_axis_unknown) {
        copy_cut(out_axis->label, sizeof out_axis->label, column, strlen(column));
        return;
    }
    size_t stem;
    const char *unit = find_unit(column, &stem);
    long number = take_number(column, &stem);
    out_axis->quantity = quantity_of(column);
    copy_cut(out_axis->label, sizeof out_axis->label, column, stem);
    copy_cut(out_axis->units, sizeof out_axis->units, unit, strlen(unit));
    if (axis == run_axis_any)
        return;
    out_dof->node = 2 * number - (begins_with(column, "load_") ? 0 : 1);
    out_dof->direction = axis == run_axis_rotary ? uff_rotation_z : uff_translation_x;
}

void uff_clean_name(char *name)
{
    for (char *c = name; *c; c++)
        if (strchr(",*=\"", *c) || (unsigned char)*c < 0x20 || *c == 0x7f)
            *c = '_';
    size_t first = strspn(name, " "), length = strlen(name + first);
    memmove(name, name + first, length + 1);
    while (length > 0 && name[length - 1] == ' ')
        name[--length] = '\0';
}

void uff_name_column(const struct uff_axis *axis, const struct uff_dof *dof, bool si, size_t size, char *out_name)
{
    bool rotation = abs(dof->direction) >= 4;
    for (size_t i = 0; i < known_count; i++) {
        bool same_units = axis->units[0] ? strcmp(axis->units, known[i].units) == 0 : si;
        if (axis->quantity == known[i].quantity && same_units && dof->direction != uff_scalar &&
            rotation == (known[i].direction == uff_rotation_z)) {
            snprintf(out_name, size, "%s", known[i].column);
            return;
        }
    }
    const char *label = axis->label[0] ? axis->label : "quantity";
    snprintf(out_name, size, "%s%s%s", label, axis->units[0] ? "_" : "", axis->units);
    uff_clean_name(out_name);
}
