/* SPDX-License-Identifier: MIT */
/// Modbus on the host, TCP and RTU, as drivers/modbus/link.h: the one file that knows libmodbus.
/// Nothing waits for ever: an exchange takes at most the response time plus the time of 260 bytes with a gap before
/// each, a settle at most settle_ms (TCP: one connection attempt).
#ifndef SERVOSCOPE_PORTS_MODBUS_HOST_H
#define SERVOSCOPE_PORTS_MODBUS_HOST_H

#include "drivers/modbus/link.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct modbus_port_options {
    uint32_t response_ms; ///< 0: 1000
    uint32_t gap_ms;      ///< longest gap inside a reply; 0: 50
    uint32_t silence_ms;  ///< RTU: how long a line has to be silent to be settled; 0: response_ms
    uint8_t slave;        ///< address, 0: 1
};

struct modbus_port;

/// Opens tcp: "HOST:PORT" or rtu: "DEVICE:BAUD" (8 bits, even parity, one stop bit).
/// Errors: NULL; out_text says why, with what was expected
struct modbus_port *modbus_port_open_tcp(const char *place, const struct modbus_port_options *options, char *out_text,
                                         size_t text_size);
struct modbus_port *modbus_port_open_rtu(const char *place, const struct modbus_port_options *options, char *out_text,
                                         size_t text_size);

struct modbus_link modbus_port_link(struct modbus_port *self);

/// Longest time that one request can take, settling included, ms.
uint32_t modbus_port_bound_ms(const struct modbus_port *self);

/// NULL is allowed.
void modbus_port_close(struct modbus_port *self);

#endif
