/* SPDX-License-Identifier: MIT */
#include "sim/node/simulated_drive.h"

#include <math.h>
#include <string.h>

static double sample_period_s(const struct simulated_drive *self)
{
    return 1.0 / self->model.sample_rate_hz;
}

static void detect_fault(struct simulated_drive *self, uint16_t code, uint8_t register_bits)
{
    bool powered = cia402_machine_is_powered(&self->machine);
    if (self->machine.state == cia402_fault || self->machine.state == cia402_fault_reaction_active)
        return;
    self->objects.error_code = code;
    cia402_machine_event(&self->machine, cia402_fault_detected);
    self->stopping_samples = 0;
    if (!powered) // nothing to ramp down
        cia402_machine_event(&self->machine, cia402_fault_reaction_done);
    canopen_node_raise(&self->node, code, register_bits);
}

// ---- Dictionary

static uint32_t write_control_word(void *owner, const struct od_entry *entry, int64_t value)
{
    struct simulated_drive *self = owner;
    enum cia402_state before = self->machine.state;
    od_store(owner, entry, value);
    if (cia402_machine_command(&self->machine, (uint16_t)value)) {
        self->objects.error_code = 0;
        canopen_node_clear_errors(&self->node);
    }
    if (before != cia402_operation_enabled && self->machine.state == cia402_operation_enabled) {
        self->followed_position = self->objects.position_actual;
        self->following_samples = 0;
        if (!self->period_valid) {
            self->machine.state = cia402_switched_on;
            detect_fault(self, emcy_parameter, emcy_profile_specific);
        }
    }
    if (before != self->machine.state)
        self->stopping_samples = 0;
    return od_abort_none;
}

static uint32_t write_quick_stop_option(void *owner, const struct od_entry *entry, int64_t value)
{
    struct simulated_drive *self = owner;
    if (value != 2 && value != 6)
        return od_abort_value;
    od_store(owner, entry, value);
    self->machine.stays_in_quick_stop = value == 6;
    return od_abort_none;
}

static uint32_t write_mode(void *owner, const struct od_entry *entry, int64_t value)
{
    struct simulated_drive *self = owner;
    if (value != cia402_mode_csp && value != cia402_mode_cst && value != 0)
        return od_abort_value;
    if (cia402_machine_is_powered(&self->machine) && value != self->objects.mode)
        return od_abort_state; // a change under torque would be a step
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

static uint32_t write_deceleration(void *owner, const struct od_entry *entry, int64_t value)
{
    struct simulated_drive *self = owner;
    if (value == 0) // would never stop
        return od_abort_value;
    od_store(owner, entry, value);
    self->drive.stop_deceleration = (double)value * 1e-3;
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
    uint32_t period_us = cia402_period_us(self->objects.period_units, self->objects.period_exponent);
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

#define AT(member) offsetof(struct simulated_drive, member)
#define CONSTANT(index, sub, type, value)                                                                              \
    {                                                                                                                  \
        index, sub, type, od_readable | od_constant, 0, value, NULL                                                    \
    }
#define READ_ONLY(index, sub, type, member)                                                                            \
    {                                                                                                                  \
        index, sub, type, od_readable, AT(member), 0, NULL                                                             \
    }
#define WRITABLE(index, sub, type, member, write)                                                                      \
    {                                                                                                                  \
        index, sub, type, od_readable | od_writable, AT(objects.member), 0, write                                      \
    }
#define TARGET(index, type, member, write)                                                                             \
    {                                                                                                                  \
        index, 0, type, od_readable | od_writable | od_mappable_receive, AT(objects.member), 0, write                  \
    }
#define ACTUAL(index, type, member)                                                                                    \
    {                                                                                                                  \
        index, 0, type, od_readable | od_mappable_transmit, AT(objects.member), 0, NULL                                \
    }

static const struct od_entry profile_entries[] = {
    CONSTANT(0x2000, 0, od_u8, 5),
    READ_ONLY(0x2000, 1, od_u32, objects.saturated),
    READ_ONLY(0x2000, 2, od_u32, node.errors.targets_lost),
    READ_ONLY(0x2000, 3, od_u32, node.errors.targets_rejected),
    READ_ONLY(0x2000, 4, od_u32, node.sync.missed),
    READ_ONLY(0x2000, 5, od_u32, node.errors.values_refused),
    ACTUAL(cia402_error_code, od_u16, error_code),
    TARGET(cia402_control_word, od_u16, control_word, write_control_word),
    ACTUAL(cia402_status_word, od_u16, status_word),
    WRITABLE(cia402_quick_stop_option, 0, od_i16, quick_stop_option, write_quick_stop_option),
    TARGET(cia402_modes_of_operation, od_i8, mode, write_mode),
    ACTUAL(cia402_mode_display, od_i8, mode_display),
    ACTUAL(cia402_position_actual, od_i32, position_actual),
    WRITABLE(cia402_following_error_window, 0, od_u32, following_error_window, NULL),
    WRITABLE(cia402_following_error_timeout, 0, od_u16, following_error_timeout_ms, NULL),
    ACTUAL(cia402_velocity_actual, od_i32, velocity_actual),
    TARGET(cia402_target_torque, od_i16, target_torque, NULL),
    WRITABLE(cia402_max_torque, 0, od_u16, max_torque, write_max_torque),
    ACTUAL(cia402_torque_demand, od_i16, torque_demand),
    READ_ONLY(cia402_rated_torque, 0, od_u32, objects.rated_torque),
    ACTUAL(cia402_torque_actual, od_i16, torque_actual),
    TARGET(cia402_target_position, od_i32, target_position, NULL),
    WRITABLE(cia402_max_velocity, 0, od_u32, max_velocity, NULL),
    WRITABLE(cia402_quick_stop_deceleration, 0, od_u32, quick_stop_deceleration, write_deceleration),
    CONSTANT(cia402_encoder_resolution, 0, od_u8, 2),
    READ_ONLY(cia402_encoder_resolution, 1, od_u32, objects.increments),
    READ_ONLY(cia402_encoder_resolution, 2, od_u32, objects.revolutions),
    READ_ONLY(cia402_unit_position, 0, od_u32, objects.unit_position),
    READ_ONLY(cia402_unit_velocity, 0, od_u32, objects.unit_velocity),
    READ_ONLY(cia402_unit_acceleration, 0, od_u32, objects.unit_acceleration),
    TARGET(cia402_velocity_offset, od_i32, velocity_offset, NULL),
    TARGET(cia402_torque_offset, od_i16, torque_offset, NULL),
    CONSTANT(cia402_interpolation_period, 0, od_u8, 2),
    WRITABLE(cia402_interpolation_period, 1, od_u8, period_units, write_period),
    WRITABLE(cia402_interpolation_period, 2, od_i8, period_exponent, write_period),
    ACTUAL(cia402_following_error_actual, od_i32, following_error_actual),
    READ_ONLY(cia402_supported_modes, 0, od_u32, objects.supported_modes),
};

// ---- Stops and limits

/// A stop is over when its ramp has reached zero and the motor follows, or a tenth of a second after the ramp at the
/// latest.
static void finish_stop(struct simulated_drive *self)
{
    bool stopping =
        self->machine.state == cia402_quick_stop_active || self->machine.state == cia402_fault_reaction_active;
    if (!stopping || self->drive.stop_velocity != 0.0)
        return;
    self->stopping_samples++;
    const double still = self->model.linear ? 3e-4 : 2e-2, longest_s = 0.1;
    if (!(fabs(self->sample.velocity) <= still) && self->stopping_samples * sample_period_s(self) < longest_s)
        return;
    if (self->machine.state == cia402_fault_reaction_active)
        cia402_machine_event(&self->machine, cia402_fault_reaction_done);
    else if (!self->machine.stays_in_quick_stop)
        cia402_machine_event(&self->machine, cia402_quick_stop_done);
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
    if (self->following_samples * sample_period_s(self) * 1e3 > o->following_error_timeout_ms)
        detect_fault(self, emcy_following_error, emcy_profile_specific);
}

// ---- One sample

/// The position set-point, moved no faster than 607F allows.
static int32_t limited_position(struct simulated_drive *self)
{
    int64_t target = self->objects.target_position;
    if (self->objects.max_velocity == 0)
        return (int32_t)target;
    double limit = self->objects.max_velocity * self->scaling.velocity * sample_period_s(self) / self->scaling.position;
    int64_t step = (int64_t)fmin(limit, 4e9) + 1; // one count more: the set-points themselves are rounded
    int64_t from = self->followed_position;
    if (target > from + step || target < from - step) {
        self->limited = true;
        target = target > from ? from + step : from - step;
    }
    return (int32_t)target; // between two 32-bit numbers
}

static int32_t limited_velocity(struct simulated_drive *self)
{
    int64_t limit = self->objects.max_velocity, velocity = self->objects.velocity_offset;
    if (limit == 0 || (velocity <= limit && velocity >= -limit))
        return (int32_t)velocity;
    self->limited = true;
    return (int32_t)(velocity > 0 ? limit : -limit);
}

static struct sim_command command_of_state(struct simulated_drive *self)
{
    const struct simulated_drive_objects *o = &self->objects;
    const struct cia402_scaling *s = &self->scaling;
    struct sim_command command = {.control = sim_control_off};
    self->limited = false;
    if (!cia402_machine_is_powered(&self->machine))
        return command;
    if (self->machine.state != cia402_operation_enabled || (o->control_word & cia402_control_halt) || o->mode == 0) {
        command.control = sim_control_stop;
    } else if (o->mode == cia402_mode_cst) {
        command.control = sim_control_torque;
        command.torque = ((int32_t)o->target_torque + o->torque_offset) * s->torque;
    } else {
        self->followed_position = limited_position(self);
        command.control = sim_control_cascade;
        command.position = self->followed_position * s->position;
        command.velocity = limited_velocity(self) * s->velocity;
        command.torque = o->torque_offset * s->torque;
    }
    return command;
}

static void publish(struct simulated_drive *self, bool targets_fresh)
{
    struct simulated_drive_objects *o = &self->objects;
    const struct cia402_scaling *s = &self->scaling;
    uint32_t *saturated = &o->saturated;
    o->position_actual = cia402_to_units(self->sample.position, s->position, INT32_MIN, INT32_MAX, saturated);
    o->velocity_actual = cia402_to_units(self->sample.velocity, s->velocity, INT32_MIN, INT32_MAX, saturated);
    o->torque_actual = (int16_t)cia402_to_units(self->sample.torque, s->torque, INT16_MIN, INT16_MAX, saturated);
    o->torque_demand = (int16_t)cia402_to_units(self->sample.torque_ref, s->torque, INT16_MIN, INT16_MAX, saturated);
    watch_following_error(self);
    finish_stop(self);
    bool clipped = self->limited || fabs(self->sample.torque_ref) >= self->drive.torque_limit;
    o->status_word =
        (uint16_t)(cia402_status_encode(self->machine.state) | cia402_status_remote | cia402_status_voltage);
    if (clipped && self->command.control != sim_control_off)
        o->status_word |= cia402_status_limited;
    bool follows = self->command.control == sim_control_cascade || self->command.control == sim_control_torque;
    if (follows && targets_fresh)
        o->status_word |= cia402_status_follows;
    if (o->error_code == emcy_following_error)
        o->status_word |= cia402_status_following_error;
}

static void take_sample(struct simulated_drive *self, bool targets_fresh)
{
    self->command = command_of_state(self);
    sim_belt_drive_step(&self->drive, &self->command, &self->sample);
    self->samples++;
    publish(self, targets_fresh);
    if (self->command.control == sim_control_off) // the torque is off since this sample: nothing left to do alone
        self->own_cycle = false;
}

// ---- What the bus brings

static void on_synchronise(void *owner, uint64_t now_us, bool targets_fresh)
{
    (void)now_us;
    struct simulated_drive *self = owner;
    self->own_cycle = false;
    take_sample(self, targets_fresh);
}

static void on_connection_lost(void *owner, uint16_t emcy_code, uint64_t now_us)
{
    struct simulated_drive *self = owner;
    if (!cia402_machine_is_powered(&self->machine))
        return;
    detect_fault(self, emcy_code, emcy_communication_error);
    if (emcy_code == emcy_heartbeat) // SYNC still comes, or will be missed in its own time
        return;
    self->own_cycle = true;
    self->next_us = now_us;
}

static void power_on(struct simulated_drive *self)
{
    struct simulated_drive_objects *o = &self->objects;
    cia402_machine_init(&self->machine);
    cia402_machine_event(&self->machine, cia402_initialised);
    o->quick_stop_option = 2;
    o->mode = o->mode_display = 0;
    o->error_code = o->control_word = 0;
    o->target_position = o->velocity_offset = 0;
    o->target_torque = o->torque_offset = 0;
    o->following_error_window = UINT32_MAX;
    o->following_error_timeout_ms = 0;
    o->max_velocity = 0;
    o->max_torque = UINT16_MAX;
    o->quick_stop_deceleration = self->model.linear ? 5000 : 50000;
    self->drive.torque_limit = o->max_torque * self->scaling.torque;
    self->drive.stop_deceleration = o->quick_stop_deceleration * 1e-3;
    self->own_cycle = false;
    o->status_word =
        (uint16_t)(cia402_status_encode(self->machine.state) | cia402_status_remote | cia402_status_voltage);
}

static void on_reset(void *owner)
{
    power_on(owner);
}

static const struct canopen_node_events events = {on_synchronise, on_connection_lost, on_reset};

static void receive(void *object, const struct can_frame *frame, uint64_t now_us)
{
    struct simulated_drive *self = object;
    canopen_node_receive(&self->node, frame, now_us);
}

static void advance(void *object, uint64_t now_us)
{
    struct simulated_drive *self = object;
    if (self->node.state == nmt_initialising)
        canopen_node_boot(&self->node, now_us);
    canopen_node_advance(&self->node, now_us);
    if (!self->own_cycle || now_us < self->next_us)
        return;
    self->next_us += cia402_period_us(self->objects.period_units, self->objects.period_exponent);
    take_sample(self, false);
}

static uint64_t deadline_us(const void *object)
{
    const struct simulated_drive *self = object;
    if (self->node.state == nmt_initialising)
        return 0;
    uint64_t deadline = canopen_node_deadline_us(&self->node);
    return self->own_cycle && self->next_us < deadline ? self->next_us : deadline;
}

struct can_participant simulated_drive_participant(struct simulated_drive *self)
{
    return (struct can_participant){.self = self, .receive = receive, .advance = advance, .deadline_us = deadline_us};
}

// ---- Making one

/// Smallest of 1, 2, 5 times a power of ten that is not below `value`, at least 1.
static uint32_t round_up_125(double value)
{
    double decade = 1.0;
    while (decade * 10.0 <= value && decade < 1e8)
        decade *= 10.0;
    const double steps[] = {1.0, 2.0, 5.0};
    for (int i = 0; i < 3; i++)
        if (value <= steps[i] * decade)
            return (uint32_t)(steps[i] * decade);
    return (uint32_t)(10.0 * decade);
}

static void choose_units(struct simulated_drive *self)
{
    struct simulated_drive_objects *o = &self->objects;
    const struct sim_model *m = &self->model;
    double counts = m->sensors.counts_per_rev;
    bool countable = counts >= 1.0 && counts <= 16777216.0 && counts == floor(counts);
    double inertia = m->motor_inertia_kgm2 + m->load_inertia_kgm2;
    o->increments = countable ? (uint32_t)counts : 1048576;
    o->revolutions = 1;
    if (m->linear) {
        o->unit_position = CIA402_UNIT(-8, cia402_unit_metre, 0);
        o->unit_velocity = CIA402_UNIT(-7, cia402_unit_metre, cia402_unit_second);
        o->rated_torque = round_up_125(inertia * 1.3e3);
    } else {
        o->unit_position = CIA402_UNIT(0, cia402_unit_increment, 0);
        o->unit_velocity = CIA402_UNIT(-6, cia402_unit_radian, cia402_unit_second);
        o->rated_torque = round_up_125(inertia * 80e3);
    }
    const uint8_t square_second = 0x57;
    o->unit_acceleration = CIA402_UNIT(-3, m->linear ? cia402_unit_metre : cia402_unit_radian, square_second);
    const struct cia402_scaling_objects scaling = {o->increments, o->revolutions, o->unit_position, o->unit_velocity,
                                                   o->rated_torque};
    cia402_scaling_read(&scaling, &self->scaling);
}

void simulated_drive_init(struct simulated_drive *self, const struct sim_model *model, uint8_t node_id,
                          const struct can_port *port)
{
    memset(self, 0, sizeof *self);
    self->model = *model;
    const struct canopen_node_identity identity = {.device_type = CIA402_SERVO_DRIVE, .product = 0x402, .revision = 1};
    canopen_node_init(&self->node, node_id, port, &identity, profile_entries,
                      sizeof profile_entries / sizeof profile_entries[0], &events, self);
    choose_units(self);
    self->objects.supported_modes = CIA402_SUPPORTS(cia402_mode_csp) | CIA402_SUPPORTS(cia402_mode_cst);
    // A rate that 60C2 cannot say leaves the period at 0 x 1 s: the drive runs once a master has set one.
    self->period_valid =
        cia402_period_encode(1.0 / model->sample_rate_hz, &self->objects.period_units, &self->objects.period_exponent);
    sim_belt_drive_init(&self->drive, &self->model, 0.0);
    power_on(self);
}
