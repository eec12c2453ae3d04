/* SPDX-License-Identifier: MIT */
#include "ports/modbus_server.h"

#include "ports/place.h"
#include "ports/wall_clock.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

/// A host's serial port delivers a frame in lumps some milliseconds apart, so that the standard's 1.75 ms would cut
/// frames in pieces.
enum { host_silence_us = 5000, listen_backlog = 4 };

static void start(struct modbus_server *self, struct modbus_map *map)
{
    memset(self, 0, sizeof *self);
    self->map = map;
    self->listener = self->line = self->commander = -1;
    for (int i = 0; i < modbus_server_clients; i++) {
        self->clients[i].socket = -1;
    }
}

static bool fail(struct modbus_server *self, const char *place, const char *why, char *out_text, size_t text_size)
{
    snprintf(out_text, text_size, "%s: %s", place, why);
    modbus_server_close(self);
    return false;
}

static bool set_nonblocking(int file)
{
    int flags = fcntl(file, F_GETFL);
    return flags >= 0 && fcntl(file, F_SETFL, flags | O_NONBLOCK) == 0;
}

// ---- Opening

static int listen_at(const struct addrinfo *where)
{
    int one = 1;
    int listener = socket(where->ai_family, where->ai_socktype, where->ai_protocol);
    if (listener < 0) {
        return -1;
    }
    setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    if (bind(listener, where->ai_addr, where->ai_addrlen) != 0 || listen(listener, listen_backlog) != 0 ||
        !set_nonblocking(listener)) {
        int reason = errno;
        close(listener);
        errno = reason;
        return -1;
    }
    return listener;
}

static void name_place(struct modbus_server *self, const char *host)
{
    struct sockaddr_storage bound = {0};
    socklen_t size = sizeof bound;
    char service[8] = "?";
    if (getsockname(self->listener, (struct sockaddr *)&bound, &size) == 0) {
        getnameinfo((struct sockaddr *)&bound, size, NULL, 0, service, sizeof service, NI_NUMERICSERV);
    }
    snprintf(self->place, sizeof self->place, "%s:%s", host, service);
}

bool modbus_server_open_tcp(struct modbus_server *self, struct modbus_map *map, const char *place, char *out_text,
                            size_t text_size)
{
    char host[64], service[8];
    long port;
    start(self, map);
    if (!place_split(place, host, sizeof host, &port) || port > 65535) {
        return fail(self, place, "expected HOST:PORT, port 0..65535", out_text, text_size);
    }
    if (host[0] == '\0') {
        snprintf(host, sizeof host, "127.0.0.1");
    }
    snprintf(service, sizeof service, "%u", (unsigned)port & 0xFFFFu);
    struct addrinfo wanted = {.ai_socktype = SOCK_STREAM, .ai_flags = AI_PASSIVE | AI_NUMERICSERV}, *found = NULL;
    int status = getaddrinfo(host, service, &wanted, &found);
    if (status != 0) {
        return fail(self, place, gai_strerror(status), out_text, text_size);
    }
    self->listener = listen_at(found);
    int reason = errno;
    freeaddrinfo(found);
    if (self->listener < 0) {
        return fail(self, place, strerror(reason), out_text, text_size);
    }
    name_place(self, host);
    return true;
}

static speed_t speed_of(long baud)
{
    static const struct {
        long baud;
        speed_t speed;
    } speeds[] = {{1200, B1200},   {2400, B2400},   {4800, B4800},     {9600, B9600},    {19200, B19200},
                  {38400, B38400}, {57600, B57600}, {115200, B115200}, {230400, B230400}};
    for (size_t i = 0; i < sizeof speeds / sizeof speeds[0]; i++) {
        if (speeds[i].baud == baud) {
            return speeds[i].speed;
        }
    }
    return B0;
}

static bool set_up_line(int line, speed_t speed)
{
    struct termios settings;
    if (tcgetattr(line, &settings) != 0) {
        return false;
    }
    settings.c_iflag = 0;
    settings.c_oflag = 0;
    settings.c_lflag = 0;
    settings.c_cflag = CS8 | CREAD | CLOCAL | PARENB;
    settings.c_cc[VMIN] = 0;
    settings.c_cc[VTIME] = 0;
    return cfsetispeed(&settings, speed) == 0 && cfsetospeed(&settings, speed) == 0 &&
           tcsetattr(line, TCSANOW, &settings) == 0 && tcflush(line, TCIOFLUSH) == 0;
}

bool modbus_server_open_rtu(struct modbus_server *self, struct modbus_map *map, const char *place, uint8_t slave,
                            char *out_text, size_t text_size)
{
    char device[80];
    long baud;
    start(self, map);
    if (!place_split(place, device, sizeof device, &baud) || speed_of(baud) == B0) {
        return fail(self, place, "expected DEVICE:BAUD, baud 1200, 2400, 4800 ... 230400", out_text, text_size);
    }
    self->line = open(device, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (self->line < 0 || !set_up_line(self->line, speed_of(baud))) {
        return fail(self, place, errno == ENOTTY ? "is no serial device" : strerror(errno), out_text, text_size);
    }
    struct modbus_rtu_timing timing = modbus_rtu_timing_of((uint32_t)baud);
    timing.t15_us = 0;
    timing.t35_us = timing.t35_us < host_silence_us ? host_silence_us : timing.t35_us;
    modbus_rtu_slave_init(&self->rtu, map, slave, timing);
    snprintf(self->place, sizeof self->place, "%s", place);
    return true;
}

// ---- TCP

static void drop(struct modbus_server *self, int index)
{
    close(self->clients[index].socket);
    self->clients[index].socket = -1;
    if (self->commander == index) {
        self->commander = -1;
    }
}

static void accept_client(struct modbus_server *self)
{
    int one = 1;
    int client = accept(self->listener, NULL, NULL);
    if (client < 0) {
        return;
    }
    for (int i = 0; i < modbus_server_clients; i++) {
        if (self->clients[i].socket < 0 && set_nonblocking(client)) {
            setsockopt(client, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
            self->clients[i].socket = client;
            modbus_tcp_slave_init(&self->clients[i].slave, self->map);
            return;
        }
    }
    self->refused++;
    close(client);
}

/// Whether whoever commands has gone silent while nothing moves.
static bool commander_is_idle(struct modbus_server *self)
{
    struct modbus_report report;
    if (wall_clock_now_s() - self->written_s < modbus_server_idle_s) {
        return false;
    }
    self->map->config.device.report(self->map->config.device.self, &report);
    return report.state == modbus_state_idle || report.state == modbus_state_done || report.state == modbus_state_fault;
}

static bool may_write(struct modbus_server *self, int index)
{
    if (self->commander >= 0 && self->commander != index && commander_is_idle(self)) {
        self->commander = -1;
    }
    return self->commander < 0 || self->commander == index;
}

/// A client that does not take its replies is closed: nobody waits for it.
static bool send_all(int socket, const uint8_t *bytes, uint32_t size)
{
    return send(socket, bytes, size, MSG_NOSIGNAL) == (ssize_t)size;
}

static bool serve_bytes(struct modbus_server *self, int index, const uint8_t *bytes, uint32_t size)
{
    struct modbus_server_client *client = &self->clients[index];
    uint8_t reply[modbus_tcp_frame_max];
    while (size > 0) {
        uint32_t length;
        uint32_t taken = modbus_tcp_slave_take(&client->slave, may_write(self, index), bytes, size, reply, &length);
        if (client->slave.has_written) {
            self->commander = index;
            self->written_s = wall_clock_now_s();
        }
        if (client->slave.broken || (length > 0 && !send_all(client->socket, reply, length))) {
            return false;
        }
        bytes += taken;
        size -= taken;
    }
    return true;
}

static void serve_client(struct modbus_server *self, int index)
{
    uint8_t bytes[1024];
    ssize_t got = recv(self->clients[index].socket, bytes, sizeof bytes, 0);
    bool nothing_yet = got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR);
    if (nothing_yet) {
        return;
    }
    if (got <= 0 || !serve_bytes(self, index, bytes, (uint32_t)got)) {
        drop(self, index);
    }
}

// ---- RTU

static uint64_t now_us(void)
{
    return (uint64_t)(wall_clock_now_s() * 1e6);
}

static void poll_line(struct modbus_server *self)
{
    uint8_t reply[modbus_rtu_frame_max];
    uint32_t length = modbus_rtu_slave_poll(&self->rtu, now_us(), reply);
    for (uint32_t sent = 0; sent < length;) {
        ssize_t wrote = write(self->line, reply + sent, length - sent);
        if (wrote <= 0) {
            return; // the master sees a reply that is cut short
        }
        sent += (uint32_t)wrote;
    }
}

/// `events`: what poll said. An adapter that was pulled out hangs up, and its reads give nothing or fail.
static void serve_line(struct modbus_server *self, short events)
{
    uint8_t bytes[modbus_rtu_frame_max];
    ssize_t got = read(self->line, bytes, sizeof bytes);
    bool failed = got < 0 && errno != EAGAIN && errno != EINTR;
    bool hung_up = got <= 0 && (events & (POLLHUP | POLLERR | POLLNVAL)) != 0;
    self->line_lost = self->line_lost || failed || hung_up;
    poll_line(self);
    uint64_t arrived_us = now_us();
    for (ssize_t i = 0; i < got; i++) {
        modbus_rtu_slave_byte(&self->rtu, bytes[i], arrived_us);
    }
}

// ---- Loop

enum { polled_max = modbus_server_clients + 1 };

/// Who is asked for input; out_clients: index of the client, -1: listener, -2: line.
static nfds_t collect(const struct modbus_server *self, struct pollfd out_files[polled_max],
                      int out_clients[polled_max])
{
    nfds_t count = 0;
    if (self->listener >= 0) {
        out_files[count] = (struct pollfd){.fd = self->listener, .events = POLLIN};
        out_clients[count++] = -1;
    }
    if (self->line >= 0) {
        out_files[count] = (struct pollfd){.fd = self->line, .events = POLLIN};
        out_clients[count++] = -2;
    }
    for (int i = 0; i < modbus_server_clients && self->listener >= 0; i++) {
        if (self->clients[i].socket >= 0) {
            out_files[count] = (struct pollfd){.fd = self->clients[i].socket, .events = POLLIN};
            out_clients[count++] = i;
        }
    }
    return count;
}

static void serve_ready(struct modbus_server *self, const struct pollfd *files, const int *clients, nfds_t count)
{
    for (nfds_t i = 0; i < count; i++) {
        if (files[i].revents == 0) {
            continue;
        }
        if (clients[i] == -1) {
            accept_client(self);
        } else if (clients[i] == -2) {
            serve_line(self, files[i].revents);
        } else {
            serve_client(self, clients[i]);
        }
    }
}

static int wait_ms(const struct modbus_server *self, double seconds)
{
    int ms = seconds > 0.0 ? (int)(seconds * 1e3) : 0;
    bool frame_open = self->line >= 0 && self->rtu.size > 0;
    return frame_open && ms > 1 ? 1 : ms;
}

bool modbus_server_run(struct modbus_server *self, double seconds)
{
    double until_s = wall_clock_now_s() + seconds;
    do {
        struct pollfd files[polled_max];
        int clients[polled_max];
        nfds_t count = collect(self, files, clients);
        int ready = poll(files, count, wait_ms(self, until_s - wall_clock_now_s()));
        if (ready < 0) {
            return errno == EINTR;
        }
        if (ready > 0) {
            serve_ready(self, files, clients, count);
        }
        if (self->line >= 0) {
            poll_line(self);
        }
    } while (!self->line_lost && wall_clock_now_s() < until_s);
    return !self->line_lost;
}

void modbus_server_close(struct modbus_server *self)
{
    for (int i = 0; i < modbus_server_clients; i++) {
        if (self->clients[i].socket >= 0) {
            drop(self, i);
        }
    }
    if (self->listener >= 0) {
        close(self->listener);
    }
    if (self->line >= 0) {
        close(self->line);
    }
    self->listener = self->line = -1;
}
