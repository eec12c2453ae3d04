/* SPDX-License-Identifier: MIT */
/// Network management (CiA 301): who may talk, and the boot-up message.
#ifndef SERVOSCOPE_DRIVERS_CAN_NMT_H
#define SERVOSCOPE_DRIVERS_CAN_NMT_H

#include "drivers/can/can_frame.h"

/// States as they appear in a heartbeat.
enum nmt_state {
    nmt_initialising = 0, ///< its heartbeat is the boot-up message
    nmt_stopped = 4,
    nmt_operational = 5,
    nmt_pre_operational = 127,
};

enum nmt_command {
    nmt_none = 0,
    nmt_start = 1,
    nmt_stop = 2,
    nmt_enter_pre_operational = 128,
    nmt_reset_node = 129,
    nmt_reset_communication = 130,
};

enum { nmt_cob_id = 0x000, nmt_node_id_max = 127 };

/// Makes the command frame; node_id 0 means every node.
struct can_frame nmt_command_frame(enum nmt_command command, uint8_t node_id);

/// What a frame asks of node `node_id`; nmt_none if it is no command, a malformed or unknown one, or for somebody else.
enum nmt_command nmt_command_parse(const struct can_frame *frame, uint8_t node_id);

/// State after a command. Both resets lead through nmt_initialising.
enum nmt_state nmt_state_after(enum nmt_state state, enum nmt_command command);

#endif
