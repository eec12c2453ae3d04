/* SPDX-License-Identifier: MIT */
/// ODrive's CAN Simple, both halves: the simulated node against any frame, the master's door against any node.
#include "drivers/can/odrive_master.h"
#include "sim/node/odrive_node.h"
#include "tests/fuzz/fuzz.h"

#include <math.h>

/// The master's port: its receive queue is the input; every wait takes the time it asks for.
struct feed {
    const uint8_t *data;
    size_t size;
    uint64_t now_us;
};

static enum can_status feed_send(void *self, const struct can_frame *frame)
{
    (void)self;
    FUZZ_CHECK(can_frame_is_valid(frame));
    return can_ok;
}

static bool feed_receive(void *self, struct can_frame *out_frame)
{
    static const uint8_t commands[] = {
        odrive_heartbeat,     odrive_get_encoder_estimates, odrive_get_torques, odrive_get_iq,
        odrive_set_input_pos, odrive_get_encoder_estimates, odrive_get_torques, 0x1F};
    struct feed *feed = self;
    if (feed->size < fuzz_step_bytes)
        return false;
    struct fuzz_step step = fuzz_step(feed->data);
    *out_frame = fuzz_frame((uint16_t)(3u << 5 | commands[step.what & 7]), &step);
    out_frame->remote = (feed->data[1] & 0xF0) == 0x70;
    if ((step.what & 7) == 0 && (step.what & 0x30) != 0) // mostly a sane heartbeat, or nothing gets beyond it
        *out_frame = odrive_heartbeat_frame(3, &(struct odrive_status){0, odrive_closed_loop});
    feed->data += fuzz_step_bytes;
    feed->size -= fuzz_step_bytes;
    return (step.what & 0x40) == 0; // else the queue looks empty for once
}

static enum can_status feed_wait(void *self, uint64_t until_us)
{
    struct feed *feed = self;
    uint64_t soon_us = feed->now_us + 500;
    feed->now_us = until_us > soon_us && feed->size >= fuzz_step_bytes ? soon_us
                   : until_us > feed->now_us                           ? until_us
                                                                       : feed->now_us;
    return can_ok;
}

static uint64_t feed_time_us(const void *self)
{
    return ((const struct feed *)self)->now_us;
}

static void fuzz_door(const uint8_t *data, size_t size)
{
    static const struct can_port_operations operations = {feed_send, feed_receive, feed_wait, feed_time_us};
    struct feed feed = {data, size, 0};
    const struct can_port port = {&operations, &feed};
    struct odrive_master master;
    struct odrive_master_options options = odrive_master_defaults();
    options.node_id = 3;
    options.torque_constant_Nm_per_A = 0.05;
    options.stop_time_s = 0.01; // the waits are the parser's idle time
    options.arm_timeout_us = 20000;
    odrive_master_init(&master, &port, &options);
    struct drive drive = odrive_master_drive(&master);
    const struct drive_configuration configuration = {
        .mode = size & 1 ? drive_mode_torque : drive_mode_cascade, .sample_rate_hz = 1000.0, .torque_limit_Nm = 1.0};
    enum drive_status status = drive.operations->open(drive.self, &configuration);
    // What a hostile node can only now and then bring about: being open.
    master.opened = true;
    if (status == drive_ok || size % 3 != 0)
        status = drive.operations->arm(drive.self);
    master.armed = master.armed || size % 5 == 0;
    for (int n = 0; n < 20; n++) {
        struct drive_setpoint setpoint = {.torque_Nm = 0.1 * n};
        struct drive_sample sample;
        drive.operations->exchange(drive.self, &setpoint, &sample);
        FUZZ_CHECK(isfinite(sample.position_rad) && isfinite(sample.velocity_rad_per_s));
        FUZZ_CHECK(isfinite(sample.torque_Nm) && isfinite(sample.torque_ref_Nm));
    }
    drive.operations->stop(drive.self);
    drive.operations->close(drive.self);
}

static enum can_status node_send(void *self, const struct can_frame *frame)
{
    (void)self;
    FUZZ_CHECK(can_frame_is_valid(frame) && frame->id >> 5 == 3 && !frame->remote);
    return can_ok;
}

static void fuzz_node(const uint8_t *data, size_t size)
{
    static const struct can_port_operations operations = {node_send, NULL, NULL, NULL};
    static const struct can_port port = {&operations, NULL};
    static struct odrive_node node;
    struct sim_model model;
    struct odrive_node_options options = odrive_node_defaults();
    uint64_t now_us = 0;
    sim_model_default(&model);
    options.node_id = 3;
    FUZZ_CHECK(odrive_node_init(&node, &model, &options, &port));
    const struct can_participant participant = odrive_node_participant(&node);
    for (; size >= fuzz_step_bytes; data += fuzz_step_bytes, size -= fuzz_step_bytes) {
        struct fuzz_step step = fuzz_step(data);
        struct can_frame frame = fuzz_frame((uint16_t)(3u << 5 | (step.what & 0x1F)), &step);
        frame.remote = (data[1] & 0xF0) == 0x70;
        if ((step.what & 0x1F) == odrive_set_axis_state && (step.what & 0x80))
            frame = odrive_words_frame(3, odrive_set_axis_state, 4, odrive_closed_loop, 0);
        participant.receive(participant.self, &frame, now_us);
        now_us += step.what & 0x40 ? 1000u : 50u;
        for (int n = 0; n < 4 && participant.deadline_us(participant.self) <= now_us; n++)
            participant.advance(participant.self, now_us);
        FUZZ_CHECK(isfinite(node.input_torque_Nm) && isfinite(node.input_position_rev));
        FUZZ_CHECK(node.status.error == 0 || node.status.state == odrive_idle);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_node(data, size);
    fuzz_door(data, size);
    return 0;
}
