/* SPDX-License-Identifier: MIT */
/// The two ends of a long SDO transfer (CiA 301), seven bytes a frame, segmented or in blocks: who sends the bytes and
/// who takes them. Client and server use both: a download sends from the client, an upload from the server.
/// Segmented: every segment is answered. Block: up to 127 segments are answered by the number of the last one that came
/// in order; what is missing after it is sent again. No heap, no clock; the bytes are the caller's.
#ifndef SERVOSCOPE_DRIVERS_CAN_SDO_TRANSFER_H
#define SERVOSCOPE_DRIVERS_CAN_SDO_TRANSFER_H

#include <stdbool.h>
#include <stdint.h>

enum {
    sdo_segment_bytes = 7,
    sdo_block_max = 127,  ///< segments that one answer may cover
    sdo_stalled_max = 16, ///< answers in a row that brought nothing forward; one more ends the transfer
};

/// Continues the CRC of block transfers over `count` bytes; start with 0.
/// Equation: CRC-16 with x^16 + x^12 + x^5 + 1, most significant bit first, start 0 ("123456789" gives 31C3)
/// Test:     tests/unit/test_sdo_long.c
uint16_t sdo_crc(uint16_t crc, const uint8_t *bytes, uint32_t count);

struct sdo_sender {
    const uint8_t *bytes; ///< must stay as they are until the transfer ends
    uint32_t size;
    uint32_t base;       ///< first byte that is not acknowledged
    bool toggle;         ///< of the next segment
    uint8_t block_size;  ///< segments of the present sub-block
    uint8_t sent;        ///< of these
    uint8_t stalled;     ///< answers in a row that acknowledged nothing
    bool everything_out; ///< the sub-block has the transfer's last segment and its answer covered it
};

void sdo_sender_start(struct sdo_sender *self, const uint8_t *bytes, uint32_t size);

/// Makes the next segment of a segmented transfer and counts it as taken: command bits toggle, unused bytes and last.
void sdo_sender_segment(struct sdo_sender *self, uint8_t *out_data);

/// Whether every byte has gone out as a segment, segmented transfer.
bool sdo_sender_is_done(const struct sdo_sender *self);

/// Starts sub-blocks of `block_size` segments; false unless it is 1 .. sdo_block_max.
bool sdo_sender_start_block(struct sdo_sender *self, uint8_t block_size);

/// Whether the sub-block has a segment that is not sent yet.
bool sdo_sender_has_segment(const struct sdo_sender *self);

/// Makes that segment; sdo_sender_advance says that it went out.
void sdo_sender_block_segment(const struct sdo_sender *self, uint8_t *out_data);
void sdo_sender_advance(struct sdo_sender *self);

/// Takes the answer to a sub-block: number of the last segment that came in order, size of the next sub-block.
/// Errors: od_abort_sequence (more than were sent), od_abort_block_size, od_abort_timeout (sdo_stalled_max exceeded)
uint32_t sdo_sender_acknowledge(struct sdo_sender *self, uint8_t number, uint8_t block_size);

/// Bytes of the last segment that mean nothing, for the frame that ends a block transfer.
uint8_t sdo_sender_unused(const struct sdo_sender *self);

struct sdo_receiver {
    uint8_t *room;
    uint32_t capacity, size;
    bool toggle;        ///< expected with the next segment
    uint8_t block_size; ///< segments of the present sub-block
    uint8_t received;   ///< of these, in order
    bool begun;         ///< something of this sub-block has come, in order or not
    bool last;          ///< the transfer's last segment has come
    bool held;          ///< `tail` has the last seven bytes: how many of them count is known with the next frame
    uint8_t tail[sdo_segment_bytes];
};

void sdo_receiver_start(struct sdo_receiver *self, uint8_t *room, uint32_t capacity, uint8_t block_size);

/// Takes a segment of a segmented transfer.
/// Errors: od_abort_toggle, od_abort_too_long (does not fit)
uint32_t sdo_receiver_segment(struct sdo_receiver *self, const uint8_t *data);

/// Takes a segment of a sub-block; `out_answer` is true if the sub-block is over and wants its answer. Segments out of
/// order are passed over; the answer has them sent again.
/// Errors: od_abort_too_long
uint32_t sdo_receiver_block_segment(struct sdo_receiver *self, const uint8_t *data, bool *out_answer);

/// Makes the number for the answer and starts the next sub-block.
uint8_t sdo_receiver_acknowledge(struct sdo_receiver *self);

/// Whether a sub-block has begun and not ended: its end was lost, and an answer brings it.
bool sdo_receiver_is_partial(const struct sdo_receiver *self);

/// Ends a block transfer: `unused` bytes of the last segment mean nothing.
/// Errors: od_abort_too_long, od_abort_command (the last segment has not come)
uint32_t sdo_receiver_finish(struct sdo_receiver *self, uint8_t unused);

#endif
