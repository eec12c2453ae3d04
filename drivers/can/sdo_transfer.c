/* SPDX-License-Identifier: MIT */
#include "drivers/can/sdo_transfer.h"

#include "drivers/can/object_dictionary.h"

#include <string.h>

enum { block_last = 0x80, block_number = 0x7F };

uint16_t sdo_crc(uint16_t crc, const uint8_t *bytes, uint32_t count)
{
    // Half a byte at a time: 32 bytes of table, an eighth of the steps.
    static const uint16_t table[16] = {0x0000, 0x1021, 0x2042, 0x3063, 0x4084, 0x50A5, 0x60C6, 0x70E7,
                                       0x8108, 0x9129, 0xA14A, 0xB16B, 0xC18C, 0xD1AD, 0xE1CE, 0xF1EF};
    for (uint32_t i = 0; i < count; i++) {
        crc = (uint16_t)((crc << 4) ^ table[(crc >> 12) ^ (bytes[i] >> 4)]);
        crc = (uint16_t)((crc << 4) ^ table[(crc >> 12) ^ (bytes[i] & 0x0F)]);
    }
    return crc;
}

// ---- Sender

void sdo_sender_start(struct sdo_sender *self, const uint8_t *bytes, uint32_t size)
{
    *self = (struct sdo_sender){.bytes = bytes, .size = size};
}

/// Copies the segment that starts at byte `at`, zeros behind the end; returns how many bytes of it count.
static uint32_t copy_segment(const struct sdo_sender *self, uint32_t at, uint8_t *out_bytes)
{
    uint32_t left = self->size - at;
    uint32_t count = left < sdo_segment_bytes ? left : sdo_segment_bytes;
    memset(out_bytes, 0, sdo_segment_bytes);
    if (count > 0)
        memcpy(out_bytes, self->bytes + at, count);
    return count;
}

void sdo_sender_segment(struct sdo_sender *self, uint8_t *out_data)
{
    uint32_t count = copy_segment(self, self->base, &out_data[1]);
    self->base += count;
    self->everything_out = self->base == self->size;
    out_data[0] = (uint8_t)((self->toggle ? 0x10u : 0u) | ((sdo_segment_bytes - count) << 1) | self->everything_out);
    self->toggle = !self->toggle;
}

bool sdo_sender_is_done(const struct sdo_sender *self)
{
    return self->everything_out;
}

/// Segments that the bytes from `base` on take; nothing at all still takes one.
static uint32_t segments_left(const struct sdo_sender *self)
{
    uint32_t left = self->size - self->base;
    if (left == 0)
        return self->base == 0 ? 1 : 0;
    return left / sdo_segment_bytes + (left % sdo_segment_bytes != 0);
}

bool sdo_sender_start_block(struct sdo_sender *self, uint8_t block_size)
{
    if (!(block_size >= 1 && block_size <= sdo_block_max))
        return false;
    uint32_t left = segments_left(self);
    self->block_size = left < block_size ? (uint8_t)left : block_size;
    self->sent = 0;
    return true;
}

bool sdo_sender_has_segment(const struct sdo_sender *self)
{
    return self->sent < self->block_size;
}

void sdo_sender_block_segment(const struct sdo_sender *self, uint8_t *out_data)
{
    // base + 7 x sent < size < 2^32: a segment that is still to be sent starts inside the bytes (or there are none).
    copy_segment(self, self->base + (uint32_t)self->sent * sdo_segment_bytes, &out_data[1]);
    bool last = (uint32_t)self->sent + 1 == segments_left(self);
    out_data[0] = (uint8_t)((self->sent + 1) | (last ? block_last : 0));
}

void sdo_sender_advance(struct sdo_sender *self)
{
    self->sent++;
}

uint32_t sdo_sender_acknowledge(struct sdo_sender *self, uint8_t number, uint8_t block_size)
{
    if (number > self->sent)
        return od_abort_sequence;
    self->stalled = number == 0 ? (uint8_t)(self->stalled + 1) : 0;
    if (self->stalled > sdo_stalled_max)
        return od_abort_timeout;
    self->everything_out = number == segments_left(self);
    if (self->everything_out) {
        self->base = self->size;
        self->block_size = self->sent = 0;
        return od_abort_none;
    }
    self->base += (uint32_t)number * sdo_segment_bytes;
    return sdo_sender_start_block(self, block_size) ? od_abort_none : od_abort_block_size;
}

uint8_t sdo_sender_unused(const struct sdo_sender *self)
{
    if (self->size == 0)
        return sdo_segment_bytes;
    return (uint8_t)((sdo_segment_bytes - self->size % sdo_segment_bytes) % sdo_segment_bytes);
}

// ---- Receiver

void sdo_receiver_start(struct sdo_receiver *self, uint8_t *room, uint32_t capacity, uint8_t block_size)
{
    *self = (struct sdo_receiver){.room = room, .capacity = capacity, .block_size = block_size};
}

static uint32_t append(struct sdo_receiver *self, const uint8_t *bytes, uint32_t count)
{
    if (count > self->capacity - self->size) // size <= capacity always
        return od_abort_too_long;
    if (count > 0)
        memcpy(self->room + self->size, bytes, count);
    self->size += count;
    return od_abort_none;
}

uint32_t sdo_receiver_segment(struct sdo_receiver *self, const uint8_t *data)
{
    bool toggle = (data[0] & 0x10) != 0;
    if (toggle != self->toggle)
        return od_abort_toggle;
    self->toggle = !self->toggle;
    self->last = data[0] & 1;
    return append(self, &data[1], sdo_segment_bytes - ((data[0] >> 1) & 7u));
}

uint32_t sdo_receiver_block_segment(struct sdo_receiver *self, const uint8_t *data, bool *out_answer)
{
    uint8_t number = data[0] & block_number;
    bool last = (data[0] & block_last) != 0;
    uint32_t abort_code = od_abort_none;
    if (number == self->received + 1 && !self->last) {
        if (self->held)
            abort_code = append(self, self->tail, sdo_segment_bytes);
        memcpy(self->tail, &data[1], sdo_segment_bytes);
        self->held = true;
        self->last = last;
        self->received++;
    }
    bool end = last || number == self->block_size;
    self->begun = self->begun || self->received > 0 || !end;
    // An end without a beginning is the last sub-block's end once more: answered, it would be taken for this one's.
    *out_answer = end && self->begun;
    return abort_code;
}

uint8_t sdo_receiver_acknowledge(struct sdo_receiver *self)
{
    uint8_t number = self->received;
    self->received = 0;
    self->begun = false;
    return number;
}

bool sdo_receiver_is_partial(const struct sdo_receiver *self)
{
    return self->begun;
}

uint32_t sdo_receiver_finish(struct sdo_receiver *self, uint8_t unused)
{
    if (!self->last || !self->held || unused > sdo_segment_bytes)
        return od_abort_command;
    self->held = false;
    return append(self, self->tail, (uint32_t)sdo_segment_bytes - unused);
}
