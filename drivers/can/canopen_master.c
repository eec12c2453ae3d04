/* SPDX-License-Identifier: MIT */
#include "drivers/can/canopen_master.h"

#include "drivers/can/sdo_server.h"

#include <string.h>

void canopen_master_init(struct canopen_master *self, const struct can_port *port, uint8_t node_id, uint8_t master_id,
                         uint32_t sdo_timeout_us)
{
    memset(self, 0, sizeof *self);
    self->port = *port;
    self->node_id = node_id;
    self->master_id = master_id;
    self->sdo_timeout_us = sdo_timeout_us;
    self->sdo.node_id = node_id;
    heartbeat_consumer_start(&self->consumer, node_id, 0);
}

uint64_t canopen_master_time_us(const struct canopen_master *self)
{
    return self->port.operations->time_us(self->port.self);
}

static enum can_status noted(struct canopen_master *self, enum can_status status)
{
    if (status == can_err_bus_off || status == can_err_gone)
        self->status = status;
    return status;
}

enum can_status canopen_master_send(struct canopen_master *self, const struct can_frame *frame)
{
    return noted(self, self->port.operations->send(self->port.self, frame));
}

static void dispatch(struct canopen_master *self, const struct can_frame *frame)
{
    struct emcy_message emergency;
    if ((frame->id & 0x7F) != self->node_id)
        return; // other traffic on the same bus
    if (sdo_client_take(&self->sdo, frame))
        return;
    if (heartbeat_consumer_take(&self->consumer, frame, canopen_master_time_us(self)))
        return;
    if (emcy_parse(frame, self->node_id, &emergency)) {
        if (emergency.code == emcy_no_error)
            return;
        self->emergency = emergency;
        self->emergencies++;
        return;
    }
    uint16_t function = frame->id & 0x780;
    bool process_data = function >= 0x180 && function < 0x580 && (function & 0x080) != 0;
    if (process_data && !frame->remote && self->on_process_data)
        self->on_process_data(self->owner, frame);
    else
        self->unexpected++;
}

enum can_status canopen_master_step(struct canopen_master *self, uint64_t until_us)
{
    struct can_frame frame;
    uint64_t due_us = heartbeat_producer_deadline_us(&self->producer);
    enum can_status status = can_ok;
    if (heartbeat_producer_due(&self->producer, nmt_operational, canopen_master_time_us(self), &frame))
        status = canopen_master_send(self, &frame);
    else
        status = noted(self, self->port.operations->wait(self->port.self, due_us < until_us ? due_us : until_us));
    while (self->port.operations->receive(self->port.self, &frame))
        dispatch(self, &frame);
    heartbeat_consumer_expired(&self->consumer, canopen_master_time_us(self));
    return status == can_err_full ? can_ok : status;
}

enum can_status canopen_master_serve(struct canopen_master *self, uint64_t until_us)
{
    enum can_status status = can_ok;
    while (status == can_ok && canopen_master_time_us(self) < until_us)
        status = canopen_master_step(self, until_us);
    return status;
}

/// Sends what the transfer has to send; stops where the port has no room.
static enum can_status send_upcoming(struct canopen_master *self)
{
    struct can_frame frame;
    while (sdo_client_upcoming(&self->sdo, &frame)) {
        enum can_status status = canopen_master_send(self, &frame);
        if (status != can_ok)
            return status == can_err_full ? can_ok : status;
        sdo_client_sent(&self->sdo);
    }
    return can_ok;
}

/// Serves the bus until the transfer gets on or the time-out is over; true if it got on.
static bool wait_progress(struct canopen_master *self, uint64_t last_us)
{
    const uint32_t room_us = 500; // a frame or two have left the send queue by then
    uint64_t from_us = canopen_master_time_us(self), until_us = from_us + self->sdo_timeout_us;
    uint64_t remind_us = from_us + self->sdo_timeout_us / 2;
    uint32_t progress = self->sdo.progress;
    struct can_frame frame;
    until_us = until_us < last_us ? until_us : last_us;
    while (send_upcoming(self) == can_ok && self->sdo.state == sdo_client_waiting) {
        uint64_t now_us = canopen_master_time_us(self);
        if (self->sdo.progress != progress || now_us >= until_us)
            break;
        if (now_us >= remind_us) {
            sdo_client_remind(&self->sdo);
            remind_us = until_us;
        }
        uint64_t next_us = remind_us < until_us ? remind_us : until_us;
        if (sdo_client_upcoming(&self->sdo, &frame) && now_us + room_us < next_us)
            next_us = now_us + room_us;
        if (canopen_master_step(self, next_us) != can_ok)
            break;
    }
    return self->sdo.progress != progress;
}

/// Waits for the end of a transfer whose first frame is `request`, `frames` answers at most; sends an abort if it does
/// not come.
static uint32_t transfer(struct canopen_master *self, const struct can_frame *request, uint32_t frames)
{
    canopen_master_send(self, request);
    uint64_t last_us = canopen_master_time_us(self) + (uint64_t)frames * self->sdo_timeout_us;
    bool going = true;
    while (going && self->status == can_ok && self->sdo.state == sdo_client_waiting)
        going = wait_progress(self, last_us) && canopen_master_time_us(self) < last_us;
    send_upcoming(self); // the confirmation, or the abort of a transfer that failed
    if (self->sdo.state == sdo_client_waiting) {
        struct can_frame frame = sdo_client_give_up(&self->sdo);
        canopen_master_send(self, &frame);
    }
    return self->status != can_ok ? CANOPEN_BUS_LOST : self->sdo.abort_code;
}

/// Whether asking again can help: no answer, or one to an earlier request for the same object.
static bool worth_another(uint32_t abort_code)
{
    return abort_code == od_abort_timeout || abort_code == od_abort_command;
}

uint32_t canopen_master_read(struct canopen_master *self, uint16_t index, uint8_t subindex, uint8_t size,
                             uint32_t *out_value)
{
    uint32_t abort_code = od_abort_timeout;
    for (int attempt = 0; attempt < canopen_master_sdo_attempts && worth_another(abort_code); attempt++) {
        struct can_frame request = sdo_client_upload(&self->sdo, index, subindex, size);
        abort_code = transfer(self, &request, 1);
    }
    if (abort_code == od_abort_none)
        *out_value = self->sdo.value;
    return abort_code;
}

uint32_t canopen_master_read_surely(struct canopen_master *self, uint16_t index, uint8_t subindex, uint8_t size,
                                    uint32_t *out_value)
{
    uint32_t before = 0, value = 0;
    uint32_t abort_code = canopen_master_read(self, index, subindex, size, &before);
    for (int attempt = 0; attempt < 3 && abort_code == od_abort_none; attempt++) {
        abort_code = canopen_master_read(self, index, subindex, size, &value);
        if (abort_code == od_abort_none && value == before) {
            *out_value = value;
            return od_abort_none;
        }
        before = value;
    }
    return abort_code == od_abort_none ? od_abort_incompatible : abort_code;
}

uint32_t canopen_master_write(struct canopen_master *self, uint16_t index, uint8_t subindex, uint8_t size,
                              uint32_t value)
{
    uint32_t abort_code = od_abort_timeout;
    for (int attempt = 0; attempt < canopen_master_sdo_attempts && worth_another(abort_code); attempt++) {
        struct can_frame request = sdo_client_download(&self->sdo, index, subindex, size, value);
        abort_code = transfer(self, &request, 1);
    }
    return abort_code;
}

uint32_t canopen_master_write_surely(struct canopen_master *self, uint16_t index, uint8_t subindex, uint8_t size,
                                     uint32_t value, uint32_t mask)
{
    uint32_t read = ~value;
    uint32_t abort_code = canopen_master_write(self, index, subindex, size, value);
    if (abort_code != od_abort_none)
        return abort_code;
    abort_code = canopen_master_read(self, index, subindex, size, &read);
    if (abort_code == od_abort_none && (read & mask) != (value & mask))
        return od_abort_incompatible;
    return abort_code;
}

/// Answers that a transfer of `size` bytes takes at most.
static uint32_t frames_of(uint32_t size)
{
    return size / sdo_segment_bytes + 4;
}

uint32_t canopen_master_read_data(struct canopen_master *self, uint16_t index, uint8_t subindex, uint8_t *room,
                                  uint32_t capacity, uint32_t *out_size)
{
    enum sdo_method method = sdo_block;
    uint32_t abort_code = od_abort_timeout;
    for (int attempt = 0; attempt < canopen_master_sdo_attempts; attempt++) {
        struct can_frame request = sdo_client_upload_data(&self->sdo, method, index, subindex, room, capacity);
        abort_code = transfer(self, &request, frames_of(capacity));
        if (!worth_another(abort_code) && abort_code != od_abort_crc)
            break;
        if (abort_code == od_abort_command)
            method = sdo_segmented;
    }
    if (abort_code == od_abort_none)
        *out_size = self->sdo.receiver.size;
    return abort_code;
}

uint32_t canopen_master_write_data(struct canopen_master *self, uint16_t index, uint8_t subindex, const uint8_t *bytes,
                                   uint32_t size)
{
    enum sdo_method method = sdo_block;
    uint32_t abort_code = od_abort_timeout;
    for (int attempt = 0; attempt < canopen_master_sdo_attempts; attempt++) {
        struct can_frame request = sdo_client_download_data(&self->sdo, method, index, subindex, bytes, size);
        abort_code = transfer(self, &request, frames_of(size));
        if (!worth_another(abort_code) && abort_code != od_abort_crc)
            break;
        if (abort_code == od_abort_command)
            method = sdo_segmented;
    }
    return abort_code;
}
