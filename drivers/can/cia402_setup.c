/* SPDX-License-Identifier: MIT */
#include "drivers/can/cia402_setup.h"

#include "drivers/can/pdo.h"
#include "drivers/can/pdo_check.h"

#include <math.h>
#include <stdio.h>

/// One object and what it is to hold.
struct parameter {
    uint16_t index;
    uint8_t subindex, size;
    uint32_t value;
};

static enum drive_status failed(struct cia402_master *self, const char *verb, const struct parameter *p,
                                uint32_t abort_code)
{
    if (abort_code == CANOPEN_BUS_LOST) {
        snprintf(self->detail, sizeof self->detail, "node %u: the bus was lost", self->options.node_id);
        return drive_err_bus;
    }
    if (abort_code == od_abort_timeout) {
        snprintf(self->detail, sizeof self->detail, "node %u does not answer (%s %04X:%u)", self->options.node_id, verb,
                 p->index, p->subindex);
        return drive_err_timeout;
    }
    if (abort_code == od_abort_incompatible)
        snprintf(self->detail, sizeof self->detail, "node %u: %s %04X:%u = %lu: read back as something else",
                 self->options.node_id, verb, p->index, p->subindex, (unsigned long)p->value);
    else
        snprintf(self->detail, sizeof self->detail, "node %u: %s %04X:%u = %lu: %s (abort %08lX)",
                 self->options.node_id, verb, p->index, p->subindex, (unsigned long)p->value, od_abort_str(abort_code),
                 (unsigned long)abort_code);
    return drive_err_refused;
}

static enum drive_status refuse(struct cia402_master *self, enum drive_status status, const char *text)
{
    snprintf(self->detail, sizeof self->detail, "node %u: %s", self->options.node_id, text);
    return status;
}

/// Writes, reads back and remembers; returns an abort code.
static uint32_t put(struct cia402_master *self, const struct parameter *p, uint32_t mask)
{
    uint32_t abort_code = canopen_master_write_surely(&self->bus, p->index, p->subindex, p->size, p->value, mask);
    if (abort_code != od_abort_none)
        return abort_code;
    size_t i = 0;
    while (i < self->written_count && !(self->written[i].index == p->index && self->written[i].subindex == p->subindex))
        i++;
    if (i == cia402_written_max)
        return od_abort_memory;
    self->written[i] = (struct cia402_written){p->index, p->subindex, p->size, p->value, mask};
    self->written_count = i == self->written_count ? i + 1 : self->written_count;
    return od_abort_none;
}

/// Reads everything once more. A write that was altered on its way into one to another object has been answered and
/// repeated, but what it hit is wrong now.
static enum drive_status verify_all(struct cia402_master *self)
{
    for (size_t i = 0; i < self->written_count; i++) {
        const struct cia402_written *w = &self->written[i];
        const struct parameter p = {w->index, w->subindex, w->size, w->value};
        uint32_t value = 0;
        uint32_t abort_code = canopen_master_read_surely(&self->bus, w->index, w->subindex, w->size, &value);
        if (abort_code != od_abort_none)
            return failed(self, "read", &p, abort_code);
        if ((value ^ w->value) & w->mask)
            return failed(self, "verify", &p, od_abort_incompatible);
    }
    return drive_ok;
}

static enum drive_status write_all(struct cia402_master *self, const struct parameter *parameters, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        const struct parameter *p = &parameters[i];
        uint32_t abort_code = put(self, p, UINT32_MAX);
        if (abort_code != od_abort_none)
            return failed(self, "write", p, abort_code);
    }
    return drive_ok;
}

static enum drive_status read_one(struct cia402_master *self, uint16_t index, uint8_t subindex, uint8_t size,
                                  uint32_t *out_value)
{
    const struct parameter p = {index, subindex, size, 0};
    uint32_t abort_code = canopen_master_read_surely(&self->bus, index, subindex, size, out_value);
    return abort_code == od_abort_none ? drive_ok : failed(self, "read", &p, abort_code);
}

// ---- What is asked for

static enum drive_status check_configuration(struct cia402_master *self)
{
    const struct drive_configuration *c = &self->configuration;
    if (!(c->torque_limit_Nm > 0.0 && c->torque_limit_Nm <= 1e9))
        return refuse(self, drive_err_argument, "the torque limit has to be above 0");
    if (!(c->velocity_limit_rad_per_s >= 0.0) || !(c->following_error_rad >= 0.0))
        return refuse(self, drive_err_argument, "velocity limit and following error must not be negative");
    if (!(c->sample_rate_hz > 0.0 && c->sample_rate_hz <= 20000.0)) {
        snprintf(self->detail, sizeof self->detail, "sample rate %g Hz: object 60C2 expects above 0 and at most 20000",
                 c->sample_rate_hz);
        return drive_err_argument;
    }
    return drive_ok;
}

/// How this make is told the period.
static enum drive_status plan_period(struct cia402_master *self, struct parameter *out_units,
                                     struct parameter *out_exponent)
{
    uint8_t units;
    int8_t exponent;
    if (!cia402_profile_period(self->profile, self->configuration.sample_rate_hz, &units, &exponent, self->detail,
                               sizeof self->detail))
        return drive_err_argument;
    *out_units = (struct parameter){cia402_interpolation_period, 1, 1, units};
    *out_exponent = (struct parameter){cia402_interpolation_period, 2, 1, (uint8_t)exponent};
    self->period_us = cia402_period_us(units, exponent);
    if (self->configuration.mode == drive_mode_cascade && self->profile->no_feedforward) {
        snprintf(self->detail, sizeof self->detail,
                 "%s takes no velocity and torque feed-forward (60B1, 60B2), which the cascade needs: expected torque "
                 "mode",
                 self->profile->make);
        return drive_err_argument;
    }
    return drive_ok;
}

/// Plans one cycle on the wire; refuses what the bus cannot carry.
static enum drive_status plan_cycle(struct cia402_master *self)
{
    const double rate_hz = self->configuration.sample_rate_hz;
    unsigned bits = cia402_master_cycle_bits(self->configuration.mode, self->checked);
    double load = bits * rate_hz / self->options.bitrate;
    if (!(load <= CIA402_BUS_LOAD_LIMIT)) {
        snprintf(self->detail, sizeof self->detail,
                 "bus load: %u bits per cycle x %g Hz / %lu bit/s = %.0f %%, the limit is %.0f %%", bits, rate_hz,
                 (unsigned long)self->options.bitrate, 100.0 * load, 100.0 * CIA402_BUS_LOAD_LIMIT);
        return drive_err_argument;
    }
    // Before each SYNC the RPDOs have to get out, behind one foreign frame at worst. At 70 % load there is time for
    // that: then the 30 % left are more than the 135 bits of that frame, for every cycle of at least 315 bits.
    unsigned before_sync =
        cia402_master_target_bits(self->configuration.mode, self->checked) + can_frame_bits_worst(can_data_max);
    self->targets_us = (uint32_t)ceil(1e6 * before_sync / self->options.bitrate);
    self->reply_us = self->period_us - self->targets_us;
    if (self->reply_us < self->options.reply_patience_us)
        self->reply_us = self->options.reply_patience_us;
    return drive_ok;
}

// ---- What the drive says

/// A drive under torque before we have asked for it follows somebody else.
static enum drive_status refuse_other_commander(struct cia402_master *self)
{
    uint32_t word = 0, watched = 0;
    enum cia402_state state;
    if (canopen_master_read(&self->bus, cia402_status_word, 0, 2, &word) != od_abort_none ||
        !cia402_status_decode((uint16_t)word, &state) ||
        (state != cia402_operation_enabled && state != cia402_quick_stop_active))
        return self->bus.status == can_ok ? drive_ok : refuse(self, drive_err_bus, "the bus was lost");
    if (canopen_master_read(&self->bus, 0x1016, 1, 4, &watched) == od_abort_none && (watched >> 16 & 0x7F) != 0)
        snprintf(self->detail, sizeof self->detail,
                 "node %u is in %s already and watches the heartbeat of node %lu: another master commands it",
                 self->options.node_id, cia402_state_str(state), (unsigned long)(watched >> 16 & 0x7F));
    else
        snprintf(self->detail, sizeof self->detail, "node %u is in %s already: another master commands it",
                 self->options.node_id, cia402_state_str(state));
    return drive_err_refused;
}

/// The profile asked for, unless the drive says that it is of another make; else by its identity.
static enum drive_status choose_profile(struct cia402_master *self)
{
    uint32_t vendor = 0, product = 0;
    bool told = canopen_master_read_surely(&self->bus, 0x1018, 1, 4, &vendor) == od_abort_none;
    if (told && canopen_master_read_surely(&self->bus, 0x1018, 2, 4, &product) != od_abort_none)
        product = 0;
    if (self->bus.status != can_ok)
        return refuse(self, drive_err_bus, "the bus was lost");
    self->profile = self->options.profile ? self->options.profile : cia402_profile_identify(vendor, product);
    if (told && self->profile->vendor != 0 && self->profile->vendor != vendor) {
        snprintf(self->detail, sizeof self->detail,
                 "node %u: vendor (1018:1) is %08lX, profile %s is for %s with %08lX", self->options.node_id,
                 (unsigned long)vendor, self->profile->name, self->profile->make, (unsigned long)self->profile->vendor);
        return drive_err_identity;
    }
    return drive_ok;
}

static enum drive_status identify(struct cia402_master *self)
{
    uint32_t device_type, modes;
    enum drive_status status = read_one(self, 0x1000, 0, 4, &device_type);
    if (status != drive_ok)
        return status;
    // Profile 402 with the servo's bit; makers set others beside it.
    if ((device_type & CIA402_SERVO_DRIVE) != CIA402_SERVO_DRIVE || (device_type & 0xFFFF) != 0x0192) {
        snprintf(self->detail, sizeof self->detail, "node %u: device type (1000) is %08lX, a servo drive has %08lX",
                 self->options.node_id, (unsigned long)device_type, (unsigned long)CIA402_SERVO_DRIVE);
        return drive_err_identity;
    }
    status = choose_profile(self);
    if (status != drive_ok)
        return status;
    status = read_one(self, cia402_supported_modes, 0, 4, &modes);
    if (status != drive_ok)
        return status;
    bool torque = self->configuration.mode == drive_mode_torque;
    if (!(modes & (torque ? CIA402_SUPPORTS(cia402_mode_cst) : CIA402_SUPPORTS(cia402_mode_csp)))) {
        snprintf(self->detail, sizeof self->detail,
                 "node %u: supported modes (6502) are %08lX, without cyclic synchronous %s", self->options.node_id,
                 (unsigned long)modes, torque ? "torque" : "position");
        return drive_err_identity;
    }
    uint32_t ignored;
    self->checked = canopen_master_read(&self->bus, pdo_check_sample_index, 2, 1, &ignored) == od_abort_none &&
                    canopen_master_read(&self->bus, pdo_check_target_index, 2, 1, &ignored) == od_abort_none;
    return self->bus.status == can_ok ? drive_ok : refuse(self, drive_err_bus, "the bus was lost");
}

/// Reads an object of which the profile may know what a drive without it means; `fallback` 0: it has to be there.
static enum drive_status read_or_known(struct cia402_master *self, uint16_t index, uint8_t subindex, uint32_t fallback,
                                       uint32_t *out_value)
{
    uint32_t abort_code = canopen_master_read_surely(&self->bus, index, subindex, 4, out_value);
    const struct parameter p = {index, subindex, 4, 0};
    if (abort_code == od_abort_none)
        return drive_ok;
    if (fallback == 0 || (abort_code != od_abort_no_object && abort_code != od_abort_no_subindex))
        return failed(self, "read", &p, abort_code);
    *out_value = fallback;
    return drive_ok;
}

static enum drive_status read_scaling(struct cia402_master *self)
{
    const struct cia402_scaling_objects *known = &self->profile->units;
    struct cia402_scaling_objects objects = {.torque_units = self->profile->torque_units_per_rated};
    const struct {
        uint16_t index;
        uint8_t subindex;
        uint32_t fallback, *value;
    } wanted[] = {
        {cia402_unit_position, 0, known->position_unit, &objects.position_unit},
        {cia402_unit_velocity, 0, known->velocity_unit, &objects.velocity_unit},
        {cia402_encoder_resolution, 1, known->increments, &objects.increments},
        {cia402_encoder_resolution, 2, known->revolutions, &objects.revolutions},
        {cia402_rated_torque, 0, known->rated_torque, &objects.rated_torque},
    };
    for (size_t i = 0; i < sizeof wanted / sizeof wanted[0]; i++) {
        enum drive_status status =
            read_or_known(self, wanted[i].index, wanted[i].subindex, wanted[i].fallback, wanted[i].value);
        if (status != drive_ok)
            return status;
    }
    const char *wrong = cia402_scaling_read(&objects, &self->scaling);
    return wrong ? refuse(self, drive_err_identity, wrong) : drive_ok;
}

// ---- What is written

/// A limit in the drive's units, rounded down, at least 1 and at most `maximum`.
static uint32_t limit_units(double value, double unit, double maximum)
{
    return (uint32_t)fmin(fmax(floor(value / unit), 1.0), maximum);
}

static enum drive_status write_limits(struct cia402_master *self)
{
    const struct drive_configuration *c = &self->configuration;
    uint32_t torque = limit_units(c->torque_limit_Nm, self->scaling.torque, UINT16_MAX);
    if (c->torque_limit_Nm < self->scaling.torque)
        return refuse(self, drive_err_argument, "the torque limit is below one permille of the rated torque (6076)");
    struct parameter limits[3] = {{cia402_max_torque, 0, 2, torque}};
    size_t count = 1;
    if (c->following_error_rad > 0.0) {
        uint32_t window = limit_units(c->following_error_rad, self->scaling.position, UINT32_MAX - 1.0);
        limits[count++] = (struct parameter){cia402_following_error_window, 0, 4, window};
    }
    if (c->velocity_limit_rad_per_s > 0.0) {
        uint32_t velocity = limit_units(c->velocity_limit_rad_per_s, self->scaling.velocity, UINT32_MAX);
        limits[count++] = (struct parameter){cia402_max_velocity, 0, 4, velocity};
    }
    return write_all(self, limits, count);
}

/// Writes an object that not every drive has.
static enum drive_status write_if_there(struct cia402_master *self, struct parameter p, bool *out_there)
{
    uint32_t abort_code = put(self, &p, UINT32_MAX);
    *out_there = abort_code == od_abort_none;
    bool missing = abort_code == od_abort_no_object || abort_code == od_abort_no_subindex;
    return *out_there || missing ? drive_ok : failed(self, "write", &p, abort_code);
}

/// Leftovers of somebody else that would be torque or motion, and what is to happen when we fall silent.
static enum drive_status write_optional(struct cia402_master *self)
{
    const struct parameter optional[] = {
        {cia402_abort_connection_option, 0, 2, 1}, // a lost connection is a fault
        {cia402_torque_offset, 0, 2, 0},
        {cia402_velocity_offset, 0, 4, 0},
    };
    enum drive_status status = drive_ok;
    bool there;
    for (size_t i = 0; i < sizeof optional / sizeof optional[0] && status == drive_ok; i++)
        status = write_if_there(self, optional[i], &there);
    return status;
}

/// SYNC with a counter where the drive takes one, and the time after which it misses one.
static enum drive_status write_sync(struct cia402_master *self)
{
    const struct parameter off = {0x1006, 0, 4, 0}; // 1019 may only be written while this is 0
    bool counted = false, timed = false;
    enum drive_status status = write_all(self, &off, 1);
    if (status == drive_ok)
        status = write_if_there(self, (struct parameter){0x1019, 0, 1, sync_overflow_max}, &counted);
    self->bus.sync = (struct sync_producer){.overflow = counted ? sync_overflow_max : 0};
    if (status == drive_ok && self->profile->has_sync_timeout)
        status = write_if_there(self, (struct parameter){0x2003, 1, 4, self->options.sync_timeout_us}, &timed);
    // Elsewhere 1006 alone says it: the time-out is 1.5 times what it holds.
    uint32_t watched_us = self->period_us;
    if (!timed && self->options.sync_timeout_us != 0)
        watched_us = self->options.sync_timeout_us / 3 * 2;
    const struct parameter period = {0x1006, 0, 4, watched_us};
    return status == drive_ok ? write_all(self, &period, 1) : status;
}

/// Three heartbeats, or one more than SYNC is waited for: what a late SYNC is forgiven for is no lost heartbeat, and
/// the last one may have come just before its successor was due.
static uint32_t heartbeat_lost_after_ms(const struct cia402_master *self)
{
    const uint32_t one_ms = self->options.heartbeat_ms, sync_ms = self->options.sync_timeout_us / 1000u;
    return sync_ms > 2u * one_ms ? sync_ms + one_ms : 3u * one_ms;
}

static enum drive_status write_parameters(struct cia402_master *self, struct parameter units, struct parameter exponent)
{
    const uint32_t heartbeat_ms = self->options.heartbeat_ms, lost_after_ms = heartbeat_lost_after_ms(self);
    const uint32_t mode = self->configuration.mode == drive_mode_torque ? cia402_mode_cst : cia402_mode_csp;
    const struct parameter parameters[] = {
        {cia402_quick_stop_option, 0, 2, 2}, // ramp, then without torque: how stop() ends
        {cia402_modes_of_operation, 0, 1, mode},
        exponent,
        units,
        {0x1016, 1, 4, (uint32_t)self->options.master_id << 16 | lost_after_ms},
        {0x1017, 0, 2, heartbeat_ms},
    };
    enum drive_status status = write_all(self, parameters, sizeof parameters / sizeof parameters[0]);
    if (status == drive_ok)
        status = write_optional(self);
    if (status == drive_ok)
        status = write_sync(self);
    if (status != drive_ok)
        return status;
    uint32_t display;
    status = read_one(self, cia402_mode_display, 0, 1, &display);
    if (status == drive_ok && display != mode)
        return refuse(self, drive_err_refused, "the mode asked for (6060) is not the mode shown (6061)");
    return status;
}

// ---- Process data

struct mapping {
    uint8_t number; ///< 0..3
    bool transmit;  ///< by the drive
    uint8_t count;  ///< 0: not used, disabled
    uint32_t entries[4];
};

#define MAPPED(index, subindex, bits) ((uint32_t)(index) << 16 | (uint32_t)(subindex) << 8 | (bits))

static enum drive_status map_pdo(struct cia402_master *self, const struct mapping *m)
{
    uint16_t parameters = (uint16_t)((m->transmit ? 0x1800 : 0x1400) + m->number);
    uint16_t mapping = (uint16_t)(parameters + 0x200);
    uint32_t cob_id = (m->transmit ? 0x180u : 0x200u) + 0x100u * m->number + self->options.node_id;
    const struct parameter off = {parameters, 1, 4, cob_id | PDO_DISABLED}, on = {parameters, 1, 4, cob_id};
    uint32_t abort_code = put(self, &off, ~PDO_NO_REMOTE);
    if (m->count == 0 && (abort_code == od_abort_no_object || abort_code == od_abort_no_subindex))
        return drive_ok; // a drive with fewer PDOs than four has nothing to disable
    if (abort_code != od_abort_none)
        return failed(self, "write", &off, abort_code);
    if (m->count == 0)
        return drive_ok;
    struct parameter steps[7] = {{parameters, 2, 1, 1}, {mapping, 0, 1, 0}};
    size_t count = 2;
    for (uint8_t i = 0; i < m->count; i++)
        steps[count++] = (struct parameter){mapping, (uint8_t)(i + 1), 4, m->entries[i]};
    steps[count++] = (struct parameter){mapping, 0, 1, m->count};
    enum drive_status status = write_all(self, steps, count);
    if (status != drive_ok)
        return status;
    abort_code = put(self, &on, ~PDO_NO_REMOTE);
    return abort_code == od_abort_none ? drive_ok : failed(self, "write", &on, abort_code);
}

static enum drive_status map_process_data(struct cia402_master *self)
{
    const bool torque = self->configuration.mode == drive_mode_torque;
    const uint8_t check = self->checked ? 2 : 0;
    const uint32_t counter = MAPPED(pdo_check_target_index, 1, 8), byte = MAPPED(pdo_check_target_index, 2, 8);
    const struct mapping targets[2] = {
        {0,
         false,
         2,
         {MAPPED(cia402_control_word, 0, 16),
          torque ? MAPPED(cia402_target_torque, 0, 16) : MAPPED(cia402_target_position, 0, 32)}},
        {1,
         false,
         (uint8_t)((torque ? 0 : 2) + check),
         {torque ? counter : MAPPED(cia402_velocity_offset, 0, 32), torque ? byte : MAPPED(cia402_torque_offset, 0, 16),
          counter, byte}},
    };
    const struct mapping samples[2] = {
        {0,
         true,
         3,
         {MAPPED(cia402_status_word, 0, 16), MAPPED(cia402_position_actual, 0, 32),
          MAPPED(cia402_torque_actual, 0, 16)}},
        {1,
         true,
         (uint8_t)(2 + check),
         {MAPPED(cia402_velocity_actual, 0, 32), MAPPED(cia402_torque_demand, 0, 16),
          MAPPED(pdo_check_sample_index, 1, 8), MAPPED(pdo_check_sample_index, 2, 8)}},
    };
    const struct mapping unused[4] = {{2, false, 0, {0}}, {3, false, 0, {0}}, {2, true, 0, {0}}, {3, true, 0, {0}}};
    enum drive_status status = drive_ok;
    for (int i = 0; i < 2 && status == drive_ok; i++)
        status = map_pdo(self, &targets[i]);
    for (int i = 0; i < 2 && status == drive_ok; i++)
        status = map_pdo(self, &samples[i]);
    for (int i = 0; i < 4 && status == drive_ok; i++)
        status = map_pdo(self, &unused[i]);
    return status;
}

// ---- Start

/// Sends NMT start until the heartbeat says operational; three heartbeats at most.
static enum drive_status start_node(struct cia402_master *self)
{
    struct canopen_master *bus = &self->bus;
    const uint32_t heartbeat_us = self->options.heartbeat_ms * 1000u;
    heartbeat_producer_start(&bus->producer, self->options.master_id, heartbeat_us, canopen_master_time_us(bus));
    heartbeat_consumer_start(&bus->consumer, self->options.node_id, 1000u * heartbeat_lost_after_ms(self));
    for (int attempt = 0; attempt < 3; attempt++) {
        struct can_frame frame = nmt_command_frame(nmt_start, self->options.node_id);
        canopen_master_send(bus, &frame);
        uint64_t until_us = canopen_master_time_us(bus) + heartbeat_us + heartbeat_us / 4;
        while (canopen_master_time_us(bus) < until_us && bus->status == can_ok) {
            canopen_master_step(bus, until_us);
            if (bus->consumer.life == heartbeat_alive && bus->consumer.state == nmt_operational) {
                self->boot_ups = bus->consumer.boot_ups;
                return drive_ok;
            }
        }
    }
    if (bus->status != can_ok)
        return refuse(self, drive_err_bus, "the bus was lost");
    return refuse(self, drive_err_timeout, "no heartbeat says operational");
}

enum drive_status cia402_setup(struct cia402_master *self)
{
    struct parameter units = {0}, exponent = {0};
    self->written_count = 0;
    enum drive_status status = check_configuration(self);
    if (status == drive_ok)
        status = refuse_other_commander(self);
    if (status != drive_ok)
        return status;
    struct can_frame frame = nmt_command_frame(nmt_enter_pre_operational, self->options.node_id);
    canopen_master_send(&self->bus, &frame);
    status = identify(self);
    if (status == drive_ok)
        status = plan_period(self, &units, &exponent);
    if (status == drive_ok)
        status = plan_cycle(self);
    if (status == drive_ok)
        status = read_scaling(self);
    if (status == drive_ok)
        status = write_parameters(self, units, exponent);
    if (status == drive_ok)
        status = write_limits(self);
    if (status == drive_ok)
        status = map_process_data(self);
    if (status == drive_ok)
        status = verify_all(self);
    if (status == drive_ok)
        status = start_node(self);
    return status;
}
