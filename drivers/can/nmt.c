/* SPDX-License-Identifier: MIT */
#include "drivers/can/nmt.h"

struct can_frame nmt_command_frame(enum nmt_command command, uint8_t node_id)
{
    struct can_frame frame = can_frame_make(nmt_cob_id, 2);
    frame.data[0] = (uint8_t)command;
    frame.data[1] = node_id;
    return frame;
}

enum nmt_command nmt_command_parse(const struct can_frame *frame, uint8_t node_id)
{
    if (frame->id != nmt_cob_id || frame->remote || frame->length != 2)
        return nmt_none;
    if (frame->data[1] != 0 && frame->data[1] != node_id)
        return nmt_none;
    switch (frame->data[0]) {
    case nmt_start:
    case nmt_stop:
    case nmt_enter_pre_operational:
    case nmt_reset_node:
    case nmt_reset_communication:
        return (enum nmt_command)frame->data[0];
    default:
        return nmt_none;
    }
}

enum nmt_state nmt_state_after(enum nmt_state state, enum nmt_command command)
{
    switch (command) {
    case nmt_start:
        return state == nmt_initialising ? state : nmt_operational;
    case nmt_stop:
        return state == nmt_initialising ? state : nmt_stopped;
    case nmt_enter_pre_operational:
        return state == nmt_initialising ? state : nmt_pre_operational;
    case nmt_reset_node:
    case nmt_reset_communication:
        return nmt_initialising;
    case nmt_none:
        break;
    }
    return state;
}
