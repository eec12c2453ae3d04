/* SPDX-License-Identifier: MIT */
#include "drivers/can/cia402_master.h"

#include "drivers/can/cia402_setup.h"
#include "drivers/can/pdo_check.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

struct cia402_master_options cia402_master_defaults(void)
{
    return (struct cia402_master_options){
        .node_id = 5,
        .master_id = 127,
        .bitrate = 1000000,
        .sdo_timeout_us = 50000,
        .heartbeat_ms = 100,
        .arm_timeout_us = 2000000,
        .stop_timeout_us = 5000000,
        .lost_in_a_row = 5,
    };
}

/// Bytes of the four process data frames.
struct frame_lengths {
    uint8_t rpdo1, rpdo2, tpdo1, tpdo2; ///< rpdo2 = 0: not used
};

static struct frame_lengths lengths_of(enum drive_mode mode, bool checked)
{
    uint8_t check = checked ? 2 : 0;
    return (struct frame_lengths){
        .rpdo1 = mode == drive_mode_torque ? 4 : 6,
        .rpdo2 = (uint8_t)((mode == drive_mode_torque ? 0 : 6) + check),
        .tpdo1 = 8,
        .tpdo2 = (uint8_t)(6 + check),
    };
}

unsigned cia402_master_target_bits(enum drive_mode mode, bool checked)
{
    struct frame_lengths l = lengths_of(mode, checked);
    return can_frame_bits_worst(l.rpdo1) + (l.rpdo2 == 0 ? 0 : can_frame_bits_worst(l.rpdo2));
}

unsigned cia402_master_cycle_bits(enum drive_mode mode, bool checked)
{
    struct frame_lengths l = lengths_of(mode, checked);
    return can_frame_bits_worst(1) + cia402_master_target_bits(mode, checked) + can_frame_bits_worst(l.tpdo1) +
           can_frame_bits_worst(l.tpdo2);
}

// ---- One SYNC cycle

/// Whether the two frames in hand are whole and of this SYNC.
static bool replies_pass(const struct cia402_master *self)
{
    const uint8_t *first = self->replies[0].data, *second = self->replies[1].data;
    if (self->mixed)
        return false;
    if (!self->checked)
        return true;
    uint8_t check = pdo_check(pdo_check(pdo_check_start, first, 8), second, 7);
    return second[6] == self->bus.sync.counter && second[7] == check;
}

static void decode_replies(struct cia402_master *self)
{
    const uint8_t *first = self->replies[0].data, *second = self->replies[1].data;
    self->last = (struct cia402_cycle){
        .status_word = (uint16_t)od_from_raw(od_u16, can_get(first, 2)),
        .position = (int32_t)od_from_raw(od_i32, can_get(&first[2], 4)),
        .torque = (int16_t)od_from_raw(od_i16, can_get(&first[6], 2)),
        .velocity = (int32_t)od_from_raw(od_i32, can_get(second, 4)),
        .torque_demand = (int16_t)od_from_raw(od_i16, can_get(&second[4], 2)),
    };
}

/// A process data frame that comes when none is awaited: after its cycle has ended, or once more.
static void count_unawaited(struct cia402_master *self)
{
    if (!self->cycling || self->complete)
        self->bus.unexpected++;
    else if (!self->late_counted)
        self->counters.samples_late++;
    self->late_counted = true;
}

/// Whether TPDO2 carries another SYNC's counter: of an earlier one, or altered. Counts it.
static bool is_of_another_sync(struct cia402_master *self, int which, const struct can_frame *frame)
{
    if (which != 1 || !self->checked || frame->data[6] == self->bus.sync.counter)
        return false;
    // Late if a sample is missing, else just not to be used.
    uint32_t *counter = self->missing_in_a_row > 0 ? &self->counters.samples_late : &self->bus.unexpected;
    *counter += !self->late_counted;
    self->late_counted = true;
    return true;
}

/// Keeps one reply. Whether the two belong together is for the check to say, and a cycle in which one of them came
/// twice with different content is none: a leftover of an earlier cycle is among them.
static void keep_reply(struct cia402_master *self, int which, const struct can_frame *frame)
{
    if (self->have[which]) {
        self->bus.unexpected++;
        self->mixed = self->mixed || memcmp(self->replies[which].data, frame->data, sizeof frame->data) != 0;
    }
    self->replies[which] = *frame;
    self->have[which] = true;
}

static void on_process_data(void *owner, const struct can_frame *frame)
{
    struct cia402_master *self = owner;
    struct frame_lengths l = lengths_of(self->configuration.mode, self->checked);
    int which = (frame->id & 0x780) == 0x180 ? 0 : (frame->id & 0x780) == 0x280 ? 1 : -1;
    if (which < 0 || frame->length != (which == 0 ? l.tpdo1 : l.tpdo2)) {
        self->bus.unexpected++;
        return;
    }
    if (!self->awaiting) {
        count_unawaited(self);
        return;
    }
    if (is_of_another_sync(self, which, frame))
        return;
    keep_reply(self, which, frame);
    enum cia402_state state;
    if (!self->have[0] || !self->have[1] || !replies_pass(self))
        return;
    if (!cia402_status_decode((uint16_t)can_get(self->replies[0].data, 2), &state))
        return;
    decode_replies(self);
    self->state = state;
    self->complete = true;
    self->awaiting = false;
}

static void send_targets(struct cia402_master *self)
{
    struct frame_lengths l = lengths_of(self->configuration.mode, self->checked);
    bool torque = self->configuration.mode == drive_mode_torque;
    struct can_frame first = can_frame_make((uint16_t)(0x200 + self->options.node_id), l.rpdo1);
    struct can_frame second = can_frame_make((uint16_t)(0x300 + self->options.node_id), l.rpdo2);
    can_put(first.data, 2, self->control_word);
    if (torque) {
        can_put(&first.data[2], 2, od_to_raw(od_i16, self->target.torque));
    } else {
        can_put(&first.data[2], 4, od_to_raw(od_i32, self->target.position));
        can_put(second.data, 4, od_to_raw(od_i32, self->target.velocity));
        can_put(&second.data[4], 2, od_to_raw(od_i16, self->target.torque));
    }
    if (self->checked) {
        uint8_t *end = &second.data[l.rpdo2 - 2];
        end[0] = sync_producer_upcoming(&self->bus.sync);
        end[1] = pdo_check(pdo_check(pdo_check_start, first.data, l.rpdo1), second.data, l.rpdo2 - 1u);
    }
    canopen_master_send(&self->bus, &first);
    if (l.rpdo2 > 0)
        canopen_master_send(&self->bus, &second);
}

/// Sends control word and targets, then SYNC at its time, and collects the answer. False if the bus is lost.
/// Waits: until the end of this period at most, plus one period when SYNC starts.
static bool run_cycle(struct cia402_master *self)
{
    struct canopen_master *bus = &self->bus;
    uint64_t now_us = canopen_master_time_us(bus);
    if (!self->cycling) {
        self->cycling = true;
        self->complete = true; // nothing outstanding
        self->next_sync_us = now_us + self->period_us;
    } else if (self->next_sync_us < now_us + self->targets_us) {
        // The caller came too late for this period: SYNC slips rather than overtaking its own set-points.
        self->next_sync_us = now_us + self->targets_us;
        self->counters.samples_late++;
    }
    send_targets(self);
    bool in_time = canopen_master_serve(bus, self->next_sync_us) == can_ok;
    self->have[0] = self->have[1] = self->mixed = self->complete = self->late_counted = false;
    if (!in_time)
        return false;
    self->awaiting = true;
    struct can_frame frame = sync_producer_next(&bus->sync);
    canopen_master_send(bus, &frame);
    uint64_t until_us = self->next_sync_us + self->reply_us;
    while (self->awaiting && bus->status == can_ok && canopen_master_time_us(bus) < until_us)
        canopen_master_step(bus, until_us);
    self->awaiting = false;
    self->next_sync_us += self->period_us;
    self->missing_in_a_row = self->complete ? 0 : self->missing_in_a_row + 1;
    self->counters.frames_unexpected = bus->unexpected + bus->sdo.unexpected;
    self->counters.emergencies = bus->emergencies;
    self->counters.last_emergency_code = bus->emergency.code;
    return bus->status == can_ok;
}

static enum drive_status lost_bus(struct cia402_master *self)
{
    snprintf(self->detail, sizeof self->detail, "node %u: the bus is %s", self->options.node_id,
             self->bus.status == can_err_bus_off ? "off" : "gone");
    return drive_err_bus;
}

static enum drive_status drive_fault(struct cia402_master *self, const char *doing)
{
    uint16_t code = self->bus.emergency.code;
    snprintf(self->detail, sizeof self->detail, "node %u: %s while %s; last emergency %04X (%s)", self->options.node_id,
             cia402_state_str(self->state), doing, code, emcy_code_str(code));
    return drive_err_fault;
}

// ---- Door: open, arm

static enum drive_status master_open(void *object, const struct drive_configuration *configuration)
{
    struct cia402_master *self = object;
    self->configuration = *configuration;
    self->opened = self->armed = self->cycling = false;
    memset(&self->counters, 0, sizeof self->counters);
    self->saturated = 0;
    self->bus.emergencies = self->bus.unexpected = self->bus.sdo.unexpected = 0;
    self->bus.emergency = (struct emcy_message){0};
    self->bus.status = can_ok;
    self->bus.sync = (struct sync_producer){.overflow = sync_overflow_max};
    self->detail[0] = '\0';
    enum drive_status status = cia402_setup(self);
    self->opened = status == drive_ok;
    return status;
}

/// The control word that leads one state further towards operation enabled.
static uint16_t next_control_word(const struct cia402_master *self)
{
    switch (self->state) {
    case cia402_switch_on_disabled:
        return cia402_control_shutdown;
    case cia402_ready:
        return cia402_control_switch_on;
    case cia402_switched_on:
    case cia402_operation_enabled:
        return cia402_control_enable_operation;
    case cia402_fault: // the reset is an edge: low in between
        return self->control_word == cia402_control_fault_reset ? cia402_control_disable_voltage
                                                                : cia402_control_fault_reset;
    default:
        return cia402_control_disable_voltage;
    }
}

static enum drive_status enter_operation(struct cia402_master *self)
{
    uint32_t cycles = self->options.arm_timeout_us / self->period_us + 1;
    unsigned resets = 0;
    const unsigned resets_max = 3;
    for (uint32_t i = 0; i < cycles; i++) {
        if (!run_cycle(self))
            return lost_bus(self);
        if (self->missing_in_a_row > self->options.lost_in_a_row)
            break;
        if (!self->complete)
            continue;
        bool commanded = self->control_word == cia402_control_enable_operation;
        if (commanded && self->state == cia402_operation_enabled && (self->last.status_word & cia402_status_follows))
            return drive_ok;
        self->control_word = next_control_word(self);
        resets += self->control_word == cia402_control_fault_reset;
        if (resets > resets_max)
            return drive_fault(self, "resetting the fault");
        // The position to hold stays once "enable operation" has been said.
        if (self->control_word != cia402_control_enable_operation || !commanded)
            self->target.position = self->last.position;
    }
    if (self->missing_in_a_row > self->options.lost_in_a_row) {
        if (self->counters.samples_late > 0)
            snprintf(self->detail, sizeof self->detail, "node %u answers SYNC too late: expected within %lu us",
                     self->options.node_id, (unsigned long)self->reply_us);
        else
            snprintf(self->detail, sizeof self->detail, "node %u does not answer SYNC", self->options.node_id);
        return drive_err_timeout;
    }
    if (self->state == cia402_fault)
        return drive_fault(self, "switching on");
    snprintf(self->detail, sizeof self->detail, "node %u stays in %s on the way to operation enabled",
             self->options.node_id, cia402_state_str(self->state));
    return drive_err_refused;
}

static enum drive_status master_arm(void *object)
{
    struct cia402_master *self = object;
    if (!self->opened) {
        snprintf(self->detail, sizeof self->detail, "arm before open");
        return drive_err_argument;
    }
    self->control_word = cia402_control_disable_voltage;
    self->target = (struct cia402_setpoint){.position = self->last.position};
    self->missing_in_a_row = 0;
    enum drive_status status = enter_operation(self);
    if (status != drive_ok)
        return status;
    self->zero = self->configuration.mode == drive_mode_torque ? self->last.position : self->target.position;
    self->armed = true;
    return drive_ok;
}

// ---- Door: exchange

static bool setpoint_is_finite(const struct drive_setpoint *setpoint)
{
    return isfinite(setpoint->position_rad) && isfinite(setpoint->velocity_rad_per_s) && isfinite(setpoint->torque_Nm);
}

static void set_target(struct cia402_master *self, const struct drive_setpoint *setpoint)
{
    const struct cia402_scaling *s = &self->scaling;
    int64_t position = self->zero;
    position += cia402_to_units(setpoint->position_rad, s->position, INT32_MIN, INT32_MAX, &self->saturated);
    if (position > INT32_MAX || position < INT32_MIN)
        self->saturated++;
    self->target.position = (int32_t)(position > INT32_MAX ? INT32_MAX : position < INT32_MIN ? INT32_MIN : position);
    self->target.velocity =
        cia402_to_units(setpoint->velocity_rad_per_s, s->velocity, INT32_MIN, INT32_MAX, &self->saturated);
    self->target.torque =
        (int16_t)cia402_to_units(setpoint->torque_Nm, s->torque, INT16_MIN, INT16_MAX, &self->saturated);
}

/// What this cycle means for the measurement, worst first.
static enum drive_status judge_cycle(struct cia402_master *self)
{
    if (self->bus.consumer.boot_ups != self->boot_ups) {
        snprintf(self->detail, sizeof self->detail, "node %u restarted", self->options.node_id);
        return drive_err_fault;
    }
    if (self->complete && self->state != cia402_operation_enabled)
        return drive_fault(self, "measuring");
    if (self->bus.consumer.life == heartbeat_lost) {
        snprintf(self->detail, sizeof self->detail, "node %u: its heartbeat stopped", self->options.node_id);
        return drive_err_timeout;
    }
    if (self->missing_in_a_row > self->options.lost_in_a_row) {
        snprintf(self->detail, sizeof self->detail, "node %u: %lu samples in a row did not come", self->options.node_id,
                 (unsigned long)self->missing_in_a_row);
        return self->bus.emergencies > 0 ? drive_err_fault : drive_err_timeout;
    }
    return drive_ok;
}

static enum drive_status master_exchange(void *object, const struct drive_setpoint *setpoint,
                                         struct drive_sample *out_sample)
{
    struct cia402_master *self = object;
    *out_sample = (struct drive_sample){.valid = false};
    if (!self->armed || !setpoint_is_finite(setpoint)) {
        snprintf(self->detail, sizeof self->detail,
                 self->armed ? "a set-point is not a number" : "exchange before arm");
        return drive_err_argument;
    }
    set_target(self, setpoint);
    self->control_word = cia402_control_enable_operation;
    bool on_bus = run_cycle(self);
    const struct cia402_scaling *s = &self->scaling;
    *out_sample = (struct drive_sample){
        .torque_ref_Nm = self->last.torque_demand * s->torque,
        .torque_Nm = self->last.torque * s->torque,
        .position_rad = (double)((int64_t)self->last.position - self->zero) * s->position,
        .velocity_rad_per_s = self->last.velocity * s->velocity,
        .valid = self->complete && self->state == cia402_operation_enabled &&
                 (self->last.status_word & cia402_status_follows) != 0,
    };
    if (!out_sample->valid)
        self->counters.samples_lost++;
    if (!on_bus)
        return lost_bus(self);
    return judge_cycle(self);
}

// ---- Door: stop, close

static bool has_torque(const struct cia402_master *self)
{
    return self->state == cia402_operation_enabled || self->state == cia402_quick_stop_active ||
           self->state == cia402_fault_reaction_active;
}

/// Repeats a control word until a cycle came back without torque; true if one did.
static bool insist(struct cia402_master *self, uint16_t control_word, uint32_t timeout_us)
{
    uint32_t cycles = timeout_us / self->period_us + 2;
    const uint32_t silence = 50; // cycles without an answer: nobody is there to be stopped this way
    self->control_word = control_word;
    self->missing_in_a_row = 0;
    for (uint32_t i = 0; i < cycles && self->missing_in_a_row < silence; i++) {
        if (!run_cycle(self))
            return false;
        if (self->complete && !has_torque(self))
            return true;
    }
    return false;
}

static enum drive_status master_stop(void *object)
{
    struct cia402_master *self = object;
    if (!self->cycling)
        return drive_ok;
    self->armed = false;
    bool off = insist(self, cia402_control_quick_stop, self->options.stop_timeout_us);
    const uint32_t again_us = 100000;
    off = insist(self, cia402_control_disable_voltage, again_us) || off;
    self->cycling = false;
    if (off)
        return drive_ok;
    if (self->bus.status != can_ok)
        return lost_bus(self);
    snprintf(self->detail, sizeof self->detail,
             "node %u does not confirm that it is without torque; its own SYNC time-out has to stop it",
             self->options.node_id);
    return drive_err_timeout;
}

static void master_close(void *object)
{
    struct cia402_master *self = object;
    master_stop(self);
    if (!self->opened)
        return;
    self->opened = false;
    canopen_master_write(&self->bus, 0x1016, 1, 4, 0); // we will be silent from now on
    struct can_frame frame = nmt_command_frame(nmt_enter_pre_operational, self->options.node_id);
    canopen_master_send(&self->bus, &frame);
    heartbeat_producer_start(&self->bus.producer, self->options.master_id, 0, 0);
    heartbeat_consumer_start(&self->bus.consumer, self->options.node_id, 0);
    const uint32_t to_get_out_us = 5000;
    canopen_master_serve(&self->bus, canopen_master_time_us(&self->bus) + to_get_out_us);
}

static const struct drive_counters *master_counters(const void *object)
{
    const struct cia402_master *self = object;
    return &self->counters;
}

static const char *master_detail(const void *object)
{
    const struct cia402_master *self = object;
    return self->detail;
}

static const struct drive_operations operations = {
    master_open, master_arm, master_exchange, master_stop, master_close, master_counters, master_detail,
};

void cia402_master_init(struct cia402_master *self, const struct can_port *port,
                        const struct cia402_master_options *options)
{
    memset(self, 0, sizeof *self);
    self->options = *options;
    canopen_master_init(&self->bus, port, options->node_id, options->master_id, options->sdo_timeout_us);
    self->bus.on_process_data = on_process_data;
    self->bus.owner = self;
}

struct drive cia402_master_drive(struct cia402_master *self)
{
    return (struct drive){.operations = &operations, .self = self};
}
