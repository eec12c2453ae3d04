/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/door.h"

#include "tools/servoscope/door_parts.h"
#include "tools/servoscope/options.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const struct door_scheme *const schemes[] = {&door_simulated, &door_can, &door_slcan, &door_odrive,
                                                    &door_odrive_slcan};
enum { scheme_count = sizeof schemes / sizeof schemes[0] };

int door_open(const char *url, const struct sim_model *model, struct door *out_door, struct error *out_error)
{
    char forms[300] = "";
    *out_door = (struct door){.owner = NULL};
    for (size_t i = 0; i < scheme_count; i++) {
        const struct door_scheme *scheme = schemes[i];
        size_t length = strlen(scheme->prefix), used = strlen(forms);
        if (strncmp(url, scheme->prefix, length) == 0) {
            int status = scheme->open(scheme, url + length, model, out_door, out_error);
            out_door->scheme = scheme;
            return status;
        }
        snprintf(&forms[used], sizeof forms - used, "%s%s", i == 0 ? "" : ", ", scheme->form);
    }
    return error_set(out_error, error_usage,
                     "--drive: '%s' is no drive that this program can reach; expected %s, "
                     "modbus-tcp:HOST:PORT or modbus-rtu:DEVICE:BAUD",
                     url, forms);
}

bool door_has_statistics(const struct door *self)
{
    return self->owner && self->scheme->read_statistics;
}

void door_read_statistics(const struct door *self, struct door_statistics *out_statistics)
{
    *out_statistics = (struct door_statistics){.bitrate = 0};
    if (door_has_statistics(self))
        self->scheme->read_statistics(self, out_statistics);
}

void door_close(struct door *self)
{
    if (self->owner) {
        self->drive.operations->close(self->drive.self);
        self->scheme->free(self);
    }
    *self = (struct door){.owner = NULL};
}

// ---- URL

/// A number of a query, within its range.
static int read_number(const char *name, const char *text, long lowest, long highest, long *out_value,
                       struct error *out_error)
{
    char *end;
    *out_value = strtol(text, &end, 10);
    if (*text == '\0' || *end != '\0' || !(*out_value >= lowest && *out_value <= highest)) {
        return error_set(out_error, error_usage, "--drive: %s=%s: expected a whole number from %ld to %ld", name, text,
                         lowest, highest);
    }
    return 0;
}

/// Whether a name is one of a list separated by blanks.
static bool is_among(const char *name, const char *list)
{
    const size_t length = strlen(name);
    for (const char *at = list; *at != '\0'; at += strspn(at, " ")) {
        const size_t item = strcspn(at, " ");
        if (item == length && strncmp(at, name, length) == 0) {
            return true;
        }
        at += item;
    }
    return false;
}

static int read_pair(const struct door_scheme *scheme, char *pair, struct door_query *io_query, struct error *out_error)
{
    char *equals = strchr(pair, '=');
    const char *value = equals ? equals + 1 : "";
    if (equals) {
        *equals = '\0';
    }
    if (!is_among(pair, scheme->asked)) {
        return error_set(out_error, error_usage,
                         "--drive: '%s' is nothing that can be asked behind '?' of %s; expected one of: %s", pair,
                         scheme->form, scheme->asked);
    }
    if (strcmp(pair, "node") == 0) {
        return read_number(pair, value, scheme->node_lowest, scheme->node_highest, &io_query->node, out_error);
    }
    if (strcmp(pair, "bitrate") == 0) {
        return read_number(pair, value, 10000, 1000000, &io_query->bitrate, out_error);
    }
    if (strcmp(pair, "sync_timeout_ms") == 0) {
        return read_number(pair, value, 1, 10000, &io_query->sync_timeout_ms, out_error);
    }
    if (strcmp(pair, "kt") == 0) {
        int status = options_parse_number("--drive: kt", value, &io_query->torque_constant_Nm_per_A, out_error);
        return status || io_query->torque_constant_Nm_per_A > 0.0
                   ? status
                   : error_set(out_error, error_usage, "--drive: kt=%s: expected a torque constant above 0", value);
    }
    snprintf(io_query->profile, sizeof io_query->profile, "%s", value); // the one that is left
    return *value != '\0' ? 0 : error_set(out_error, error_usage, "--drive: profile=: expected the name of a make");
}

int door_read_query(const struct door_scheme *scheme, const char *rest, struct door_query *out_query,
                    struct error *out_error)
{
    char pairs[256];
    const char *mark = strchr(rest, '?');
    int length = mark ? (int)(mark - rest) : (int)strlen(rest);
    *out_query = (struct door_query){.node = scheme->node_default, .bitrate = 1000000};
    if (length == 0 || (size_t)length >= sizeof out_query->address || (mark && strlen(mark) >= sizeof pairs)) {
        return error_set(out_error, error_usage, "--drive: '%s%s': expected %s", scheme->prefix, rest, scheme->form);
    }
    snprintf(out_query->address, sizeof out_query->address, "%.*s", length, rest);
    snprintf(pairs, sizeof pairs, "%s", mark ? mark + 1 : "");
    int status = 0;
    for (char *at = pairs; *at != '\0' && !status;) {
        char *end = at + strcspn(at, "&");
        char *next = *end == '&' ? end + 1 : end;
        *end = '\0';
        status = read_pair(scheme, at, out_query, out_error);
        at = next;
    }
    return status;
}
