/* SPDX-License-Identifier: MIT */
/// Heartbeat (CiA 301): a node says periodically that it lives, another one notices when it stops. Times are arguments.
#ifndef SERVOSCOPE_DRIVERS_CAN_HEARTBEAT_H
#define SERVOSCOPE_DRIVERS_CAN_HEARTBEAT_H

#include "drivers/can/can_frame.h"
#include "drivers/can/nmt.h"

#include <stdbool.h>
#include <stdint.h>

enum { heartbeat_cob_id = 0x700 };

struct heartbeat_producer {
    uint8_t node_id;
    uint32_t period_us; ///< 0: silent
    uint64_t next_us;
};

enum heartbeat_life {
    heartbeat_unseen, ///< nothing heard yet: no reason to complain
    heartbeat_alive,
    heartbeat_lost,
};

struct heartbeat_consumer {
    uint8_t node_id;
    uint32_t timeout_us; ///< 0: does not watch
    uint64_t last_us;
    enum heartbeat_life life;
    uint8_t state;     ///< last one heard, enum nmt_state
    uint32_t boot_ups; ///< boot-up messages heard
};

struct can_frame heartbeat_frame(uint8_t node_id, enum nmt_state state);

/// Starts or, with period 0, ends producing; the first one is due at once.
void heartbeat_producer_start(struct heartbeat_producer *self, uint8_t node_id, uint32_t period_us, uint64_t now_us);

/// True if one is due now; fills it in and sets the next time.
bool heartbeat_producer_due(struct heartbeat_producer *self, enum nmt_state state, uint64_t now_us,
                            struct can_frame *out_frame);

uint64_t heartbeat_producer_deadline_us(const struct heartbeat_producer *self);

/// Starts or, with time-out 0, ends watching. Monitoring begins with the first heartbeat heard.
void heartbeat_consumer_start(struct heartbeat_consumer *self, uint8_t node_id, uint32_t timeout_us);

/// Takes a frame; true if it is the watched node's heartbeat or boot-up.
bool heartbeat_consumer_take(struct heartbeat_consumer *self, const struct can_frame *frame, uint64_t now_us);

/// True once, when the time-out has passed since the last one.
bool heartbeat_consumer_expired(struct heartbeat_consumer *self, uint64_t now_us);

uint64_t heartbeat_consumer_deadline_us(const struct heartbeat_consumer *self);

#endif
