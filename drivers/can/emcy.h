/* SPDX-License-Identifier: MIT */
/// Emergency messages (CiA 301): what went wrong in a node, once, when it happens.
#ifndef SERVOSCOPE_DRIVERS_CAN_EMCY_H
#define SERVOSCOPE_DRIVERS_CAN_EMCY_H

#include "drivers/can/can_frame.h"

#include <stdbool.h>
#include <stdint.h>

enum { emcy_cob_id = 0x080, emcy_history_max = 8 };

/// Error codes used here (CiA 301 and CiA 402).
enum emcy_code {
    emcy_no_error = 0x0000,
    emcy_parameter = 0x6320,
    emcy_motor_blocked = 0x7121,
    emcy_encoder = 0x7305,
    emcy_communication = 0x8100,
    emcy_heartbeat = 0x8130,
    emcy_bus_off_recovered = 0x8140,
    emcy_pdo_length = 0x8210,
    emcy_sync_length = 0x8240,
    emcy_speed = 0x8400,
    emcy_following_error = 0x8611,
    emcy_travel = 0x8612,
    emcy_sync_lost = 0x8700,
};

/// Bits of object 1001.
enum emcy_register {
    emcy_generic = 0x01,
    emcy_communication_error = 0x10,
    emcy_profile_specific = 0x20,
};

struct emcy_message {
    uint16_t code;
    uint8_t error_register;
    uint8_t manufacturer[5];
};

/// Keeps objects 1001 and 1003.
struct emcy_producer {
    uint8_t node_id;
    uint8_t error_register;
    uint8_t history_count;
    uint32_t history[emcy_history_max]; ///< newest first
};

/// Reads an emergency of node `node_id`; false if the frame is none. A SYNC (same identifier plus 0) is none.
bool emcy_parse(const struct can_frame *frame, uint8_t node_id, struct emcy_message *out_message);

/// Records an error and makes its frame.
struct can_frame emcy_producer_raise(struct emcy_producer *self, uint16_t code, uint8_t register_bits);

/// Empties the history (object 1003).
void emcy_producer_forget(struct emcy_producer *self);

/// Clears the error register and makes the frame that says so; the history stays.
struct can_frame emcy_producer_clear(struct emcy_producer *self);

const char *emcy_code_str(uint16_t code);

#endif
