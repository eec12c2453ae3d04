/* SPDX-License-Identifier: MIT */
#include "drivers/can/sdo_client.h"

#include "drivers/can/sdo_server.h"

enum { command_upload = 0x40, command_download = 0x23, command_abort = 0x80, command_downloaded = 0x60 };

static struct can_frame start(struct sdo_client *self, uint16_t index, uint8_t subindex, uint8_t size, bool download)
{
    self->state = sdo_client_waiting;
    self->download = download;
    self->index = index;
    self->subindex = subindex;
    self->size = size;
    self->abort_code = od_abort_none;
    struct can_frame frame = can_frame_make((uint16_t)(sdo_request_cob_id + self->node_id), 8);
    can_put(&frame.data[1], 2, index);
    frame.data[3] = subindex;
    return frame;
}

struct can_frame sdo_client_upload(struct sdo_client *self, uint16_t index, uint8_t subindex, uint8_t size)
{
    struct can_frame frame = start(self, index, subindex, size, false);
    frame.data[0] = command_upload;
    return frame;
}

struct can_frame sdo_client_download(struct sdo_client *self, uint16_t index, uint8_t subindex, uint8_t size,
                                     uint32_t value)
{
    struct can_frame frame = start(self, index, subindex, size, true);
    frame.data[0] = (uint8_t)(command_download | ((4 - size) << 2));
    can_put(&frame.data[4], size, value);
    return frame;
}

static void finish(struct sdo_client *self, uint32_t abort_code)
{
    self->abort_code = abort_code;
    self->state = abort_code == od_abort_none ? sdo_client_done : sdo_client_aborted;
}

static void judge_upload(struct sdo_client *self, const struct can_frame *frame)
{
    uint8_t command = frame->data[0];
    if (command >> 5 != 2 || !(command & 2)) { // not an upload's answer, or one that starts segments
        finish(self, od_abort_command);
        return;
    }
    uint8_t size = (command & 1) ? (uint8_t)(4 - ((command >> 2) & 3)) : self->size;
    if (self->size != 0 && size != self->size) {
        finish(self, od_abort_length);
        return;
    }
    self->value = can_get(&frame->data[4], size);
    finish(self, od_abort_none);
}

bool sdo_client_take(struct sdo_client *self, const struct can_frame *frame)
{
    if (frame->id != sdo_response_cob_id + self->node_id)
        return false;
    bool ours = self->state == sdo_client_waiting && !frame->remote && frame->length == 8 &&
                can_get(&frame->data[1], 2) == self->index && frame->data[3] == self->subindex;
    if (!ours) {
        self->unexpected++;
        return true;
    }
    if (frame->data[0] == command_abort) {
        uint32_t abort_code = can_get(&frame->data[4], 4);
        finish(self, abort_code == od_abort_none ? od_abort_general : abort_code);
    } else if (!self->download) {
        judge_upload(self, frame);
    } else {
        finish(self, frame->data[0] == command_downloaded ? od_abort_none : od_abort_command);
    }
    return true;
}

struct can_frame sdo_client_give_up(struct sdo_client *self)
{
    struct can_frame frame = start(self, self->index, self->subindex, self->size, self->download);
    finish(self, od_abort_timeout);
    frame.data[0] = command_abort;
    can_put(&frame.data[4], 4, od_abort_timeout);
    return frame;
}
