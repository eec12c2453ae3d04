/* SPDX-License-Identifier: MIT */
#include "drivers/modbus/slave_rtu.h"

#include "core/fixed.h"
#include "drivers/modbus/crc16.h"
#include "drivers/modbus/pdu.h"

struct modbus_rtu_timing modbus_rtu_timing_of(uint32_t bits_per_s)
{
    struct modbus_rtu_timing timing = {750, 1750};
    if (bits_per_s >= 1 && bits_per_s <= 19200) {
        timing.t15_us = 16500000u / bits_per_s;
        timing.t35_us = 38500000u / bits_per_s;
    }
    return timing;
}

void modbus_rtu_slave_init(struct modbus_rtu_slave *self, struct modbus_map *map, uint8_t address,
                           struct modbus_rtu_timing timing)
{
    static const struct modbus_rtu_slave empty;
    *self = empty;
    self->map = map;
    self->address = address;
    self->timing = timing;
}

static void begin_frame(struct modbus_rtu_slave *self)
{
    self->size = 0;
    self->spoiled = false;
}

void modbus_rtu_slave_byte(struct modbus_rtu_slave *self, uint8_t byte, uint64_t now_us)
{
    uint64_t silence_us = now_us - self->last_us;
    if (self->size > 0 && silence_us >= self->timing.t35_us) {
        self->count.spoiled = core_count_up(self->count.spoiled);
        begin_frame(self);
    } else if (self->size > 0 && self->timing.t15_us != 0 && silence_us > self->timing.t15_us) {
        self->spoiled = true;
    }
    self->last_us = now_us;
    if (self->size == modbus_rtu_frame_max) {
        self->spoiled = true;
        return;
    }
    self->frame[self->size++] = byte;
}

uint32_t modbus_rtu_slave_frame(struct modbus_rtu_slave *self, const uint8_t *frame, uint32_t size, uint8_t *out_reply)
{
    if (size < modbus_rtu_frame_least || size > modbus_rtu_frame_max) {
        self->count.spoiled = core_count_up(self->count.spoiled);
        return 0;
    }
    uint32_t received = frame[size - 2u] | (uint32_t)frame[size - 1u] << 8;
    if (received != modbus_crc16(frame, size - 2u)) {
        self->count.bad_crc = core_count_up(self->count.bad_crc);
        return 0;
    }
    if (frame[0] != self->address) {
        self->count.foreign = core_count_up(self->count.foreign);
        return 0;
    }
    self->count.answered = core_count_up(self->count.answered);
    uint32_t length = 1u + modbus_pdu_answer(self->map, true, frame + 1, size - 3u, out_reply + 1);
    out_reply[0] = self->address;
    uint32_t crc = modbus_crc16(out_reply, length);
    out_reply[length] = (uint8_t)(crc & 0xFFu);
    out_reply[length + 1u] = (uint8_t)(crc >> 8);
    return length + 2u;
}

uint32_t modbus_rtu_slave_poll(struct modbus_rtu_slave *self, uint64_t now_us, uint8_t *out_reply)
{
    if (self->size == 0 || now_us - self->last_us < self->timing.t35_us) {
        return 0;
    }
    uint32_t length = 0;
    if (self->spoiled) {
        self->count.spoiled = core_count_up(self->count.spoiled);
    } else {
        length = modbus_rtu_slave_frame(self, self->frame, self->size, out_reply);
    }
    begin_frame(self);
    return length;
}
