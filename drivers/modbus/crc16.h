/* SPDX-License-Identifier: MIT */
/// Check sum of a Modbus RTU frame: reflected polynomial 0xA001, start 0xFFFF; sent low byte first.
/// Detects every single and double bit error and every burst of up to 16 bits in a frame of 256 bytes.
#ifndef SERVOSCOPE_DRIVERS_MODBUS_CRC16_H
#define SERVOSCOPE_DRIVERS_MODBUS_CRC16_H

#include <stdint.h>

/// Check value of "123456789" is 0x4B37. Test: tests/unit/test_modbus_slave.c
uint16_t modbus_crc16(const uint8_t *bytes, uint32_t size);

#endif
