/* SPDX-License-Identifier: MIT */
#include "drivers/can/odrive_master.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;

struct odrive_master_options odrive_master_defaults(void)
{
    return (struct odrive_master_options){
        .bitrate = 1000000,
        .answer_timeout_us = 200000,
        .arm_timeout_us = 2000000,
        .stop_time_s = 0.2,
        .lost_in_a_row = 5,
    };
}

unsigned odrive_master_cycle_bits(enum drive_mode mode, bool polled)
{
    unsigned setpoint = can_frame_bits_worst(mode == drive_mode_torque ? 4 : 8);
    return setpoint + 2 * can_frame_bits_worst(8) + (polled ? 2 * can_frame_bits_worst(0) : 0);
}

static enum odrive_command torque_command(const struct odrive_master *self)
{
    return self->has_torques ? odrive_get_torques : odrive_get_iq;
}

// ---- Frames

static uint64_t time_us(const struct odrive_master *self)
{
    return self->port.operations->time_us(self->port.self);
}

static void note(struct odrive_master *self, enum can_status status)
{
    if (status == can_err_bus_off || status == can_err_gone)
        self->status = status;
}

static void send(struct odrive_master *self, struct can_frame frame)
{
    note(self, self->port.operations->send(self->port.self, &frame));
}

/// Finite values only: a drive whose estimate is no number has none.
static bool take_pair(const struct can_frame *frame, double *out_first, double *out_second)
{
    double first = odrive_float_at(frame, 0), second = odrive_float_at(frame, 4);
    if (!isfinite(first) || !isfinite(second))
        return false;
    *out_first = first;
    *out_second = second;
    return true;
}

static bool is_same(const struct can_frame *a, const struct can_frame *b)
{
    return a->id == b->id && memcmp(a->data, b->data, sizeof a->data) == 0;
}

static void take_estimates(struct odrive_master *self, const struct can_frame *frame)
{
    if (!take_pair(frame, &self->position_rev, &self->velocity_rev_per_s))
        return;
    uint64_t now_us = time_us(self);
    bool repeated = self->window_estimates > 0 && is_same(frame, &self->last_estimates);
    self->estimates++;
    self->estimates_us = now_us;
    self->last_estimates = *frame;
    self->window_estimates += now_us >= self->window_us && !repeated;
}

static void take_torques(struct odrive_master *self, const struct can_frame *frame, bool torques)
{
    double unit = torques ? 1.0 : self->options.torque_constant_Nm_per_A, reference, actual;
    if (!take_pair(frame, &reference, &actual))
        return;
    self->torques += torques;
    self->currents += !torques;
    if (torques != self->has_torques)
        return;
    bool repeated = self->window_torques > 0 && is_same(frame, &self->last_torques);
    self->torque_ref_Nm = reference * unit;
    self->torque_Nm = actual * unit;
    self->last_torques = *frame;
    if (time_us(self) < self->window_us || repeated)
        return;
    // The drive's estimates win the bus over its torques: torques before them are of the sample before.
    self->window_torques += self->window_estimates > 0 ? 1u : 2u;
}

static void dispatch(struct odrive_master *self, const struct can_frame *frame)
{
    uint8_t node_id = self->options.node_id;
    if (frame->id >> 5 != node_id || frame->remote)
        return; // other traffic on the same bus
    if (odrive_heartbeat_parse(frame, node_id, &self->drive)) {
        self->heartbeats++;
        self->heartbeat_us = time_us(self);
    } else if (odrive_is(frame, node_id, odrive_get_encoder_estimates, 8)) {
        take_estimates(self, frame);
    } else if (odrive_is(frame, node_id, odrive_get_torques, 8)) {
        take_torques(self, frame, true);
    } else if (odrive_is(frame, node_id, odrive_get_iq, 8)) {
        take_torques(self, frame, false);
    } else {
        self->counters.frames_unexpected++;
    }
}

/// Serves what has arrived; waits until `until_us` at most.
static void step(struct odrive_master *self, uint64_t until_us)
{
    struct can_frame frame;
    note(self, self->port.operations->wait(self->port.self, until_us));
    while (self->port.operations->receive(self->port.self, &frame))
        dispatch(self, &frame);
}

static void serve(struct odrive_master *self, uint64_t until_us)
{
    while (self->status == can_ok && time_us(self) < until_us)
        step(self, until_us);
}

/// Gives what has been sent the time to get out: a command of a smaller number would overtake one that it builds on.
static void flush(struct odrive_master *self)
{
    const uint32_t to_get_out_us = 5000;
    serve(self, time_us(self) + to_get_out_us);
}

/// Waits until a count changes; false if it does not within the time for an answer.
static bool await(struct odrive_master *self, const uint32_t *count)
{
    uint32_t before = *count;
    uint64_t until_us = time_us(self) + self->options.answer_timeout_us;
    while (self->status == can_ok && *count == before && time_us(self) < until_us)
        step(self, until_us);
    return *count != before;
}

/// Asks for an answer; true if it came.
static bool ask(struct odrive_master *self, enum odrive_command command, const uint32_t *count)
{
    send(self, odrive_request_frame(self->options.node_id, command));
    return await(self, count);
}

static enum drive_status fail(struct odrive_master *self, enum drive_status status, const char *text)
{
    if (self->status != can_ok) {
        snprintf(self->detail, sizeof self->detail, "ODrive %u: the bus is %s", self->options.node_id,
                 self->status == can_err_bus_off ? "off" : "gone");
        return drive_err_bus;
    }
    snprintf(self->detail, sizeof self->detail, "ODrive %u: %s", self->options.node_id, text);
    return status;
}

static enum drive_status fail_fault(struct odrive_master *self, const char *doing)
{
    char text[160];
    snprintf(text, sizeof text, "axis state %u, error %08lX (%s) while %s", self->drive.state,
             (unsigned long)self->drive.error, odrive_error_str(self->drive.error), doing);
    return fail(self, drive_err_fault, text);
}

// ---- Door: open

static enum drive_status check_configuration(struct odrive_master *self)
{
    const struct drive_configuration *c = &self->configuration;
    double constant = self->options.torque_constant_Nm_per_A;
    char text[200];
    if (self->options.node_id > odrive_node_max)
        return fail(self, drive_err_argument, "the node number is not 0 .. 62");
    if (!(constant >= 0.0 && constant <= 1e3))
        return fail(self, drive_err_argument, "the torque constant is not 0 .. 1000 Nm/A");
    if (!(c->sample_rate_hz >= 10.0 && c->sample_rate_hz <= 10e3)) {
        snprintf(text, sizeof text, "sample rate %.9g Hz, 10 .. 10000 expected", c->sample_rate_hz);
        return fail(self, drive_err_argument, text);
    }
    if (!(c->torque_limit_Nm > 0.0) || !(c->velocity_limit_rad_per_s >= 0.0))
        return fail(self, drive_err_argument, "torque limit above 0 and velocity limit not below 0 expected");
    if (c->mode == drive_mode_cascade && !(constant > 0.0))
        return fail(self, drive_err_argument,
                    "its position control needs a current limit: give the torque constant (Nm/A) for one");
    self->period_us = (uint32_t)lround(1e6 / c->sample_rate_hz);
    return drive_ok;
}

static enum drive_status check_load(struct odrive_master *self)
{
    char text[200];
    unsigned bits = odrive_master_cycle_bits(self->configuration.mode, self->polled);
    double load = bits * self->configuration.sample_rate_hz / self->options.bitrate;
    if (load <= ODRIVE_BUS_LOAD_LIMIT)
        return drive_ok;
    snprintf(text, sizeof text, "bus load: %u bits per cycle x %g Hz / %lu bit/s = %.0f %%, at most %.0f %% is planned",
             bits, self->configuration.sample_rate_hz, (unsigned long)self->options.bitrate, 100.0 * load,
             100.0 * ODRIVE_BUS_LOAD_LIMIT);
    return fail(self, drive_err_argument, text);
}

/// Finds out whether the drive sends estimates by itself, and at the right rate.
static enum drive_status find_clock(struct odrive_master *self)
{
    const unsigned periods = 20;
    const uint32_t *torque_count = self->has_torques ? &self->torques : &self->currents;
    uint32_t before = self->estimates, torques_before = *torque_count;
    serve(self, time_us(self) + (uint64_t)periods * self->period_us);
    uint32_t came = self->estimates - before, torques = *torque_count - torques_before;
    self->polled = came == 0;
    if (self->polled ||
        (came + 1 >= periods && came <= periods + 1 && torques + 1 >= periods && torques <= periods + 1))
        return drive_ok;
    char text[200];
    snprintf(text, sizeof text,
             "it sends %u estimates and %u torques by itself in %u sample periods: set both message rates to the "
             "table's, or to 0",
             (unsigned)came, (unsigned)torques, periods);
    return fail(self, drive_err_refused, text);
}

static void set_limits(struct odrive_master *self)
{
    const struct drive_configuration *c = &self->configuration;
    double constant = self->options.torque_constant_Nm_per_A;
    const double unlimited_rev_per_s = 1e4;
    double speed = c->velocity_limit_rad_per_s > 0.0 ? c->velocity_limit_rad_per_s / two_pi : unlimited_rev_per_s;
    if (constant > 0.0)
        send(self, odrive_floats_frame(self->options.node_id, odrive_set_limits, speed, c->torque_limit_Nm / constant));
}

static void set_mode(struct odrive_master *self, enum odrive_control_mode mode)
{
    send(self,
         odrive_words_frame(self->options.node_id, odrive_set_controller_mode, 8, mode, odrive_input_passthrough));
}

static enum drive_status identify(struct odrive_master *self)
{
    uint32_t before = self->heartbeats;
    uint64_t until_us = time_us(self) + 3u * odrive_heartbeat_ms * 1000u;
    while (self->status == can_ok && self->heartbeats == before && time_us(self) < until_us)
        step(self, until_us);
    if (self->heartbeats == before)
        return fail(self, drive_err_timeout, "no heartbeat");
    if (!ask(self, odrive_get_encoder_estimates, &self->estimates))
        return fail(self, drive_err_identity, "it has no encoder estimates");
    self->has_torques = ask(self, odrive_get_torques, &self->torques);
    if (self->has_torques)
        return drive_ok;
    if (!(self->options.torque_constant_Nm_per_A > 0.0))
        return fail(self, drive_err_identity,
                    "its firmware does not say torques: give the torque constant (Nm/A) to use its currents");
    if (!ask(self, odrive_get_iq, &self->currents))
        return fail(self, drive_err_identity, "it says neither torques nor currents");
    return drive_ok;
}

static enum drive_status master_open(void *object, const struct drive_configuration *configuration)
{
    struct odrive_master *self = object;
    self->configuration = *configuration;
    self->opened = self->armed = false;
    memset(&self->counters, 0, sizeof self->counters);
    self->saturated = 0;
    self->status = can_ok;
    self->detail[0] = '\0';
    enum drive_status status = check_configuration(self);
    if (status == drive_ok)
        status = identify(self);
    if (status != drive_ok)
        return status;
    self->polled = false; // what is least to be carried
    status = check_load(self);
    if (status == drive_ok)
        status = find_clock(self);
    if (status == drive_ok)
        status = check_load(self);
    self->opened = status == drive_ok;
    if (status != drive_ok)
        return status;
    bool torque = configuration->mode == drive_mode_torque;
    send(self, odrive_words_frame(self->options.node_id, odrive_set_axis_state, 4, odrive_idle, 0));
    send(self, odrive_words_frame(self->options.node_id, odrive_clear_errors, 0, 0, 0));
    flush(self);
    set_limits(self);
    set_mode(self, torque ? odrive_control_torque : odrive_control_position);
    flush(self);
    return self->status == can_ok ? drive_ok : fail(self, drive_err_bus, "");
}

// ---- Set-points and samples

static double clip(struct odrive_master *self, double value, double limit)
{
    if (fabs(value) <= limit)
        return value;
    self->saturated++;
    return value > 0.0 ? limit : -limit;
}

static void send_setpoint(struct odrive_master *self, const struct drive_setpoint *setpoint)
{
    double torque = clip(self, setpoint->torque_Nm, self->configuration.torque_limit_Nm);
    if (self->configuration.mode == drive_mode_torque) {
        send(self, odrive_float_frame(self->options.node_id, odrive_set_input_torque, torque));
        return;
    }
    struct can_frame frame;
    self->saturated += odrive_input_pos_frame(self->options.node_id, self->zero_rev + setpoint->position_rad / two_pi,
                                              setpoint->velocity_rad_per_s / two_pi, torque, &frame);
    send(self, frame);
}

/// Waits for the sample that is due; true if it came whole and in time.
static bool collect(struct odrive_master *self)
{
    uint64_t half_us = self->period_us / 2, early_us = self->due_us - half_us, late_us = self->due_us + half_us;
    if (self->polled) {
        early_us = self->due_us;
        late_us = self->due_us + self->period_us * 4u / 5u; // requests, answers and a heartbeat one after the other
        serve(self, self->due_us);
        send(self, odrive_request_frame(self->options.node_id, odrive_get_encoder_estimates));
        send(self, odrive_request_frame(self->options.node_id, torque_command(self)));
    }
    self->window_us = early_us;
    self->window_estimates = self->window_torques = 0;
    const unsigned doubtful_after_loss = 3;
    bool whole = false;
    while (self->status == can_ok && (!whole || self->doubtful > 0) && time_us(self) < late_us) {
        step(self, late_us);
        whole = self->window_estimates == 1 && self->window_torques == 1;
    }
    if (!whole)
        self->doubtful = doubtful_after_loss;
    else if (self->doubtful > 0)
        self->doubtful--;
    // The drive's messages are the clock; a lost one leaves its place in time empty.
    self->due_us = (whole && !self->polled ? self->estimates_us : self->due_us) + self->period_us;
    self->missing_in_a_row = whole ? 0 : self->missing_in_a_row + 1;
    return whole;
}

/// One exchange: the set-point goes out, the next sample comes in.
static bool run_cycle(struct odrive_master *self, const struct drive_setpoint *setpoint)
{
    uint64_t now_us = time_us(self);
    if (self->due_us + self->period_us < now_us) { // the caller came too late for this sample
        self->counters.samples_late++;
        self->due_us = now_us + self->period_us;
    }
    send_setpoint(self, setpoint);
    return collect(self);
}

// ---- Door: arm, exchange

static enum drive_status master_arm(void *object)
{
    struct odrive_master *self = object;
    struct drive_setpoint still = {0};
    if (!self->opened)
        return fail(self, drive_err_argument, "arm before open");
    bool clocked = self->polled ? ask(self, odrive_get_encoder_estimates, &self->estimates)
                                : await(self, &self->estimates); // an answer would come at any time of its period
    if (!clocked)
        return fail(self, drive_err_timeout, "no encoder estimates");
    self->zero_rev = self->position_rev;
    self->due_us = self->estimates_us + self->period_us;
    self->missing_in_a_row = self->doubtful = 0;
    uint64_t until_us = time_us(self) + self->options.arm_timeout_us;
    send_setpoint(self, &still);
    flush(self);
    if (!self->polled)
        self->due_us = self->estimates_us + self->period_us;
    send(self, odrive_words_frame(self->options.node_id, odrive_set_axis_state, 4, odrive_closed_loop, 0));
    uint32_t heartbeats = self->heartbeats;
    while (self->status == can_ok && time_us(self) < until_us) {
        run_cycle(self, &still);
        bool news = self->heartbeats != heartbeats;
        if (news && self->drive.error != 0)
            return fail_fault(self, "switching on");
        if (news && self->drive.state == odrive_closed_loop && self->missing_in_a_row == 0) {
            self->armed = true;
            return drive_ok;
        }
    }
    return fail(self, drive_err_refused, "does not enter closed loop control");
}

static enum drive_status master_exchange(void *object, const struct drive_setpoint *setpoint,
                                         struct drive_sample *out_sample)
{
    struct odrive_master *self = object;
    *out_sample = (struct drive_sample){.valid = false};
    bool finite =
        isfinite(setpoint->position_rad) && isfinite(setpoint->velocity_rad_per_s) && isfinite(setpoint->torque_Nm);
    if (!self->armed || !finite)
        return fail(self, drive_err_argument, self->armed ? "a set-point is not a number" : "exchange before arm");
    bool whole = run_cycle(self, setpoint);
    *out_sample = (struct drive_sample){
        .torque_ref_Nm = self->torque_ref_Nm,
        .torque_Nm = self->torque_Nm,
        .position_rad = (self->position_rev - self->zero_rev) * two_pi,
        .velocity_rad_per_s = self->velocity_rev_per_s * two_pi,
        .valid = whole && self->drive.state == odrive_closed_loop,
    };
    if (!out_sample->valid)
        self->counters.samples_lost++;
    if (self->status != can_ok)
        return fail(self, drive_err_bus, "");
    if (self->drive.error != 0 || self->drive.state != odrive_closed_loop)
        return fail_fault(self, "measuring");
    if (time_us(self) > self->heartbeat_us + 3u * odrive_heartbeat_ms * 1000u)
        return fail(self, drive_err_timeout, "its heartbeat stopped");
    if (self->missing_in_a_row > self->options.lost_in_a_row)
        return fail(self, drive_err_timeout, "too many samples in a row did not come");
    return drive_ok;
}

// ---- Door: stop, close

/// Velocity control down a ramp; the set-points keep the drive's watchdog content.
static void ramp_down(struct odrive_master *self)
{
    uint8_t node_id = self->options.node_id;
    double speed = self->velocity_rev_per_s;
    double cycles = ceil(self->options.stop_time_s * 1e6 / self->period_us), held = ceil(1e5 / self->period_us);
    send(self, odrive_floats_frame(node_id, odrive_set_input_vel, speed, 0.0));
    serve(self, time_us(self) + self->period_us); // the mode must not overtake it
    set_mode(self, odrive_control_velocity);
    for (double n = 1.0; n <= cycles + held && self->status == can_ok; n += 1.0) {
        send(self, odrive_floats_frame(node_id, odrive_set_input_vel, speed * fmax(1.0 - n / cycles, 0.0), 0.0));
        serve(self, time_us(self) + self->period_us);
    }
}

static enum drive_status master_stop(void *object)
{
    struct odrive_master *self = object;
    uint8_t node_id = self->options.node_id;
    if (!self->armed)
        return drive_ok;
    self->armed = false;
    if (self->drive.state == odrive_closed_loop)
        ramp_down(self);
    for (int attempt = 0; attempt < 3 && self->status == can_ok; attempt++) {
        uint32_t heartbeats = self->heartbeats;
        send(self, odrive_words_frame(node_id, odrive_set_axis_state, 4, odrive_idle, 0));
        uint64_t until_us = time_us(self) + 2u * odrive_heartbeat_ms * 1000u;
        while (self->status == can_ok && time_us(self) < until_us) {
            step(self, until_us);
            if (self->heartbeats != heartbeats && self->drive.state != odrive_closed_loop)
                return drive_ok;
        }
    }
    send(self, odrive_words_frame(node_id, odrive_estop, 0, 0, 0));
    return fail(self, drive_err_timeout, "does not confirm that it is idle; its own watchdog has to stop it");
}

static void master_close(void *object)
{
    struct odrive_master *self = object;
    master_stop(self);
    if (self->opened)
        send(self, odrive_words_frame(self->options.node_id, odrive_set_axis_state, 4, odrive_idle, 0));
    self->opened = false;
    flush(self);
}

static const struct drive_counters *master_counters(const void *object)
{
    const struct odrive_master *self = object;
    return &self->counters;
}

static const char *master_detail(const void *object)
{
    const struct odrive_master *self = object;
    return self->detail;
}

static const struct drive_operations operations = {
    master_open, master_arm, master_exchange, master_stop, master_close, master_counters, master_detail,
};

void odrive_master_init(struct odrive_master *self, const struct can_port *port,
                        const struct odrive_master_options *options)
{
    memset(self, 0, sizeof *self);
    self->options = *options;
    self->port = *port;
}

struct drive odrive_master_drive(struct odrive_master *self)
{
    return (struct drive){.operations = &operations, .self = self};
}
