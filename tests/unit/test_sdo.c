/* SPDX-License-Identifier: MIT */
/// SDO server and client: every command byte, every length, every pair of requested and answered size.
#include "drivers/can/sdo_client.h"
#include "drivers/can/sdo_server.h"

#include "unity.h"

#include <stdio.h>
#include <string.h>

struct values {
    uint8_t u8;
    int8_t i8;
    uint16_t u16;
    int16_t i16;
    uint32_t u32, read_only, write_only;
};

static struct values values;

static uint32_t write_even(void *owner, const struct od_entry *entry, int64_t value)
{
    if (value % 2 != 0)
        return od_abort_value;
    od_store(owner, entry, value);
    return od_abort_none;
}

#define AT(member) offsetof(struct values, member)

static const struct od_entry entries[] = {
    {0x2000, 0, od_u8, od_readable | od_constant, 0, 7, NULL},
    {0x2000, 1, od_u8, od_readable | od_writable, AT(u8), 0, NULL},
    {0x2000, 2, od_i8, od_readable | od_writable, AT(i8), 0, NULL},
    {0x2000, 3, od_u16, od_readable | od_writable, AT(u16), 0, NULL},
    {0x2000, 4, od_i16, od_readable | od_writable, AT(i16), 0, NULL},
    {0x2000, 5, od_u32, od_readable | od_writable, AT(u32), 0, write_even},
    {0x2000, 6, od_u32, od_readable, AT(read_only), 0, NULL},
    {0x2000, 7, od_u32, od_writable, AT(write_only), 0, NULL},
};

static const struct object_dictionary dictionary = {
    .section_count = 1,
    .sections = {{entries, sizeof entries / sizeof entries[0], &values}},
};

static struct sdo_server server;
static struct sdo_client client;

void setUp(void)
{
    memset(&values, 0, sizeof values);
    server = (struct sdo_server){.node_id = 5, .dictionary = &dictionary};
    client = (struct sdo_client){.node_id = 5};
}

void tearDown(void) {}

static struct can_frame request(uint8_t command, uint16_t index, uint8_t subindex, uint32_t data)
{
    struct can_frame frame = can_frame_make(0x605, 8);
    frame.data[0] = command;
    can_put(&frame.data[1], 2, index);
    frame.data[3] = subindex;
    can_put(&frame.data[4], 4, data);
    return frame;
}

static uint32_t aborts_with(const struct can_frame *answer)
{
    return answer->data[0] == 0x80 ? can_get(&answer->data[4], 4) : od_abort_none;
}

/// What the idle server has to answer to a command byte for 2000:1 (one byte, read and write) with 2A in byte 4, where
/// long transfers have their size.
static uint32_t expected_abort(uint8_t command)
{
    bool one_byte = (command & 3) != 3 || ((command >> 2) & 3) == 3;
    switch (command >> 5) {
    case 1: // download
        if (!(command & 2))
            return (command & 1) ? od_abort_too_long : od_abort_none;
        return one_byte ? od_abort_none : od_abort_too_long;
    case 2: // upload
        return od_abort_none;
    case 5: // block upload
        return (command & 3) == 0 ? od_abort_none : od_abort_command;
    case 6: // block download
        if (command & 1)
            return od_abort_command;
        return (command & 2) ? od_abort_too_long : od_abort_none;
    default:
        return od_abort_command;
    }
}

static void test_sdo_server_answers_every_command_byte(void)
{
    for (unsigned command = 0; command < 256; command++) {
        struct can_frame frame = request((uint8_t)command, 0x2000, 1, 0x2A), answer;
        setUp();
        values.u8 = 0x11;
        bool answered = sdo_server_take(&server, &frame, 0, &answer);
        char text[32];
        snprintf(text, sizeof text, "command 0x%02X", command);
        TEST_ASSERT_EQUAL_MESSAGE(command >> 5 != 4, answered, text);
        uint32_t expected = expected_abort((uint8_t)command);
        bool writes = command >> 5 == 1 && (command & 2) && expected == od_abort_none;
        TEST_ASSERT_EQUAL_HEX8_MESSAGE(writes ? 0x2A : 0x11, values.u8, text);
        if (!answered)
            continue;
        TEST_ASSERT_EQUAL_HEX16_MESSAGE(0x585, answer.id, text);
        TEST_ASSERT_EQUAL_MESSAGE(8, answer.length, text);
        TEST_ASSERT_EQUAL_HEX16_MESSAGE(0x2000, can_get(&answer.data[1], 2), text);
        TEST_ASSERT_EQUAL_MESSAGE(1, answer.data[3], text);
        TEST_ASSERT_EQUAL_HEX32_MESSAGE(expected, aborts_with(&answer), text);
    }
}

static void test_sdo_server_ignores_and_counts_every_other_length(void)
{
    uint32_t counted = 0;
    for (unsigned command = 0; command < 256; command++)
        for (uint8_t length = 0; length < 8; length++) {
            struct can_frame frame = request((uint8_t)command, 0x2000, 1, 0x2A), answer;
            frame.length = length;
            TEST_ASSERT_FALSE(sdo_server_take(&server, &frame, 0, &answer));
            TEST_ASSERT_EQUAL_UINT32(++counted, server.malformed);
            TEST_ASSERT_EQUAL_HEX8(0, values.u8);
        }
    struct can_frame remote = request(0x40, 0x2000, 1, 0), answer;
    remote.remote = true;
    TEST_ASSERT_FALSE(sdo_server_take(&server, &remote, 0, &answer));
}

static void test_sdo_server_listens_to_its_own_identifier_only(void)
{
    for (uint16_t id = 0; id <= can_id_max; id++) {
        struct can_frame frame = request(0x40, 0x2000, 1, 0), answer;
        frame.id = id;
        TEST_ASSERT_EQUAL(id == 0x605, sdo_server_take(&server, &frame, 0, &answer));
    }
}

static uint32_t answer_to(uint8_t command, uint16_t index, uint8_t subindex, uint32_t data)
{
    struct can_frame frame = request(command, index, subindex, data), answer;
    TEST_ASSERT_TRUE(sdo_server_take(&server, &frame, 0, &answer));
    return aborts_with(&answer);
}

static void test_sdo_server_checks_size_against_type(void)
{
    static const uint8_t sizes[] = {0, 1, 1, 2, 2, 4};
    for (uint8_t sub = 1; sub <= 5; sub++)
        for (uint8_t sent = 1; sent <= 4; sent++) {
            uint32_t expected = sent > sizes[sub]   ? od_abort_too_long
                                : sent < sizes[sub] ? od_abort_too_short
                                                    : od_abort_none;
            TEST_ASSERT_EQUAL_HEX32(expected, answer_to((uint8_t)(0x23 | ((4 - sent) << 2)), 0x2000, sub, 2));
        }
}

static void test_sdo_server_checks_access_existence_and_value(void)
{
    TEST_ASSERT_EQUAL_HEX32(od_abort_no_object, answer_to(0x40, 0x1FFF, 0, 0));
    TEST_ASSERT_EQUAL_HEX32(od_abort_no_object, answer_to(0x23, 0x2001, 0, 0));
    TEST_ASSERT_EQUAL_HEX32(od_abort_no_subindex, answer_to(0x40, 0x2000, 8, 0));
    TEST_ASSERT_EQUAL_HEX32(od_abort_read_only, answer_to(0x23, 0x2000, 6, 1));
    TEST_ASSERT_EQUAL_HEX32(od_abort_read_only, answer_to(0x2F, 0x2000, 0, 1));
    TEST_ASSERT_EQUAL_HEX32(od_abort_write_only, answer_to(0x40, 0x2000, 7, 0));
    TEST_ASSERT_EQUAL_HEX32(od_abort_value, answer_to(0x23, 0x2000, 5, 3));
    TEST_ASSERT_EQUAL_UINT32(0, values.u32);
}

/// Client and server back to back.
static enum sdo_client_state exchange(struct can_frame frame)
{
    struct can_frame answer;
    TEST_ASSERT_TRUE(sdo_server_take(&server, &frame, 0, &answer));
    TEST_ASSERT_TRUE(sdo_client_take(&client, &answer));
    return client.state;
}

static void test_sdo_client_and_server_carry_every_type(void)
{
    static const struct {
        uint8_t sub, size;
        uint32_t value;
    } cases[] = {{1, 1, 0xFE}, {2, 1, 0x80}, {3, 2, 0xFEDC}, {4, 2, 0x8001}, {5, 4, 0xFEDCBA98}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        TEST_ASSERT_EQUAL(sdo_client_done,
                          exchange(sdo_client_download(&client, 0x2000, cases[i].sub, cases[i].size, cases[i].value)));
        TEST_ASSERT_EQUAL(sdo_client_done, exchange(sdo_client_upload(&client, 0x2000, cases[i].sub, cases[i].size)));
        TEST_ASSERT_EQUAL_HEX32(cases[i].value, client.value);
    }
    TEST_ASSERT_EQUAL_INT8(-128, values.i8);
    TEST_ASSERT_EQUAL_INT16(-32767, values.i16);
    TEST_ASSERT_EQUAL(sdo_client_aborted, exchange(sdo_client_upload(&client, 0x2000, 1, 4)));
    TEST_ASSERT_EQUAL_HEX32(od_abort_length, client.abort_code);
}

static void test_sdo_client_takes_only_its_own_answer(void)
{
    for (unsigned command = 0; command < 256; command++)
        for (uint8_t length = 0; length <= 8; length++)
            for (int upload = 0; upload < 2; upload++) {
                setUp();
                if (upload)
                    sdo_client_upload(&client, 0x6076, 0, 4);
                else
                    sdo_client_download(&client, 0x6076, 0, 4, 1);
                struct can_frame answer = request((uint8_t)command, 0x6076, 0, 0x12345678);
                answer.id = 0x585;
                answer.length = length;
                TEST_ASSERT_TRUE(sdo_client_take(&client, &answer));
                // Done only by the one answer that fits; an expedited upload without size is taken as the size asked
                // for.
                bool fits = upload ? (command & 0xEF) == 0x43 || (command & 0xE3) == 0x42 : command == 0x60;
                enum sdo_client_state expected = length != 8 ? sdo_client_waiting
                                                 : fits      ? sdo_client_done
                                                             : sdo_client_aborted;
                char text[48];
                snprintf(text, sizeof text, "%s, answer 0x%02X, length %u", upload ? "upload" : "download", command,
                         length);
                TEST_ASSERT_EQUAL_MESSAGE(expected, client.state, text);
            }
}

static void test_sdo_client_waits_past_answers_for_other_objects(void)
{
    sdo_client_upload(&client, 0x6076, 0, 4);
    struct can_frame other = request(0x43, 0x6077, 0, 1);
    other.id = 0x585;
    TEST_ASSERT_TRUE(sdo_client_take(&client, &other));
    other = request(0x43, 0x6076, 1, 1);
    other.id = 0x585;
    TEST_ASSERT_TRUE(sdo_client_take(&client, &other));
    TEST_ASSERT_EQUAL(sdo_client_waiting, client.state);
    TEST_ASSERT_EQUAL_UINT32(2, client.unexpected);
    other.id = 0x586;
    TEST_ASSERT_FALSE(sdo_client_take(&client, &other));
}

static void test_sdo_client_gives_up_with_an_abort(void)
{
    sdo_client_upload(&client, 0x6076, 2, 4);
    struct can_frame frame = sdo_client_give_up(&client), answer;
    TEST_ASSERT_EQUAL(sdo_client_aborted, client.state);
    TEST_ASSERT_EQUAL_HEX32(od_abort_timeout, client.abort_code);
    TEST_ASSERT_EQUAL_HEX32(od_abort_timeout, aborts_with(&frame));
    TEST_ASSERT_FALSE(sdo_server_take(&server, &frame, 0, &answer)); // an abort is not answered
    struct can_frame late = request(0x43, 0x6076, 2, 1);
    late.id = 0x585;
    TEST_ASSERT_TRUE(sdo_client_take(&client, &late));
    TEST_ASSERT_EQUAL(sdo_client_aborted, client.state);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_sdo_server_answers_every_command_byte);
    RUN_TEST(test_sdo_server_ignores_and_counts_every_other_length);
    RUN_TEST(test_sdo_server_listens_to_its_own_identifier_only);
    RUN_TEST(test_sdo_server_checks_size_against_type);
    RUN_TEST(test_sdo_server_checks_access_existence_and_value);
    RUN_TEST(test_sdo_client_and_server_carry_every_type);
    RUN_TEST(test_sdo_client_takes_only_its_own_answer);
    RUN_TEST(test_sdo_client_waits_past_answers_for_other_objects);
    RUN_TEST(test_sdo_client_gives_up_with_an_abort);
    return UNITY_END();
}
