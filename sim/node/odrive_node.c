/* SPDX-License-Identifier: MIT */
#include "sim/node/odrive_node.h"

#include <math.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;

struct odrive_node_options odrive_node_defaults(void)
{
    return (struct odrive_node_options){
        .torque_constant_Nm_per_A = 0.05, .cyclic = true, .has_torques = true, .clock_ratio = 1.0};
}

static void send(struct odrive_node *self, struct can_frame frame)
{
    if (self->port.operations->send(self->port.self, &frame) != can_ok)
        self->frames_unsent++;
}

static void send_estimates(struct odrive_node *self)
{
    send(self, odrive_floats_frame(self->options.node_id, odrive_get_encoder_estimates, self->sample.position / two_pi,
                                   self->sample.velocity / two_pi));
}

static void send_torques(struct odrive_node *self, enum odrive_command command)
{
    double unit = command == odrive_get_iq ? self->options.torque_constant_Nm_per_A : 1.0;
    send(self, odrive_floats_frame(self->options.node_id, command, self->sample.torque_ref / unit,
                                   self->sample.torque / unit));
}

static void send_heartbeat(struct odrive_node *self)
{
    send(self, odrive_heartbeat_frame(self->options.node_id, &self->status));
}

static void disarm(struct odrive_node *self, uint32_t error)
{
    self->status.error |= error;
    self->status.state = odrive_idle;
    send_heartbeat(self);
}

// ---- One tick

static struct sim_command command_of_state(const struct odrive_node *self)
{
    struct sim_command command = {.control = sim_control_off};
    if (self->status.state != odrive_closed_loop)
        return command;
    command.torque = self->input_torque_Nm;
    command.velocity = self->input_velocity_rev_per_s * two_pi;
    command.position = self->input_position_rev * two_pi;
    command.control = self->control_mode == odrive_control_torque     ? sim_control_torque
                      : self->control_mode == odrive_control_velocity ? sim_control_velocity
                                                                      : sim_control_cascade;
    return command;
}

static void tick(struct odrive_node *self, uint64_t now_us)
{
    if (self->status.state == odrive_closed_loop && now_us - self->input_us > odrive_node_watchdog_us)
        disarm(self, odrive_error_watchdog);
    struct sim_command command = command_of_state(self);
    sim_belt_drive_step(&self->drive, &command, &self->sample);
    self->ticks++;
    bool numbers = isfinite(self->sample.position) && isfinite(self->sample.velocity);
    bool loop = self->status.state == odrive_closed_loop;
    if (loop && !numbers)
        disarm(self, odrive_error_missing_estimate);
    else if (loop && !(fabs(self->sample.velocity) <= self->speed_limit_rev_per_s * two_pi))
        disarm(self, odrive_error_velocity_limit);
    if (!self->options.cyclic)
        return;
    send_estimates(self);
    send_torques(self, self->options.has_torques ? odrive_get_torques : odrive_get_iq);
}

// ---- What the bus brings

static void set_state(struct odrive_node *self, uint32_t state, uint64_t now_us)
{
    bool possible = state == odrive_idle || (state == odrive_closed_loop && self->status.error == 0);
    if (!possible) {
        self->requests_refused++;
        return;
    }
    self->status.state = (uint8_t)state;
    self->input_us = now_us;
}

static void set_limits(struct odrive_node *self, double speed_rev_per_s, double current_A)
{
    if (!(speed_rev_per_s > 0.0) || !(current_A > 0.0)) {
        self->requests_refused++;
        return;
    }
    self->speed_limit_rev_per_s = speed_rev_per_s;
    self->drive.torque_limit = current_A * self->options.torque_constant_Nm_per_A;
}

static void set_mode(struct odrive_node *self, uint32_t control, uint32_t input)
{
    if (control < odrive_control_torque || control > odrive_control_position || input != odrive_input_passthrough)
        self->requests_refused++;
    else
        self->control_mode = control;
}

static double thousandth_at(const struct can_frame *frame, uint8_t at)
{
    return (int16_t)(uint16_t)can_get(&frame->data[at], 2) * 1e-3;
}

/// A set-point; one that is no number is passed over, so that the watchdog ends what sends nothing else.
static void take_input(struct odrive_node *self, const struct can_frame *frame, uint64_t now_us)
{
    uint8_t node_id = self->options.node_id;
    double first = odrive_float_at(frame, 0), second = 0.0;
    if (!isfinite(first)) {
        self->requests_refused++;
        return;
    }
    if (odrive_is(frame, node_id, odrive_set_input_torque, 4)) {
        self->input_torque_Nm = first;
    } else if (odrive_is(frame, node_id, odrive_set_input_pos, 8)) {
        self->input_position_rev = first;
        self->input_velocity_rev_per_s = thousandth_at(frame, 4);
        self->input_torque_Nm = thousandth_at(frame, 6);
    } else {
        second = odrive_float_at(frame, 4);
        self->input_velocity_rev_per_s = first;
        self->input_torque_Nm = isfinite(second) ? second : 0.0;
    }
    self->input_us = now_us;
}

static void answer_request(struct odrive_node *self, const struct can_frame *frame)
{
    uint8_t node_id = self->options.node_id;
    if (odrive_is_request(frame, node_id, odrive_get_encoder_estimates))
        send_estimates(self);
    else if (odrive_is_request(frame, node_id, odrive_get_iq))
        send_torques(self, odrive_get_iq);
    else if (odrive_is_request(frame, node_id, odrive_get_torques) && self->options.has_torques)
        send_torques(self, odrive_get_torques);
    else if (odrive_is_request(frame, node_id, odrive_heartbeat))
        send_heartbeat(self);
}

static void receive(void *object, const struct can_frame *frame, uint64_t now_us)
{
    struct odrive_node *self = object;
    uint8_t node_id = self->options.node_id;
    bool input = odrive_is(frame, node_id, odrive_set_input_torque, 4) ||
                 odrive_is(frame, node_id, odrive_set_input_pos, 8) ||
                 odrive_is(frame, node_id, odrive_set_input_vel, 8);
    if (input)
        take_input(self, frame, now_us);
    else if (odrive_is(frame, node_id, odrive_estop, 0))
        disarm(self, odrive_error_estop);
    else if (odrive_is(frame, node_id, odrive_clear_errors, 0))
        self->status.error = 0;
    else if (odrive_is(frame, node_id, odrive_set_axis_state, 4))
        set_state(self, can_get(frame->data, 4), now_us);
    else if (odrive_is(frame, node_id, odrive_set_controller_mode, 8))
        set_mode(self, can_get(frame->data, 4), can_get(&frame->data[4], 4));
    else if (odrive_is(frame, node_id, odrive_set_limits, 8))
        set_limits(self, odrive_float_at(frame, 0), odrive_float_at(frame, 4));
    else
        answer_request(self, frame);
}

static void advance(void *object, uint64_t now_us)
{
    struct odrive_node *self = object;
    if (now_us >= self->heartbeat_us) {
        send_heartbeat(self);
        self->heartbeat_us = now_us + odrive_heartbeat_ms * 1000u;
    }
    if ((double)now_us < self->tick_us)
        return;
    tick(self, now_us);
    self->tick_us += self->period_us;
    if (self->tick_us <= (double)now_us) // was held up for more than a period: the plant does not catch up
        self->tick_us = (double)now_us + self->period_us;
}

static uint64_t deadline_us(const void *object)
{
    const struct odrive_node *self = object;
    uint64_t tick_us = (uint64_t)ceil(self->tick_us);
    return tick_us < self->heartbeat_us ? tick_us : self->heartbeat_us;
}

bool odrive_node_init(struct odrive_node *self, const struct sim_model *model,
                      const struct odrive_node_options *options, const struct can_port *port)
{
    memset(self, 0, sizeof *self);
    if (model->linear || options->node_id > odrive_node_max ||
        !(options->clock_ratio >= 0.9 && options->clock_ratio <= 1.1))
        return false;
    self->options = *options;
    self->port = *port;
    self->model = *model;
    self->status.state = odrive_idle;
    self->control_mode = odrive_control_position;
    self->speed_limit_rev_per_s = INFINITY;
    self->period_us = 1e6 / model->sample_rate_hz * options->clock_ratio;
    self->tick_us = self->period_us;
    sim_belt_drive_init(&self->drive, &self->model, 0.0);
    return true;
}

struct can_participant odrive_node_participant(struct odrive_node *self)
{
    return (struct can_participant){.self = self, .receive = receive, .advance = advance, .deadline_us = deadline_us};
}
