/* SPDX-License-Identifier: MIT */
#include "sim/node/simulated_drive.h"

#include "sim/node/simulated_drive_parts.h"

#include <math.h>
#include <string.h>

// ---- Time: its own clock against the bus's

static uint64_t own_time_us(const struct simulated_drive *self, uint64_t bus_us)
{
    return self->clock_rate == 1.0 ? bus_us : (uint64_t)((double)bus_us * self->clock_rate);
}

/// The first bus time at which its own clock shows at least `own_us`.
static uint64_t bus_time_us(const struct simulated_drive *self, uint64_t own_us)
{
    if (self->clock_rate == 1.0 || own_us == CAN_NEVER_US)
        return own_us;
    uint64_t bus_us = (uint64_t)((double)own_us / self->clock_rate);
    while (own_time_us(self, bus_us) < own_us)
        bus_us++;
    return bus_us;
}

// ---- Sending

static void flush_replies(struct simulated_drive *self, uint64_t now_us)
{
    size_t sent = 0;
    while (sent < self->reply_count && self->replies[sent].due_us <= now_us) {
        if (self->port.operations->send(self->port.self, &self->replies[sent].frame) != can_ok)
            self->node.errors.frames_unsent++;
        sent++;
    }
    self->reply_count -= sent;
    memmove(self->replies, self->replies + sent, self->reply_count * sizeof self->replies[0]);
}

/// What the node sends through: TPDOs may have to wait, and nothing goes out of a silent drive.
static enum can_status send_delayed(void *object, const struct can_frame *frame)
{
    struct simulated_drive *self = object;
    if (self->silent)
        return can_ok;
    bool process_data = frame->id >= 0x180 && frame->id < 0x580;
    if (!process_data || self->reply_us == 0 || self->reply_count == simulated_replies_max)
        return self->port.operations->send(self->port.self, frame);
    self->replies[self->reply_count].frame = *frame;
    self->replies[self->reply_count].due_us = self->node.now_us + self->reply_us;
    self->reply_count++;
    return can_ok;
}

static const struct can_port_operations delayed_operations = {.send = send_delayed};

// ---- Faults

static void begin_fault(struct simulated_drive *self, const struct simulated_fault *fault)
{
    static const enum sim_encoder encoders[simulated_fault_kinds] = {
        [simulated_fault_encoder_stuck] = sim_encoder_stuck,
        [simulated_fault_encoder_reversed] = sim_encoder_reversed,
        [simulated_fault_encoder_dead] = sim_encoder_dead,
    };
    self->injected[fault->kind]++;
    switch (fault->kind) {
    case simulated_fault_heartbeat_stops:
        self->node.producer.period_us = 0;
        break;
    case simulated_fault_reset: {
        struct can_frame frame = nmt_command_frame(nmt_reset_node, self->node.node_id);
        canopen_node_receive(&self->node, &frame, self->node.now_us);
        break;
    }
    case simulated_fault_silent:
        self->silent = true;
        break;
    case simulated_fault_sync_missed:
        break;
    default:
        self->drive.encoder = encoders[fault->kind];
        break;
    }
}

static void end_fault(struct simulated_drive *self, const struct simulated_fault *fault)
{
    if (fault->kind == simulated_fault_silent)
        self->silent = false;
    if (fault->kind <= simulated_fault_encoder_dead)
        self->drive.encoder = sim_encoder_good;
}

/// A SYNC has come in operation enabled; false if it is lost on this drive.
static bool pass_faults(struct simulated_drive *self)
{
    bool heard = true;
    self->operating_syncs++;
    for (size_t i = 0; i < self->fault_count; i++) {
        const struct simulated_fault *fault = &self->faults[i];
        uint64_t end = (uint64_t)fault->sync + fault->count;
        if (self->operating_syncs == fault->sync)
            begin_fault(self, fault);
        else if (fault->count != 0 && self->operating_syncs == end)
            end_fault(self, fault);
        bool on = self->operating_syncs >= fault->sync && (fault->count == 0 || self->operating_syncs < end);
        heard = heard && !(on && fault->kind == simulated_fault_sync_missed);
    }
    return heard;
}

// ---- What the bus brings

/// Compares the SYNCs' mean period with 60C2: set-points at another rate than the drive believes would be wrong ones.
static void watch_period(struct simulated_drive *self, uint64_t now_us)
{
    enum { window = 16 };
    uint32_t missed = self->node.sync.missed - self->period.missed;
    self->period.missed = self->node.sync.missed;
    if (self->period.periods == 0 || now_us < self->period.since_us) {
        self->period.since_us = now_us;
        self->period.periods = 1;
        return;
    }
    self->period.periods += missed;
    if (self->period.periods < window) {
        self->period.periods++;
        return;
    }
    double mean_us = (double)(now_us - self->period.since_us) / self->period.periods;
    double nominal_us = simulated_drive_period_us(self);
    self->period.wrong = !(fabs(mean_us - nominal_us) <= self->period_tolerance * nominal_us);
    self->period.since_us = now_us;
    self->period.periods = 1;
    if (self->period.wrong && self->machine.state == cia402_operation_enabled)
        simulated_drive_detect(self, emcy_parameter, emcy_profile_specific, simulated_reaction_by_option);
}

static void on_synchronise(void *owner, uint64_t now_us, bool targets_fresh)
{
    struct simulated_drive *self = owner;
    self->own_cycle = false;
    watch_period(self, now_us);
    simulated_drive_take_sample(self, targets_fresh);
    self->next_us = now_us + 2u * simulated_drive_period_us(self);
}

/// Under torque, until its last sample was one without, and while it turns, a drive goes on whatever the bus does.
static bool has_to_go_on(const struct simulated_drive *self)
{
    return cia402_machine_is_powered(&self->machine) || self->command.control != sim_control_off ||
           simulated_drive_is_moving(self);
}

/// A SYNC that is missed by its time-out starts the own cycle; where none is watched, two periods without one do.
static bool runs_alone(const struct simulated_drive *self)
{
    bool watched = self->node.sync.period_us != 0 && self->node.sync.running;
    return self->own_cycle || (!watched && self->period_valid && has_to_go_on(self));
}

static void on_connection_lost(void *owner, uint16_t emcy_code, uint64_t now_us)
{
    struct simulated_drive *self = owner;
    struct cia402_machine *machine = &self->machine;
    self->period.periods = 0;
    if (!cia402_machine_is_powered(machine))
        return; // what still turns goes on by itself
    switch (machine->options.abort_connection) {
    case 0:
        canopen_node_raise(&self->node, emcy_code, emcy_communication_error);
        break;
    case 1:
        simulated_drive_detect(self, emcy_code, emcy_communication_error, simulated_reaction_by_option);
        break;
    default:
        canopen_node_raise(&self->node, emcy_code, emcy_communication_error);
        cia402_machine_command(machine, machine->options.abort_connection == 2 ? cia402_control_disable_voltage
                                                                               : cia402_control_quick_stop);
        simulated_drive_update_status(self);
        break;
    }
    if (emcy_code == emcy_heartbeat) // SYNC still comes, or will be missed in its own time
        return;
    self->own_cycle = true;
    self->next_us = now_us;
}

static void on_reset(void *owner)
{
    struct simulated_drive *self = owner;
    simulated_drive_set_defaults(self);
}

static const struct canopen_node_events events = {on_synchronise, on_connection_lost, on_reset};

// ---- One commander

static bool is_streamed(const struct simulated_drive *self, uint16_t index)
{
    for (size_t i = 0; i < pdo_per_direction; i++) {
        const struct pdo *pdo = &self->node.rpdo[i];
        for (size_t e = 0; pdo_is_enabled(pdo) && e < pdo->mapped_count; e++)
            if (pdo->mapped[e] >> 16 == index)
                return true;
    }
    return false;
}

/// What anybody may write to a drive that somebody else commands: a stop, and the mode, which has a rule of its own
/// (only while no set-point is followed).
static bool is_free_to_all(const struct can_frame *download)
{
    uint32_t index = can_get(&download->data[1], 2);
    if (index == cia402_modes_of_operation)
        return true;
    bool expedited = download->data[0] >> 5 == 1 && (download->data[0] & 0x02) != 0;
    if (index != cia402_control_word || download->data[3] != 0 || !expedited)
        return false;
    enum cia402_event event = cia402_control_decode((uint16_t)can_get(&download->data[4], 2));
    return event == cia402_quick_stop || event == cia402_disable_voltage;
}

static bool is_download(const struct simulated_drive *self, const struct can_frame *frame)
{
    unsigned specifier = frame->data[0] >> 5;
    return frame->id == 0x600u + self->node.node_id && !frame->remote && frame->length == 8 &&
           (specifier == 1 || specifier == 6);
}

/// SDO does not say who asks. While somebody streams control words to a drive under torque, a download can only be
/// somebody else's.
static bool refuse_second_commander(struct simulated_drive *self, const struct can_frame *frame)
{
    bool commanded = cia402_machine_is_powered(&self->machine) && is_streamed(self, cia402_control_word);
    if (!commanded || !is_download(self, frame) || is_free_to_all(frame))
        return false;
    struct can_frame answer = can_frame_make((uint16_t)(0x580 + self->node.node_id), 8);
    answer.data[0] = 0x80;
    memcpy(&answer.data[1], &frame->data[1], 3);
    can_put(&answer.data[4], 4, od_abort_state);
    self->commands_refused++;
    if (send_delayed(self, &answer) != can_ok)
        self->node.errors.frames_unsent++;
    return true;
}

// ---- Participant

static bool is_sync(const struct can_frame *frame)
{
    return frame->id == sync_cob_id && !frame->remote;
}

static void take_sync(struct simulated_drive *self, const struct can_frame *frame, uint64_t own_us)
{
    self->holding = false;
    self->node.now_us = own_us;
    if (self->machine.state == cia402_operation_enabled && !pass_faults(self))
        return;
    canopen_node_receive(&self->node, frame, own_us);
}

static void receive(void *object, const struct can_frame *frame, uint64_t bus_us)
{
    struct simulated_drive *self = object;
    uint64_t own_us = own_time_us(self, bus_us);
    if (is_sync(frame)) {
        if (self->holding)
            take_sync(self, &self->held, own_us);
        if (self->latch_us == 0) {
            take_sync(self, frame, own_us);
            return;
        }
        self->held = *frame;
        self->holding = true;
        self->held_due_us = own_us + self->latch_us;
        return;
    }
    if (!refuse_second_commander(self, frame))
        canopen_node_receive(&self->node, frame, own_us);
}

static void advance(void *object, uint64_t bus_us)
{
    struct simulated_drive *self = object;
    uint64_t own_us = own_time_us(self, bus_us);
    if (self->node.state == nmt_initialising)
        canopen_node_boot(&self->node, own_us);
    if (self->holding && own_us >= self->held_due_us)
        take_sync(self, &self->held, own_us);
    flush_replies(self, own_us);
    canopen_node_advance(&self->node, own_us);
    if (!runs_alone(self) || own_us < self->next_us)
        return;
    self->own_cycle = true;
    self->next_us += simulated_drive_period_us(self);
    simulated_drive_take_sample(self, false);
}

static uint64_t earlier(uint64_t a, uint64_t b)
{
    return a < b ? a : b;
}

static uint64_t deadline_us(const void *object)
{
    const struct simulated_drive *self = object;
    if (self->node.state == nmt_initialising)
        return 0;
    uint64_t own_us = canopen_node_deadline_us(&self->node);
    if (self->holding)
        own_us = earlier(own_us, self->held_due_us);
    if (self->reply_count > 0)
        own_us = earlier(own_us, self->replies[0].due_us);
    if (runs_alone(self))
        own_us = earlier(own_us, self->next_us);
    return bus_time_us(self, own_us);
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
    const struct cia402_scaling_objects scaling = {o->increments,    o->revolutions,  o->unit_position,
                                                   o->unit_velocity, o->rated_torque, 1000};
    cia402_scaling_read(&scaling, &self->scaling);
}

void simulated_drive_init(struct simulated_drive *self, const struct sim_model *model, uint8_t node_id,
                          const struct can_port *port)
{
    memset(self, 0, sizeof *self);
    self->model = *model;
    self->port = *port;
    self->clock_rate = 1.0;
    self->period_tolerance = 0.25;
    const struct can_port delayed = {.operations = &delayed_operations, .self = self};
    const struct canopen_node_identity identity = {.device_type = CIA402_SERVO_DRIVE,
                                                   .product = 0x402,
                                                   .revision = 1,
                                                   .device_name = "servoscope simulated drive",
                                                   .hardware_version = "model",
                                                   .software_version = "1"};
    canopen_node_init(&self->node, node_id, &delayed, &identity, simulated_drive_entries, simulated_drive_entry_count,
                      &events, self);
    choose_units(self);
    self->objects.supported_modes = CIA402_SUPPORTS(cia402_mode_profile_torque) | CIA402_SUPPORTS(cia402_mode_csp) |
                                    CIA402_SUPPORTS(cia402_mode_csv) | CIA402_SUPPORTS(cia402_mode_cst);
    // A rate that 60C2 cannot say leaves the period at 0 x 1 s: the drive runs once a master has set one.
    self->period_valid =
        cia402_period_encode(1.0 / model->sample_rate_hz, &self->objects.period_units, &self->objects.period_exponent);
    sim_belt_drive_init(&self->drive, &self->model, 0.0);
    simulated_drive_set_defaults(self);
}

void simulated_drive_set_faults(struct simulated_drive *self, const struct simulated_fault *faults, size_t count)
{
    self->faults = faults;
    self->fault_count = count;
}

void simulated_drive_set_delays(struct simulated_drive *self, uint32_t latch_us, uint32_t reply_us)
{
    self->latch_us = latch_us;
    self->reply_us = reply_us;
}

void simulated_drive_set_drift(struct simulated_drive *self, double drift_ppm)
{
    self->clock_rate = 1.0 + drift_ppm * 1e-6;
}
