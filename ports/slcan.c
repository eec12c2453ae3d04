/* SPDX-License-Identifier: MIT */
#define _GNU_SOURCE
#include "ports/slcan.h"

#include "ports/slcan_line.h"

#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

/// Bytes read at once; the shortest frame line has 6 with its CR.
enum { chunk_bytes = 512, shortest_line = 6 };

void slcan_line_init(struct slcan *self, bool adapter)
{
    memset(self, 0, sizeof *self);
    self->line = self->listener = self->pty_keeper = -1;
    self->adapter = adapter;
    wall_clock_start(&self->clock);
}

// ---- Bytes

/// The other side is gone: an adapter waits for the next one, a client is at its end.
static void drop_line(struct slcan *self)
{
    self->channel_open = false;
    self->unsent_count = 0;
    self->parser = (struct slcan_parser){.length = 0};
    if (self->pty_keeper >= 0) { // the pty stays; what nobody has read is not for the next one
        tcflush(self->pty_keeper, TCIFLUSH);
        return;
    }
    if (self->line >= 0) {
        close(self->line);
    }
    self->line = -1;
    self->status = self->adapter ? can_ok : can_err_gone;
}

static bool would_block(void)
{
    return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR;
}

static void flush(struct slcan *self)
{
    if (self->line < 0 || self->unsent_count == 0) {
        return;
    }
    ssize_t written = self->on_socket ? send(self->line, self->unsent, self->unsent_count, MSG_DONTWAIT | MSG_NOSIGNAL)
                                      : write(self->line, self->unsent, self->unsent_count);
    if (written < 0 && !would_block()) {
        drop_line(self);
        return;
    }
    if (written > 0) {
        self->unsent_count -= (size_t)written;
        memmove(self->unsent, &self->unsent[written], self->unsent_count);
    }
}

bool slcan_line_write(struct slcan *self, const char *text, size_t length)
{
    if (length > slcan_unsent_bytes_max - self->unsent_count) {
        return false;
    }
    memcpy(&self->unsent[self->unsent_count], text, length);
    self->unsent_count += length;
    flush(self);
    return true;
}

static void say(struct slcan *self, const char *answer)
{
    slcan_line_write(self, answer, strlen(answer));
}

// ---- Lines

static void take_frame(struct slcan *self, const struct can_frame *frame)
{
    if (!self->channel_open) {
        if (self->adapter) {
            self->counters.refused++;
            say(self, "\a");
        }
        return; // a client: left over from before
    }
    if (self->adapter) {
        say(self, "z\r");
    }
    bus_watch_frame(&self->watch, frame, wall_clock_us(&self->clock));
    self->waiting[(self->waiting_first + self->waiting_count) % slcan_receive_max] = *frame;
    self->waiting_count++; // read_line reads no more than there is room for
    self->counters.received++;
}

/// A new client begins by closing the channel: what is left over from one that went without a word is not for it.
static void close_channel(struct slcan *self)
{
    if (self->pty_keeper >= 0) {
        tcflush(self->pty_keeper, TCIFLUSH);
    }
    self->unsent_count = 0;
    self->channel_open = false;
}

/// An adapter's answer to a command, as Lawicel's gives it. What would change nothing here (filters, polling) is done;
/// there are no time stamps.
static void obey(struct slcan *self, const char *command)
{
    static const struct {
        const char *command, *answer;
    } questions[] = {{"V", "V1013\r"}, {"N", "NSVSC\r"}, {"F", "F00\r"}, {"Z0", "\r"}, {"", ""}};
    for (size_t i = 0; i < sizeof questions / sizeof questions[0]; i++) {
        if (strcmp(command, questions[i].command) == 0) {
            say(self, questions[i].answer);
            return;
        }
    }
    bool done = strchr("COLMmXWQ", command[0]) != NULL || (strchr("Ss", command[0]) != NULL && !self->channel_open);
    if (command[0] == 'C') {
        close_channel(self);
    }
    self->channel_open = self->channel_open || command[0] == 'O' || command[0] == 'L';
    self->counters.refused += !done;
    say(self, done ? "\r" : "\a");
}

static void take_byte(struct slcan *self, char byte)
{
    struct can_frame frame;
    switch (slcan_parser_take(&self->parser, byte, &frame)) {
    case slcan_more:
        break;
    case slcan_frame:
        take_frame(self, &frame);
        break;
    case slcan_extended:
        self->counters.extended++;
        if (self->adapter) {
            say(self, "Z\r");
        }
        break;
    case slcan_command:
        if (self->adapter) {
            obey(self, self->parser.line);
        } else {
            self->done += self->parser.line[0] == '\0';
        }
        break;
    case slcan_refused:
        self->counters.refused++;
        break;
    case slcan_malformed:
        self->counters.malformed++;
        if (self->adapter) {
            say(self, "\a");
        }
        break;
    }
}

// ---- Pump

static void accept_client(struct slcan *self)
{
    int client = self->listener < 0 ? -1 : accept(self->listener, NULL, NULL);
    if (client < 0) {
        return;
    }
    if (self->line >= 0) { // one commander at a time
        self->counters.turned_away++;
        close(client);
        return;
    }
    const int on = 1;
    setsockopt(client, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    self->counters.clients++;
    self->line = client;
}

/// Reads what is there and what there is room for.
static void read_line(struct slcan *self)
{
    char bytes[chunk_bytes];
    while (self->line >= 0) {
        size_t room = (slcan_receive_max - self->waiting_count) * shortest_line;
        size_t wanted = room < sizeof bytes ? room : sizeof bytes;
        if (wanted == 0) {
            return;
        }
        ssize_t length =
            self->on_socket ? recv(self->line, bytes, wanted, MSG_DONTWAIT) : read(self->line, bytes, wanted);
        if (length == 0 || (length < 0 && !would_block())) {
            drop_line(self);
            return;
        }
        if (length < 0) {
            return;
        }
        for (ssize_t i = 0; i < length; i++) {
            take_byte(self, bytes[i]);
        }
        if ((size_t)length < wanted) {
            return;
        }
    }
}

void slcan_line_pump(struct slcan *self)
{
    accept_client(self);
    flush(self);
    read_line(self);
}

bool slcan_line_wait(struct slcan *self, uint64_t until_us)
{
    struct pollfd files[2];
    size_t count = 0;
    if (self->line >= 0) {
        files[count++] =
            (struct pollfd){.fd = self->line, .events = (short)(POLLIN | (self->unsent_count > 0 ? POLLOUT : 0))};
    }
    if (self->listener >= 0) {
        files[count++] = (struct pollfd){.fd = self->listener, .events = POLLIN};
    }
    return wall_clock_wait(&self->clock, files, count, until_us) > 0;
}

// ---- Port

static enum can_status port_send(void *object, const struct can_frame *frame)
{
    struct slcan *self = object;
    char text[slcan_frame_text_max];
    if (self->status != can_ok || !can_frame_is_valid(frame)) {
        self->counters.unsent++;
        return self->status != can_ok ? self->status : can_err_full;
    }
    if (!self->channel_open) { // an adapter without a client
        return can_ok;
    }
    if (!slcan_line_write(self, text, slcan_format(frame, text))) {
        self->counters.unsent++;
        if (self->pty_keeper >= 0) { // nobody reads the pty any more
            drop_line(self);
        }
        return self->status == can_ok ? can_err_full : self->status;
    }
    bus_watch_frame(&self->watch, frame, wall_clock_us(&self->clock));
    self->counters.sent++;
    return self->status;
}

static bool port_receive(void *object, struct can_frame *out_frame)
{
    struct slcan *self = object;
    if (self->waiting_count == 0) {
        slcan_line_pump(self);
    }
    if (self->waiting_count == 0) {
        return false;
    }
    *out_frame = self->waiting[self->waiting_first];
    self->waiting_first = (self->waiting_first + 1) % slcan_receive_max;
    self->waiting_count--;
    return true;
}

static uint64_t port_time_us(const void *object)
{
    const struct slcan *self = object;
    return wall_clock_us(&self->clock);
}

static enum can_status port_wait(void *object, uint64_t until_us)
{
    struct slcan *self = object;
    slcan_line_pump(self);
    while (self->waiting_count == 0 && port_time_us(self) < until_us && slcan_line_wait(self, until_us)) {
        slcan_line_pump(self);
    }
    return self->status;
}

static const struct can_port_operations operations = {port_send, port_receive, port_wait, port_time_us};

struct can_port slcan_port(struct slcan *self)
{
    return (struct can_port){.operations = &operations, .self = self};
}
