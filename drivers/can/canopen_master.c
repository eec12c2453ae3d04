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

/// Waits for the answer to a request just made; sends an abort if none comes.
static uint32_t transfer(struct canopen_master *self, const struct can_frame *request)
{
    enum can_status status = canopen_master_send(self, request);
    uint64_t until_us = canopen_master_time_us(self) + self->sdo_timeout_us;
    while (status == can_ok && self->sdo.state == sdo_client_waiting && canopen_master_time_us(self) < until_us)
        status = canopen_master_step(self, until_us);
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
        abort_code = transfer(self, &request);
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
        abort_code = transfer(self, &request);
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
