/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/can_bus.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char slcan_scheme[] = "slcan:", connect_scheme[] = "slcan-connect:";

/// What follows a scheme in a name, or NULL if it has another one.
static const char *behind(const char *scheme, const char *name)
{
    size_t length = strlen(scheme);
    return strncmp(name, scheme, length) == 0 ? name + length : NULL;
}

/// The resolver takes 70000 for 4464.
static bool is_port(const char *text, long lowest)
{
    const size_t digits_max = 5, digits = strspn(text, "0123456789");
    long number = digits > 0 && digits <= digits_max && text[digits] == '\0' ? strtol(text, NULL, 10) : -1;
    return number >= lowest && number <= 65535;
}

/// HOST:PORT, [V6]:PORT or PORT alone into its parts; false if there is no port, or none from `port_lowest` to 65535.
static bool split_address(const char *text, long port_lowest, char *out_host, size_t size, const char **out_port)
{
    const char *colon = strrchr(text, ':');
    const char *end = colon ? colon : text;
    *out_port = colon ? colon + 1 : text;
    if (!is_port(*out_port, port_lowest)) {
        return false;
    }
    const bool bracketed = colon && text[0] == '[' && colon > text && colon[-1] == ']';
    int length = (int)(end - text) - (bracketed ? 2 : 0);
    snprintf(out_host, size, "%.*s", length, bracketed ? text + 1 : text);
    if (length == 0) { // nobody else unless told otherwise
        snprintf(out_host, size, "127.0.0.1");
    }
    return (size_t)length < size;
}

static int open_slcan(struct can_bus *self, const char *address, const char *option, bool serves, uint32_t bitrate,
                      struct error *out_error)
{
    char host[128], reason[300] = "";
    const char *port;
    bool done;
    const long port_lowest = serves ? 0 : 1; // 0: a free one
    self->is_slcan = true;
    if (address[0] == '/') {
        done = serves ? slcan_listen_pty(&self->slcan, address, reason, sizeof reason)
                      : slcan_connect_serial(&self->slcan, address, bitrate, reason, sizeof reason);
    } else if (split_address(address, port_lowest, host, sizeof host, &port)) {
        done = serves ? slcan_listen_tcp(&self->slcan, host, port, reason, sizeof reason)
                      : slcan_connect_tcp(&self->slcan, host, port, bitrate, reason, sizeof reason);
    } else {
        return error_set(out_error, error_usage,
                         "%s: 'slcan:%s', expected slcan:HOST:PORT (port %ld..65535) or slcan:/PATH of a serial device",
                         option, address, port_lowest);
    }
    return done ? 0 : error_set(out_error, error_refused, "%s: slcan:%s", option, reason);
}

int can_bus_open(struct can_bus *self, const char *name, const char *option, enum can_bus_side side, uint8_t node_id,
                 uint32_t bitrate, struct error *out_error)
{
    memset(self, 0, sizeof *self);
    const char *slcan = behind(slcan_scheme, name), *adapter = behind(connect_scheme, name);
    if (slcan) {
        return open_slcan(self, slcan, option, side == can_bus_drive, bitrate, out_error);
    }
    if (adapter && side == can_bus_drive) {
        return open_slcan(self, adapter, option, false, bitrate, out_error);
    }
    if (*name == '\0' || strpbrk(name, ":/?")) {
        return error_set(out_error, error_usage, "%s: '%s', expected a CAN interface, slcan:HOST:PORT or slcan:/PATH",
                         option, name);
    }
    char reason[200];
    if (socketcan_open(&self->socketcan, name, side == can_bus_master ? node_id : 0, reason, sizeof reason)) {
        return 0;
    }
    return error_set(out_error, error_refused, "%s: %s", option, reason);
}

struct can_port can_bus_port(struct can_bus *self)
{
    return self->is_slcan ? slcan_port(&self->slcan) : socketcan_port(&self->socketcan);
}

struct bus_watch *can_bus_watch(struct can_bus *self)
{
    return self->is_slcan ? &self->slcan.watch : &self->socketcan.watch;
}

struct can_bus_statistics can_bus_read_statistics(const struct can_bus *self)
{
    if (self->is_slcan) {
        const struct slcan_counters *c = &self->slcan.counters;
        return (struct can_bus_statistics){
            .sent = c->sent,
            .received = c->received,
            .unsent = c->unsent,
            .error_frames = c->malformed,
            .clients = c->clients,
            .turned_away = c->turned_away,
        };
    }
    const struct socketcan_counters *c = &self->socketcan.counters;
    return (struct can_bus_statistics){
        .sent = c->sent,
        .received = c->received,
        .unsent = c->unsent,
        .overflowed = c->overflowed,
        .error_frames = c->error_frames,
        .bus_offs = c->bus_offs,
    };
}

void can_bus_describe(const struct can_bus *self, const char *name, char *out_text, size_t size)
{
    if (!self->is_slcan) {
        snprintf(out_text, size, "CAN interface %s", name);
    } else if (self->slcan.pty_keeper >= 0) {
        snprintf(out_text, size, "slcan at %s (%s)", name + sizeof slcan_scheme - 1, self->slcan.pty_name);
    } else if (self->slcan.listener >= 0) {
        snprintf(out_text, size, "slcan, TCP port %u", self->slcan.port);
    } else {
        snprintf(out_text, size, "%s", name);
    }
}

void can_bus_close(struct can_bus *self)
{
    if (self->is_slcan) {
        slcan_close(&self->slcan);
    } else {
        socketcan_close(&self->socketcan);
    }
}
