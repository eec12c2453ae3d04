/* SPDX-License-Identifier: MIT */
/// SDO server (CiA 301), expedited transfers: up to four bytes in one frame. Every other request is answered by an
/// abort.
#ifndef SERVOSCOPE_DRIVERS_CAN_SDO_SERVER_H
#define SERVOSCOPE_DRIVERS_CAN_SDO_SERVER_H

#include "drivers/can/can_frame.h"
#include "drivers/can/object_dictionary.h"

#include <stdbool.h>
#include <stdint.h>

enum { sdo_request_cob_id = 0x600, sdo_response_cob_id = 0x580 };

struct sdo_server {
    uint8_t node_id;
    const struct object_dictionary *dictionary;
    uint32_t malformed; ///< requests that were not eight bytes long: not SDO, not answered
    uint32_t aborts;    ///< requests answered by an abort
};

/// Takes a frame; true if there is an answer to send.
/// Errors: a request of other than 8 bytes or a remote frame is counted and not answered; the client's own abort is not
///         answered either. Segmented and block requests get od_abort_command.
/// Test:   tests/unit/test_sdo.c (every command byte, every length)
bool sdo_server_take(struct sdo_server *self, const struct can_frame *frame, struct can_frame *out_answer);

#endif
