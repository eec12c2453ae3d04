/* SPDX-License-Identifier: MIT */
/// Serves a register map on a TCP port or a serial line, beside whatever else the caller's loop does.
/// TCP: up to modbus_server_clients connections may read; the first that writes commands until it closes, or until it
/// has written nothing for modbus_server_idle_s and the drive is not under way. Writes of others are refused with
/// exception 06. A name other than a loopback address has to be given on purpose.
#ifndef SERVOSCOPE_PORTS_MODBUS_SERVER_H
#define SERVOSCOPE_PORTS_MODBUS_SERVER_H

#include "drivers/modbus/slave_rtu.h"
#include "drivers/modbus/slave_tcp.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { modbus_server_clients = 4, modbus_server_idle_s = 10 };

struct modbus_server_client {
    int socket; ///< -1: free
    struct modbus_tcp_slave slave;
};

/// Read-only for the application.
struct modbus_server {
    struct modbus_map *map;
    int listener, line; ///< -1: not used
    struct modbus_server_client clients[modbus_server_clients];
    int commander; ///< index of the client that commands, -1: none
    double written_s;
    struct modbus_rtu_slave rtu;
    bool line_lost;
    uint32_t refused; ///< connections beyond modbus_server_clients
    char place[96];   ///< where it listens: "127.0.0.1:1502", "/dev/pts/3:115200"
};

/// Listens on "HOST:PORT"; an empty HOST is 127.0.0.1, port 0 any free one (self->place says which).
/// Errors: false; out_text says why
bool modbus_server_open_tcp(struct modbus_server *self, struct modbus_map *map, const char *place, char *out_text,
                            size_t text_size);

/// Serves "DEVICE:BAUD", 8 bits, even parity, one stop bit, under address `slave`.
bool modbus_server_open_rtu(struct modbus_server *self, struct modbus_map *map, const char *place, uint8_t slave,
                            char *out_text, size_t text_size);

/// Serves requests for about `seconds`; returns sooner if a signal comes.
/// Errors: false: the serial line is gone
bool modbus_server_run(struct modbus_server *self, double seconds);

void modbus_server_close(struct modbus_server *self);

#endif
