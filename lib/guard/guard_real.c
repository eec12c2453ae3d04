/* SPDX-License-Identifier: MIT */
#include "guard/guard_real.h"

#include "core/fixed.h"
#include "guard/latch.h"

static bool is_within(core_real value, core_real low, core_real high)
{
    return value >= low && value <= high;
}

static bool is_finite(core_real value)
{
    return is_within(value, -CORE_REAL_MAX, CORE_REAL_MAX);
}

enum core_status guard_real_init(struct guard_real *self, const struct guard_real_limits *limits)
{
    if (!self || !limits) {
        return core_err_argument;
    }
    if (!(limits->position_min_rad < limits->position_max_rad)) {
        return core_err_guard_travel;
    }
    if (!(limits->velocity_max_rad_per_s > 0)) {
        return core_err_guard_velocity;
    }
    if (!(limits->torque_max_Nm > 0)) {
        return core_err_guard_torque;
    }
    if (limits->stuck_samples != 0 && !(limits->stuck_torque_Nm > 0)) {
        return core_err_guard_stuck;
    }
    guard_state_init(&self->state, limits->watchdog_samples, limits->stuck_samples);
    self->limits = *limits;
    self->trip_value = 0;
    self->last_position_rad = 0;
    return core_ok;
}

/* A sensor that delivers no number is the sensor's fault, not the axis's, so it is looked at first. */
static enum guard_cause judge(const struct guard_real *self, const struct guard_real_sample *sample)
{
    const struct guard_real_limits *limits = &self->limits;
    if (!sample->valid || !is_finite(sample->position_rad) || !is_finite(sample->velocity_rad_per_s) ||
        !is_finite(sample->torque_Nm)) {
        return guard_cause_sensor;
    }
    if (!is_within(sample->position_rad, limits->position_min_rad, limits->position_max_rad)) {
        return guard_cause_travel;
    }
    if (!is_within(sample->velocity_rad_per_s, -limits->velocity_max_rad_per_s, limits->velocity_max_rad_per_s)) {
        return guard_cause_speed;
    }
    return guard_cause_none;
}

enum core_status guard_real_arm(struct guard_real *self, const struct guard_real_sample *now)
{
    if (!self || !now) {
        return core_err_argument;
    }
    enum core_status status = guard_state_arm(&self->state, judge(self, now) == guard_cause_none);
    if (status == core_ok) {
        self->trip_value = 0;
        self->last_position_rad = now->position_rad;
    }
    return status;
}

static core_real sensor_value(const struct guard_real_sample *sample)
{
    if (!is_finite(sample->position_rad)) {
        return sample->position_rad;
    }
    return !is_finite(sample->velocity_rad_per_s) ? sample->velocity_rad_per_s : sample->torque_Nm;
}

static core_real value_of(const struct guard_real *self, enum guard_cause cause, const struct guard_real_sample *sample)
{
    switch (cause) {
    case guard_cause_travel:
        return sample->position_rad;
    case guard_cause_speed:
        return sample->velocity_rad_per_s;
    case guard_cause_stuck:
        return sample->torque_Nm;
    case guard_cause_watchdog:
        return (core_real)self->state.silent_samples;
    case guard_cause_sensor:
    case guard_cause_none:
    default:
        return sensor_value(sample);
    }
}

enum guard_action guard_real_step(struct guard_real *self, const struct guard_real_sample *sample)
{
    core_real threshold = self->limits.stuck_torque_Nm;
    bool unmoved = is_within(sample->position_rad - self->last_position_rad, 0, 0);
    bool loaded = sample->torque_Nm >= threshold || sample->torque_Nm <= -threshold;
    enum guard_cause cause = guard_state_watch(&self->state, judge(self, sample), unmoved && loaded);
    if (cause != guard_cause_none) {
        self->trip_value = value_of(self, cause, sample);
    }
    self->last_position_rad = sample->position_rad;
    return guard_state_latch(&self->state, cause);
}

core_real guard_real_clip_torque(struct guard_real *self, core_real torque_Nm)
{
    core_real limit = self->limits.torque_max_Nm;
    if (is_within(torque_Nm, -limit, limit)) {
        return torque_Nm;
    }
    self->state.count.torque_clipped = core_count_up(self->state.count.torque_clipped);
    if (torque_Nm > limit) {
        return limit;
    }
    return torque_Nm < -limit ? -limit : 0;
}
