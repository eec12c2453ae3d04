/* SPDX-License-Identifier: MIT */
#include "guard/latch.h"

#include "core/fixed.h"

void guard_state_init(struct guard_state *self, uint32_t watchdog_samples, uint32_t stuck_samples)
{
    self->mode = guard_idle;
    self->cause = guard_cause_none;
    self->watchdog_samples = watchdog_samples;
    self->stuck_samples = stuck_samples;
    self->silent_samples = 0;
    self->still_samples = 0;
    self->signs_of_life = 0;
    self->signs_seen = 0;
    self->count.trips = 0;
    self->count.torque_clipped = 0;
}

void guard_alive(struct guard_state *state)
{
    state->signs_of_life = state->signs_of_life + 1u;
}

enum core_status guard_state_arm(struct guard_state *self, bool inside)
{
    if (!inside) {
        self->mode = self->mode == guard_tripped ? guard_tripped : guard_idle;
        return core_err_guard_outside;
    }
    self->mode = guard_armed;
    self->cause = guard_cause_none;
    self->silent_samples = 0;
    self->still_samples = 0;
    self->signs_seen = self->signs_of_life;
    return core_ok;
}

enum guard_cause guard_state_watch(struct guard_state *self, enum guard_cause measured, bool still)
{
    if (self->mode != guard_armed) {
        return guard_cause_none;
    }
    uint32_t signs = self->signs_of_life;
    self->silent_samples = signs == self->signs_seen ? core_count_up(self->silent_samples) : 0;
    self->signs_seen = signs;
    self->still_samples = still ? core_count_up(self->still_samples) : 0;
    if (measured != guard_cause_none) {
        return measured;
    }
    if (self->watchdog_samples != 0 && self->silent_samples > self->watchdog_samples) {
        return guard_cause_watchdog;
    }
    if (self->stuck_samples != 0 && self->still_samples >= self->stuck_samples) {
        return guard_cause_stuck;
    }
    return guard_cause_none;
}

enum guard_action guard_state_latch(struct guard_state *self, enum guard_cause cause)
{
    if (cause != guard_cause_none) {
        self->mode = guard_tripped;
        self->cause = cause;
        self->count.trips = core_count_up(self->count.trips);
    }
    return self->mode == guard_armed ? guard_run : guard_ramp_down;
}

const char *guard_cause_str(enum guard_cause cause)
{
    switch (cause) {
    case guard_cause_none:
        return "none";
    case guard_cause_sensor:
        return "sensor";
    case guard_cause_travel:
        return "travel";
    case guard_cause_speed:
        return "speed";
    case guard_cause_watchdog:
        return "watchdog";
    case guard_cause_stuck:
        return "stuck";
    default:
        return "unknown cause";
    }
}
