/* SPDX-License-Identifier: MIT */
#include "sim/node/simulated_drive_parts.h"

#include <math.h>

static double period_s(const struct simulated_drive *self)
{
    return 1.0 / self->model.sample_rate_hz;
}

uint32_t simulated_drive_period_us(const struct simulated_drive *self)
{
    return cia402_period_us(self->objects.period_units, self->objects.period_exponent);
}

/// Below this speed the motor stands.
static double still_speed(const struct simulated_drive *self)
{
    return self->model.linear ? 3e-4 : 2e-2;
}

bool simulated_drive_is_moving(const struct simulated_drive *self)
{
    return isfinite(self->sample.velocity) && fabs(self->sample.velocity) > still_speed(self);
}

void simulated_drive_detect(struct simulated_drive *self, uint16_t code, uint8_t register_bits,
                            enum simulated_reaction reaction)
{
    struct cia402_machine *machine = &self->machine;
    bool had_torque = cia402_machine_is_powered(machine);
    bool first = machine->state != cia402_fault && machine->state != cia402_fault_reaction_active;
    if (first) {
        self->objects.error_code = code;
        cia402_machine_event(machine, cia402_fault_detected);
        self->ramping = false;
    }
    if (reaction == simulated_reaction_coast)
        cia402_machine_event(machine, cia402_fault_reaction_done);
    if (first || (had_torque && !cia402_machine_is_powered(machine)))
        canopen_node_raise(&self->node, code, register_bits);
    simulated_drive_update_status(self);
}

// ---- Status

static bool target_is_reached(const struct simulated_drive *self)
{
    if (self->command.control == sim_control_stop)
        return self->stood_still;
    return self->command.control == sim_control_torque && self->objects.mode == cia402_mode_profile_torque &&
           !(fabs(self->profile_torque - self->objects.target_torque) > 0.0);
}

void simulated_drive_update_status(struct simulated_drive *self)
{
    bool powered = cia402_machine_is_powered(&self->machine);
    bool clipped = self->limited || fabs(self->sample.torque_ref) >= self->drive.torque_limit;
    uint16_t word = cia402_status_encode(self->machine.state) | cia402_status_remote | cia402_status_voltage;
    if (powered && clipped && self->command.control != sim_control_off)
        word |= cia402_status_limited;
    if (powered && self->follows)
        word |= cia402_status_follows;
    if (powered && target_is_reached(self))
        word |= cia402_status_target_reached;
    if (self->objects.error_code == emcy_following_error || (powered && self->following_samples > 0))
        word |= cia402_status_following_error;
    self->objects.status_word = word;
}

// ---- What the set-points ask for, within their limits

static int64_t clipped(int64_t value, int64_t low, int64_t high, bool *io_limited)
{
    *io_limited = *io_limited || value < low || value > high;
    return value < low ? low : value > high ? high : value;
}

/// The position set-point, within 607D and moved no faster than 607F allows.
static int32_t limited_position(struct simulated_drive *self)
{
    const struct simulated_drive_objects *o = &self->objects;
    int64_t target = clipped(o->target_position, o->position_min, o->position_max, &self->limited);
    if (o->max_velocity == 0)
        return (int32_t)target;
    double limit = o->max_velocity * self->scaling.velocity * period_s(self) / self->scaling.position;
    int64_t step = (int64_t)fmin(limit, 4e9) + 1; // one count more: the set-points themselves are rounded
    int64_t from = self->followed_position;
    return (int32_t)clipped(target, from - step, from + step, &self->limited); // between two 32-bit numbers
}

static double limited_velocity(struct simulated_drive *self, int64_t velocity)
{
    int64_t limit = self->objects.max_velocity;
    if (limit > 0)
        velocity = clipped(velocity, -limit, limit, &self->limited);
    return (double)velocity * self->scaling.velocity;
}

/// One sample further along the slope (6087) towards the target, in permille.
static double next_profile_torque(struct simulated_drive *self)
{
    double step = self->objects.torque_slope * period_s(self);
    double to_go = self->objects.target_torque - self->profile_torque;
    self->profile_torque =
        fabs(to_go) <= step ? self->objects.target_torque : self->profile_torque + copysign(step, to_go);
    return self->profile_torque;
}

static struct sim_command command_of_mode(struct simulated_drive *self)
{
    const struct simulated_drive_objects *o = &self->objects;
    const struct cia402_scaling *s = &self->scaling;
    struct sim_command command = {.control = sim_control_torque, .torque = o->torque_offset * s->torque};
    switch (o->mode) {
    case cia402_mode_profile_torque:
        command.torque = next_profile_torque(self) * s->torque;
        return command;
    case cia402_mode_cst:
        command.torque = ((int32_t)o->target_torque + o->torque_offset) * s->torque;
        return command;
    case cia402_mode_csv:
        command.control = sim_control_velocity;
        command.velocity = limited_velocity(self, (int64_t)o->target_velocity + o->velocity_offset);
        return command;
    default:
        self->followed_position = limited_position(self);
        command.control = sim_control_cascade;
        command.position = self->followed_position * s->position;
        command.velocity = limited_velocity(self, o->velocity_offset);
        return command;
    }
}

static struct sim_command command_of_state(struct simulated_drive *self)
{
    struct sim_command command = {.control = sim_control_off};
    enum cia402_action action = cia402_machine_action(&self->machine);
    self->limited = false;
    if (action == cia402_coast)
        return command;
    if (action == cia402_follow_setpoints && self->objects.mode != cia402_mode_none)
        return command_of_mode(self);
    bool slow = action == cia402_slow_down_ramp;
    self->drive.stop_deceleration =
        (slow ? self->objects.profile_deceleration : self->objects.quick_stop_deceleration) * 1e-3;
    self->profile_torque = 0.0; // begins anew after a halt
    command.control = sim_control_stop;
    return command;
}

// ---- What is watched

/// A stop in which the motor gets faster is none: the encoder counts the wrong way, or the motor is driven.
static bool is_running_away(const struct simulated_drive *self)
{
    const double margin = 100.0 * still_speed(self), growth = 1.2; // a swinging belt adds some
    return self->ramping && !(fabs(self->sample.velocity) <= growth * self->stop_speed + margin);
}

/// A stop is over when its ramp has reached zero and the motor follows, or a tenth of a second after the ramp at the
/// latest.
static void follow_stop(struct simulated_drive *self)
{
    if (self->command.control != sim_control_stop) {
        self->ramping = self->stood_still = false;
        return;
    }
    if (!self->ramping) {
        self->ramping = true;
        self->stood_still = false;
        self->stopping_samples = 0;
        self->stop_speed = fabs(self->sample.velocity);
    }
    if (is_running_away(self)) {
        simulated_drive_detect(self, emcy_speed, emcy_profile_specific, simulated_reaction_coast);
        return;
    }
    if (self->drive.stop_velocity != 0.0)
        return;
    self->stopping_samples++;
    const double longest_s = 0.1;
    if (!(fabs(self->sample.velocity) <= still_speed(self)) && self->stopping_samples * period_s(self) < longest_s)
        return;
    self->stood_still = true;
    cia402_machine_stood_still(&self->machine);
}

static void watch_following_error(struct simulated_drive *self)
{
    struct simulated_drive_objects *o = &self->objects;
    bool following = self->command.control == sim_control_cascade;
    int64_t error = following ? (int64_t)self->followed_position - o->position_actual : 0;
    o->following_error_actual = (int32_t)fmin(fmax((double)error, INT32_MIN), INT32_MAX);
    bool watched = o->following_error_window != 0 && o->following_error_window != UINT32_MAX;
    if (!watched || (error < 0 ? -error : error) <= (int64_t)o->following_error_window) {
        self->following_samples = 0;
        return;
    }
    self->following_samples++;
    if (self->following_samples * period_s(self) * 1e3 > o->following_error_timeout_ms)
        simulated_drive_detect(self, emcy_following_error, emcy_profile_specific, simulated_reaction_by_option);
}

static void watch_travel(struct simulated_drive *self)
{
    const struct simulated_drive_objects *o = &self->objects;
    bool commanded = self->command.control == sim_control_torque || self->command.control == sim_control_velocity;
    bool above = o->position_actual > o->position_max && o->velocity_actual > 0;
    bool below = o->position_actual < o->position_min && o->velocity_actual < 0;
    if ((commanded && (above || below)) || self->drive.hit_end_stop)
        simulated_drive_detect(self, emcy_travel, emcy_profile_specific, simulated_reaction_by_option);
}

static void watch_speed(struct simulated_drive *self)
{
    uint32_t limit = self->objects.max_motor_speed;
    const double unit = self->model.linear ? 1e-3 : 6.283185307179586 / 60.0;
    if (limit != UINT32_MAX && !(fabs(self->sample.velocity) <= limit * unit))
        simulated_drive_detect(self, emcy_speed, emcy_profile_specific, simulated_reaction_by_option);
}

static void watch_motion(struct simulated_drive *self)
{
    const struct simulated_drive_objects *o = &self->objects;
    bool still = o->position_actual == self->last_position;
    int32_t torque = o->torque_demand;
    self->last_position = o->position_actual;
    if (!still || (torque < 0 ? -torque : torque) < o->blocked_torque) {
        self->blocked_samples = 0;
        return;
    }
    self->blocked_samples++;
    if (o->blocked_time_ms != 0 && self->blocked_samples * period_s(self) * 1e3 > o->blocked_time_ms)
        simulated_drive_detect(self, emcy_motor_blocked, emcy_profile_specific, simulated_reaction_coast);
}

// ---- One sample

/// Measured values into their objects; false if they are none.
static bool publish(struct simulated_drive *self)
{
    struct simulated_drive_objects *o = &self->objects;
    const struct cia402_scaling *s = &self->scaling;
    uint32_t *saturated = &o->saturated;
    o->torque_actual = (int16_t)cia402_to_units(self->sample.torque, s->torque, INT16_MIN, INT16_MAX, saturated);
    o->torque_demand = (int16_t)cia402_to_units(self->sample.torque_ref, s->torque, INT16_MIN, INT16_MAX, saturated);
    if (!isfinite(self->sample.position) || !isfinite(self->sample.velocity))
        return false; // the last good ones stay
    o->position_actual = cia402_to_units(self->sample.position, s->position, INT32_MIN, INT32_MAX, saturated);
    o->velocity_actual = cia402_to_units(self->sample.velocity, s->velocity, INT32_MIN, INT32_MAX, saturated);
    return true;
}

void simulated_drive_take_sample(struct simulated_drive *self, bool targets_fresh)
{
    self->drive.hit_end_stop = false;
    self->command = command_of_state(self);
    sim_belt_drive_step(&self->drive, &self->command, &self->sample);
    self->samples++;
    bool measured = publish(self);
    bool off = self->command.control == sim_control_off;
    self->follows = targets_fresh && !off && self->command.control != sim_control_stop;
    if (!measured) {
        self->follows = false;
        simulated_drive_detect(self, emcy_encoder, emcy_profile_specific, simulated_reaction_coast);
    } else {
        watch_following_error(self);
        follow_stop(self);
        if (!off) {
            watch_travel(self);
            watch_speed(self);
            watch_motion(self);
        }
    }
    simulated_drive_update_status(self);
    // Off and at rest since this sample: nothing left to do alone.
    if (off && !simulated_drive_is_moving(self))
        self->own_cycle = false;
}
