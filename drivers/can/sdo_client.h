/* SPDX-License-Identifier: MIT */
/// SDO client (CiA 301): expedited, segmented and block transfers. A pure state machine: it makes request frames and
/// judges answers; waiting and time-outs are its owner's.
/// A transfer: start it, send the frame; then, until the state is no longer sdo_client_waiting, hand frames to
/// sdo_client_take and send what sdo_client_upcoming has. A finished transfer may still have one frame to send.
#ifndef SERVOSCOPE_DRIVERS_CAN_SDO_CLIENT_H
#define SERVOSCOPE_DRIVERS_CAN_SDO_CLIENT_H

#include "drivers/can/can_frame.h"
#include "drivers/can/object_dictionary.h"
#include "drivers/can/sdo_transfer.h"

#include <stdbool.h>
#include <stdint.h>

enum sdo_client_state {
    sdo_client_idle,
    sdo_client_waiting,
    sdo_client_done,
    sdo_client_aborted, ///< by the server, or because its answer was not what was asked for
};

enum sdo_method {
    sdo_expedited, ///< a number, in one frame
    sdo_segmented,
    sdo_block,
};

/// What a transfer waits for.
enum sdo_client_phase {
    sdo_phase_start,    ///< the answer to the first frame
    sdo_phase_segments, ///< an answer to each segment, or segments of a block
    sdo_phase_end,      ///< the end of a block transfer
};

struct sdo_client {
    uint8_t node_id; ///< of the server
    enum sdo_client_state state;
    bool download;
    uint16_t index;
    uint8_t subindex;
    uint8_t size;        ///< bytes wanted of a number; 0 in an upload: take what comes
    uint32_t value;      ///< of a finished expedited upload, raw, `size` bytes
    uint32_t abort_code; ///< of an aborted transfer
    uint32_t unexpected; ///< answers that belong to no request of ours
    enum sdo_method method;
    enum sdo_client_phase phase;
    bool checks_crc;         ///< the server does too
    bool size_said;          ///< by the server, of an upload
    uint32_t announced_size; ///< if so
    uint32_t progress;       ///< frames that brought a transfer forward, ever: a wait starts anew when it changes
    bool has_frame;          ///< `frame` is to be sent
    struct can_frame frame;
    struct sdo_sender sender;
    struct sdo_receiver receiver; ///< after an upload: receiver.size bytes have come
};

/// Starts reading a number; `size` is the type's size, an answer of another size is an error (od_abort_length).
struct can_frame sdo_client_upload(struct sdo_client *self, uint16_t index, uint8_t subindex, uint8_t size);

/// Starts writing the low `size` bytes of `value`.
struct can_frame sdo_client_download(struct sdo_client *self, uint16_t index, uint8_t subindex, uint8_t size,
                                     uint32_t value);

/// Starts reading up to `capacity` bytes into `room`, which must outlive the transfer. A short object may come
/// expedited all the same.
/// Range: method sdo_segmented or sdo_block
struct can_frame sdo_client_upload_data(struct sdo_client *self, enum sdo_method method, uint16_t index,
                                        uint8_t subindex, uint8_t *room, uint32_t capacity);

/// Starts writing `size` bytes, which must stay as they are until the transfer ends.
struct can_frame sdo_client_download_data(struct sdo_client *self, enum sdo_method method, uint16_t index,
                                          uint8_t subindex, const uint8_t *bytes, uint32_t size);

/// Takes a frame; true if it was this server's answer. An answer for another object does not end the transfer.
/// Test: tests/unit/test_sdo.c, tests/unit/test_sdo_long.c (every answer in every phase)
bool sdo_client_take(struct sdo_client *self, const struct can_frame *frame);

/// The next frame to send, if there is one; sdo_client_sent says that it went out.
bool sdo_client_upcoming(const struct sdo_client *self, struct can_frame *out_frame);
void sdo_client_sent(struct sdo_client *self);

/// Half a time-out has passed in silence: answers a half received sub-block, so that its lost end comes again. True if
/// there is now something to send.
bool sdo_client_remind(struct sdo_client *self);

/// Ends a transfer that got no answer in time, and makes the abort frame that tells the server.
struct can_frame sdo_client_give_up(struct sdo_client *self);

#endif
