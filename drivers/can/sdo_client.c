/* SPDX-License-Identifier: MIT */
#include "drivers/can/sdo_client.h"

#include "drivers/can/sdo_server.h"

#include <string.h>

/// Command bytes; an answer's specifier is in bits 7..5.
enum {
    command_download = 0x23,
    command_download_segments = 0x21,
    command_upload = 0x40,
    command_upload_segment = 0x60,
    command_abort = 0x80,
    command_downloaded = 0x60, ///< the answer to a download
    command_block_upload = 0xA4,
    command_block_uploaded = 0xA1,
    command_block_taken = 0xA2,
    command_block_go = 0xA3,
    command_block_download = 0xC6,
    command_block_end = 0xC1,
    answered_upload_segment = 0,
    answered_download_segment = 1,
    answered_upload = 2,
    answered_download = 3,
    answered_block_download = 5,
    answered_block_upload = 6,
};

static struct can_frame start(struct sdo_client *self, enum sdo_method method, uint16_t index, uint8_t subindex,
                              bool download)
{
    self->state = sdo_client_waiting;
    self->method = method;
    self->phase = sdo_phase_start;
    self->download = download;
    self->index = index;
    self->subindex = subindex;
    self->abort_code = od_abort_none;
    self->has_frame = false;
    struct can_frame frame = can_frame_make((uint16_t)(sdo_request_cob_id + self->node_id), 8);
    can_put(&frame.data[1], 2, index);
    frame.data[3] = subindex;
    return frame;
}

struct can_frame sdo_client_upload(struct sdo_client *self, uint16_t index, uint8_t subindex, uint8_t size)
{
    struct can_frame frame = start(self, sdo_expedited, index, subindex, false);
    self->size = size;
    frame.data[0] = command_upload;
    return frame;
}

struct can_frame sdo_client_download(struct sdo_client *self, uint16_t index, uint8_t subindex, uint8_t size,
                                     uint32_t value)
{
    struct can_frame frame = start(self, sdo_expedited, index, subindex, true);
    self->size = size;
    frame.data[0] = (uint8_t)(command_download | ((4 - size) << 2));
    can_put(&frame.data[4], size, value);
    return frame;
}

struct can_frame sdo_client_upload_data(struct sdo_client *self, enum sdo_method method, uint16_t index,
                                        uint8_t subindex, uint8_t *room, uint32_t capacity)
{
    struct can_frame frame = start(self, method, index, subindex, false);
    sdo_receiver_start(&self->receiver, room, capacity, sdo_block_max);
    frame.data[0] = command_upload;
    if (method == sdo_block) {
        frame.data[0] = command_block_upload;
        frame.data[4] = sdo_block_max;
    }
    return frame;
}

struct can_frame sdo_client_download_data(struct sdo_client *self, enum sdo_method method, uint16_t index,
                                          uint8_t subindex, const uint8_t *bytes, uint32_t size)
{
    struct can_frame frame = start(self, method, index, subindex, true);
    sdo_sender_start(&self->sender, bytes, size);
    frame.data[0] = method == sdo_block ? command_block_download : command_download_segments;
    can_put(&frame.data[4], 4, size);
    return frame;
}

static void finish(struct sdo_client *self, uint32_t abort_code)
{
    self->abort_code = abort_code;
    self->state = abort_code == od_abort_none ? sdo_client_done : sdo_client_aborted;
}

/// Makes an empty frame that is to be sent next.
static struct can_frame *next_frame(struct sdo_client *self, uint8_t command)
{
    self->frame = can_frame_make((uint16_t)(sdo_request_cob_id + self->node_id), 8);
    self->frame.data[0] = command;
    self->has_frame = true;
    return &self->frame;
}

/// Ends a transfer that makes no sense any more, and tells the server.
static void refuse(struct sdo_client *self, uint32_t abort_code)
{
    struct can_frame *frame = next_frame(self, command_abort);
    can_put(&frame->data[1], 2, self->index);
    frame->data[3] = self->subindex;
    can_put(&frame->data[4], 4, abort_code);
    finish(self, abort_code);
}

// ---- Expedited

static void judge_upload(struct sdo_client *self, const struct can_frame *frame)
{
    uint8_t command = frame->data[0];
    if (command >> 5 != answered_upload || !(command & 2)) { // not an upload's answer, or one that starts segments
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

static void judge_expedited(struct sdo_client *self, const struct can_frame *frame)
{
    if (!self->download)
        judge_upload(self, frame);
    else
        finish(self, frame->data[0] == command_downloaded ? od_abort_none : od_abort_command);
}

// ---- Uploads

static void finish_upload(struct sdo_client *self)
{
    if (self->size_said && self->receiver.size != self->announced_size)
        refuse(self, self->receiver.size > self->announced_size ? od_abort_too_long : od_abort_too_short);
    else
        finish(self, od_abort_none);
}

/// An answer that has the whole object in it, or the size of what is to come.
static void start_segmented_upload(struct sdo_client *self, const struct can_frame *frame)
{
    uint8_t command = frame->data[0];
    struct sdo_receiver *r = &self->receiver;
    if (command >> 5 != answered_upload) {
        refuse(self, od_abort_command);
        return;
    }
    self->method = sdo_segmented; // a server may answer a block's request this way if there is little to send
    if (command & 2) {
        uint8_t size = (command & 1) ? (uint8_t)(4 - ((command >> 2) & 3)) : 4;
        if (size > r->capacity) {
            finish(self, od_abort_memory);
            return;
        }
        memcpy(r->room, &frame->data[4], size);
        r->size = size;
        finish(self, od_abort_none);
        return;
    }
    self->size_said = command & 1;
    self->announced_size = can_get(&frame->data[4], 4);
    if (self->size_said && self->announced_size > r->capacity) {
        refuse(self, od_abort_memory);
        return;
    }
    self->phase = sdo_phase_segments;
    next_frame(self, command_upload_segment);
}

static void take_upload_segment(struct sdo_client *self, const struct can_frame *frame)
{
    uint32_t abort_code = frame->data[0] >> 5 == answered_upload_segment
                              ? sdo_receiver_segment(&self->receiver, frame->data)
                              : od_abort_command;
    if (abort_code != od_abort_none)
        refuse(self, abort_code);
    else if (self->receiver.last)
        finish_upload(self);
    else
        next_frame(self, (uint8_t)(command_upload_segment | (self->receiver.toggle ? 0x10 : 0)));
}

static void start_block_upload(struct sdo_client *self, const struct can_frame *frame)
{
    uint8_t command = frame->data[0];
    if (command >> 5 != answered_block_upload || (command & 1)) {
        start_segmented_upload(self, frame);
        return;
    }
    self->checks_crc = (command & 4) != 0;
    self->size_said = (command & 2) != 0;
    self->announced_size = can_get(&frame->data[4], 4);
    if (self->size_said && self->announced_size > self->receiver.capacity) {
        refuse(self, od_abort_memory);
        return;
    }
    self->phase = sdo_phase_segments;
    next_frame(self, command_block_go);
}

static void acknowledge(struct sdo_client *self)
{
    struct can_frame *frame = next_frame(self, command_block_taken);
    frame->data[1] = sdo_receiver_acknowledge(&self->receiver);
    frame->data[2] = self->receiver.block_size;
    if (self->receiver.last)
        self->phase = sdo_phase_end;
}

static void take_block_segment(struct sdo_client *self, const struct can_frame *frame)
{
    bool answers = false;
    uint32_t abort_code = sdo_receiver_block_segment(&self->receiver, frame->data, &answers);
    if (abort_code != od_abort_none)
        refuse(self, abort_code);
    else if (answers)
        acknowledge(self);
}

static void end_block_upload(struct sdo_client *self, const struct can_frame *frame)
{
    uint8_t command = frame->data[0];
    if ((command & 0xE3) != command_block_end) // the last segment once more
        return;
    uint32_t abort_code = sdo_receiver_finish(&self->receiver, (command >> 2) & 7);
    uint16_t crc = sdo_crc(0, self->receiver.room, self->receiver.size);
    if (abort_code == od_abort_none && self->checks_crc && crc != can_get(&frame->data[1], 2))
        abort_code = od_abort_crc;
    if (abort_code != od_abort_none) {
        refuse(self, abort_code);
        return;
    }
    next_frame(self, command_block_uploaded);
    finish_upload(self);
}

// ---- Downloads

static void send_segment(struct sdo_client *self)
{
    struct can_frame *frame = next_frame(self, 0);
    sdo_sender_segment(&self->sender, frame->data);
}

static void judge_segmented_download(struct sdo_client *self, const struct can_frame *frame)
{
    uint8_t command = frame->data[0];
    if (self->phase == sdo_phase_start) {
        if (command >> 5 != answered_download) {
            refuse(self, od_abort_command);
            return;
        }
        self->phase = sdo_phase_segments;
        send_segment(self);
        return;
    }
    if (command >> 5 != answered_download_segment) {
        refuse(self, od_abort_command);
        return;
    }
    bool toggle = (command & 0x10) != 0; // of the segment that is answered; the sender's is already the next one's
    if (toggle == self->sender.toggle)
        refuse(self, od_abort_toggle);
    else if (sdo_sender_is_done(&self->sender))
        finish(self, od_abort_none);
    else
        send_segment(self);
}

static void start_block_download(struct sdo_client *self, const struct can_frame *frame)
{
    if (frame->data[0] >> 5 != answered_block_download || (frame->data[0] & 3) != 0) {
        refuse(self, od_abort_command);
        return;
    }
    self->checks_crc = (frame->data[0] & 4) != 0;
    if (sdo_sender_start_block(&self->sender, frame->data[4]))
        self->phase = sdo_phase_segments;
    else
        refuse(self, od_abort_block_size);
}

/// The server's answer to a sub-block.
static void judge_block_answer(struct sdo_client *self, const struct can_frame *frame)
{
    if (frame->data[0] >> 5 != answered_block_download || (frame->data[0] & 3) != 2) {
        refuse(self, od_abort_command);
        return;
    }
    if (sdo_sender_has_segment(&self->sender)) { // an old one: this sub-block is not out yet
        self->unexpected++;
        return;
    }
    uint32_t abort_code = sdo_sender_acknowledge(&self->sender, frame->data[1], frame->data[2]);
    if (abort_code != od_abort_none) {
        refuse(self, abort_code);
        return;
    }
    if (!sdo_sender_is_done(&self->sender))
        return;
    self->phase = sdo_phase_end;
    struct can_frame *end = next_frame(self, (uint8_t)(command_block_end | (sdo_sender_unused(&self->sender) << 2)));
    if (self->checks_crc)
        can_put(&end->data[1], 2, sdo_crc(0, self->sender.bytes, self->sender.size));
}

static void judge_block_download(struct sdo_client *self, const struct can_frame *frame)
{
    if (self->phase == sdo_phase_start)
        start_block_download(self, frame);
    else if (self->phase == sdo_phase_segments)
        judge_block_answer(self, frame);
    else if (frame->data[0] >> 5 == answered_block_download && (frame->data[0] & 3) == 1)
        finish(self, od_abort_none);
    else
        refuse(self, od_abort_command);
}

// ---- Frames

static void judge_upload_data(struct sdo_client *self, const struct can_frame *frame)
{
    bool block = self->method == sdo_block;
    switch (self->phase) {
    case sdo_phase_start:
        if (block)
            start_block_upload(self, frame);
        else
            start_segmented_upload(self, frame);
        break;
    case sdo_phase_segments:
        if (block)
            take_block_segment(self, frame);
        else
            take_upload_segment(self, frame);
        break;
    case sdo_phase_end:
        end_block_upload(self, frame);
        break;
    }
}

/// Only the first answer, an abort and those of numbers name the object.
static bool names_object(const struct sdo_client *self, const struct can_frame *frame)
{
    return self->phase == sdo_phase_start || frame->data[0] == command_abort;
}

bool sdo_client_take(struct sdo_client *self, const struct can_frame *frame)
{
    if (frame->id != sdo_response_cob_id + self->node_id)
        return false;
    bool ours = self->state == sdo_client_waiting && !frame->remote && frame->length == 8;
    if (ours && names_object(self, frame))
        ours = can_get(&frame->data[1], 2) == self->index && frame->data[3] == self->subindex;
    if (!ours) {
        self->unexpected++;
        return true;
    }
    self->progress++;
    if (frame->data[0] == command_abort) {
        uint32_t abort_code = can_get(&frame->data[4], 4);
        finish(self, abort_code == od_abort_none ? od_abort_general : abort_code);
        self->has_frame = false;
    } else if (self->method == sdo_expedited) {
        judge_expedited(self, frame);
    } else if (!self->download) {
        judge_upload_data(self, frame);
    } else if (self->method == sdo_block) {
        judge_block_download(self, frame);
    } else {
        judge_segmented_download(self, frame);
    }
    return true;
}

static bool has_block_segment(const struct sdo_client *self)
{
    return self->state == sdo_client_waiting && self->method == sdo_block && self->download &&
           self->phase == sdo_phase_segments && sdo_sender_has_segment(&self->sender);
}

bool sdo_client_upcoming(const struct sdo_client *self, struct can_frame *out_frame)
{
    if (self->has_frame) {
        *out_frame = self->frame;
        return true;
    }
    if (!has_block_segment(self))
        return false;
    *out_frame = can_frame_make((uint16_t)(sdo_request_cob_id + self->node_id), 8);
    sdo_sender_block_segment(&self->sender, out_frame->data);
    return true;
}

void sdo_client_sent(struct sdo_client *self)
{
    if (self->has_frame) {
        self->has_frame = false;
        return;
    }
    sdo_sender_advance(&self->sender);
    self->progress++;
}

bool sdo_client_remind(struct sdo_client *self)
{
    bool partial = self->state == sdo_client_waiting && self->method == sdo_block && !self->download &&
                   self->phase == sdo_phase_segments && sdo_receiver_is_partial(&self->receiver);
    if (partial)
        acknowledge(self);
    return partial;
}

struct can_frame sdo_client_give_up(struct sdo_client *self)
{
    refuse(self, od_abort_timeout);
    self->has_frame = false;
    return self->frame;
}
