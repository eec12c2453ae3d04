/* SPDX-License-Identifier: MIT */
#include "drivers/can/emcy.h"

#include "drivers/can/nmt.h"

#include <string.h>

/// Makes the frame of a node's emergency.
static struct can_frame make_frame(uint8_t node_id, const struct emcy_message *message)
{
    struct can_frame frame = can_frame_make((uint16_t)(emcy_cob_id + node_id), 8);
    can_put(frame.data, 2, message->code);
    frame.data[2] = message->error_register;
    memcpy(&frame.data[3], message->manufacturer, sizeof message->manufacturer);
    return frame;
}

bool emcy_parse(const struct can_frame *frame, uint8_t node_id, struct emcy_message *out_message)
{
    if (node_id == 0 || node_id > nmt_node_id_max || frame->id != emcy_cob_id + node_id)
        return false;
    if (frame->remote || frame->length != 8)
        return false;
    out_message->code = (uint16_t)can_get(frame->data, 2);
    out_message->error_register = frame->data[2];
    memcpy(out_message->manufacturer, &frame->data[3], sizeof out_message->manufacturer);
    return true;
}

struct can_frame emcy_producer_raise(struct emcy_producer *self, uint16_t code, uint8_t register_bits)
{
    self->error_register |= (uint8_t)(register_bits | emcy_generic);
    memmove(&self->history[1], &self->history[0], sizeof self->history - sizeof self->history[0]);
    self->history[0] = code;
    if (self->history_count < emcy_history_max)
        self->history_count++;
    struct emcy_message message = {.code = code, .error_register = self->error_register};
    return make_frame(self->node_id, &message);
}

void emcy_producer_forget(struct emcy_producer *self)
{
    self->history_count = 0;
    memset(self->history, 0, sizeof self->history);
}

struct can_frame emcy_producer_clear(struct emcy_producer *self)
{
    self->error_register = 0;
    struct emcy_message message = {.code = emcy_no_error};
    return make_frame(self->node_id, &message);
}

const char *emcy_code_str(uint16_t code)
{
    switch (code) {
    case emcy_no_error:
        return "no error";
    case emcy_parameter:
        return "parameter error";
    case emcy_communication:
        return "communication ended while enabled";
    case emcy_heartbeat:
        return "the master's heartbeat stopped";
    case emcy_bus_off_recovered:
        return "recovered from bus-off";
    case emcy_pdo_length:
        return "process data of a wrong length";
    case emcy_sync_length:
        return "SYNC of a wrong length";
    case emcy_motor_blocked:
        return "torque without motion: motor blocked or encoder stuck";
    case emcy_encoder:
        return "encoder without a signal";
    case emcy_speed:
        return "speed above its limit, or growing in a stop";
    case emcy_following_error:
        return "following error";
    case emcy_travel:
        return "position beyond its limit";
    case emcy_sync_lost:
        return "SYNC missing";
    default:
        return "see the drive's manual";
    }
}
