/* SPDX-License-Identifier: MIT */
#include "ports/inproc.h"

#include "unity.h"

#include <stdio.h>
#include <string.h>

static struct inproc_bus bus;
static struct can_port a, b, c;

void setUp(void)
{
    inproc_bus_init(&bus, 1000000, inproc_stuffing_worst);
    inproc_bus_add_port(&bus, &a);
    inproc_bus_add_port(&bus, &b);
    inproc_bus_add_port(&bus, &c);
}

void tearDown(void) {}

static enum can_status send(struct can_port *port, uint16_t id, uint8_t length, uint8_t first)
{
    struct can_frame frame = can_frame_make(id, length);
    frame.data[0] = length > 0 ? first : 0;
    return port->operations->send(port->self, &frame);
}

static bool receive(struct can_port *port, struct can_frame *out_frame)
{
    return port->operations->receive(port->self, out_frame);
}

/// Identifiers that a port has received, in order, as text.
static const char *received(struct can_port *port)
{
    static char text[400];
    struct can_frame frame;
    size_t at = 0;
    text[0] = '\0';
    while (receive(port, &frame))
        at += (size_t)snprintf(text + at, sizeof text - at, "%s%X", at ? " " : "", frame.id);
    return text;
}

static void test_inproc_bus_frame_lengths_follow_the_formula(void)
{
    // 47 + 8 n + floor((34 + 8 n - 1) / 4)
    TEST_ASSERT_EQUAL_UINT(55, can_frame_bits_worst(0));
    TEST_ASSERT_EQUAL_UINT(95, can_frame_bits_worst(4));
    TEST_ASSERT_EQUAL_UINT(115, can_frame_bits_worst(6));
    TEST_ASSERT_EQUAL_UINT(135, can_frame_bits_worst(8));
    TEST_ASSERT_EQUAL_UINT(135, can_frame_bits_worst(200));
}

static void test_inproc_bus_exact_length_lies_within_its_bounds(void)
{
    uint32_t random = 1;
    unsigned longest = 0;
    for (int i = 0; i < 20000; i++) {
        struct can_frame frame = can_frame_make(0, (uint8_t)(i % 9));
        random = random * 1664525u + 1013904223u;
        frame.id = (uint16_t)(random >> 21);
        for (int k = 0; k < frame.length; k++) {
            random = random * 1664525u + 1013904223u;
            frame.data[k] = (random & 0x300) ? (uint8_t)(random >> 24) : 0; // many zeros: many stuff bits
        }
        unsigned bits = can_frame_bits_exact(&frame);
        TEST_ASSERT_TRUE(bits >= 47u + 8u * frame.length && bits <= can_frame_bits_worst(frame.length));
        longest = bits > longest ? bits : longest;
    }
    TEST_ASSERT_TRUE(longest > 120);
    // By hand: identifier 0 without data is 19 zeros, their check 15 more: a stuff bit after every five of the 34.
    struct can_frame zeros = can_frame_make(0, 0);
    TEST_ASSERT_EQUAL_UINT(47 + 6, can_frame_bits_exact(&zeros));
}

static void test_inproc_bus_frame_takes_its_bits(void)
{
    TEST_ASSERT_EQUAL(can_ok, send(&a, 0x123, 8, 1));
    struct can_frame frame;
    TEST_ASSERT_FALSE(receive(&b, &frame));
    b.operations->wait(b.self, 1000);
    // 135 bits, of which the last three are the pause after the end of the frame
    TEST_ASSERT_EQUAL_UINT64(132000, bus.now_ns);
    TEST_ASSERT_TRUE(receive(&b, &frame));
    TEST_ASSERT_TRUE(receive(&c, &frame));
    TEST_ASSERT_FALSE(receive(&a, &frame)); // not to its sender
    b.operations->wait(b.self, 1000);
    TEST_ASSERT_EQUAL_UINT64(1000000, bus.now_ns); // nothing more: waits to the end
    TEST_ASSERT_TRUE(inproc_bus_load(&bus, 0, 0) == 0.135);
}

static void test_inproc_bus_lower_identifier_wins(void)
{
    send(&a, 0x300, 8, 0);
    send(&a, 0x200, 8, 0);
    send(&b, 0x250, 8, 0);
    send(&b, 0x080, 0, 0);
    inproc_bus_run(&bus, 10000);
    TEST_ASSERT_EQUAL_STRING("80 200 250 300", received(&c));
    TEST_ASSERT_EQUAL_UINT32(3, bus.counters.arbitrations); // two wanted the bus before the first three
    TEST_ASSERT_EQUAL_UINT32(0, bus.counters.collisions);
}

static void test_inproc_bus_frame_under_way_is_not_interrupted(void)
{
    send(&a, 0x700, 8, 0);
    inproc_bus_run(&bus, 10);
    send(&b, 0x001, 0, 0);
    inproc_bus_run(&bus, 1000);
    TEST_ASSERT_EQUAL_STRING("700 1", received(&c));
}

static void test_inproc_bus_same_identifier_keeps_order_and_tells_collisions(void)
{
    struct can_frame frame;
    for (uint8_t i = 0; i < 5; i++)
        send(&a, 0x100, 1, i);
    send(&b, 0x100, 1, 99);
    inproc_bus_run(&bus, 10000);
    for (uint8_t i = 0; i < 5; i++) {
        TEST_ASSERT_TRUE(receive(&c, &frame));
        TEST_ASSERT_EQUAL_UINT8(i, frame.data[0]);
    }
    TEST_ASSERT_EQUAL_UINT32(5, bus.counters.collisions);
}

static void test_inproc_bus_queue_is_bounded(void)
{
    for (int i = 0; i < inproc_send_max; i++)
        TEST_ASSERT_EQUAL(can_ok, send(&a, 0x100, 0, 0));
    TEST_ASSERT_EQUAL(can_err_full, send(&a, 0x100, 0, 0));
    struct can_frame wrong = {.id = 0x800};
    TEST_ASSERT_EQUAL(can_err_full, b.operations->send(b.self, &wrong));
    for (int i = 0; i < inproc_receive_max; i++) {
        send(&b, 0x100, 0, 0);
        inproc_bus_run(&bus, (uint64_t)(i + 1) * 1000);
    }
    TEST_ASSERT_EQUAL_UINT32(inproc_send_max, bus.counters.overruns); // c: 32 and 256 frames for 256 places
}

// ---- Faults

static struct inproc_fault plan[2];

static void plan_one(enum inproc_fault_kind kind, uint16_t cob_id, uint32_t nth)
{
    plan[0] =
        (struct inproc_fault){.kind = kind, .cob_id = cob_id, .nth = nth, .delay_us = 500, .byte = 1, .mask = 0x81};
    inproc_bus_set_faults(&bus, plan, 1);
}

/// 101, 102, 103 with two bytes of data, 200 us apart.
static void three_frames(void)
{
    for (uint16_t i = 1; i <= 3; i++) {
        send(&a, (uint16_t)(0x100 + i), 2, (uint8_t)i);
        inproc_bus_run(&bus, 200u * i);
    }
    inproc_bus_run(&bus, 5000);
}

static void test_inproc_bus_fault_hits_nth_frame_of_its_identifier(void)
{
    plan_one(inproc_drop, 0x100, 2);
    for (int i = 0; i < 3; i++) {
        send(&a, 0x100, 1, (uint8_t)i);
        send(&a, 0x200, 1, 0);
        inproc_bus_run(&bus, 1000u * (unsigned)(i + 1));
    }
    TEST_ASSERT_EQUAL_STRING("100 200 200 100 200", received(&b));
    TEST_ASSERT_EQUAL_UINT32(1, bus.counters.injected[inproc_drop]);
    TEST_ASSERT_EQUAL_UINT32(6, bus.counters.frames); // it was on the wire
}

static void test_inproc_bus_fault_kinds_do_what_they_say(void)
{
    static const struct {
        enum inproc_fault_kind kind;
        const char *received;
        uint32_t frames;
    } cases[] = {
        {inproc_drop, "101 103", 3},          {inproc_duplicate, "101 102 102 103", 4},
        {inproc_delay, "101 103 102", 3},     {inproc_swap, "101 103 102", 3},
        {inproc_corrupt, "101 102 103", 3},   {inproc_shorten, "101 102 103", 3},
        {inproc_bus_error, "101 102 103", 4}, {inproc_bus_off, "101 102 103", 3},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        setUp();
        plan_one(cases[i].kind, inproc_any, 2);
        plan[0].endpoint = 2;
        plan[0].delay_us = 300;
        three_frames();
        TEST_ASSERT_EQUAL_STRING(cases[i].received, received(&b));
        TEST_ASSERT_EQUAL_UINT32(cases[i].frames, bus.counters.frames);
        for (int kind = 0; kind < inproc_fault_kinds; kind++)
            TEST_ASSERT_EQUAL_UINT32(kind == (int)cases[i].kind, bus.counters.injected[kind]);
    }
}

static void test_inproc_bus_corrupt_and_shorten_alter_one_frame(void)
{
    struct can_frame frame;
    plan_one(inproc_corrupt, 0x102, 1);
    three_frames();
    receive(&b, &frame);
    receive(&b, &frame);
    TEST_ASSERT_EQUAL_HEX8(2, frame.data[0]);
    TEST_ASSERT_EQUAL_HEX8(0x81, frame.data[1]);
    setUp();
    plan_one(inproc_shorten, 0x102, 1);
    three_frames();
    receive(&b, &frame);
    receive(&b, &frame);
    TEST_ASSERT_EQUAL_UINT8(1, frame.length);
    setUp();
    plan_one(inproc_corrupt, 0x102, 1);
    plan[0].byte = 2; // beyond the frame: hits nothing and is not counted
    three_frames();
    TEST_ASSERT_EQUAL_UINT32(0, bus.counters.injected[inproc_corrupt]);
}

static void test_inproc_bus_off_endpoint_hears_and_says_nothing_until_back(void)
{
    plan_one(inproc_bus_off, 0x101, 1);
    plan[0].endpoint = 1;
    send(&b, 0x400, 0, 0); // still queued when its sender leaves
    send(&b, 0x401, 0, 0);
    send(&a, 0x101, 0, 0);
    inproc_bus_run(&bus, 60);
    TEST_ASSERT_EQUAL(can_err_bus_off, send(&b, 0x402, 0, 0));
    TEST_ASSERT_EQUAL_UINT32(2, bus.counters.discarded);
    send(&a, 0x102, 0, 0);
    TEST_ASSERT_EQUAL(can_err_bus_off, b.operations->wait(b.self, 300));
    TEST_ASSERT_EQUAL_STRING("", received(&b));
    inproc_bus_run(&bus, 600);
    TEST_ASSERT_EQUAL_UINT32(1, bus.counters.recovered);
    TEST_ASSERT_EQUAL(can_ok, send(&b, 0x403, 0, 0));
    inproc_bus_run(&bus, 1000);
    TEST_ASSERT_EQUAL_STRING("101 102 403", received(&c));
}

static void test_inproc_bus_two_faults_on_one_frame_both_act(void)
{
    plan_one(inproc_corrupt, 0x102, 1);
    plan[1] = plan[0];
    plan[1].kind = inproc_duplicate;
    inproc_bus_set_faults(&bus, plan, 2);
    three_frames();
    struct can_frame frame;
    receive(&b, &frame);
    receive(&b, &frame);
    TEST_ASSERT_EQUAL_HEX8(0x81, frame.data[1]);
    receive(&b, &frame);
    TEST_ASSERT_EQUAL_HEX16(0x102, frame.id);
    TEST_ASSERT_EQUAL_HEX8(0, frame.data[1]); // sent again as it was meant
}

// ---- Participants

struct ticker {
    struct can_port port;
    uint64_t next_us;
    unsigned heard;
    uint64_t heard_us;
};

static struct ticker ticker;

static void ticker_receive(void *self, const struct can_frame *frame, uint64_t now_us)
{
    struct ticker *t = self;
    t->heard++;
    t->heard_us = now_us;
    struct can_frame answer = can_frame_make((uint16_t)(frame->id + 1), 0);
    t->port.operations->send(t->port.self, &answer);
}

static void ticker_advance(void *self, uint64_t now_us)
{
    struct ticker *t = self;
    struct can_frame frame = can_frame_make(0x700, 0);
    TEST_ASSERT_EQUAL_UINT64(t->next_us, now_us);
    t->next_us += 1000;
    t->port.operations->send(t->port.self, &frame);
}

static uint64_t ticker_deadline_us(const void *self)
{
    return ((const struct ticker *)self)->next_us;
}

static void test_inproc_bus_calls_participants_at_their_time(void)
{
    int endpoint = inproc_bus_add_participant(&bus, &ticker.port);
    const struct can_participant participant = {&ticker, ticker_receive, ticker_advance, ticker_deadline_us};
    ticker.next_us = 500;
    ticker.heard = 0;
    inproc_bus_bind(&bus, endpoint, &participant);
    inproc_bus_run(&bus, 3000);
    TEST_ASSERT_EQUAL_STRING("700 700 700", received(&a));
    received(&b);
    send(&a, 0x100, 0, 0);
    TEST_ASSERT_EQUAL(can_ok, b.operations->wait(b.self, 4000));
    TEST_ASSERT_EQUAL_UINT(1, ticker.heard);
    TEST_ASSERT_EQUAL_UINT64(3052, ticker.heard_us);
    b.operations->wait(b.self, 3100);
    inproc_bus_run(&bus, 3200);
    TEST_ASSERT_EQUAL_STRING("100 101", received(&b));
}

static void test_inproc_bus_same_calls_give_the_same_run(void)
{
    struct inproc_bus first;
    plan_one(inproc_swap, 0x102, 1);
    three_frames();
    memcpy(&first, &bus, sizeof first);
    setUp();
    plan_one(inproc_swap, 0x102, 1);
    three_frames();
    TEST_ASSERT_EQUAL_UINT64(first.now_ns, bus.now_ns);
    TEST_ASSERT_EQUAL_MEMORY(&first.counters, &bus.counters, sizeof first.counters);
    TEST_ASSERT_EQUAL_MEMORY(first.endpoints[1].receive, bus.endpoints[1].receive, sizeof first.endpoints[1].receive);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_inproc_bus_frame_lengths_follow_the_formula);
    RUN_TEST(test_inproc_bus_exact_length_lies_within_its_bounds);
    RUN_TEST(test_inproc_bus_frame_takes_its_bits);
    RUN_TEST(test_inproc_bus_lower_identifier_wins);
    RUN_TEST(test_inproc_bus_frame_under_way_is_not_interrupted);
    RUN_TEST(test_inproc_bus_same_identifier_keeps_order_and_tells_collisions);
    RUN_TEST(test_inproc_bus_queue_is_bounded);
    RUN_TEST(test_inproc_bus_fault_hits_nth_frame_of_its_identifier);
    RUN_TEST(test_inproc_bus_fault_kinds_do_what_they_say);
    RUN_TEST(test_inproc_bus_corrupt_and_shorten_alter_one_frame);
    RUN_TEST(test_inproc_bus_off_endpoint_hears_and_says_nothing_until_back);
    RUN_TEST(test_inproc_bus_two_faults_on_one_frame_both_act);
    RUN_TEST(test_inproc_bus_calls_participants_at_their_time);
    RUN_TEST(test_inproc_bus_same_calls_give_the_same_run);
    return UNITY_END();
}
