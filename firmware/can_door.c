/* SPDX-License-Identifier: MIT */
#include "firmware/can_door.h"

#include "core/bytes.h"
#include "drivers/can/nmt.h"

#include <stddef.h>
#include <string.h>

enum { results_index = 0x2200, requests_per_bin = 5, heartbeat_period_ms = 10 };

// ---- Queues

static bool put_frame(struct can_queue *self, const struct can_frame *frame)
{
    if (self->put - self->taken == can_door_queue_frames) {
        return false;
    }
    self->frames[self->put % can_door_queue_frames] = *frame;
    ++self->put;
    return true;
}

static bool take_frame(struct can_queue *self, struct can_frame *out_frame)
{
    if (self->put == self->taken) {
        return false;
    }
    *out_frame = self->frames[self->taken % can_door_queue_frames];
    ++self->taken;
    return true;
}

static enum can_status send_to_master(void *self, const struct can_frame *frame)
{
    return put_frame(&((struct can_door *)self)->to_master, frame) ? can_ok : can_err_full;
}

static const struct can_port_operations port_operations = {.send = send_to_master};

// ---- Node

static uint32_t float_bits(core_real value)
{
    union core_float_bits number = {.value = (float)value};
    return number.bits;
}

static uint32_t select_bin(void *owner, const struct od_entry *entry, int64_t value)
{
    struct can_results *self = &((struct can_door *)owner)->results;
    struct frf_estimate estimate;
    if (value >= (int64_t)self->source->statistics.bin_count) {
        return od_abort_value;
    }
    od_store(owner, entry, value);
    results_estimate(self->source, (uint32_t)value, &estimate);
    self->periods = self->source->statistics.periods;
    self->real = float_bits(estimate.real);
    self->imaginary = float_bits(estimate.imaginary);
    self->std = float_bits(estimate.std);
    self->validity = (uint8_t)estimate.validity;
    return od_abort_none;
}

#define RESULT(sub, type, access, member, write)                                                                       \
    {                                                                                                                  \
        results_index, sub, type, access, offsetof(struct can_door, results.member), 0, write                          \
    }
static const struct od_entry entries[] = {
    {results_index, 0, od_u8, od_readable | od_constant, 0, 6, NULL},
    RESULT(1, od_u32, od_readable, periods, NULL),
    RESULT(2, od_u16, od_readable | od_writable, bin, select_bin),
    RESULT(3, od_u32, od_readable, real, NULL),
    RESULT(4, od_u32, od_readable, imaginary, NULL),
    RESULT(5, od_u32, od_readable, std, NULL),
    RESULT(6, od_u8, od_readable, validity, NULL),
};

static void ignore_sync(void *owner, uint64_t now_us, bool targets_fresh)
{
    (void)owner;
    (void)now_us;
    (void)targets_fresh;
}

static void ignore_loss(void *owner, uint16_t emcy_code, uint64_t now_us)
{
    (void)owner;
    (void)emcy_code;
    (void)now_us;
}

static void ignore_reset(void *owner)
{
    (void)owner;
}

static const struct canopen_node_events events = {ignore_sync, ignore_loss, ignore_reset};

void can_door_init(struct can_door *self, const struct results *results)
{
    static const struct canopen_node_identity identity = {.device_type = 0, .vendor = 0, .product = 1};
    const struct can_port port = {&port_operations, self};
    memset(self, 0, sizeof *self);
    self->results.source = results;
    self->client.node_id = can_door_node_id;
    canopen_node_init(&self->node, can_door_node_id, &port, &identity, entries, sizeof entries / sizeof *entries,
                      &events, self);
    canopen_node_boot(&self->node, 0);
}

void can_door_serve(struct can_door *self, uint64_t now_us)
{
    struct can_frame frame;
    while (take_frame(&self->to_node, &frame)) {
        canopen_node_receive(&self->node, &frame, now_us);
    }
    if (canopen_node_deadline_us(&self->node) <= now_us) {
        canopen_node_advance(&self->node, now_us);
    }
}

// ---- Master

static void keep_answer(struct can_door *self)
{
    uint32_t bin = (self->step - 1u) / requests_per_bin;
    struct can_reading *reading = &self->readings[bin];
    switch ((self->step - 1u) % requests_per_bin) {
    case 1:
        reading->real = self->client.value;
        break;
    case 2:
        reading->imaginary = self->client.value;
        break;
    case 3:
        reading->std = self->client.value;
        break;
    case 4:
        reading->validity = (uint8_t)self->client.value;
        break;
    default:
        break;
    }
}

/* Step 0 starts the heartbeat; then for each bin: select it, read its four values. */
static struct can_frame next_request(struct can_door *self)
{
    if (self->step == 0) {
        return sdo_client_download(&self->client, 0x1017, 0, 2, heartbeat_period_ms);
    }
    uint32_t bin = (self->step - 1u) / requests_per_bin, request = (self->step - 1u) % requests_per_bin;
    if (request == 0) {
        return sdo_client_download(&self->client, results_index, 2, 2, bin);
    }
    return sdo_client_upload(&self->client, results_index, (uint8_t)(2u + request), request == 4u ? 1 : 4);
}

bool can_door_read_all(struct can_door *self)
{
    struct can_frame frame;
    uint32_t steps = 1u + requests_per_bin * self->results.source->statistics.bin_count;
    while (take_frame(&self->to_master, &frame)) {
        if (frame.id == 0x700u + can_door_node_id) {
            ++self->heartbeats;
        } else {
            (void)sdo_client_take(&self->client, &frame);
        }
    }
    if (self->client.state == sdo_client_aborted) {
        ++self->aborted;
        return true;
    }
    if (self->client.state == sdo_client_done) {
        if (self->step > 0) {
            keep_answer(self);
        }
        ++self->answered;
        ++self->step;
        self->client.state = sdo_client_idle;
    }
    if (self->client.state == sdo_client_idle && self->step < steps) {
        frame = next_request(self);
        (void)put_frame(&self->to_node, &frame);
    }
    return self->step >= steps;
}
