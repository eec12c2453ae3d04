/* SPDX-License-Identifier: MIT */
#include "sim/node/simulated_drive_parts.h"

static bool period_agrees_with_1006(const struct simulated_drive *self)
{
    return self->node.sync.period_us == 0 || self->node.sync.timeout_us != 0 ||
           self->node.sync.period_us == simulated_drive_period_us(self);
}

/// Operation begins at the position where the motor is: set-points of before would be a jump.
static void forget_setpoints(struct simulated_drive *self)
{
    struct simulated_drive_objects *o = &self->objects;
    self->followed_position = o->target_position = o->position_actual;
    o->target_velocity = o->velocity_offset = 0;
    o->target_torque = o->torque_offset = 0;
    self->profile_torque = 0.0;
    self->following_samples = self->blocked_samples = 0;
}

static void begin_operation(struct simulated_drive *self)
{
    forget_setpoints(self);
    self->next_us = self->node.now_us + 2u * simulated_drive_period_us(self);
    if (self->period_valid && !self->period.wrong && period_agrees_with_1006(self))
        return;
    self->machine.state = cia402_switched_on;
    simulated_drive_detect(self, emcy_parameter, emcy_profile_specific, simulated_reaction_by_option);
}

static uint32_t write_control_word(void *owner, const struct od_entry *entry, int64_t value)
{
    struct simulated_drive *self = owner;
    enum cia402_state before = self->machine.state;
    od_store(owner, entry, value);
    if (cia402_machine_command(&self->machine, (uint16_t)value)) {
        self->objects.error_code = 0;
        canopen_node_clear_errors(&self->node);
    }
    if (before != cia402_operation_enabled && self->machine.state == cia402_operation_enabled)
        begin_operation(self);
    simulated_drive_update_status(self);
    return od_abort_none;
}

static uint32_t write_option(void *owner, const struct od_entry *entry, int64_t value)
{
    if (!cia402_option_is_valid(entry->index, value))
        return od_abort_value;
    od_store(owner, entry, value);
    return od_abort_none;
}

static uint32_t write_mode(void *owner, const struct od_entry *entry, int64_t value)
{
    struct simulated_drive *self = owner;
    bool known = value == 0 || (value > 0 && value <= 32 && (self->objects.supported_modes & CIA402_SUPPORTS(value)));
    if (!known)
        return od_abort_value;
    bool changes = value != self->objects.mode;
    if (changes && cia402_machine_is_powered(&self->machine)) {
        // Halted, or in no mode yet, and at rest: some clients change it there. Elsewhere it would be a step.
        bool resting = self->command.control == sim_control_stop && self->stood_still;
        if (!resting || self->machine.state != cia402_operation_enabled)
            return od_abort_state;
        forget_setpoints(self);
    }
    od_store(owner, entry, value);
    self->objects.mode_display = (int8_t)value;
    return od_abort_none;
}

static uint32_t write_max_torque(void *owner, const struct od_entry *entry, int64_t value)
{
    struct simulated_drive *self = owner;
    od_store(owner, entry, value);
    self->drive.torque_limit = (double)value * self->scaling.torque;
    return od_abort_none;
}

/// A ramp of 0 would never end.
static uint32_t write_ramp(void *owner, const struct od_entry *entry, int64_t value)
{
    if (value == 0)
        return od_abort_value;
    od_store(owner, entry, value);
    return od_abort_none;
}

static uint32_t write_position_limit(void *owner, const struct od_entry *entry, int64_t value)
{
    const struct simulated_drive *self = owner;
    if (entry->subindex == 1 ? value >= self->objects.position_max : value <= self->objects.position_min)
        return od_abort_value;
    od_store(owner, entry, value);
    return od_abort_none;
}

/// Takes the period over into the model if the model can run at it.
static uint32_t write_period(void *owner, const struct od_entry *entry, int64_t value)
{
    struct simulated_drive *self = owner;
    if (cia402_machine_is_powered(&self->machine))
        return od_abort_state;
    if (entry->type == od_u8 ? value == 0 : !(value >= -6 && value <= 0))
        return od_abort_value;
    od_store(owner, entry, value);
    const uint32_t shortest_us = 50, longest_us = 100000;
    uint32_t period_us = simulated_drive_period_us(self);
    self->period.periods = 0;
    self->period.wrong = false;
    // The two subindices are written one after the other: in between, the period may be one that does not suit.
    self->period_valid = period_us >= shortest_us && period_us <= longest_us;
    if (!self->period_valid)
        return od_abort_none;
    struct sim_model candidate = self->model;
    candidate.sample_rate_hz = 1e6 / period_us;
    char text[160];
    self->period_valid = sim_model_check(&candidate, text, sizeof text) == NULL;
    if (self->period_valid)
        self->model.sample_rate_hz = candidate.sample_rate_hz;
    return od_abort_none;
}

#define READ_ONLY(index, sub, type, member) OD_ENTRY(index, sub, type, od_readable, simulated_drive, member, NULL)
#define WRITABLE(index, sub, type, member, write)                                                                      \
    OD_ENTRY(index, sub, type, od_readable | od_writable, simulated_drive, member, write)
#define TARGET(index, type, member, write)                                                                             \
    OD_ENTRY(index, 0, type, od_readable | od_writable | od_mappable_receive, simulated_drive, objects.member, write)
#define ACTUAL(index, type, member)                                                                                    \
    OD_ENTRY(index, 0, type, od_readable | od_mappable_transmit, simulated_drive, objects.member, NULL)
#define OPTION(index, member) WRITABLE(index, 0, od_i16, machine.options.member, write_option)

const struct od_entry simulated_drive_entries[] = {
    OD_CONSTANT(0x2000, 0, od_u8, 6),
    READ_ONLY(0x2000, 1, od_u32, objects.saturated),
    READ_ONLY(0x2000, 2, od_u32, node.errors.targets_lost),
    READ_ONLY(0x2000, 3, od_u32, node.errors.targets_rejected),
    READ_ONLY(0x2000, 4, od_u32, node.sync.missed),
    READ_ONLY(0x2000, 5, od_u32, node.errors.values_refused),
    READ_ONLY(0x2000, 6, od_u32, commands_refused),
    OD_CONSTANT(0x2003, 0, od_u8, 1),
    WRITABLE(0x2003, 1, od_u32, node.sync.timeout_us, NULL),
    OD_CONSTANT(0x2004, 0, od_u8, 2),
    WRITABLE(0x2004, 1, od_u16, objects.blocked_torque, NULL),
    WRITABLE(0x2004, 2, od_u16, objects.blocked_time_ms, NULL),
    OPTION(cia402_abort_connection_option, abort_connection),
    ACTUAL(cia402_error_code, od_u16, error_code),
    TARGET(cia402_control_word, od_u16, control_word, write_control_word),
    ACTUAL(cia402_status_word, od_u16, status_word),
    OPTION(cia402_quick_stop_option, quick_stop),
    OPTION(cia402_shutdown_option, shutdown),
    OPTION(cia402_disable_operation_option, disable_operation),
    OPTION(cia402_halt_option, halt),
    OPTION(cia402_fault_reaction_option, fault_reaction),
    TARGET(cia402_modes_of_operation, od_i8, mode, write_mode),
    ACTUAL(cia402_mode_display, od_i8, mode_display),
    ACTUAL(cia402_position_actual, od_i32, position_actual),
    WRITABLE(cia402_following_error_window, 0, od_u32, objects.following_error_window, NULL),
    WRITABLE(cia402_following_error_timeout, 0, od_u16, objects.following_error_timeout_ms, NULL),
    ACTUAL(cia402_velocity_actual, od_i32, velocity_actual),
    TARGET(cia402_target_torque, od_i16, target_torque, NULL),
    WRITABLE(cia402_max_torque, 0, od_u16, objects.max_torque, write_max_torque),
    ACTUAL(cia402_torque_demand, od_i16, torque_demand),
    READ_ONLY(cia402_rated_torque, 0, od_u32, objects.rated_torque),
    ACTUAL(cia402_torque_actual, od_i16, torque_actual),
    TARGET(cia402_target_position, od_i32, target_position, NULL),
    OD_CONSTANT(cia402_position_limit, 0, od_u8, 2),
    WRITABLE(cia402_position_limit, 1, od_i32, objects.position_min, write_position_limit),
    WRITABLE(cia402_position_limit, 2, od_i32, objects.position_max, write_position_limit),
    WRITABLE(cia402_max_velocity, 0, od_u32, objects.max_velocity, NULL),
    WRITABLE(cia402_max_motor_speed, 0, od_u32, objects.max_motor_speed, NULL),
    WRITABLE(cia402_profile_deceleration, 0, od_u32, objects.profile_deceleration, write_ramp),
    WRITABLE(cia402_quick_stop_deceleration, 0, od_u32, objects.quick_stop_deceleration, write_ramp),
    WRITABLE(cia402_torque_slope, 0, od_u32, objects.torque_slope, write_ramp),
    OD_CONSTANT(cia402_encoder_resolution, 0, od_u8, 2),
    READ_ONLY(cia402_encoder_resolution, 1, od_u32, objects.increments),
    READ_ONLY(cia402_encoder_resolution, 2, od_u32, objects.revolutions),
    READ_ONLY(cia402_unit_position, 0, od_u32, objects.unit_position),
    READ_ONLY(cia402_unit_velocity, 0, od_u32, objects.unit_velocity),
    READ_ONLY(cia402_unit_acceleration, 0, od_u32, objects.unit_acceleration),
    TARGET(cia402_velocity_offset, od_i32, velocity_offset, NULL),
    TARGET(cia402_torque_offset, od_i16, torque_offset, NULL),
    OD_CONSTANT(cia402_interpolation_period, 0, od_u8, 2),
    WRITABLE(cia402_interpolation_period, 1, od_u8, objects.period_units, write_period),
    WRITABLE(cia402_interpolation_period, 2, od_i8, objects.period_exponent, write_period),
    ACTUAL(cia402_following_error_actual, od_i32, following_error_actual),
    TARGET(cia402_target_velocity, od_i32, target_velocity, NULL),
    READ_ONLY(cia402_supported_modes, 0, od_u32, objects.supported_modes),
};

const size_t simulated_drive_entry_count = sizeof simulated_drive_entries / sizeof simulated_drive_entries[0];

void simulated_drive_set_defaults(struct simulated_drive *self)
{
    struct simulated_drive_objects *o = &self->objects;
    cia402_machine_init(&self->machine);
    cia402_machine_event(&self->machine, cia402_initialised);
    o->mode = o->mode_display = cia402_mode_none;
    o->error_code = o->control_word = 0;
    o->target_position = o->target_velocity = o->velocity_offset = 0;
    o->target_torque = o->torque_offset = 0;
    o->following_error_window = UINT32_MAX;
    o->following_error_timeout_ms = 0;
    o->position_min = INT32_MIN;
    o->position_max = INT32_MAX;
    o->max_velocity = 0;
    o->max_motor_speed = UINT32_MAX;
    o->max_torque = UINT16_MAX;
    o->torque_slope = 10000;
    o->profile_deceleration = self->model.linear ? 1000 : 10000;
    o->quick_stop_deceleration = self->model.linear ? 5000 : 50000;
    o->blocked_torque = 1000; // nothing stands still under its rated torque for long
    o->blocked_time_ms = 20;
    self->drive.torque_limit = o->max_torque * self->scaling.torque;
    self->own_cycle = false;
    self->follows = self->limited = false;
    self->following_samples = self->blocked_samples = 0;
    self->period.periods = 0;
    self->period.wrong = false;
    simulated_drive_update_status(self);
}
