/* SPDX-License-Identifier: MIT */
#define _GNU_SOURCE
#include "ports/modbus_host.h"

#include "ports/place.h"

#include <errno.h>
#include <modbus.h>
#include <netdb.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>

enum {
    default_response_ms = 1000,
    default_gap_ms = 50,
    frame_bytes_max = 260,
    settle_rounds = 3, ///< a line that is not silent after that many silences is given up
};

struct modbus_port {
    modbus_t *context;
    struct modbus_port_options options;
    bool tcp, lost;
    char name[128];
};

static void sleep_ms(uint32_t ms)
{
    struct timespec left = {(time_t)(ms / 1000u), (long)(ms % 1000u) * 1000000L};
    while (nanosleep(&left, &left) == -1 && errno == EINTR) {
    }
}

/// What libmodbus's errno means. Its own errors lie from MODBUS_ENOBASE on, exception codes first.
static int link_status(struct modbus_port *self)
{
    int code = errno - MODBUS_ENOBASE;
    if (code >= 1 && code < MODBUS_EXCEPTION_MAX) {
        return code;
    }
    if (code >= 0) {
        return modbus_link_damaged; // check sum, slave, function, count, or an exception that does not exist
    }
    if (errno == ETIMEDOUT || errno == EINTR) {
        return modbus_link_timeout;
    }
    self->lost = true;
    return modbus_link_lost;
}

/// A request on a line that has failed before would meet the rest of the last reply: settle has to come first.
static int outcome(struct modbus_port *self, int done, uint32_t count)
{
    if (done == (int)count) {
        return modbus_link_ok;
    }
    return done >= 0 ? modbus_link_damaged : link_status(self);
}

static int read_words(void *object, uint32_t address, uint32_t count, uint16_t *out_words)
{
    struct modbus_port *self = object;
    if (self->lost) {
        return modbus_link_lost;
    }
    return outcome(self, modbus_read_registers(self->context, (int)address, (int)count, out_words), count);
}

static int write_words(void *object, uint32_t address, uint32_t count, const uint16_t *words)
{
    struct modbus_port *self = object;
    if (self->lost) {
        return modbus_link_lost;
    }
    return outcome(self, modbus_write_registers(self->context, (int)address, (int)count, words), count);
}

static int exchange(void *object, uint32_t write_address, uint32_t write_count, const uint16_t *words,
                    uint32_t read_address, uint32_t read_count, uint16_t *out_words)
{
    struct modbus_port *self = object;
    if (self->lost) {
        return modbus_link_lost;
    }
    int done = modbus_write_and_read_registers(self->context, (int)write_address, (int)write_count, words,
                                               (int)read_address, (int)read_count, out_words);
    return outcome(self, done, read_count);
}

/// A new connection cannot hold an old reply.
static int reconnect(struct modbus_port *self)
{
    modbus_close(self->context);
    self->lost = modbus_connect(self->context) == -1;
    return self->lost ? modbus_link_lost : modbus_link_ok;
}

static int settle(void *object)
{
    struct modbus_port *self = object;
    if (self->tcp) {
        return reconnect(self);
    }
    struct pollfd line = {.fd = modbus_get_socket(self->context), .events = POLLIN};
    for (int round = 0; round < settle_rounds && !self->lost; ++round) {
        line.revents = 0;
        int ready = poll(&line, 1, (int)self->options.silence_ms);
        if (ready == 0) {
            return modbus_link_ok;
        }
        if (ready < 0 && errno == EINTR) {
            continue;
        }
        self->lost = ready < 0 || (line.revents & (POLLERR | POLLHUP | POLLNVAL)) != 0;
        if (!self->lost) {
            sleep_ms(self->options.gap_ms); // the rest of it
            modbus_flush(self->context);
        }
    }
    return self->lost ? modbus_link_lost : modbus_link_timeout;
}

static void wait(void *object, uint32_t ms)
{
    (void)object;
    sleep_ms(ms);
}

static const char *name(const void *object)
{
    const struct modbus_port *self = object;
    return self->name;
}

struct modbus_link modbus_port_link(struct modbus_port *self)
{
    const struct modbus_link link = {self, read_words, write_words, exchange, settle, wait, name};
    return link;
}

uint32_t modbus_port_bound_ms(const struct modbus_port *self)
{
    const struct modbus_port_options *o = &self->options;
    uint32_t settle_ms = self->tcp ? o->response_ms : settle_rounds * (o->silence_ms + o->gap_ms);
    return o->response_ms + frame_bytes_max * o->gap_ms + settle_ms;
}

static struct modbus_port *fail(struct modbus_port *self, char *out_text, size_t text_size, const char *place,
                                const char *why)
{
    snprintf(out_text, text_size, "%s: %s", place, why);
    modbus_port_close(self);
    return NULL;
}

static struct modbus_port *finish_open(struct modbus_port *self, const char *place,
                                       const struct modbus_port_options *options, char *out_text, size_t text_size)
{
    struct modbus_port_options *o = &self->options;
    *o = options ? *options : (struct modbus_port_options){0};
    o->response_ms = o->response_ms ? o->response_ms : default_response_ms;
    o->gap_ms = o->gap_ms ? o->gap_ms : default_gap_ms;
    o->silence_ms = o->silence_ms ? o->silence_ms : o->response_ms;
    o->slave = o->slave ? o->slave : 1;
    snprintf(self->name, sizeof self->name, "%s", place);
    modbus_set_slave(self->context, o->slave);
    modbus_set_response_timeout(self->context, o->response_ms / 1000u, o->response_ms % 1000u * 1000u);
    modbus_set_byte_timeout(self->context, o->gap_ms / 1000u, o->gap_ms % 1000u * 1000u);
    // Recovery is ours (settle): the library's may repeat a request or wait without end.
    modbus_set_error_recovery(self->context, MODBUS_ERROR_RECOVERY_NONE);
    if (modbus_connect(self->context) == -1) {
        return fail(self, out_text, text_size, place, errno == ENOTTY ? "is no serial device" : modbus_strerror(errno));
    }
    if (!self->tcp) {
        modbus_flush(self->context);
    }
    return self;
}

struct modbus_port *modbus_port_open_tcp(const char *place, const struct modbus_port_options *options, char *out_text,
                                         size_t text_size)
{
    char host[64];
    long port;
    if (!place_split(place, host, sizeof host, &port) || port < 1 || port > 65535) {
        snprintf(out_text, text_size, "'%s': expected HOST:PORT, port 1..65535", place);
        return NULL;
    }
    char service[8];
    snprintf(service, sizeof service, "%u", (unsigned)port & 0xFFFFu);
    // The library calls a name that nobody knows a refused connection.
    const struct addrinfo wanted = {.ai_socktype = SOCK_STREAM};
    struct addrinfo *found = NULL;
    const int resolved = getaddrinfo(host, service, &wanted, &found);
    if (resolved != 0) {
        snprintf(out_text, text_size, "%s: %s", place, gai_strerror(resolved));
        return NULL;
    }
    freeaddrinfo(found);
    struct modbus_port *self = calloc(1, sizeof *self);
    if (self) {
        self->tcp = true;
        self->context = modbus_new_tcp_pi(host, service);
    }
    if (!self || !self->context) {
        return fail(self, out_text, text_size, place, "memory is short");
    }
    return finish_open(self, place, options, out_text, text_size);
}

struct modbus_port *modbus_port_open_rtu(const char *place, const struct modbus_port_options *options, char *out_text,
                                         size_t text_size)
{
    char device[96];
    long baud;
    if (!place_split(place, device, sizeof device, &baud) || baud < 1200 || baud > 4000000) {
        snprintf(out_text, text_size, "'%s': expected DEVICE:BAUD, baud 1200..4000000", place);
        return NULL;
    }
    struct modbus_port *self = calloc(1, sizeof *self);
    if (self) {
        self->context = modbus_new_rtu(device, (int)baud, 'E', 8, 1);
    }
    if (!self || !self->context) {
        return fail(self, out_text, text_size, place, "memory is short");
    }
    return finish_open(self, place, options, out_text, text_size);
}

void modbus_port_close(struct modbus_port *self)
{
    if (self && self->context) {
        modbus_close(self->context);
        modbus_free(self->context);
    }
    free(self);
}
