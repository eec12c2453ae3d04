/* SPDX-License-Identifier: MIT */
/// The port that does harm: each fault hits the frame it names, both ways, and nothing else.
#include "ports/fault_port.h"

#include <string.h>
#include <unity.h>

enum { id_out = 0x285, id_in = 0x205, queue_max = 64 };

/// A bus without anybody: keeps what is sent, hands out what the test puts there, has the time that the test says.
struct quiet_bus {
    uint64_t now_us;
    size_t sent_count, put_count, taken_count;
    struct can_frame sent[queue_max], put[queue_max];
};

static enum can_status quiet_send(void *object, const struct can_frame *frame)
{
    struct quiet_bus *self = object;
    self->sent[self->sent_count++] = *frame;
    return can_ok;
}

static bool quiet_receive(void *object, struct can_frame *out_frame)
{
    struct quiet_bus *self = object;
    if (self->taken_count == self->put_count) {
        return false;
    }
    *out_frame = self->put[self->taken_count++];
    return true;
}

static enum can_status quiet_wait(void *object, uint64_t until_us)
{
    struct quiet_bus *self = object;
    self->now_us = until_us;
    return can_ok;
}

static uint64_t quiet_time_us(const void *object)
{
    const struct quiet_bus *self = object;
    return self->now_us;
}

static const struct can_port_operations quiet_operations = {quiet_send, quiet_receive, quiet_wait, quiet_time_us};

static struct quiet_bus bus;
static struct fault_port harm;
static struct can_port port;

static void begin(const struct inproc_fault *faults, size_t count)
{
    memset(&bus, 0, sizeof bus);
    const struct can_port base = {&quiet_operations, &bus};
    TEST_ASSERT_TRUE(fault_port_init(&harm, &base, faults, count));
    port = fault_port_port(&harm);
}

void setUp(void) {}

void tearDown(void) {}

static struct can_frame numbered(uint16_t id, unsigned number)
{
    struct can_frame frame = can_frame_make(id, 2);
    frame.data[0] = (uint8_t)number;
    return frame;
}

static enum can_status send_numbered(unsigned number)
{
    const struct can_frame frame = numbered(id_out, number);
    return port.operations->send(port.self, &frame);
}

static void put_numbered(unsigned count)
{
    for (unsigned i = 1; i <= count; i++) {
        bus.put[bus.put_count++] = numbered(id_in, i);
    }
}

/// The numbers of all frames that come through now, one digit each.
static const char *take_numbers(void)
{
    static char text[queue_max + 1];
    struct can_frame frame;
    size_t count = 0;
    while (port.operations->receive(port.self, &frame)) {
        text[count++] = (char)('0' + frame.data[0]);
    }
    text[count] = '\0';
    return text;
}

static const char *sent_numbers(void)
{
    static char text[queue_max + 1];
    for (size_t i = 0; i < bus.sent_count; i++) {
        text[i] = (char)('0' + bus.sent[i].data[0]);
    }
    text[bus.sent_count] = '\0';
    return text;
}

static void test_fault_port_without_faults_changes_nothing(void)
{
    begin(NULL, 0);
    put_numbered(9);
    TEST_ASSERT_EQUAL_STRING("123456789", take_numbers());
    for (unsigned i = 1; i <= 9; i++) {
        TEST_ASSERT_EQUAL(can_ok, send_numbered(i));
    }
    TEST_ASSERT_EQUAL_STRING("123456789", sent_numbers());
}

/// Every order fault at every place of nine frames, in both directions.
static void test_fault_port_hits_the_frame_it_names(void)
{
    const enum inproc_fault_kind kinds[] = {inproc_drop, inproc_duplicate, inproc_swap};
    for (size_t k = 0; k < 3; k++) {
        for (unsigned nth = 1; nth <= 9; nth++) {
            char expected[16] = "";
            for (unsigned i = 1; i <= 9; i++) {
                char pair[3] = {(char)('0' + i), (char)('0' + i), '\0'};
                bool hit = i == nth;
                if (kinds[k] == inproc_swap && (hit || i == nth + 1)) {
                    pair[0] = (char)('0' + nth + 1);
                    pair[1] = (char)('0' + nth);
                    strcat(expected, hit && nth < 9 ? pair : ""); // the last one waits for a frame that never comes
                } else if (!(kinds[k] == inproc_drop && hit)) {
                    strcat(expected, kinds[k] == inproc_duplicate && hit ? pair : pair + 1);
                }
            }
            const struct inproc_fault faults[] = {{.kind = kinds[k], .cob_id = id_in, .nth = nth},
                                                  {.kind = kinds[k], .cob_id = id_out, .nth = nth}};
            begin(faults, 2);
            put_numbered(9);
            TEST_ASSERT_EQUAL_STRING(expected, take_numbers());
            for (unsigned i = 1; i <= 9; i++) {
                send_numbered(i);
            }
            TEST_ASSERT_EQUAL_STRING(expected, sent_numbers());
            TEST_ASSERT_EQUAL_UINT32(2, harm.injected[kinds[k]]);
        }
    }
}

static void test_fault_port_counts_each_identifier_for_itself(void)
{
    const struct inproc_fault fault = {.kind = inproc_drop, .cob_id = id_in, .nth = 2};
    const struct can_frame foreign = numbered(0x080, 7);
    begin(&fault, 1);
    bus.put[bus.put_count++] = foreign;
    put_numbered(1);
    bus.put[bus.put_count++] = foreign;
    put_numbered(3);
    TEST_ASSERT_EQUAL_STRING("71723", take_numbers());
}

static void test_fault_port_delays_until_the_time(void)
{
    const struct inproc_fault fault = {.kind = inproc_delay, .cob_id = id_in, .nth = 1, .delay_us = 500};
    begin(&fault, 1);
    put_numbered(2);
    TEST_ASSERT_EQUAL_STRING("2", take_numbers());
    port.operations->wait(port.self, 10000); // ends when the frame is due
    TEST_ASSERT_EQUAL_UINT64(500, bus.now_us);
    TEST_ASSERT_EQUAL_STRING("1", take_numbers());
}

static void test_fault_port_alters_frames(void)
{
    const struct inproc_fault faults[] = {
        {.kind = inproc_corrupt, .cob_id = id_out, .nth = 1, .byte = 0, .mask = 0x05},
        {.kind = inproc_corrupt, .cob_id = id_out, .nth = 2, .byte = 2, .mask = 0x05}, // beyond its end
        {.kind = inproc_shorten, .cob_id = id_out, .nth = 3},
    };
    begin(faults, 3);
    for (unsigned i = 1; i <= 3; i++) {
        send_numbered(i);
    }
    TEST_ASSERT_EQUAL_STRING("423", sent_numbers());
    TEST_ASSERT_EQUAL_UINT8(2, bus.sent[1].length);
    TEST_ASSERT_EQUAL_UINT8(1, bus.sent[2].length);
    TEST_ASSERT_EQUAL_UINT32(1, harm.injected[inproc_corrupt]);
    TEST_ASSERT_EQUAL_UINT32(1, harm.injected[inproc_shorten]);
}

static void test_fault_port_leaves_the_bus_and_comes_back(void)
{
    const struct inproc_fault fault = {.kind = inproc_bus_off, .cob_id = id_out, .nth = 2, .delay_us = 1000};
    begin(&fault, 1);
    TEST_ASSERT_EQUAL(can_ok, send_numbered(1));
    TEST_ASSERT_EQUAL(can_ok, send_numbered(2));
    TEST_ASSERT_EQUAL(can_err_bus_off, send_numbered(3));
    put_numbered(3);
    TEST_ASSERT_EQUAL_STRING("", take_numbers());
    TEST_ASSERT_EQUAL(can_err_bus_off, port.operations->wait(port.self, 999));
    TEST_ASSERT_EQUAL(can_ok, port.operations->wait(port.self, 5000));
    TEST_ASSERT_EQUAL_UINT64(1000, bus.now_us);
    TEST_ASSERT_EQUAL(can_ok, send_numbered(4));
    TEST_ASSERT_EQUAL_STRING("124", sent_numbers());
}

static void test_fault_port_refuses_what_a_real_bus_does_itself(void)
{
    const struct inproc_fault fault = {.kind = inproc_bus_error, .cob_id = id_out, .nth = 1};
    const struct can_port base = {&quiet_operations, &bus};
    TEST_ASSERT_FALSE(fault_port_init(&harm, &base, &fault, 1));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_fault_port_without_faults_changes_nothing);
    RUN_TEST(test_fault_port_hits_the_frame_it_names);
    RUN_TEST(test_fault_port_counts_each_identifier_for_itself);
    RUN_TEST(test_fault_port_delays_until_the_time);
    RUN_TEST(test_fault_port_alters_frames);
    RUN_TEST(test_fault_port_leaves_the_bus_and_comes_back);
    RUN_TEST(test_fault_port_refuses_what_a_real_bus_does_itself);
    return UNITY_END();
}
