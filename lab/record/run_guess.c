/* SPDX-License-Identifier: MIT */
#include "lab/record/run_guess.h"

#include <ctype.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { words_max = 16, word_size = 24 };

enum quantity {
    quantity_torque,
    quantity_force,
    quantity_current,
    quantity_voltage,
    quantity_angle,
    quantity_angular_velocity,
    quantity_length,
    quantity_velocity,
    quantity_count,
};

/// What a run calls a quantity, and on which kind of axis it is there.
static const struct {
    const char *stem, *unit;
    enum run_axis axis;
    bool has_load;
} quantities[quantity_count] = {
    [quantity_torque] = {"torque", "Nm", run_axis_rotary, false},
    [quantity_force] = {"force", "N", run_axis_linear, false},
    [quantity_current] = {"current", "A", run_axis_any, false},
    [quantity_voltage] = {"voltage", "V", run_axis_any, false},
    [quantity_angle] = {"position", "rad", run_axis_rotary, true},
    [quantity_angular_velocity] = {"velocity", "rad_per_s", run_axis_rotary, true},
    [quantity_length] = {"position", "m", run_axis_linear, true},
    [quantity_velocity] = {"velocity", "m_per_s", run_axis_linear, true},
};

/// Units as words, the longer ones first.
static const struct {
    const char *words[3];
    enum quantity quantity;
    double scale;
} units[] = {
    {{"rad", "per", "s"}, quantity_angular_velocity, 1.0},
    {{"deg", "per", "s"}, quantity_angular_velocity, 0.017453292519943295},
    {{"mrad", "per", "s"}, quantity_angular_velocity, 1e-3},
    {{"rev", "per", "s"}, quantity_angular_velocity, 6.283185307179586},
    {{"um", "per", "s"}, quantity_velocity, 1e-6},
    {{"mm", "per", "s"}, quantity_velocity, 1e-3},
    {{"m", "per", "s"}, quantity_velocity, 1.0},
    {{"rad", "s"}, quantity_angular_velocity, 1.0},
    {{"deg", "s"}, quantity_angular_velocity, 0.017453292519943295},
    {{"mrad", "s"}, quantity_angular_velocity, 1e-3},
    {{"rev", "s"}, quantity_angular_velocity, 6.283185307179586},
    {{"um", "s"}, quantity_velocity, 1e-6},
    {{"mm", "s"}, quantity_velocity, 1e-3},
    {{"mm", "min"}, quantity_velocity, 1e-3 / 60.0},
    {{"m", "min"}, quantity_velocity, 1.0 / 60.0},
    {{"m", "s"}, quantity_velocity, 1.0},
    {{"rpm"}, quantity_angular_velocity, 0.10471975511965977},
    {{"mNm"}, quantity_torque, 1e-3},
    {{"Ncm"}, quantity_torque, 1e-2},
    {{"kNm"}, quantity_torque, 1e3},
    {{"Nm"}, quantity_torque, 1.0},
    {{"kN"}, quantity_force, 1e3},
    {{"N"}, quantity_force, 1.0},
    {{"uA"}, quantity_current, 1e-6},
    {{"mA"}, quantity_current, 1e-3},
    {{"A"}, quantity_current, 1.0},
    {{"kV"}, quantity_voltage, 1e3},
    {{"mV"}, quantity_voltage, 1e-3},
    {{"V"}, quantity_voltage, 1.0},
    {{"rev"}, quantity_angle, 6.283185307179586},
    {{"mrad"}, quantity_angle, 1e-3},
    {{"rad"}, quantity_angle, 1.0},
    {{"deg"}, quantity_angle, 0.017453292519943295},
    {{"um"}, quantity_length, 1e-6},
    {{"mm"}, quantity_length, 1e-3},
    {{"cm"}, quantity_length, 1e-2},
    {{"m"}, quantity_length, 1.0},
};

static const char *const set_point_words[] = {"ref", "reference", "cmd", "command", "commanded", "set",      "setpoint",
                                              "sp",  "target",    "des", "desired", "demand",    "demanded", "soll"};
static const char *const measured_words[] = {"meas", "measured", "act", "actual", "ist", "fb", "feedback"};
static const char *const motor_words[] = {"motor", "mot"};
static const char *const load_words[] = {"load"};
static const char *const foreign_words[] = {"dc",    "vdc", "vbus",   "bus",   "supply", "link",        "err",
                                            "error", "lag", "lim",    "limit", "max",    "min",         "temp",
                                            "raw",   "id",  "offset", "noise", "dist",   "disturbance", "following"};

/// A column's name taken apart.
struct column {
    size_t count;
    char words[words_max][word_size];
    bool known; ///< its unit is one of the list
    enum quantity quantity;
    double scale;
    bool set_point, load;
    int rank; ///< how much it says that it is the motor's measured one; -1: it is something else
};

static void split_words(const char *name, struct column *out)
{
    size_t length = 0;
    out->count = 0;
    for (const char *at = name; out->count < words_max; at++) {
        const bool part = isalnum((unsigned char)*at);
        if (part && length + 1 < word_size)
            out->words[out->count][length++] = *at;
        if (!part && length > 0) {
            out->words[out->count++][length] = '\0';
            length = 0;
        }
        if (*at == '\0')
            return;
    }
}

/// Whether a capital begins a word inside a word: ActPos.
static bool is_hump(const char *word, const char *at)
{
    return at == word || *at == '\0' || (isupper((unsigned char)*at) && islower((unsigned char)at[-1]));
}

static bool has_part(const char *word, const char *part)
{
    const size_t length = strlen(part);
    for (const char *at = word; strlen(at) >= length; at++) {
        size_t same = 0;
        while (same < length && tolower((unsigned char)at[same]) == part[same])
            same++;
        if (same == length && is_hump(word, at) && is_hump(word, at + length))
            return true;
    }
    return false;
}

static bool has_word(const struct column *column, const char *const *list, size_t count)
{
    for (size_t w = 0; w < column->count; w++)
        for (size_t i = 0; i < count; i++)
            if (has_part(column->words[w], list[i]))
                return true;
    return false;
}

#define HAS_WORD(column, list) has_word(column, list, sizeof(list) / sizeof(list)[0])

/// Whether a unit's words are those that end before word `end`. A name is more than its unit.
static bool ends_with_unit(const struct column *column, size_t end, const char *const unit[3])
{
    size_t count = 0;
    while (count < 3 && unit[count])
        count++;
    if (count >= end || (count == 1 && unit[0][1] == '\0' && end < column->count))
        return false;
    for (size_t i = 0; i < count; i++)
        if (strcmp(column->words[end - count + i], unit[i]) != 0)
            return false;
    return true;
}

/* Whether a word belongs to the unit in front of it: rad/s^2 is no velocity, and rad per s2 no angle. */
static bool goes_on(const char *word)
{
    const char *digits = word + (*word == 's');
    return strcmp(word, "per") == 0 || *digits == '\0' || strspn(digits, "0123456789") == strlen(digits);
}

static void find_unit(struct column *io)
{
    for (size_t end = io->count; end > 1; end--) {
        if (end < io->count && goes_on(io->words[end]))
            continue;
        for (size_t u = 0; u < sizeof units / sizeof units[0]; u++) {
            if (ends_with_unit(io, end, units[u].words)) {
                io->known = true;
                io->quantity = units[u].quantity;
                io->scale = units[u].scale;
                return;
            }
        }
    }
}

/// The words of a unit that stand between `at` and `end`, with a name in front as find_unit wants it.
static void bracket_words(const char *at, const char *end, struct column *out)
{
    char text[words_max * word_size] = "x ";
    const size_t length = (size_t)(end - at);
    *out = (struct column){.rank = -1};
    if (length + 3 < sizeof text)
        strncat(text, at, length);
    split_words(text, out);
}

/// A unit in brackets is all that is in them, "[rad/s]", whatever their words are alone: of "[N/m]" the metre is no
/// position. Square brackets hold nothing but units; "(filtered)" may be a remark. False if there are no such brackets.
static bool find_bracket_unit(const char *name, struct column *io)
{
    bool found = false;
    for (const char *open = strpbrk(name, "[("); open; open = strpbrk(open + 1, "[(")) {
        const char *close = strpbrk(open, "])");
        struct column inside;
        if (!close)
            break;
        bracket_words(open + 1, close, &inside);
        for (size_t u = 0; u < sizeof units / sizeof units[0] && !io->known; u++) {
            size_t count = 0;
            while (count < 3 && units[u].words[count])
                count++;
            io->known = inside.count == count + 1 && ends_with_unit(&inside, inside.count, units[u].words);
            io->quantity = units[u].quantity;
            io->scale = units[u].scale;
        }
        if (io->known)
            return true;
        found = found || *open == '[' || strcspn(open + 1, "/^*%") < (size_t)(close - open - 1);
    }
    return found;
}

/// Sets known, quantity and scale by the unit in a name.
static void take_unit(const char *name, struct column *io)
{
    if (!find_bracket_unit(name, io))
        find_unit(io);
}

static void read_column(const char *name, struct column *out)
{
    *out = (struct column){.rank = -1};
    split_words(name, out);
    take_unit(name, out);
    if (!out->known || HAS_WORD(out, foreign_words))
        return;
    out->set_point = HAS_WORD(out, set_point_words);
    out->load = !out->set_point && HAS_WORD(out, load_words) && quantities[out->quantity].has_load;
    out->rank = 2 * HAS_WORD(out, measured_words) + HAS_WORD(out, motor_words);
}

bool run_guess_scale(const char *name, double *out_scale)
{
    struct column column = {.rank = -1};
    split_words(name, &column);
    take_unit(name, &column);
    if (column.known)
        *out_scale = column.scale;
    return column.known;
}

bool run_guess_time_scale(const char *name, double *out_scale)
{
    static const struct {
        const char *unit;
        double scale;
    } times[] = {{"s", 1.0}, {"ms", 1e-3}, {"us", 1e-6}, {"ns", 1e-9}, {"min", 60.0}, {"h", 3600.0}};
    struct column column = {.rank = -1};
    split_words(name, &column);
    for (size_t i = 0; column.count > 1 && i < sizeof times / sizeof times[0]; i++)
        if (strcmp(column.words[column.count - 1], times[i].unit) == 0) {
            *out_scale = times[i].scale;
            return true;
        }
    return false;
}

static void write_name(enum quantity quantity, bool set_point, bool load, char *out_name, size_t size)
{
    snprintf(out_name, size, "%s%s%s_%s", load ? "load_" : "", quantities[quantity].stem, set_point ? "_ref" : "",
             quantities[quantity].unit);
}

static bool has_column(const struct text_table *table, const char *name)
{
    for (size_t c = 0; c < table->column_count; c++)
        if (strcmp(table->columns[c].name, name) == 0)
            return true;
    return false;
}

static bool is_kept(const char *name, const char *const *keep, size_t keep_count)
{
    for (size_t i = 0; i < keep_count; i++)
        if (keep[i] && strcmp(keep[i], name) == 0)
            return true;
    return false;
}

static bool is_candidate(const struct column *column, enum quantity quantity, bool set_point, bool load)
{
    return column->rank >= 0 && column->quantity == quantity && column->set_point == set_point && column->load == load;
}

/// The column that says more than all others that it is the one asked for; column_count: none does.
static size_t choose(const struct text_table *table, const struct column *columns, enum quantity quantity,
                     bool set_point, bool load)
{
    size_t best = table->column_count;
    size_t equals = 0;
    for (size_t c = 0; c < table->column_count; c++) {
        if (!is_candidate(&columns[c], quantity, set_point, load))
            continue;
        const bool better = best == table->column_count || columns[c].rank > columns[best].rank;
        equals = better ? 1 : equals + (columns[c].rank == columns[best].rank);
        best = better ? c : best;
    }
    return equals == 1 ? best : table->column_count;
}

static bool add_entry(struct run_map *io_map, const char *name, const char *source, double scale)
{
    struct run_map_entry *entry = &io_map->entries[io_map->count];
    *entry = (struct run_map_entry){strdup(name), strdup(source), scale, true};
    io_map->count++;
    return entry->name && entry->source;
}

/// Rotary if something turns, by known or by found names.
static enum run_axis find_axis(const struct text_table *table, const struct column *columns)
{
    bool linear = false;
    for (size_t c = 0; c < table->column_count; c++) {
        const enum run_axis known = run_name_axis(table->columns[c].name);
        const enum run_axis own = columns[c].rank >= 0 ? quantities[columns[c].quantity].axis : run_axis_unknown;
        if (known == run_axis_rotary || (known == run_axis_unknown && own == run_axis_rotary))
            return run_axis_rotary;
        linear = linear || known == run_axis_linear || own == run_axis_linear;
    }
    return linear ? run_axis_linear : run_axis_rotary;
}

static bool fill_map(const struct text_table *table, const struct column *columns, struct run_map *io_map)
{
    const enum run_axis axis = find_axis(table, columns);
    bool done = true;
    for (int q = 0; q < quantity_count; q++) {
        if (quantities[q].axis != run_axis_any && quantities[q].axis != axis)
            continue;
        for (int role = 0; role < 3 && done; role++) {
            char name[48];
            const bool set_point = role == 1, load = role == 2;
            if (load && !quantities[q].has_load)
                continue;
            write_name((enum quantity)q, set_point, load, name, sizeof name);
            const size_t c = choose(table, columns, (enum quantity)q, set_point, load);
            if (c < table->column_count && !has_column(table, name))
                done = add_entry(io_map, name, table->columns[c].name, columns[c].scale);
        }
    }
    return done;
}

int run_guess_map(const struct text_table *table, const char *const *keep, size_t keep_count, struct run_map *out_map,
                  struct error *out_error)
{
    struct column *columns = calloc(table->column_count, sizeof *columns);
    *out_map = (struct run_map){.entries = calloc(3 * quantity_count, sizeof *out_map->entries)};
    bool done = columns && out_map->entries;
    for (size_t c = 0; c < table->column_count && done; c++) {
        const char *name = table->columns[c].name;
        columns[c].rank = -1;
        if (run_name_axis(name) == run_axis_unknown && !is_kept(name, keep, keep_count))
            read_column(name, &columns[c]);
    }
    done = done && fill_map(table, columns, out_map);
    free(columns);
    if (done)
        return error_none;
    run_map_free(out_map);
    return error_set(out_error, error_refused, "%s: memory is short", table->path);
}

int run_guess_note(const struct run_map *map, struct text_table *io_table, struct error *out_error)
{
    size_t size = 1;
    if (map->count == 0)
        return error_none;
    for (size_t i = 0; i < map->count; i++)
        size += strlen(map->entries[i].name) + strlen(map->entries[i].source) + 40;
    char *text = calloc(size, 1);
    char *key = strdup("columns_named");
    struct run_key *keys = realloc(io_table->keys, (io_table->key_count + 1) * sizeof *keys);
    io_table->keys = keys ? keys : io_table->keys;
    size_t *lines = realloc(io_table->key_line, (io_table->key_count + 1) * sizeof *lines);
    io_table->key_line = lines ? lines : io_table->key_line;
    if (!text || !key || !keys || !lines) {
        free(text);
        free(key);
        return error_set(out_error, error_refused, "%s: memory is short", io_table->path);
    }
    for (size_t i = 0; i < map->count; i++) {
        const struct run_map_entry *entry = &map->entries[i];
        const size_t used = strlen(text);
        char scale[32] = "";
        if (entry->scale != 1.0)
            snprintf(scale, sizeof scale, "*%.9g", entry->scale);
        snprintf(text + used, size - used, "%s%s=%s%s", i > 0 ? "," : "", entry->name, entry->source, scale);
    }
    io_table->keys[io_table->key_count] = (struct run_key){key, text};
    io_table->key_line[io_table->key_count++] = io_table->names_line;
    return error_none;
}
