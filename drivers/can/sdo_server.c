/* SPDX-License-Identifier: MIT */
#include "drivers/can/sdo_server.h"

#include "drivers/can/can_port.h"

#include <string.h>

/// Command byte: client command specifier in bits 7..5.
enum {
    request_download_segment = 0,
    request_download = 1, ///< bits 3..2 bytes unused, bit 1 expedited, bit 0 size said
    request_upload = 2,
    request_upload_segment = 3,
    request_abort = 4,
    request_block_upload = 5,   ///< bits 1..0 start, end, answer, go
    request_block_download = 6, ///< bit 2 CRC, bit 1 size said, bit 0 end
    answer_downloaded = 0x60,
    answer_uploaded = 0x43,
    answer_segments = 0x41,
    answer_downloaded_segment = 0x20,
    answer_block_download = 0xA4,
    answer_block_taken = 0xA2,
    answer_block_downloaded = 0xA1,
    answer_block_upload = 0xC6,
    answer_block_end = 0xC1,
    answer_abort = 0x80,
};

enum { block_upload_start = 0, block_upload_end = 1, block_upload_answer = 2, block_upload_go = 3 };

static uint16_t request_index(const struct can_frame *request)
{
    return (uint16_t)can_get(&request->data[1], 2);
}

/// Looks the request's object up and checks that it may be read or written.
static uint32_t locate(struct sdo_server *self, uint8_t needed)
{
    uint32_t abort_code = od_locate(self->dictionary, self->index, self->subindex, &self->place);
    if (abort_code != od_abort_none)
        return abort_code;
    if (!(self->place.entry->access & needed))
        return needed == od_readable ? od_abort_write_only : od_abort_read_only;
    return od_abort_none;
}

// ---- Downloads

/// Makes room for a download that takes more than one frame.
static uint32_t start_receiver(struct sdo_server *self, bool size_said, uint32_t announced_size, uint8_t block_size)
{
    struct od_data *data = od_data_of(&self->place);
    uint8_t *room = data ? data->room : self->number;
    uint32_t capacity = data ? data->capacity : od_type_size(self->place.entry->type);
    if (!room)
        return od_abort_read_only;
    if (size_said && announced_size > capacity)
        return od_abort_too_long;
    if (size_said && !data && announced_size < capacity)
        return od_abort_too_short;
    if (data && data->bytes == data->room)
        data->size = 0;
    self->size_said = size_said;
    self->announced_size = announced_size;
    sdo_receiver_start(&self->receiver, room, capacity, block_size);
    return od_abort_none;
}

/// Puts a complete download in force.
static uint32_t finish_download(struct sdo_server *self)
{
    uint32_t size = self->receiver.size;
    struct od_data *data = od_data_of(&self->place);
    uint32_t wanted = self->size_said ? self->announced_size : data ? size : od_type_size(self->place.entry->type);
    if (size != wanted)
        return size > wanted ? od_abort_too_long : od_abort_too_short;
    if (!data) {
        uint8_t type = self->place.entry->type;
        return od_write(&self->place, od_from_raw(type, can_get(self->number, od_type_size(type))));
    }
    uint32_t abort_code = od_write(&self->place, size);
    if (abort_code != od_abort_none)
        return abort_code;
    data->bytes = data->room;
    data->size = size;
    return od_abort_none;
}

static uint32_t download_expedited(struct sdo_server *self, const struct can_frame *request)
{
    uint8_t command = request->data[0];
    bool number = od_data_of(&self->place) == NULL;
    uint8_t unsaid = number ? od_type_size(self->place.entry->type) : 4;
    uint8_t sent = (command & 1) ? (uint8_t)(4 - ((command >> 2) & 3)) : unsaid;
    uint32_t abort_code = start_receiver(self, true, sent, 0);
    if (abort_code != od_abort_none)
        return abort_code;
    memcpy(self->receiver.room, &request->data[4], sent);
    self->receiver.size = sent;
    return finish_download(self);
}

static uint32_t start_download(struct sdo_server *self, const struct can_frame *request, struct can_frame *out_answer)
{
    uint32_t abort_code = locate(self, od_writable);
    uint8_t command = request->data[0];
    bool expedited = (command & 2) != 0;
    if (abort_code == od_abort_none)
        abort_code = expedited ? download_expedited(self, request)
                               : start_receiver(self, command & 1, can_get(&request->data[4], 4), 0);
    if (abort_code == od_abort_none && !expedited)
        self->state = sdo_server_segment_download;
    out_answer->data[0] = answer_downloaded;
    return abort_code;
}

static uint32_t download_segment(struct sdo_server *self, const struct can_frame *request, struct can_frame *out_answer)
{
    if (self->state != sdo_server_segment_download)
        return od_abort_command;
    uint32_t abort_code = sdo_receiver_segment(&self->receiver, request->data);
    memset(out_answer->data, 0, sizeof out_answer->data);
    out_answer->data[0] = (uint8_t)(answer_downloaded_segment | (request->data[0] & 0x10));
    if (abort_code == od_abort_none && self->receiver.last) {
        self->state = sdo_server_idle;
        abort_code = finish_download(self);
    }
    return abort_code;
}

static uint32_t start_block_download(struct sdo_server *self, const struct can_frame *request,
                                     struct can_frame *out_answer)
{
    uint8_t command = request->data[0];
    if (command & 1) // an end without a beginning
        return od_abort_command;
    uint32_t abort_code = locate(self, od_writable);
    if (abort_code == od_abort_none)
        abort_code = start_receiver(self, (command & 2) != 0, can_get(&request->data[4], 4), sdo_block_max);
    if (abort_code != od_abort_none)
        return abort_code;
    self->checks_crc = (command & 4) != 0;
    self->state = sdo_server_block_download;
    out_answer->data[0] = answer_block_download;
    out_answer->data[4] = sdo_block_max;
    return od_abort_none;
}

static uint32_t end_block_download(struct sdo_server *self, const struct can_frame *request,
                                   struct can_frame *out_answer)
{
    self->state = sdo_server_idle;
    uint32_t abort_code = sdo_receiver_finish(&self->receiver, (request->data[0] >> 2) & 7);
    if (abort_code != od_abort_none)
        return abort_code;
    uint16_t crc = sdo_crc(0, self->receiver.room, self->receiver.size);
    if (self->checks_crc && crc != can_get(&request->data[1], 2))
        return od_abort_crc;
    memset(out_answer->data, 0, sizeof out_answer->data);
    out_answer->data[0] = answer_block_downloaded;
    return finish_download(self);
}

// ---- Uploads

/// Says where the bytes of the object are; a number is put on the wire's form first.
static void start_sender(struct sdo_server *self)
{
    const struct od_data *data = od_data_of(&self->place);
    if (data) {
        sdo_sender_start(&self->sender, data->bytes, data->size);
        return;
    }
    uint8_t type = self->place.entry->type;
    can_put(self->number, od_type_size(type), od_to_raw(type, od_load(&self->place)));
    sdo_sender_start(&self->sender, self->number, od_type_size(type));
}

static uint32_t start_upload(struct sdo_server *self, struct can_frame *out_answer)
{
    uint32_t abort_code = locate(self, od_readable);
    if (abort_code != od_abort_none)
        return abort_code;
    start_sender(self);
    uint32_t size = self->sender.size;
    if (size >= 1 && size <= 4) {
        out_answer->data[0] = (uint8_t)(answer_uploaded | ((4 - size) << 2));
        memcpy(&out_answer->data[4], self->sender.bytes, size);
        return od_abort_none;
    }
    self->state = sdo_server_segment_upload;
    out_answer->data[0] = answer_segments;
    can_put(&out_answer->data[4], 4, size);
    return od_abort_none;
}

static uint32_t upload_segment(struct sdo_server *self, const struct can_frame *request, struct can_frame *out_answer)
{
    if (self->state != sdo_server_segment_upload)
        return od_abort_command;
    if (((request->data[0] & 0x10) != 0) != self->sender.toggle)
        return od_abort_toggle;
    sdo_sender_segment(&self->sender, out_answer->data);
    if (sdo_sender_is_done(&self->sender))
        self->state = sdo_server_idle;
    return od_abort_none;
}

static uint32_t start_block_upload(struct sdo_server *self, const struct can_frame *request,
                                   struct can_frame *out_answer)
{
    uint32_t abort_code = locate(self, od_readable);
    if (abort_code != od_abort_none)
        return abort_code;
    start_sender(self);
    uint8_t block_size = request->data[4], switch_below = request->data[5];
    if (switch_below != 0 && self->sender.size <= switch_below) // the client rather has so few bytes without a block
        return start_upload(self, out_answer);
    if (!sdo_sender_start_block(&self->sender, block_size))
        return od_abort_block_size;
    self->checks_crc = (request->data[0] & 4) != 0;
    self->state = sdo_server_block_upload_ready;
    out_answer->data[0] = answer_block_upload;
    can_put(&out_answer->data[4], 4, self->sender.size);
    return od_abort_none;
}

/// The client's answer to a sub-block.
static uint32_t block_upload_acknowledge(struct sdo_server *self, const struct can_frame *request,
                                         struct can_frame *out_answer, bool *out_answers)
{
    *out_answers = false;
    if (sdo_sender_has_segment(&self->sender)) // an old one: this sub-block is not out yet
        return od_abort_none;
    uint32_t abort_code = sdo_sender_acknowledge(&self->sender, request->data[1], request->data[2]);
    *out_answers = abort_code != od_abort_none || sdo_sender_is_done(&self->sender);
    if (abort_code != od_abort_none || !sdo_sender_is_done(&self->sender))
        return abort_code;
    self->state = sdo_server_block_upload_end;
    memset(out_answer->data, 0, sizeof out_answer->data);
    out_answer->data[0] = (uint8_t)(answer_block_end | (sdo_sender_unused(&self->sender) << 2));
    if (self->checks_crc)
        can_put(&out_answer->data[1], 2, sdo_crc(0, self->sender.bytes, self->sender.size));
    return od_abort_none;
}

static uint32_t block_upload(struct sdo_server *self, const struct can_frame *request, struct can_frame *out_answer,
                             bool *out_answers)
{
    switch (request->data[0] & 3) {
    case block_upload_go:
        if (self->state != sdo_server_block_upload_ready)
            return od_abort_command;
        self->state = sdo_server_block_upload;
        *out_answers = false;
        return od_abort_none;
    case block_upload_answer:
        if (self->state != sdo_server_block_upload)
            return od_abort_command;
        return block_upload_acknowledge(self, request, out_answer, out_answers);
    case block_upload_end:
        if (self->state != sdo_server_block_upload_end)
            return od_abort_command;
        self->state = sdo_server_idle;
        *out_answers = false;
        return od_abort_none;
    default:
        return od_abort_command;
    }
}

// ---- Frames

static bool starts_transfer(uint8_t command)
{
    switch (command >> 5) {
    case request_download:
    case request_upload:
        return true;
    case request_block_upload:
        return (command & 3) == block_upload_start;
    case request_block_download:
        return (command & 1) == 0;
    default:
        return false;
    }
}

static uint32_t start_transfer(struct sdo_server *self, const struct can_frame *request, struct can_frame *out_answer)
{
    self->state = sdo_server_idle;
    self->index = request_index(request);
    self->subindex = request->data[3];
    can_put(&out_answer->data[1], 2, self->index);
    out_answer->data[3] = self->subindex;
    switch (request->data[0] >> 5) {
    case request_download:
        return start_download(self, request, out_answer);
    case request_upload:
        return start_upload(self, out_answer);
    case request_block_upload:
        return start_block_upload(self, request, out_answer);
    default:
        return start_block_download(self, request, out_answer);
    }
}

static uint32_t continue_transfer(struct sdo_server *self, const struct can_frame *request,
                                  struct can_frame *out_answer, bool *out_answers)
{
    switch (request->data[0] >> 5) {
    case request_download_segment:
        return download_segment(self, request, out_answer);
    case request_upload_segment:
        return upload_segment(self, request, out_answer);
    case request_block_upload:
        return block_upload(self, request, out_answer, out_answers);
    default: // the end of a block download in its place does not come here
        return od_abort_command;
    }
}

static void make_abort(struct sdo_server *self, uint32_t abort_code, struct can_frame *out_frame)
{
    self->state = sdo_server_idle;
    *out_frame = can_frame_make((uint16_t)(sdo_response_cob_id + self->node_id), 8);
    out_frame->data[0] = answer_abort;
    can_put(&out_frame->data[1], 2, self->index);
    out_frame->data[3] = self->subindex;
    can_put(&out_frame->data[4], 4, abort_code);
}

static void acknowledge(struct sdo_server *self, struct can_frame *out_frame)
{
    *out_frame = can_frame_make((uint16_t)(sdo_response_cob_id + self->node_id), 8);
    out_frame->data[0] = answer_block_taken;
    out_frame->data[1] = sdo_receiver_acknowledge(&self->receiver);
    out_frame->data[2] = self->receiver.block_size;
    if (self->receiver.last)
        self->state = sdo_server_block_download_end;
}

/// In the middle of a block download every frame but an abort is a segment.
static uint32_t take_block_segment(struct sdo_server *self, const struct can_frame *frame, struct can_frame *out_answer,
                                   bool *out_answers)
{
    uint32_t abort_code = sdo_receiver_block_segment(&self->receiver, frame->data, out_answers);
    if (abort_code != od_abort_none)
        *out_answers = true;
    else if (*out_answers)
        acknowledge(self, out_answer);
    return abort_code;
}

/// Whether a frame ends the transfer, or looks like it and is to be passed over: behind a block's last segment, what
/// looks like an abort may be that segment once more.
static bool take_abort(struct sdo_server *self, uint8_t command)
{
    const uint8_t exact = request_abort << 5;
    if (self->state == sdo_server_block_download ? command != exact : command >> 5 != request_abort)
        return false;
    if (command == exact || self->state != sdo_server_block_download_end)
        self->state = sdo_server_idle;
    return true;
}

/// Serves a frame that is no abort; returns an abort code.
static uint32_t serve_frame(struct sdo_server *self, const struct can_frame *frame, struct can_frame *out_answer,
                            bool *out_answers)
{
    uint8_t command = frame->data[0];
    if (self->state == sdo_server_block_download)
        return take_block_segment(self, frame, out_answer, out_answers);
    if (self->state == sdo_server_block_download_end && (command & 0xE3) == 0xC1)
        return end_block_download(self, frame, out_answer);
    if (starts_transfer(command))
        return start_transfer(self, frame, out_answer);
    if (self->state == sdo_server_idle) { // belongs to no transfer: its own bytes name the object in the answer
        self->index = request_index(frame);
        self->subindex = frame->data[3];
    }
    return continue_transfer(self, frame, out_answer, out_answers);
}

bool sdo_server_take(struct sdo_server *self, const struct can_frame *frame, uint64_t now_us,
                     struct can_frame *out_answer)
{
    if (frame->id != sdo_request_cob_id + self->node_id)
        return false;
    if (frame->remote || frame->length != 8) {
        self->malformed++;
        return false;
    }
    if (take_abort(self, frame->data[0]))
        return false;
    self->last_us = now_us;
    self->reminded = false;
    *out_answer = can_frame_make((uint16_t)(sdo_response_cob_id + self->node_id), 8);
    bool answers = true;
    uint32_t abort_code = serve_frame(self, frame, out_answer, &answers);
    if (abort_code == od_abort_none)
        return answers;
    self->aborts++;
    make_abort(self, abort_code, out_answer);
    return true;
}

bool sdo_server_upcoming(const struct sdo_server *self, struct can_frame *out_frame)
{
    if (self->state != sdo_server_block_upload || !sdo_sender_has_segment(&self->sender))
        return false;
    *out_frame = can_frame_make((uint16_t)(sdo_response_cob_id + self->node_id), 8);
    sdo_sender_block_segment(&self->sender, out_frame->data);
    return true;
}

void sdo_server_sent(struct sdo_server *self, uint64_t now_us)
{
    self->last_us = now_us;
    sdo_sender_advance(&self->sender);
}

static bool may_remind(const struct sdo_server *self)
{
    return !self->reminded && self->state == sdo_server_block_download && sdo_receiver_is_partial(&self->receiver);
}

uint64_t sdo_server_deadline_us(const struct sdo_server *self)
{
    if (self->state == sdo_server_idle)
        return CAN_NEVER_US;
    return self->last_us + (may_remind(self) ? sdo_server_timeout_us / 2 : sdo_server_timeout_us);
}

bool sdo_server_advance(struct sdo_server *self, uint64_t now_us, struct can_frame *out_frame)
{
    if (now_us < sdo_server_deadline_us(self))
        return false;
    if (may_remind(self) && now_us < self->last_us + sdo_server_timeout_us) {
        self->reminded = true;
        acknowledge(self, out_frame);
        return true;
    }
    self->timeouts++;
    make_abort(self, od_abort_timeout, out_frame);
    return true;
}
