/* SPDX-License-Identifier: MIT */
/* Ways to a line for slcan.c: TCP, serial devices and ptys, on either side. */
#define _GNU_SOURCE
#include "ports/slcan.h"
#include "ports/slcan_line.h"

#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

static const uint64_t connect_timeout_us = 3000000, answer_timeout_us = 300000, quiet_us = 20000;

// ---- The client's greeting

/// Sends a command and waits for its answer; false if it was refused. Silence is taken for consent: not every adapter
/// answers.
static bool command(struct slcan *self, const char *text)
{
    const uint32_t done = self->done, refused = self->counters.refused;
    uint64_t until_us = wall_clock_us(&self->clock) + answer_timeout_us;
    slcan_line_write(self, text, strlen(text));
    while (self->done == done && self->counters.refused == refused && self->status == can_ok &&
           wall_clock_us(&self->clock) < until_us) {
        slcan_line_wait(self, until_us);
        slcan_line_pump(self);
    }
    return self->counters.refused == refused;
}

/// Ends whatever half line the adapter holds, closes its channel, and lets what it still says pass by.
static void quieten(struct slcan *self)
{
    command(self, "\r\r\rC\r");
    uint64_t until_us = wall_clock_us(&self->clock) + quiet_us;
    while (wall_clock_us(&self->clock) < until_us && self->status == can_ok) {
        slcan_line_wait(self, until_us);
        slcan_line_pump(self);
    }
}

static bool open_channel(struct slcan *self, const char *name, uint32_t bitrate, char *out_reason, size_t size)
{
    const char rate[] = {'S', slcan_rate_digit(bitrate), '\r', '\0'};
    const char *wrong = NULL;
    if (rate[1] == '\0') {
        snprintf(out_reason, size,
                 "%s: %lu bit/s is none of the rates of slcan (10, 20, 50, 100, 125, 250, 500, 800 kbit/s, 1 Mbit/s)",
                 name, (unsigned long)bitrate);
        slcan_close(self);
        return false;
    }
    quieten(self);
    if (!command(self, rate)) {
        wrong = "the adapter refuses the bit rate";
    } else if (!command(self, "O\r")) {
        wrong = "the adapter refuses to open its channel";
    } else if (self->status != can_ok) {
        wrong = "the adapter has closed the connection: it may be serving somebody else";
    }
    if (wrong) {
        snprintf(out_reason, size, "%s: %s", name, wrong);
        slcan_close(self);
        return false;
    }
    self->counters = (struct slcan_counters){0};
    self->waiting_count = 0;
    self->channel_open = true;
    return true;
}

// ---- TCP

static struct addrinfo *find_address(const char *host, const char *port, bool passive, char *out_reason, size_t size)
{
    const struct addrinfo hints = {.ai_socktype = SOCK_STREAM, .ai_flags = passive ? AI_PASSIVE : 0};
    struct addrinfo *found = NULL;
    int status = getaddrinfo(host, port, &hints, &found);
    if (status != 0) {
        snprintf(out_reason, size, "%s:%s: %s", host, port, gai_strerror(status));
        return NULL;
    }
    return found;
}

/// Connects within the time-out; errno says why not.
static bool connect_within(struct slcan *self, const struct addrinfo *address)
{
    int error = 0;
    socklen_t length = sizeof error;
    struct pollfd file = {.fd = self->line, .events = POLLOUT};
    if (connect(self->line, address->ai_addr, address->ai_addrlen) == 0) {
        return true;
    }
    if (errno != EINPROGRESS) {
        return false;
    }
    if (wall_clock_wait(&self->clock, &file, 1, wall_clock_us(&self->clock) + connect_timeout_us) == 0) {
        errno = ETIMEDOUT;
        return false;
    }
    getsockopt(self->line, SOL_SOCKET, SO_ERROR, &error, &length);
    errno = error;
    return error == 0;
}

bool slcan_connect_tcp(struct slcan *self, const char *host, const char *port, uint32_t bitrate, char *out_reason,
                       size_t size)
{
    slcan_line_init(self, false);
    self->on_socket = true;
    struct addrinfo *addresses = find_address(host, port, false, out_reason, size);
    if (!addresses) {
        return false;
    }
    int error = 0;
    for (const struct addrinfo *a = addresses; a && self->line < 0; a = a->ai_next) {
        self->line = socket(a->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
        if (self->line < 0 || !connect_within(self, a)) {
            error = errno;
            slcan_close(self);
        }
    }
    freeaddrinfo(addresses);
    char name[160];
    snprintf(name, sizeof name, "%s:%s", host, port);
    if (self->line < 0) {
        snprintf(out_reason, size, "%s: %s", name, strerror(error));
        return false;
    }
    const int on = 1;
    setsockopt(self->line, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    return open_channel(self, name, bitrate, out_reason, size);
}

static int listen_at(const struct addrinfo *address)
{
    const int on = 1;
    int listener = socket(address->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (listener < 0) {
        return -1;
    }
    setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    if (bind(listener, address->ai_addr, address->ai_addrlen) == 0 && listen(listener, 4) == 0) {
        return listener;
    }
    int error = errno;
    close(listener);
    errno = error;
    return -1;
}

bool slcan_listen_tcp(struct slcan *self, const char *host, const char *port, char *out_reason, size_t size)
{
    slcan_line_init(self, true);
    self->on_socket = true;
    struct addrinfo *addresses = find_address(host, port, true, out_reason, size);
    if (!addresses) {
        return false;
    }
    self->listener = listen_at(addresses);
    int error = errno;
    freeaddrinfo(addresses);
    if (self->listener < 0) {
        snprintf(out_reason, size, "%s:%s: %s", host, port, strerror(error));
        return false;
    }
    struct sockaddr_storage bound;
    socklen_t length = sizeof bound;
    char service[8] = "0";
    if (getsockname(self->listener, (struct sockaddr *)&bound, &length) == 0) {
        getnameinfo((struct sockaddr *)&bound, length, NULL, 0, service, sizeof service, NI_NUMERICSERV);
    }
    self->port = (uint16_t)strtoul(service, NULL, 10);
    return true;
}

// ---- Serial

/// Bytes as they are, no flow control; reads return at once.
static bool make_raw(int file)
{
    struct termios settings;
    if (tcgetattr(file, &settings) != 0) {
        return false;
    }
    cfmakeraw(&settings);
    settings.c_cflag |= CLOCAL | CREAD;
    settings.c_cc[VMIN] = 1;
    settings.c_cc[VTIME] = 0;
    // USB adapters ignore the speed; of those with a real line the common ones take 1 Mbaud.
    if (cfsetspeed(&settings, B1000000) != 0) {
        cfsetspeed(&settings, B115200);
    }
    return tcsetattr(file, TCSANOW, &settings) == 0;
}

bool slcan_connect_serial(struct slcan *self, const char *path, uint32_t bitrate, char *out_reason, size_t size)
{
    slcan_line_init(self, false);
    self->line = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (self->line < 0 || !make_raw(self->line)) {
        snprintf(out_reason, size, "%s: %s", path, self->line < 0 ? strerror(errno) : "is no serial device");
        slcan_close(self);
        return false;
    }
    return open_channel(self, path, bitrate, out_reason, size);
}

/// Makes `link` point to the pty. A link that a killed program has left behind is replaced: one to a pty that is gone,
/// or to the number that has just been given to ours.
static bool make_link(const char *pty, const char *link)
{
    static const char ptys[] = "/dev/pts/";
    char target[64];
    if (symlink(pty, link) == 0) {
        return true;
    }
    ssize_t length = errno == EEXIST ? readlink(link, target, sizeof target - 1) : -1;
    if (length < 0) {
        errno = errno == EINVAL ? EEXIST : errno; // there is something, and it is no link
        return false;
    }
    target[length] = '\0';
    bool left_over = strncmp(target, ptys, sizeof ptys - 1) == 0 &&
                     (strcmp(target, pty) == 0 || (access(target, F_OK) != 0 && errno == ENOENT));
    if (!left_over) {
        errno = EEXIST;
        return false;
    }
    return unlink(link) == 0 && symlink(pty, link) == 0;
}

bool slcan_listen_pty(struct slcan *self, const char *link, char *out_reason, size_t size)
{
    slcan_line_init(self, true);
    self->line = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (self->line < 0 || grantpt(self->line) != 0 || unlockpt(self->line) != 0 ||
        ptsname_r(self->line, self->pty_name, sizeof self->pty_name) != 0) {
        snprintf(out_reason, size, "no pty: %s", strerror(errno));
        slcan_close(self);
        return false;
    }
    self->pty_keeper = open(self->pty_name, O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (self->pty_keeper < 0 || !make_raw(self->pty_keeper)) {
        snprintf(out_reason, size, "%s: %s", self->pty_name, strerror(errno));
        slcan_close(self);
        return false;
    }
    if (link && !make_link(self->pty_name, link)) {
        snprintf(out_reason, size, "%s: cannot be made a link to %s: %s", link, self->pty_name, strerror(errno));
        slcan_close(self);
        return false;
    }
    if (link) {
        snprintf(self->link, sizeof self->link, "%s", link);
    }
    return true;
}

void slcan_close(struct slcan *self)
{
    if (!self->adapter && self->channel_open && self->status == can_ok) {
        slcan_line_write(self, "C\r", 2);
    }
    int *const files[] = {&self->line, &self->listener, &self->pty_keeper};
    for (size_t i = 0; i < sizeof files / sizeof files[0]; i++) {
        if (*files[i] >= 0) {
            close(*files[i]);
        }
        *files[i] = -1;
    }
    if (self->link[0] != '\0') {
        unlink(self->link);
    }
    self->link[0] = '\0';
    self->channel_open = false;
}
