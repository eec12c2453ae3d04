/* SPDX-License-Identifier: MIT */
/// An slcan adapter on TCP, met by a client that is a bare socket: commands and answers, lines in pieces and in heaps,
/// one client at a time, clients that go.
#include "ports/slcan.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>
#include <unity.h>

/// Longest wait for bytes that are on their way through the loopback; reached only when they never come.
static const uint64_t patience_us = 5000000;

static struct slcan adapter;
static struct can_port port;

static int dial(void)
{
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons(adapter.port)};
    int client = socket(AF_INET, SOCK_STREAM, 0);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    TEST_ASSERT_EQUAL_INT(0, connect(client, (struct sockaddr *)&address, sizeof address));
    return client;
}

static uint64_t now_us(void)
{
    return port.operations->time_us(port.self);
}

/// Lets the adapter work until the client has `length` bytes, or for as long as the patience lasts; what it has.
static const char *hear(int client, size_t length)
{
    static char text[256];
    size_t have = 0;
    const uint64_t until_us = now_us() + patience_us;
    memset(text, 0, sizeof text);
    while (have < length && now_us() < until_us) {
        port.operations->wait(port.self, now_us() + 1000);
        ssize_t count = recv(client, text + have, sizeof text - 1 - have, MSG_DONTWAIT);
        have += count > 0 ? (size_t)count : 0;
    }
    return text;
}

static void say(int client, const char *text)
{
    TEST_ASSERT_EQUAL_INT((int)strlen(text), (int)send(client, text, strlen(text), 0));
}

/// Waits for a frame as a driver does.
static bool take(struct can_frame *out_frame)
{
    const uint64_t until_us = now_us() + patience_us;
    while (now_us() < until_us) {
        port.operations->wait(port.self, until_us);
        if (port.operations->receive(port.self, out_frame)) {
            return true;
        }
    }
    return false;
}

/// Until the adapter has noticed something.
static void wait_for(const bool *flag, bool value)
{
    const uint64_t until_us = now_us() + patience_us;
    while (*flag != value && now_us() < until_us) {
        port.operations->wait(port.self, now_us() + 1000);
    }
    TEST_ASSERT_EQUAL(value, *flag);
}

void setUp(void)
{
    char reason[200] = "";
    TEST_ASSERT_TRUE_MESSAGE(slcan_listen_tcp(&adapter, "127.0.0.1", "0", reason, sizeof reason), reason);
    TEST_ASSERT_NOT_EQUAL(0, adapter.port);
    port = slcan_port(&adapter);
}

void tearDown(void)
{
    slcan_close(&adapter);
    slcan_close(&adapter); // harmless twice
}

static void test_slcan_port_answers_commands_as_an_adapter(void)
{
    int client = dial();
    say(client, "\r\rC\rV\rS8\rO\rS8\rZ1\rk\rF\rC\r");
    const char expected[] = "\rV1013\r\r\r\a\a\aF00\r\r"; // a rate only while closed; no time stamps; no command k
    TEST_ASSERT_EQUAL_STRING(expected, hear(client, sizeof expected - 1));
    TEST_ASSERT_FALSE(adapter.channel_open);
    close(client);
}

static void test_slcan_port_takes_lines_in_pieces_and_in_heaps(void)
{
    const char lines[] = "O\rt60524ABC\rt0801AA\rT000006050\r";
    int client = dial();
    struct can_frame frame;
    for (size_t i = 0; i + 1 < sizeof lines; i++) { // byte by byte, each in a packet of its own
        char byte[2] = {lines[i], '\0'};
        say(client, byte);
        port.operations->wait(port.self, now_us() + 200);
    }
    TEST_ASSERT_TRUE(take(&frame));
    TEST_ASSERT_EQUAL_HEX16(0x605, frame.id);
    TEST_ASSERT_TRUE(take(&frame));
    TEST_ASSERT_EQUAL_HEX16(0x080, frame.id);
    TEST_ASSERT_EQUAL_STRING("\rz\rz\rZ\r", hear(client, 7));
    TEST_ASSERT_EQUAL_UINT32(1, adapter.counters.extended);
    char heap[200 * 8 + 1] = "";
    for (int i = 0; i < 200; i++) {
        strcat(heap, "t12310A\r");
    }
    say(client, heap);
    for (int i = 0; i < 200; i++) {
        TEST_ASSERT_TRUE(take(&frame));
        TEST_ASSERT_EQUAL_HEX8(0x0A, frame.data[0]);
    }
    TEST_ASSERT_EQUAL_UINT32(202, adapter.counters.received);
    close(client);
}

static void test_slcan_port_sends_frames_only_into_an_open_channel(void)
{
    int client = dial();
    struct can_frame frame = can_frame_make(0x705, 1);
    TEST_ASSERT_EQUAL(can_ok, port.operations->send(port.self, &frame)); // as on a bus without anybody
    say(client, "O\r");
    TEST_ASSERT_EQUAL_STRING("\r", hear(client, 1));
    TEST_ASSERT_EQUAL(can_ok, port.operations->send(port.self, &frame));
    TEST_ASSERT_EQUAL_STRING("t705100\r", hear(client, 8));
    TEST_ASSERT_EQUAL_UINT32(1, adapter.counters.sent);
    close(client);
}

static void test_slcan_port_refuses_frames_while_closed_and_lines_that_are_none(void)
{
    int client = dial();
    struct can_frame frame;
    say(client, "t60524ABC\rO\rt60524AB\rt6Q524ABC\rt60524ABC\r");
    TEST_ASSERT_EQUAL_STRING("\a\r\a\az\r", hear(client, 6));
    TEST_ASSERT_TRUE(take(&frame));
    TEST_ASSERT_EQUAL_UINT32(1, adapter.counters.received);
    TEST_ASSERT_EQUAL_UINT32(2, adapter.counters.malformed);
    close(client);
}

static void test_slcan_port_serves_one_client_and_then_the_next(void)
{
    char byte;
    int first = dial();
    say(first, "O\r");
    TEST_ASSERT_EQUAL_STRING("\r", hear(first, 1));
    int second = dial();
    const uint64_t until_us = now_us() + patience_us;
    while (adapter.counters.turned_away == 0 && now_us() < until_us) {
        port.operations->wait(port.self, now_us() + 1000);
    }
    TEST_ASSERT_EQUAL_INT(0, (int)recv(second, &byte, 1, 0)); // closed
    TEST_ASSERT_TRUE(adapter.channel_open);
    close(second);
    close(first);
    wait_for(&adapter.channel_open, false);
    TEST_ASSERT_EQUAL(can_ok, adapter.status);
    int third = dial();
    say(third, "O\r");
    TEST_ASSERT_EQUAL_STRING("\r", hear(third, 1));
    TEST_ASSERT_EQUAL_UINT32(2, adapter.counters.clients);
    close(third);
}

/// A client that reads nothing: frames are refused and counted once the line is full, and none goes missing silently.
static void test_slcan_port_counts_what_a_full_line_does_not_take(void)
{
    int client = dial();
    struct can_frame frame = can_frame_make(0x285, 8);
    say(client, "O\r");
    TEST_ASSERT_EQUAL_STRING("\r", hear(client, 1));
    uint32_t sent = 0;
    const uint32_t most = 10000000; // no socket buffer holds so many
    while (port.operations->send(port.self, &frame) == can_ok && sent < most) {
        sent++;
    }
    TEST_ASSERT_TRUE(sent < most);
    TEST_ASSERT_EQUAL(can_err_full, port.operations->send(port.self, &frame));
    TEST_ASSERT_EQUAL_UINT32(sent, adapter.counters.sent);
    TEST_ASSERT_EQUAL_UINT32(2, adapter.counters.unsent);
    close(client);
}

static void test_slcan_port_client_says_why_nobody_is_there(void)
{
    struct slcan other;
    char reason[200] = "";
    TEST_ASSERT_FALSE(slcan_connect_tcp(&other, "127.0.0.1", "1", 1000000, reason, sizeof reason));
    TEST_ASSERT_NOT_NULL(strstr(reason, "127.0.0.1:1: "));
    TEST_ASSERT_FALSE(slcan_connect_serial(&other, "/dev/null", 1000000, reason, sizeof reason));
    TEST_ASSERT_NOT_NULL(strstr(reason, "is no serial device"));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_slcan_port_answers_commands_as_an_adapter);
    RUN_TEST(test_slcan_port_takes_lines_in_pieces_and_in_heaps);
    RUN_TEST(test_slcan_port_sends_frames_only_into_an_open_channel);
    RUN_TEST(test_slcan_port_refuses_frames_while_closed_and_lines_that_are_none);
    RUN_TEST(test_slcan_port_serves_one_client_and_then_the_next);
    RUN_TEST(test_slcan_port_counts_what_a_full_line_does_not_take);
    RUN_TEST(test_slcan_port_client_says_why_nobody_is_there);
    return UNITY_END();
}
