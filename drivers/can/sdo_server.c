/* SPDX-License-Identifier: MIT */
#include "drivers/can/sdo_server.h"

/// Command byte: client command specifier in bits 7..5; of a download bits 3..2 bytes unused, bit 1 expedited, bit 0
/// size said.
enum {
    request_download = 1,
    request_upload = 2,
    request_abort = 4,
    answer_downloaded = 0x60,
    answer_uploaded = 0x43,
    answer_abort = 0x80,
};

static uint32_t download(const struct sdo_server *self, const struct can_frame *request, uint16_t index,
                         uint8_t subindex)
{
    uint8_t command = request->data[0];
    if (!(command & 2)) // segmented
        return od_abort_command;
    struct od_place place;
    uint32_t abort_code = od_locate(self->dictionary, index, subindex, &place);
    if (abort_code != od_abort_none)
        return abort_code;
    if (!(place.entry->access & od_writable))
        return od_abort_read_only;
    uint8_t size = od_type_size(place.entry->type);
    uint8_t sent = (command & 1) ? (uint8_t)(4 - ((command >> 2) & 3)) : size;
    if (sent > size)
        return od_abort_too_long;
    if (sent < size)
        return od_abort_too_short;
    return od_write(&place, od_from_raw(place.entry->type, can_get(&request->data[4], size)));
}

static uint32_t upload(const struct sdo_server *self, uint16_t index, uint8_t subindex, struct can_frame *out_answer)
{
    struct od_place place;
    uint32_t abort_code = od_locate(self->dictionary, index, subindex, &place);
    if (abort_code != od_abort_none)
        return abort_code;
    if (!(place.entry->access & od_readable))
        return od_abort_write_only;
    uint8_t size = od_type_size(place.entry->type);
    out_answer->data[0] = (uint8_t)(answer_uploaded | ((4 - size) << 2));
    can_put(&out_answer->data[4], size, od_to_raw(place.entry->type, od_load(&place)));
    return od_abort_none;
}

bool sdo_server_take(struct sdo_server *self, const struct can_frame *frame, struct can_frame *out_answer)
{
    if (frame->id != sdo_request_cob_id + self->node_id)
        return false;
    if (frame->remote || frame->length != 8) {
        self->malformed++;
        return false;
    }
    uint8_t specifier = frame->data[0] >> 5;
    if (specifier == request_abort)
        return false;
    uint16_t index = (uint16_t)can_get(&frame->data[1], 2);
    uint8_t subindex = frame->data[3];
    *out_answer = can_frame_make((uint16_t)(sdo_response_cob_id + self->node_id), 8);
    uint32_t abort_code = od_abort_command;
    if (specifier == request_download) {
        out_answer->data[0] = answer_downloaded;
        abort_code = download(self, frame, index, subindex);
    } else if (specifier == request_upload) {
        abort_code = upload(self, index, subindex, out_answer);
    }
    can_put(&out_answer->data[1], 2, index);
    out_answer->data[3] = subindex;
    if (abort_code != od_abort_none) {
        self->aborts++;
        out_answer->data[0] = answer_abort;
        can_put(&out_answer->data[4], 4, abort_code);
    }
    return true;
}
