/* SPDX-License-Identifier: MIT */
/// A Modbus slave on a pty or a loopback socket, in a thread of its own, that answers rightly but for what a script
/// does to one reply. Its POSITION register counts the requests it has answered, so that each reply is one of a kind.
#ifndef SERVOSCOPE_TESTS_SCRIPTED_SLAVE_H
#define SERVOSCOPE_TESTS_SCRIPTED_SLAVE_H

#include "drivers/modbus/crc16.h"
#include "drivers/modbus/slave_rtu.h"
#include "drivers/modbus/slave_tcp.h"

#include "unity.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

enum slave_fault {
    slave_good,
    slave_exception, ///< with code `number`
    slave_cut,       ///< only the first `number` bytes
    slave_flip,      ///< bit `number` of the reply
    slave_wrong_id,  ///< unit or address of another slave; check sums are right from here on
    slave_wrong_function,
    slave_wrong_count,       ///< says and sends `number` registers more
    slave_wrong_transaction, ///< TCP only
    slave_late,              ///< by `number` ms
    slave_doubled,
    slave_merged, ///< in one piece behind the reply before
    slave_split,  ///< after `number` bytes, with a short gap
    slave_echo,   ///< the request itself comes back first
    slave_silent,
    slave_gone, ///< closes the connection, or the line, for good
};

struct scripted_slave {
    struct modbus_map map;
    uint8_t table[64];
    struct modbus_record snapshot[4];
    struct modbus_rtu_slave rtu;
    struct modbus_tcp_slave tcp;
    bool is_tcp;
    int listener, line, keep_open;
    char place[128]; ///< for modbus_port_open_...
    pthread_t thread;
    atomic_bool stop;
    atomic_int answered;
    atomic_int fault, number, at; ///< which reply (counted from when the script was set) is spoilt; -1: all
    uint8_t before[modbus_tcp_frame_max];
    uint32_t before_size;
};

static void slave_sleep_ms(int ms)
{
    struct timespec time = {ms / 1000, ms % 1000 * 1000000L};
    nanosleep(&time, NULL);
}

static inline void slave_report(const void *object, struct modbus_report *out_report)
{
    const struct scripted_slave *self = object;
    memset(out_report, 0, sizeof *out_report);
    out_report->position = (float)self->answered;
}

static inline void slave_nothing(void *object)
{
    (void)object;
}

static inline enum core_status slave_prepare(void *object, const struct msgen_table *table,
                                             const struct modbus_run_setup *setup)
{
    (void)object, (void)table, (void)setup;
    return core_ok;
}

static inline enum core_status slave_arm(void *object)
{
    (void)object;
    return core_ok;
}

static inline uint32_t slave_spectrum(const void *object, uint32_t period, struct modbus_record *out_records,
                                      uint32_t *out_count)
{
    (void)object, (void)period, (void)out_records;
    *out_count = 0;
    return modbus_spectrum_not_yet;
}

static inline void slave_seal(struct scripted_slave *self, uint8_t *reply, uint32_t *io_size)
{
    if (self->is_tcp) {
        reply[4] = (uint8_t)((*io_size - 6) >> 8);
        reply[5] = (uint8_t)(*io_size - 6);
        return;
    }
    uint16_t crc = modbus_crc16(reply, *io_size - 2);
    reply[*io_size - 2] = (uint8_t)crc;
    reply[*io_size - 1] = (uint8_t)(crc >> 8);
}

/// Changes a reply that keeps its check sum right.
static inline void slave_forge(struct scripted_slave *self, uint8_t *reply, uint32_t *io_size)
{
    uint32_t unit = self->is_tcp ? 6 : 0;
    switch ((int)self->fault) {
    case slave_exception:
        reply[unit + 1] |= 0x80u;
        reply[unit + 2] = (uint8_t)self->number;
        *io_size = self->is_tcp ? 9 : 5;
        break;
    case slave_wrong_id:
        reply[unit] = (uint8_t)(reply[unit] + 1u);
        break;
    case slave_wrong_function:
        reply[unit + 1] = reply[unit + 1] == 3 ? 4 : 3;
        break;
    case slave_wrong_count:
        reply[unit + 2] = (uint8_t)(reply[unit + 2] + 2 * self->number);
        *io_size += (uint32_t)(2 * self->number);
        break;
    case slave_wrong_transaction:
        reply[1] ^= 1u;
        return;
    default:
        return;
    }
    slave_seal(self, reply, io_size);
}

static inline void slave_send(int line, const uint8_t *bytes, uint32_t size)
{
    while (size > 0) {
        ssize_t sent = write(line, bytes, size);
        if (sent <= 0)
            return;
        bytes += sent;
        size -= (uint32_t)sent;
    }
}

static inline void slave_close(struct scripted_slave *self)
{
    if (self->line >= 0)
        close(self->line);
    if (self->keep_open >= 0)
        close(self->keep_open);
    if (self->listener >= 0)
        close(self->listener);
    self->line = self->listener = self->keep_open = -1;
}

static inline void slave_spoil(struct scripted_slave *self, const uint8_t *request, uint32_t request_size,
                               uint8_t *reply, uint32_t size)
{
    uint8_t joined[2 * modbus_tcp_frame_max];
    slave_forge(self, reply, &size);
    uint32_t number = (uint32_t)self->number;
    switch ((int)self->fault) {
    case slave_cut:
        slave_send(self->line, reply, number < size ? number : size);
        return;
    case slave_flip:
        if (number / 8 < size)
            reply[number / 8] ^= (uint8_t)(1u << number % 8);
        break;
    case slave_late:
        slave_sleep_ms(self->number);
        break;
    case slave_doubled:
        slave_send(self->line, reply, size);
        break;
    case slave_merged:
        memcpy(joined, self->before, self->before_size);
        memcpy(joined + self->before_size, reply, size);
        slave_send(self->line, joined, self->before_size + size);
        return;
    case slave_split:
        number = number < size ? number : size;
        slave_send(self->line, reply, number);
        slave_sleep_ms(2);
        slave_send(self->line, reply + number, size - number);
        return;
    case slave_echo:
        slave_send(self->line, request, request_size);
        break;
    case slave_silent:
        return;
    case slave_gone:
        slave_close(self);
        return;
    default:
        break;
    }
    slave_send(self->line, reply, size);
}

static inline void slave_answer(struct scripted_slave *self, const uint8_t *request, uint32_t size)
{
    uint8_t reply[modbus_tcp_frame_max + 16] = {0};
    uint32_t length = 0;
    self->answered++;
    if (self->is_tcp)
        modbus_tcp_slave_take(&self->tcp, true, request, size, reply, &length);
    else
        length = modbus_rtu_slave_frame(&self->rtu, request, size, reply);
    int at = self->at;
    bool spoil = at == 0 || at == -1;
    if (at >= 0)
        self->at = at == 0 ? -2 : at - 1;
    if (length > 0 && spoil)
        slave_spoil(self, request, size, reply, length);
    else if (length > 0)
        slave_send(self->line, reply, length);
    memcpy(self->before, reply, length);
    self->before_size = length;
}

static inline void *slave_run(void *object)
{
    struct scripted_slave *self = object;
    uint8_t bytes[512];
    uint32_t size = 0;
    while (!self->stop) {
        struct pollfd file = {.fd = self->line >= 0 ? self->line : self->listener, .events = POLLIN};
        int ready = file.fd >= 0 ? poll(&file, 1, size > 0 ? 1 : 5) : (slave_sleep_ms(1), 0);
        if (ready > 0 && self->line < 0) {
            self->line = accept(self->listener, NULL, NULL);
            modbus_tcp_slave_init(&self->tcp, &self->map);
            size = 0;
        } else if (ready > 0) {
            ssize_t got = read(self->line, bytes + size, sizeof bytes - size);
            size += got > 0 ? (uint32_t)got : 0;
            if (got <= 0 && self->is_tcp) {
                close(self->line);
                self->line = -1;
            }
        } else if (size > 0) {
            slave_answer(self, bytes, size);
            size = 0;
        }
    }
    return NULL;
}

static inline void slave_open_pty(struct scripted_slave *self)
{
    self->line = posix_openpt(O_RDWR | O_NOCTTY);
    TEST_ASSERT_TRUE(self->line >= 0 && grantpt(self->line) == 0 && unlockpt(self->line) == 0);
    const char *name = ptsname(self->line);
    self->keep_open = open(name, O_RDWR | O_NOCTTY); // or the first close of the other side hangs it up
    struct termios raw;
    TEST_ASSERT_EQUAL_INT(0, tcgetattr(self->keep_open, &raw));
    raw.c_iflag = raw.c_oflag = raw.c_lflag = 0;
    TEST_ASSERT_EQUAL_INT(0, tcsetattr(self->keep_open, TCSANOW, &raw));
    snprintf(self->place, sizeof self->place, "%s:115200", name);
}

static inline void slave_open_socket(struct scripted_slave *self)
{
    struct sockaddr_in where = {.sin_family = AF_INET, .sin_addr = {.s_addr = htonl(INADDR_LOOPBACK)}};
    socklen_t size = sizeof where;
    self->listener = socket(AF_INET, SOCK_STREAM, 0);
    TEST_ASSERT_EQUAL_INT(0, bind(self->listener, (struct sockaddr *)&where, sizeof where));
    TEST_ASSERT_EQUAL_INT(0, listen(self->listener, 4));
    TEST_ASSERT_EQUAL_INT(0, getsockname(self->listener, (struct sockaddr *)&where, &size));
    snprintf(self->place, sizeof self->place, "127.0.0.1:%u", (unsigned)ntohs(where.sin_port));
}

static inline void slave_start(struct scripted_slave *self, bool is_tcp)
{
    memset(self, 0, sizeof *self);
    self->is_tcp = is_tcp;
    self->line = self->listener = self->keep_open = -1;
    const struct modbus_map_config config = {
        .device = {self, slave_prepare, slave_arm, slave_nothing, slave_nothing, slave_nothing, slave_nothing,
                   slave_nothing, slave_report, slave_spectrum},
        .table = self->table,
        .table_bytes = sizeof self->table,
        .snapshot = self->snapshot,
        .bins_max = 4,
    };
    TEST_ASSERT_EQUAL_INT(core_ok, modbus_map_init(&self->map, &config));
    modbus_rtu_slave_init(&self->rtu, &self->map, 1, modbus_rtu_timing_of(115200));
    modbus_tcp_slave_init(&self->tcp, &self->map);
    self->at = -2;
    if (is_tcp)
        slave_open_socket(self);
    else
        slave_open_pty(self);
    TEST_ASSERT_EQUAL_INT(0, pthread_create(&self->thread, NULL, slave_run, self));
}

/// From the next reply on; `at`: which of them, -1 all.
static inline void slave_script(struct scripted_slave *self, enum slave_fault fault, int number, int at)
{
    self->fault = fault;
    self->number = number;
    self->at = at;
}

static inline void slave_end(struct scripted_slave *self)
{
    self->stop = true;
    pthread_join(self->thread, NULL);
    slave_close(self);
}

#endif
