/* SPDX-License-Identifier: MIT */
#include "drivers/can/cia402.h"

/// Rows: states; columns: events, in their order. Short names keep the table one screen wide.
enum {
    NR = cia402_not_ready,
    SD = cia402_switch_on_disabled,
    RD = cia402_ready,
    SO = cia402_switched_on,
    OE = cia402_operation_enabled,
    QS = cia402_quick_stop_active,
    FR = cia402_fault_reaction_active,
    FA = cia402_fault,
};

// clang-format off
static const uint8_t transitions[cia402_state_count][cia402_event_count] = {
    /*      init shut s-on enab d-v quick reset fault f-done q-done */
    [NR] = {SD, NR, NR, NR, NR, NR, NR, FR, NR, NR},
    [SD] = {SD, RD, SD, SD, SD, SD, SD, FR, SD, SD},
    [RD] = {RD, RD, SO, SO, SD, SD, RD, FR, RD, RD},
    [SO] = {SO, RD, SO, OE, SD, SD, SO, FR, SO, SO},
    [OE] = {OE, RD, SO, OE, SD, QS, OE, FR, OE, OE},
    [QS] = {QS, QS, QS, OE, SD, QS, QS, FR, QS, SD},
    [FR] = {FR, FR, FR, FR, FR, FR, FR, FR, FA, FR},
    [FA] = {FA, FA, FA, FA, FA, FA, SD, FA, FA, FA},
};
// clang-format on

enum cia402_state cia402_state_after(enum cia402_state state, enum cia402_event event)
{
    return (enum cia402_state)transitions[state][event];
}

enum cia402_event cia402_control_decode(uint16_t control_word)
{
    if (!(control_word & 0x2))
        return cia402_disable_voltage;
    if (!(control_word & 0x4))
        return cia402_quick_stop;
    if (!(control_word & 0x1))
        return cia402_shutdown;
    return (control_word & 0x8) ? cia402_enable_operation : cia402_switch_on;
}

static const uint16_t state_bits[cia402_state_count] = {
    [NR] = 0x00, [SD] = 0x40, [RD] = 0x21, [SO] = 0x23, [OE] = 0x27, [QS] = 0x07, [FR] = 0x0F, [FA] = 0x08,
};

uint16_t cia402_status_encode(enum cia402_state state)
{
    return state_bits[state];
}

bool cia402_status_decode(uint16_t status_word, enum cia402_state *out_state)
{
    for (int state = 0; state < cia402_state_count; state++) {
        // The quick-stop bit (5) means nothing where the state is told by the others alone.
        bool with_quick_stop = state == RD || state == SO || state == OE || state == QS;
        uint16_t mask = with_quick_stop ? 0x6F : 0x4F;
        if ((status_word & mask) == (state_bits[state] & mask)) {
            *out_state = (enum cia402_state)state;
            return true;
        }
    }
    return false;
}

const char *cia402_state_str(enum cia402_state state)
{
    switch (state) {
    case cia402_not_ready:
        return "not ready to switch on";
    case cia402_switch_on_disabled:
        return "switch-on disabled";
    case cia402_ready:
        return "ready to switch on";
    case cia402_switched_on:
        return "switched on";
    case cia402_operation_enabled:
        return "operation enabled";
    case cia402_quick_stop_active:
        return "quick stop active";
    case cia402_fault_reaction_active:
        return "fault reaction active";
    case cia402_fault:
        return "fault";
    case cia402_state_count:
        break;
    }
    return "unknown";
}

struct cia402_options cia402_options_default(void)
{
    return (struct cia402_options){
        .abort_connection = 1,
        .quick_stop = 2,
        .shutdown = 0,
        .disable_operation = 1,
        .halt = 1,
        .fault_reaction = 2,
    };
}

bool cia402_option_is_valid(uint16_t index, int64_t value)
{
    switch (index) {
    case cia402_abort_connection_option:
        return value >= 0 && value <= 3;
    case cia402_quick_stop_option:
        return (value >= 0 && value <= 2) || value == 5 || value == 6;
    case cia402_shutdown_option:
    case cia402_disable_operation_option:
        return value == 0 || value == 1;
    case cia402_halt_option:
        return value == 1 || value == 2;
    case cia402_fault_reaction_option:
        return value >= 0 && value <= 2;
    default:
        return false;
    }
}

void cia402_machine_init(struct cia402_machine *self)
{
    *self = (struct cia402_machine){
        .state = cia402_not_ready, .leaving = cia402_initialised, .options = cia402_options_default()};
}

static bool stays_in_quick_stop(const struct cia402_machine *self)
{
    return self->options.quick_stop >= 5;
}

/// Whether an event leaves operation enabled by a ramp first.
static bool leaves_by_ramp(const struct cia402_machine *self, enum cia402_event event)
{
    return (event == cia402_shutdown && self->options.shutdown != 0) ||
           (event == cia402_switch_on && self->options.disable_operation != 0);
}

static void command_in_operation(struct cia402_machine *self, enum cia402_event event)
{
    if (leaves_by_ramp(self, event)) {
        self->leaving = event;
        return;
    }
    self->leaving = cia402_initialised;
    self->state = cia402_state_after(self->state, event);
    if (self->state == cia402_quick_stop_active && self->options.quick_stop == 0)
        self->state = cia402_state_after(self->state, cia402_quick_stop_done);
}

bool cia402_machine_command(struct cia402_machine *self, uint16_t control_word)
{
    bool edge = (control_word & 0x80) && !(self->control_word & 0x80);
    self->control_word = control_word;
    if (edge && self->state == cia402_fault) {
        self->state = cia402_state_after(self->state, cia402_fault_reset);
        return true;
    }
    enum cia402_event event = cia402_control_decode(control_word);
    if (self->state == cia402_quick_stop_active && event == cia402_enable_operation && !stays_in_quick_stop(self))
        return false; // a stop that ends in switch-on disabled runs to its end
    if (self->state == cia402_operation_enabled) {
        command_in_operation(self, event);
        return false;
    }
    enum cia402_state before = self->state;
    self->state = cia402_state_after(before, event);
    // 1111 in ready to switch on goes through switched on by itself.
    if (before == cia402_ready && event == cia402_enable_operation)
        self->state = cia402_state_after(self->state, event);
    return false;
}

void cia402_machine_event(struct cia402_machine *self, enum cia402_event event)
{
    bool powered = cia402_machine_is_powered(self);
    self->state = cia402_state_after(self->state, event);
    self->leaving = cia402_initialised;
    if (event == cia402_fault_detected && (!powered || self->options.fault_reaction == 0))
        self->state = cia402_state_after(self->state, cia402_fault_reaction_done);
}

void cia402_machine_stood_still(struct cia402_machine *self)
{
    if (!cia402_machine_is_leaving(self))
        return;
    enum cia402_event event = self->leaving;
    if (self->state == cia402_quick_stop_active)
        event = cia402_quick_stop_done;
    else if (self->state == cia402_fault_reaction_active)
        event = cia402_fault_reaction_done;
    self->leaving = cia402_initialised;
    self->state = cia402_state_after(self->state, event);
}

bool cia402_machine_is_leaving(const struct cia402_machine *self)
{
    return self->state == cia402_fault_reaction_active ||
           (self->state == cia402_quick_stop_active && !stays_in_quick_stop(self)) ||
           (self->state == cia402_operation_enabled && self->leaving != cia402_initialised);
}

/// 1 and 5 are the slow-down ramp of every option code, 2 and 6 the quick-stop ramp.
static enum cia402_action action_of_option(int16_t option)
{
    if (option == 0)
        return cia402_coast;
    return option == 1 || option == 5 ? cia402_slow_down_ramp : cia402_quick_stop_ramp;
}

enum cia402_action cia402_machine_action(const struct cia402_machine *self)
{
    switch (self->state) {
    case cia402_operation_enabled:
        if (self->leaving != cia402_initialised)
            return cia402_slow_down_ramp;
        if (self->control_word & cia402_control_halt)
            return action_of_option(self->options.halt);
        return cia402_follow_setpoints;
    case cia402_quick_stop_active:
        return action_of_option(self->options.quick_stop);
    case cia402_fault_reaction_active:
        return action_of_option(self->options.fault_reaction);
    default:
        return cia402_coast;
    }
}

bool cia402_machine_is_powered(const struct cia402_machine *self)
{
    return self->state == cia402_operation_enabled || self->state == cia402_quick_stop_active ||
           self->state == cia402_fault_reaction_active;
}

bool cia402_period_encode(double period_s, uint8_t *out_units, int8_t *out_exponent)
{
    if (!(period_s >= 1e-6 && period_s <= 255.0))
        return false;
    double whole_us = (double)(uint64_t)(period_s * 1e6 + 0.5);
    double off = period_s * 1e6 - whole_us;
    const double rounding = 1e-9; // relative: a period computed as 1 / rate
    if (!(off <= rounding * whole_us && off >= -rounding * whole_us))
        return false;
    uint64_t units = (uint64_t)whole_us;
    int8_t exponent = -6;
    while (units % 10 == 0 && exponent < 0) {
        units /= 10;
        exponent++;
    }
    if (units > UINT8_MAX)
        return false;
    *out_units = (uint8_t)units;
    *out_exponent = exponent;
    return true;
}

uint32_t cia402_period_us(uint8_t units, int8_t exponent)
{
    if (exponent < -6 || exponent > 0)
        return 0;
    uint32_t period_us = units;
    for (int8_t e = -6; e < exponent; e++)
        period_us *= 10;
    return period_us;
}
