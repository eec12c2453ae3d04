/* SPDX-License-Identifier: MIT */
/// What the two variants of the guard share; not for applications.
#ifndef SERVOSCOPE_GUARD_LATCH_H
#define SERVOSCOPE_GUARD_LATCH_H

#include "guard/guard.h"

#ifdef __cplusplus
extern "C" {
#endif

void guard_state_init(struct guard_state *self, uint32_t watchdog_samples, uint32_t stuck_samples);

/// Arms or refuses; `inside` says whether the axis is inside its limits now.
enum core_status guard_state_arm(struct guard_state *self, bool inside);

/// Moves the two clocks on by one sample and returns the cause, `measured` first if there is one.
/// `still`: position unchanged under torque. Does nothing unless armed.
enum guard_cause guard_state_watch(struct guard_state *self, enum guard_cause measured, bool still);

/// Latches a cause, if there is one, and says what the player has to do.
enum guard_action guard_state_latch(struct guard_state *self, enum guard_cause cause);

#ifdef __cplusplus
}
#endif

#endif
