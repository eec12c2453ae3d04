/* SPDX-License-Identifier: MIT */
#include "drivers/can/heartbeat.h"

#include "drivers/can/can_port.h"

struct can_frame heartbeat_frame(uint8_t node_id, enum nmt_state state)
{
    struct can_frame frame = can_frame_make((uint16_t)(heartbeat_cob_id + node_id), 1);
    frame.data[0] = (uint8_t)state;
    return frame;
}

void heartbeat_producer_start(struct heartbeat_producer *self, uint8_t node_id, uint32_t period_us, uint64_t now_us)
{
    *self = (struct heartbeat_producer){.node_id = node_id, .period_us = period_us, .next_us = now_us};
}

bool heartbeat_producer_due(struct heartbeat_producer *self, enum nmt_state state, uint64_t now_us,
                            struct can_frame *out_frame)
{
    if (self->period_us == 0 || now_us < self->next_us)
        return false;
    *out_frame = heartbeat_frame(self->node_id, state);
    self->next_us += self->period_us;
    if (self->next_us <= now_us) // was held up for longer than a period: no burst to catch up
        self->next_us = now_us + self->period_us;
    return true;
}

uint64_t heartbeat_producer_deadline_us(const struct heartbeat_producer *self)
{
    return self->period_us == 0 ? CAN_NEVER_US : self->next_us;
}

void heartbeat_consumer_start(struct heartbeat_consumer *self, uint8_t node_id, uint32_t timeout_us)
{
    *self = (struct heartbeat_consumer){.node_id = node_id, .timeout_us = timeout_us};
}

bool heartbeat_consumer_take(struct heartbeat_consumer *self, const struct can_frame *frame, uint64_t now_us)
{
    if (frame->id != heartbeat_cob_id + self->node_id || frame->remote || frame->length != 1)
        return false;
    self->last_us = now_us;
    self->life = heartbeat_alive;
    self->state = frame->data[0] & 0x7F; // bit 7 is node guarding's toggle
    if (frame->data[0] == nmt_initialising)
        self->boot_ups++;
    return true;
}

bool heartbeat_consumer_expired(struct heartbeat_consumer *self, uint64_t now_us)
{
    if (now_us < heartbeat_consumer_deadline_us(self))
        return false;
    self->life = heartbeat_lost;
    return true;
}

uint64_t heartbeat_consumer_deadline_us(const struct heartbeat_consumer *self)
{
    if (self->timeout_us == 0 || self->life != heartbeat_alive)
        return CAN_NEVER_US;
    return self->last_us + self->timeout_us;
}
