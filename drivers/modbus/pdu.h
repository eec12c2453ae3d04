/* SPDX-License-Identifier: MIT */
/// One request to the register map, without what carries it: functions 03, 04, 06, 16 and 23.
#ifndef SERVOSCOPE_DRIVERS_MODBUS_PDU_H
#define SERVOSCOPE_DRIVERS_MODBUS_PDU_H

#include "drivers/modbus/register_map.h"

enum { modbus_pdu_max = 253 };

enum modbus_function {
    modbus_function_read_holding = 3,
    modbus_function_read_input = 4,
    modbus_function_write_one = 6,
    modbus_function_write_many = 16,
    modbus_function_read_write = 23,
};

/// Answers one request: function code and what follows it, without address and check sum.
/// may_write: false answers everything that writes with exception 06: somebody else commands
/// Range:     any bytes; reads request[0 .. size-1], writes at most modbus_pdu_max bytes to out_reply
/// Returns:   length of the reply, 0 for a request of no bytes
/// Test:      tests/unit/test_modbus_slave.c
uint32_t modbus_pdu_answer(struct modbus_map *map, bool may_write, const uint8_t *request, uint32_t size,
                           uint8_t *out_reply);

/// Whether a request asks to write something.
bool modbus_pdu_writes(const uint8_t *request, uint32_t size);

#endif
