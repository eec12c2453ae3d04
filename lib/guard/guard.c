/* SPDX-License-Identifier: MIT */
#include "guard/guard.h"

#include "core/fixed.h"
#include "guard/latch.h"

enum core_status guard_init(struct guard *self, const struct guard_limits *limits)
{
    if (!self || !limits) {
        return core_err_argument;
    }
    if (!(limits->position_min < limits->position_max)) {
        return core_err_guard_travel;
    }
    if (!(limits->velocity_max > 0)) {
        return core_err_guard_velocity;
    }
    if (!(limits->torque_max > 0)) {
        return core_err_guard_torque;
    }
    if (limits->stuck_torque < 0 || (limits->stuck_samples != 0 && limits->stuck_torque == 0)) {
        return core_err_guard_stuck;
    }
    guard_state_init(&self->state, limits->watchdog_samples, limits->stuck_samples);
    self->limits = *limits;
    self->trip_value = 0;
    self->last_position = 0;
    return core_ok;
}

/* Compared on both sides rather than by magnitude: |INT32_MIN| does not exist. */
static enum guard_cause judge(const struct guard *self, const struct guard_sample *sample)
{
    const struct guard_limits *limits = &self->limits;
    if (!sample->valid) {
        return guard_cause_sensor;
    }
    if (!(sample->position >= limits->position_min && sample->position <= limits->position_max)) {
        return guard_cause_travel;
    }
    bool unlimited = limits->velocity_max == INT32_MAX;
    if (!unlimited && !(sample->velocity >= -limits->velocity_max && sample->velocity <= limits->velocity_max)) {
        return guard_cause_speed;
    }
    return guard_cause_none;
}

enum core_status guard_arm(struct guard *self, const struct guard_sample *now)
{
    if (!self || !now) {
        return core_err_argument;
    }
    enum core_status status = guard_state_arm(&self->state, judge(self, now) == guard_cause_none);
    if (status == core_ok) {
        self->trip_value = 0;
        self->last_position = now->position;
    }
    return status;
}

static int32_t value_of(const struct guard *self, enum guard_cause cause, const struct guard_sample *sample)
{
    switch (cause) {
    case guard_cause_travel:
        return sample->position;
    case guard_cause_speed:
        return sample->velocity;
    case guard_cause_stuck:
        return sample->torque;
    case guard_cause_watchdog:
        return self->state.silent_samples > (uint32_t)INT32_MAX ? INT32_MAX : (int32_t)self->state.silent_samples;
    case guard_cause_sensor:
    case guard_cause_none:
    default:
        return 0;
    }
}

enum guard_action guard_step(struct guard *self, const struct guard_sample *sample)
{
    const struct guard_limits *limits = &self->limits;
    bool still = sample->position == self->last_position &&
                 (sample->torque >= limits->stuck_torque || sample->torque <= -limits->stuck_torque);
    enum guard_cause cause = guard_state_watch(&self->state, judge(self, sample), still);
    if (cause != guard_cause_none) {
        self->trip_value = value_of(self, cause, sample);
    }
    self->last_position = sample->position;
    return guard_state_latch(&self->state, cause);
}

int32_t guard_clip_torque(struct guard *self, int32_t torque)
{
    bool clipped = false;
    int32_t result = core_saturate_i32(torque, self->limits.torque_max, &clipped);
    if (clipped) {
        self->state.count.torque_clipped = core_count_up(self->state.count.torque_clipped);
    }
    return result;
}
