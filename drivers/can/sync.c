/* SPDX-License-Identifier: MIT */
#include "drivers/can/sync.h"

#include "drivers/can/can_port.h"

static uint8_t successor(uint8_t counter, uint8_t overflow)
{
    return counter >= overflow ? 1 : (uint8_t)(counter + 1);
}

uint8_t sync_producer_upcoming(const struct sync_producer *self)
{
    return self->overflow == 0 ? 0 : successor(self->counter, self->overflow);
}

struct can_frame sync_producer_next(struct sync_producer *self)
{
    struct can_frame frame = can_frame_make(sync_cob_id, self->overflow == 0 ? 0 : 1);
    self->counter = sync_producer_upcoming(self);
    frame.data[0] = self->counter;
    return frame;
}

void sync_consumer_restart(struct sync_consumer *self)
{
    self->counter = 0;
    self->running = false;
}

enum sync_result sync_consumer_take(struct sync_consumer *self, const struct can_frame *frame, uint64_t now_us)
{
    if (frame->id != sync_cob_id || frame->remote)
        return sync_none;
    if (frame->length != (self->overflow == 0 ? 0 : 1)) {
        self->malformed++;
        return sync_malformed;
    }
    uint8_t before = self->counter;
    bool first = !self->running;
    uint32_t skipped = 0;
    if (!first && self->overflow != 0) {
        skipped = ((uint32_t)frame->data[0] + 2u * self->overflow - before - 1u) % self->overflow;
        // More than half way round is an old one rather than a new one. Only with a time-out: without it, a master that
        // counts from 1 again would be ignored for long.
        bool old = self->period_us != 0 && skipped >= self->overflow / 2u;
        if (old || frame->data[0] == before) {
            self->repeated++;
            return sync_repeated;
        }
    }
    self->counter = frame->data[0];
    self->running = true;
    self->last_us = now_us;
    self->missed += skipped;
    return skipped == 0 ? sync_taken : sync_gap;
}

bool sync_consumer_window_is_over(const struct sync_consumer *self, uint64_t now_us)
{
    return self->window_us != 0 && self->running && now_us > self->last_us + self->window_us;
}

uint64_t sync_consumer_deadline_us(const struct sync_consumer *self)
{
    if (!self->running || self->period_us == 0)
        return CAN_NEVER_US;
    return self->last_us + (self->timeout_us != 0 ? self->timeout_us : self->period_us + self->period_us / 2);
}

bool sync_consumer_expired(struct sync_consumer *self, uint64_t now_us)
{
    if (now_us < sync_consumer_deadline_us(self))
        return false;
    self->running = false;
    return true;
}
