/* SPDX-License-Identifier: MIT */
/// What a master makes of frames from a node: EMCY, heartbeats, process data, SDO answers, and the stateless parsers.
#include "drivers/can/canopen_master.h"
#include "tests/fuzz/fuzz.h"

/// A port whose receive queue is the input.
struct feed {
    const uint8_t *data;
    size_t size;
    uint64_t now_us;
};

static enum can_status port_send(void *self, const struct can_frame *frame)
{
    (void)self;
    FUZZ_CHECK(can_frame_is_valid(frame));
    return can_ok;
}

static bool port_receive(void *self, struct can_frame *out_frame)
{
    static const uint16_t identifiers[] = {0x085, 0x705, 0x185, 0x285, 0x585, 0x585, 0x585, 0x000,
                                           0x080, 0x605, 0x685, 0x77F, 0x585, 0x385, 0x485, 0x586};
    struct feed *feed = self;
    if (feed->size < fuzz_step_bytes)
        return false;
    struct fuzz_step step = fuzz_step(feed->data);
    *out_frame = fuzz_frame(identifiers[step.what & 0x0F], &step);
    out_frame->remote = (feed->data[1] & 0xF0) == 0xF0;
    if (step.what & 0x80) { // names the object that is asked for
        can_put(&out_frame->data[1], 2, 0x2100);
        out_frame->data[3] = 0;
    }
    feed->data += fuzz_step_bytes;
    feed->size -= fuzz_step_bytes;
    return (step.what & 0x40) == 0; // else the queue looks empty for once
}

static enum can_status port_wait(void *self, uint64_t until_us)
{
    struct feed *feed = self;
    feed->now_us = until_us > feed->now_us ? until_us : feed->now_us;
    return can_ok;
}

static uint64_t port_time_us(const void *self)
{
    return ((const struct feed *)self)->now_us;
}

static const struct can_port_operations operations = {port_send, port_receive, port_wait, port_time_us};

static void check_parsers(const struct can_frame *frame)
{
    struct emcy_message message;
    enum nmt_command command = nmt_command_parse(frame, 5);
    FUZZ_CHECK(command == nmt_none || (frame->id == 0 && frame->length == 2));
    FUZZ_CHECK(!emcy_parse(frame, 5, &message) || (frame->id == 0x085 && frame->length == 8));
    FUZZ_CHECK(!emcy_parse(frame, 0, &message));
}

static void on_process_data(void *owner, const struct can_frame *frame)
{
    (void)owner;
    FUZZ_CHECK((frame->id & 0x7F) == 5 && !frame->remote);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static uint8_t room[600];
    struct feed feed = {data, size, 0};
    const struct can_port port = {&operations, &feed};
    struct canopen_master master;
    struct can_frame frame;
    uint32_t got = 0, value = 0;
    canopen_master_init(&master, &port, 5, 127, 1000);
    master.on_process_data = on_process_data;
    heartbeat_consumer_start(&master.consumer, 5, 2000);
    while (feed.size >= fuzz_step_bytes) {
        uint8_t what = feed.data[0];
        while (feed.size >= fuzz_step_bytes && !port_receive(&feed, &frame))
            ;
        check_parsers(&frame);
        uint32_t code = od_abort_none;
        if (what % 3 == 0)
            code = canopen_master_read_data(&master, 0x2100, 0, room, what, &got);
        else if (what % 3 == 1)
            code = canopen_master_write_data(&master, 0x2100, 0, room, what * 2u);
        else
            code = canopen_master_read(&master, 0x2100, 0, what % 5, &value);
        FUZZ_CHECK(code != od_abort_none || what % 3 != 0 || got <= what);
    }
    return 0;
}
