/* SPDX-License-Identifier: MIT */
/// SYNC (CiA 301) with its counter: the bus's common sampling instant, and how a missing one is noticed.
#ifndef SERVOSCOPE_DRIVERS_CAN_SYNC_H
#define SERVOSCOPE_DRIVERS_CAN_SYNC_H

#include "drivers/can/can_frame.h"

#include <stdbool.h>
#include <stdint.h>

enum { sync_cob_id = 0x080, sync_overflow_min = 2, sync_overflow_max = 240 };

struct sync_producer {
    uint8_t overflow; ///< the counter runs 1 .. overflow (object 1019); 0: SYNC without counter
    uint8_t counter;  ///< of the last SYNC, 0 before the first
};

/// The counter that the next SYNC will carry, 0 if it carries none.
uint8_t sync_producer_upcoming(const struct sync_producer *self);

/// Makes the next SYNC.
struct can_frame sync_producer_next(struct sync_producer *self);

struct sync_consumer {
    uint32_t period_us;  ///< object 1006; 0: no time-out
    uint32_t timeout_us; ///< 0: 1.5 periods, which a bus without real-time rights cannot keep
    uint32_t window_us;  ///< object 1007: set-points that come later after SYNC are passed over; 0: none is
    uint8_t overflow;    ///< object 1019; 0: SYNC comes without counter
    uint8_t counter;     ///< of the last SYNC taken
    bool running;        ///< a SYNC has come and none was missed for the time-out since
    uint64_t last_us;
    uint32_t missed;    ///< SYNCs that did not come, by the counter's gaps
    uint32_t repeated;  ///< SYNCs that came twice or out of order
    uint32_t malformed; ///< wrong length for the counter agreed on
};

enum sync_result {
    sync_none,      ///< not a SYNC
    sync_taken,     ///< the one expected
    sync_gap,       ///< a SYNC, but not the successor of the last one
    sync_repeated,  ///< the last one once more, or an old one that was held up: not to be acted on
    sync_malformed, ///< a SYNC of a wrong length: not to be acted on
};

/// Whether the time after the last SYNC in which set-points for the next one may come is over.
bool sync_consumer_window_is_over(const struct sync_consumer *self, uint64_t now_us);

/// Forgets what came before; keeps period, time-out and overflow.
void sync_consumer_restart(struct sync_consumer *self);

enum sync_result sync_consumer_take(struct sync_consumer *self, const struct can_frame *frame, uint64_t now_us);

/// When the next SYNC counts as lost: the time-out after the last one.
uint64_t sync_consumer_deadline_us(const struct sync_consumer *self);

/// True once, when that time has come; then waits for a first SYNC again.
bool sync_consumer_expired(struct sync_consumer *self, uint64_t now_us);

#endif
