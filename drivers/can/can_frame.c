/* SPDX-License-Identifier: MIT */
#include "drivers/can/can_frame.h"

struct can_frame can_frame_make(uint16_t id, uint8_t length)
{
    return (struct can_frame){.id = id, .length = length};
}

bool can_frame_is_valid(const struct can_frame *frame)
{
    return frame->id <= can_id_max && frame->length <= can_data_max;
}

void can_put(uint8_t *out_data, uint8_t size, uint32_t value)
{
    for (uint8_t i = 0; i < size; i++)
        out_data[i] = (uint8_t)(value >> (8 * i));
}

uint32_t can_get(const uint8_t *data, uint8_t size)
{
    uint32_t value = 0;
    for (uint8_t i = 0; i < size; i++)
        value |= (uint32_t)data[i] << (8 * i);
    return value;
}

unsigned can_frame_bits_worst(unsigned length)
{
    unsigned n = length > can_data_max ? can_data_max : length;
    return 47 + 8 * n + (34 + 8 * n - 1) / 4;
}

/// The bits of a frame from its start on, as a receiver sees them without stuff bits.
struct bit_stream {
    unsigned run;     ///< equal bits in a row on the wire
    unsigned last;    ///< the bit they are; 2 before the first one
    unsigned stuffed; ///< stuff bits so far
    uint32_t crc;     ///< of what was put, CAN's 15 bits
};

static void stream_wire(struct bit_stream *self, unsigned bit)
{
    self->run = bit == self->last ? self->run + 1 : 1;
    self->last = bit;
    if (self->run == 5) { // the stuff bit is the opposite one and starts a run itself
        self->stuffed++;
        self->last = 1 - bit;
        self->run = 1;
    }
}

static void stream_put(struct bit_stream *self, uint32_t value, unsigned bits)
{
    for (unsigned i = bits; i > 0; i--) {
        unsigned bit = (value >> (i - 1)) & 1u;
        uint32_t feedback = bit ^ ((self->crc >> 14) & 1u);
        self->crc = (self->crc << 1) & 0x7FFFu;
        if (feedback)
            self->crc ^= 0x4599u;
        stream_wire(self, bit);
    }
}

unsigned can_frame_bits_exact(const struct can_frame *frame)
{
    struct bit_stream stream = {.last = 2};
    unsigned length = frame->length > can_data_max ? can_data_max : frame->length;
    unsigned sent = frame->remote ? 0 : length;
    stream_put(&stream, 0, 1); // start of frame
    stream_put(&stream, frame->id, 11);
    stream_put(&stream, frame->remote ? 1 : 0, 1);
    stream_put(&stream, 0, 2); // base format, reserved
    stream_put(&stream, length, 4);
    for (unsigned i = 0; i < sent; i++)
        stream_put(&stream, frame->data[i], 8);
    uint32_t crc = stream.crc;
    for (unsigned i = 15; i > 0; i--)
        stream_wire(&stream, (crc >> (i - 1)) & 1u);
    return 47 + 8 * sent + stream.stuffed;
}
