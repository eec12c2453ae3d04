/* SPDX-License-Identifier: MIT */
#include "drivers/modbus/crc16.h"

uint16_t modbus_crc16(const uint8_t *bytes, uint32_t size)
{
    uint32_t crc = 0xFFFFu;
    for (uint32_t i = 0; i < size; ++i) {
        crc ^= bytes[i];
        for (unsigned bit = 0; bit < 8; ++bit) {
            crc = (crc & 1u) ? crc >> 1 ^ 0xA001u : crc >> 1;
        }
    }
    return (uint16_t)crc;
}
