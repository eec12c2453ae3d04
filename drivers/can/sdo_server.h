/* SPDX-License-Identifier: MIT */
/// SDO server (CiA 301): expedited, segmented and block transfers, both ways, one at a time. No clock: times are
/// arguments. What takes more than one frame to answer (the segments of a block upload) is asked for one by one, so
/// that its owner decides how fast they go out.
/// A request that starts a transfer ends one that was under way; so do an abort, an error and sdo_server_timeout_us
/// without a frame from the client.
#ifndef SERVOSCOPE_DRIVERS_CAN_SDO_SERVER_H
#define SERVOSCOPE_DRIVERS_CAN_SDO_SERVER_H

#include "drivers/can/can_frame.h"
#include "drivers/can/object_dictionary.h"
#include "drivers/can/sdo_transfer.h"

#include <stdbool.h>
#include <stdint.h>

enum { sdo_request_cob_id = 0x600, sdo_response_cob_id = 0x580, sdo_server_timeout_us = 1000000 };

enum sdo_server_state {
    sdo_server_idle,
    sdo_server_segment_download,
    sdo_server_segment_upload,
    sdo_server_block_download,
    sdo_server_block_download_end, ///< every segment is here, the end with its CRC is not
    sdo_server_block_upload_ready, ///< answered, the client has not said start
    sdo_server_block_upload,
    sdo_server_block_upload_end, ///< the end is sent, the client has not confirmed it
};

struct sdo_server {
    uint8_t node_id;
    const struct object_dictionary *dictionary;
    uint32_t malformed; ///< requests that were not eight bytes long: not SDO, not answered
    uint32_t aborts;    ///< requests answered by an abort
    uint32_t timeouts;  ///< transfers that the client left
    enum sdo_server_state state;
    uint16_t index; ///< of the transfer under way
    uint8_t subindex;
    struct od_place place;
    bool checks_crc;         ///< the client does too
    bool size_said;          ///< by the client, with the first frame of a download
    bool reminded;           ///< the end of a half received sub-block has been asked for
    uint32_t announced_size; ///< if so
    uint64_t last_us;        ///< of the last frame of this transfer
    uint8_t number[4];       ///< a number on its way in or out, as it is on the wire
    struct sdo_sender sender;
    struct sdo_receiver receiver;
};

/// Takes a frame; true if there is an answer to send.
/// Errors: a request of other than 8 bytes or a remote frame is counted and not answered; the client's own abort is not
///         answered either.
/// Test:   tests/unit/test_sdo.c (every command byte, every length), tests/unit/test_sdo_long.c (every command byte in
///         every state)
bool sdo_server_take(struct sdo_server *self, const struct can_frame *frame, uint64_t now_us,
                     struct can_frame *out_answer);

/// The next segment of a block upload, if one is due; sdo_server_sent says that it went out.
bool sdo_server_upcoming(const struct sdo_server *self, struct can_frame *out_frame);
void sdo_server_sent(struct sdo_server *self, uint64_t now_us);

/// When sdo_server_advance is due next; CAN_NEVER_US without a transfer.
uint64_t sdo_server_deadline_us(const struct sdo_server *self);

/// Serves what is due by time; true if there is a frame to send: half the time-out into silence the answer to a half
/// received sub-block, at its end the abort.
bool sdo_server_advance(struct sdo_server *self, uint64_t now_us, struct can_frame *out_frame);

#endif
