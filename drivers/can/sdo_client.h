/* SPDX-License-Identifier: MIT */
/// SDO client (CiA 301), expedited transfers. A pure state machine: it makes request frames and judges answers; waiting
/// and time-outs are its owner's.
#ifndef SERVOSCOPE_DRIVERS_CAN_SDO_CLIENT_H
#define SERVOSCOPE_DRIVERS_CAN_SDO_CLIENT_H

#include "drivers/can/can_frame.h"
#include "drivers/can/object_dictionary.h"

#include <stdbool.h>
#include <stdint.h>

enum sdo_client_state {
    sdo_client_idle,
    sdo_client_waiting,
    sdo_client_done,
    sdo_client_aborted, ///< by the server, or because its answer was not what was asked for
};

struct sdo_client {
    uint8_t node_id; ///< of the server
    enum sdo_client_state state;
    bool download;
    uint16_t index;
    uint8_t subindex;
    uint8_t size;        ///< bytes wanted; 0 in an upload: take what comes
    uint32_t value;      ///< of a finished upload, raw, `size` bytes
    uint32_t abort_code; ///< of an aborted transfer
    uint32_t unexpected; ///< answers that belong to no request of ours
};

/// Starts reading; `size` is the type's size, an answer of another size is an error (od_abort_length).
struct can_frame sdo_client_upload(struct sdo_client *self, uint16_t index, uint8_t subindex, uint8_t size);

/// Starts writing the low `size` bytes of `value`.
struct can_frame sdo_client_download(struct sdo_client *self, uint16_t index, uint8_t subindex, uint8_t size,
                                     uint32_t value);

/// Takes a frame; true if it was this server's answer. An answer for another object does not end the transfer.
bool sdo_client_take(struct sdo_client *self, const struct can_frame *frame);

/// Ends a transfer that got no answer in time, and makes the abort frame that tells the server.
struct can_frame sdo_client_give_up(struct sdo_client *self);

#endif
