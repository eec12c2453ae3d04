/* SPDX-License-Identifier: MIT */
#include "drivers/modbus/slave_tcp.h"

#include "core/fixed.h"
#include "drivers/modbus/pdu.h"

void modbus_tcp_slave_init(struct modbus_tcp_slave *self, struct modbus_map *map)
{
    static const struct modbus_tcp_slave empty;
    *self = empty;
    self->map = map;
}

/// Transaction, protocol 0, length of unit and PDU: at least one byte of PDU, at most 253.
static bool header_is_sound(const uint8_t *header)
{
    uint32_t length = (uint32_t)header[4] << 8 | header[5];
    return header[2] == 0 && header[3] == 0 && length >= 2u && length <= 1u + modbus_pdu_max;
}

static uint32_t frame_size(const uint8_t *header)
{
    return 6u + ((uint32_t)header[4] << 8 | header[5]);
}

static uint32_t answer(struct modbus_tcp_slave *self, bool may_write, uint8_t *out_reply)
{
    const uint8_t *request = self->frame + modbus_tcp_header;
    uint32_t request_size = self->size - modbus_tcp_header;
    self->has_written = may_write && modbus_pdu_writes(request, request_size);
    uint32_t length = modbus_pdu_answer(self->map, may_write, request, request_size, out_reply + modbus_tcp_header);
    for (uint32_t i = 0; i < modbus_tcp_header; ++i) {
        out_reply[i] = self->frame[i];
    }
    out_reply[4] = (uint8_t)((length + 1u) >> 8);
    out_reply[5] = (uint8_t)((length + 1u) & 0xFFu);
    self->answered = core_count_up(self->answered);
    self->size = 0;
    return modbus_tcp_header + length;
}

uint32_t modbus_tcp_slave_take(struct modbus_tcp_slave *self, bool may_write, const uint8_t *bytes, uint32_t size,
                               uint8_t *out_reply, uint32_t *out_length)
{
    *out_length = 0;
    self->has_written = false;
    uint32_t taken = 0;
    while (taken < size && !self->broken) {
        self->frame[self->size++] = bytes[taken++];
        if (self->size == modbus_tcp_header && !header_is_sound(self->frame)) {
            self->broken = true;
        } else if (self->size > modbus_tcp_header && self->size == frame_size(self->frame)) {
            *out_length = answer(self, may_write, out_reply);
            return taken;
        }
    }
    return self->broken ? size : taken;
}
