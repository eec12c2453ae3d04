/* SPDX-License-Identifier: MIT */
/// The host's side against a slave whose replies are spoilt in every way there is: what comes back is the value of this
/// request or an error, within the stated time. RTU runs over a pty, TCP over the loopback.
#define _XOPEN_SOURCE 700 // ptys
#include "drivers/modbus/host.h"
#include "ports/modbus_host.h"
#include "tests/support/scripted_slave.h"

#include <modbus.h>

/// Short, so that hundreds of time-outs pass in seconds; long against what a busy machine needs for an answer.
static const struct modbus_port_options quick = {.response_ms = 100, .gap_ms = 20, .silence_ms = 15};

static struct scripted_slave slave;
static struct modbus_port *port;
static struct modbus_link link_to;
static struct modbus_host host;
static struct modbus_host_state state;

void setUp(void)
{
    port = NULL;
}

void tearDown(void)
{
    modbus_port_close(port);
    slave_end(&slave);
}

static void begin(bool is_tcp)
{
    char text[200] = "";
    slave_start(&slave, is_tcp);
    port = is_tcp ? modbus_port_open_tcp(slave.place, &quick, text, sizeof text)
                  : modbus_port_open_rtu(slave.place, &quick, text, sizeof text);
    TEST_ASSERT_NOT_NULL_MESSAGE(port, text);
    link_to = modbus_port_link(port);
    TEST_ASSERT_EQUAL_INT_MESSAGE(modbus_host_ok, modbus_host_open(&host, &link_to, 0x1234), host.detail);
}

static double seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/// Reads the state: its POSITION says which of the slave's replies it is.
static bool value_or_error(const char *what)
{
    int before = slave.answered;
    enum modbus_host_status status = modbus_host_read_state(&host, &state);
    if (status != modbus_host_ok) {
        TEST_ASSERT_TRUE_MESSAGE(strlen(host.detail) > 0, what);
        return false;
    }
    // It answers a request of this very call, whichever attempt.
    TEST_ASSERT_TRUE_MESSAGE(state.position > (float)before && state.position <= (float)(int)slave.answered, what);
    return true;
}

static void expect_recovery(enum slave_fault fault, int number)
{
    char what[64];
    snprintf(what, sizeof what, "fault %d number %d", (int)fault, number);
    slave_script(&slave, fault, number, 0);
    // One bad reply: the second attempt brings the value, unless the slave said no.
    bool refused = fault == slave_exception;
    TEST_ASSERT_EQUAL_INT_MESSAGE(!refused, value_or_error(what), what);
    TEST_ASSERT_TRUE_MESSAGE(value_or_error(what), what);
}

/// The fault of the library itself: after one late reply every value is the one before, and it says that all is well.
static void test_modbus_library_takes_a_late_reply_for_the_next(void)
{
    char device[128];
    uint16_t words[2];
    slave_start(&slave, false);
    snprintf(device, sizeof device, "%.*s", (int)strcspn(slave.place, ":"), slave.place);
    modbus_t *plain = modbus_new_rtu(device, 115200, 'E', 8, 1);
    TEST_ASSERT_NOT_NULL(plain);
    modbus_set_slave(plain, 1);
    modbus_set_response_timeout(plain, 0, 60000);
    TEST_ASSERT_EQUAL_INT(0, modbus_connect(plain));
    slave_script(&slave, slave_late, 90, 0);
    TEST_ASSERT_EQUAL_INT(-1, modbus_read_registers(plain, 0x32, 2, words));
    unsigned wrong = 0;
    for (int i = 0; i < 5; i++) {
        // ID is 4D53 for ever; the library gives POSITION's words for it, or the other way round.
        uint16_t id[2] = {0, 0};
        slave_sleep_ms(10);
        int got = modbus_read_registers(plain, i % 2 ? 0x32 : 0, 2, id);
        wrong += got == 2 && (i % 2 ? id[0] == modbus_identity : id[0] != modbus_identity);
    }
    modbus_close(plain);
    modbus_free(plain);
    printf("the library alone: %u of 5 values wrong and called right\n", wrong);
    TEST_ASSERT_EQUAL_UINT(5, wrong);
}

static void test_modbus_host_finds_a_late_reply(void)
{
    begin(false);
    for (int late_ms = 60; late_ms <= 220; late_ms += 40) {
        slave_script(&slave, slave_late, late_ms, 0);
        for (int i = 0; i < 4; i++)
            value_or_error("late reply");
        slave_sleep_ms(late_ms);
        TEST_ASSERT_TRUE(value_or_error("after a late reply"));
    }
    // Always late, so late that each reply falls into the next attempt: never believed.
    for (int late_ms = 105; late_ms <= 115; late_ms += 10) {
        slave_script(&slave, slave_late, late_ms, -1);
        for (int i = 0; i < 3; i++)
            value_or_error("late replies without end");
        slave_script(&slave, slave_good, 0, -2);
        slave_sleep_ms(600);
        TEST_ASSERT_TRUE(value_or_error("after late replies"));
    }
    printf("late replies: %u were there in place of an answer and not believed\n", (unsigned)host.count.stale);
}

static void every_fault(bool is_tcp)
{
    static const int codes[] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0, 127, 255};
    begin(is_tcp);
    for (unsigned i = 0; i < sizeof codes / sizeof codes[0]; i++) {
        slave_script(&slave, slave_exception, codes[i], 0);
        bool believed = value_or_error("exception");
        // Codes that do not exist are a damaged reply; the second attempt is answered.
        bool exists = codes[i] >= 1 && codes[i] <= 11;
        TEST_ASSERT_EQUAL_INT_MESSAGE(!exists, believed, host.detail);
        TEST_ASSERT_TRUE(value_or_error("after an exception"));
    }
    expect_recovery(slave_wrong_id, 0);
    expect_recovery(slave_wrong_function, 0);
    for (int more = -3; more <= 3; more++)
        expect_recovery(slave_wrong_count, more);
    if (is_tcp)
        expect_recovery(slave_wrong_transaction, 0);
    for (int i = 0; i < 2; i++) {
        expect_recovery(slave_doubled, 0);
        expect_recovery(slave_merged, 0);
        expect_recovery(slave_echo, 0);
        expect_recovery(slave_silent, 0);
    }
}

static void test_modbus_host_survives_every_fault_on_rtu(void)
{
    every_fault(false);
}

static void test_modbus_host_survives_every_fault_on_tcp(void)
{
    every_fault(true);
}

/// NONCE up to the end of the setup.
enum { state_registers = 63, head_bytes = 9 };

/// Every place of the head and of the tail, every few of the registers between.
static int next_place(int place, int size, int step)
{
    return place < head_bytes || place >= size - 4 ? place + 1 : place + step < size - 4 ? place + step : size - 4;
}

static void every_place(bool is_tcp)
{
    const int size = (is_tcp ? 9 : 5) + 2 * state_registers;
    begin(is_tcp);
    for (int length = 0; length < size; length = next_place(length, size, 23))
        expect_recovery(slave_cut, length);
    for (int at = 0; at <= size; at = next_place(at, size, 23))
        expect_recovery(slave_split, at);
}

/// A short reply, every length and every bit of it: an error, or for the whole reply its value.
static void test_modbus_link_believes_no_damaged_reply(void)
{
    const int size = 9; // two registers
    uint16_t words[2];
    begin(false);
    for (int length = 0; length <= size; length++) {
        slave_script(&slave, slave_cut, length, 0);
        int got = link_to.read(link_to.self, 0, 2, words);
        TEST_ASSERT_EQUAL_INT(length == size, got == modbus_link_ok);
        TEST_ASSERT_EQUAL_INT(modbus_link_ok, link_to.settle(link_to.self));
    }
    for (int bit = 0; bit < 8 * size; bit++) {
        slave_script(&slave, slave_flip, bit, 0);
        TEST_ASSERT_TRUE(link_to.read(link_to.self, 0, 2, words) < 0);
        TEST_ASSERT_EQUAL_INT(modbus_link_ok, link_to.settle(link_to.self));
    }
    TEST_ASSERT_EQUAL_INT(modbus_link_ok, link_to.read(link_to.self, 0, 2, words));
    TEST_ASSERT_EQUAL_HEX16(modbus_identity, words[0]);
}

static void test_modbus_host_takes_replies_cut_and_split_anywhere_on_rtu(void)
{
    every_place(false);
}

static void test_modbus_host_takes_replies_cut_and_split_anywhere_on_tcp(void)
{
    every_place(true);
}

/// On RTU the check sum finds each of them; what it was before is never believed.
static void test_modbus_host_repeats_after_a_bit_error(void)
{
    begin(false);
    for (int bit = 0; bit < 8 * (5 + 2 * state_registers); bit += 31) {
        slave_script(&slave, slave_flip, bit, 0);
        uint32_t repeated = host.count.repeated;
        TEST_ASSERT_TRUE(value_or_error("bit error"));
        TEST_ASSERT_TRUE(host.count.repeated > repeated);
    }
}

static void expect_bounded(bool is_tcp, enum slave_fault fault)
{
    begin(is_tcp);
    // Each attempt at most its bound, here of a line on which nothing at all comes: response and settling.
    double bound_s = modbus_host_attempts * 1e-3 * modbus_port_bound_ms(port);
    slave_script(&slave, fault, 0, -1);
    double started_s = seconds();
    for (int i = 0; i < 3; i++)
        TEST_ASSERT_FALSE(value_or_error("nobody answers"));
    double took_s = seconds() - started_s;
    printf("three calls without any answer: %.2f s, stated %.2f s\n", took_s, 3.0 * bound_s);
    TEST_ASSERT_TRUE(host.count.requests <= 100);
    slave_script(&slave, slave_good, 0, -2);
    if (fault == slave_silent)
        TEST_ASSERT_TRUE(value_or_error("the slave is back"));
}

static void test_modbus_host_gives_up_on_a_silent_slave(void)
{
    expect_bounded(false, slave_silent);
    tearDown();
    expect_bounded(true, slave_silent);
}

static void test_modbus_host_gives_up_on_a_lost_port(void)
{
    expect_bounded(false, slave_gone);
    tearDown();
    expect_bounded(true, slave_gone);
}

/// What is written is there, whatever the acknowledgement says or does not say.
static void test_modbus_host_reads_back_what_it_writes(void)
{
    static const struct {
        enum slave_fault fault;
        int number;
    } faults[] = {{slave_silent, 0}, {slave_flip, 12}, {slave_cut, 3}, {slave_late, 120}, {slave_doubled, 0}};
    begin(false);
    struct modbus_host_setup setup = {.run = {.output = 3, .measure_periods = 1, .abort_samples = 1}};
    for (unsigned i = 0; i < 5 * 4; i++) {
        setup.run.measure_periods = 100 + i;
        slave_script(&slave, faults[i % 5].fault, faults[i % 5].number, (int)(i / 5) % 2);
        TEST_ASSERT_EQUAL_INT_MESSAGE(modbus_host_ok, modbus_host_write_setup(&host, &setup), host.detail);
        TEST_ASSERT_EQUAL_UINT32(100 + i, slave.map.values[modbus_field_measure_periods]);
        slave_sleep_ms(80);
    }
}

static void test_modbus_host_gives_each_command_once(void)
{
    static const enum slave_fault faults[] = {slave_good, slave_silent, slave_doubled, slave_echo};
    begin(false);
    for (unsigned i = 0; i < 4 * 3; i++) {
        uint32_t before = slave.map.values[modbus_field_acknowledged];
        slave_script(&slave, faults[i % 4], 0, (int)(i / 4));
        TEST_ASSERT_EQUAL_INT_MESSAGE(modbus_host_ok, modbus_host_command(&host, modbus_command_open_upload),
                                      host.detail);
        TEST_ASSERT_EQUAL_UINT32(before + 1, slave.map.values[modbus_field_acknowledged]);
    }
}

static void test_modbus_host_says_what_it_does_not_know(void)
{
    begin(true);
    slave.map.values[modbus_field_order_probe] = 0x03040102;
    TEST_ASSERT_EQUAL_INT(modbus_host_identity, modbus_host_open(&host, &link_to, 1));
    TEST_ASSERT_NOT_NULL(strstr(host.detail, "expected 4D53"));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_modbus_library_takes_a_late_reply_for_the_next);
    RUN_TEST(test_modbus_host_finds_a_late_reply);
    RUN_TEST(test_modbus_host_survives_every_fault_on_rtu);
    RUN_TEST(test_modbus_host_survives_every_fault_on_tcp);
    RUN_TEST(test_modbus_host_takes_replies_cut_and_split_anywhere_on_rtu);
    RUN_TEST(test_modbus_host_takes_replies_cut_and_split_anywhere_on_tcp);
    RUN_TEST(test_modbus_link_believes_no_damaged_reply);
    RUN_TEST(test_modbus_host_repeats_after_a_bit_error);
    RUN_TEST(test_modbus_host_gives_up_on_a_silent_slave);
    RUN_TEST(test_modbus_host_gives_up_on_a_lost_port);
    RUN_TEST(test_modbus_host_reads_back_what_it_writes);
    RUN_TEST(test_modbus_host_gives_each_command_once);
    RUN_TEST(test_modbus_host_says_what_it_does_not_know);
    return UNITY_END();
}
