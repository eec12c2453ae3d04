/* SPDX-License-Identifier: MIT */
/// Segmented and block SDO: client and server back to back over every size, every single lost or doubled frame; every
/// command byte in every state of the server, every answer in every phase of the client.
#include "drivers/can/can_port.h"
#include "drivers/can/sdo_client.h"
#include "drivers/can/sdo_server.h"

#include "unity.h"

#include <stdio.h>
#include <string.h>

enum { room_bytes = 3000 };

struct owner {
    struct od_data table, text, in_place, fixed;
    uint16_t number;
    uint32_t odd_refused;
};

static struct owner owner;
static uint8_t room[room_bytes], old_bytes[room_bytes], in_place_bytes[16];

static uint32_t write_table(void *object, const struct od_entry *entry, int64_t size)
{
    struct owner *self = object;
    (void)entry;
    if (size == 13) { // stands for content that the application refuses
        self->odd_refused++;
        return od_abort_value;
    }
    return od_abort_none;
}

#define AT(member) offsetof(struct owner, member)

static const struct od_entry entries[] = {
    {0x2100, 0, od_domain, od_readable | od_writable, AT(table), 0, write_table},
    {0x1008, 0, od_string, od_readable, AT(text), 0, NULL},
    {0x2101, 0, od_u16, od_readable | od_writable, AT(number), 0, NULL},
    {0x2102, 0, od_domain, od_readable | od_writable, AT(in_place), 0, NULL},
    {0x2103, 0, od_domain, od_writable, AT(in_place), 0, NULL},
    {0x2104, 0, od_domain, od_readable | od_writable, AT(fixed), 0, NULL}, // a slip of the table's author: no room
};

static const struct object_dictionary dictionary = {
    .section_count = 1,
    .sections = {{entries, sizeof entries / sizeof entries[0], &owner}},
};

static struct sdo_server server;
static struct sdo_client client;
static uint8_t source[room_bytes + 8], sink[room_bytes + 8];

void setUp(void)
{
    static const char name[] = "a drive with a name";
    memset(old_bytes, 0x5A, sizeof old_bytes);
    memset(room, 0, sizeof room);
    owner = (struct owner){
        .table = {.bytes = old_bytes, .size = 10, .room = room, .capacity = room_bytes},
        .text = {.bytes = (const uint8_t *)name, .size = sizeof name - 1},
        .in_place = {.bytes = in_place_bytes, .size = 5, .room = in_place_bytes, .capacity = sizeof in_place_bytes},
        .fixed = {.bytes = old_bytes, .size = 3},
        .number = 0x1234,
    };
    server = (struct sdo_server){.node_id = 5, .dictionary = &dictionary};
    client = (struct sdo_client){.node_id = 5};
    for (uint32_t i = 0; i < sizeof source; i++)
        source[i] = (uint8_t)(i * 37 + (i >> 8));
    memset(sink, 0xEE, sizeof sink);
}

void tearDown(void) {}

/// One frame on its way is hit: which of all, and how.
static struct {
    enum { hit_none, hit_lose, hit_double, hit_flip } kind;
    unsigned nth, count;
} hit;

/// Carries a frame to the other half; `to_server` says which.
static void carry(struct can_frame frame, bool to_server)
{
    struct can_frame answer;
    unsigned times = 1;
    if (++hit.count == hit.nth && hit.kind != hit_none) {
        times = hit.kind == hit_lose ? 0 : hit.kind == hit_double ? 2 : 1;
        if (hit.kind == hit_flip)
            frame.data[5] ^= 0x10;
    }
    for (unsigned i = 0; i < times; i++) {
        if (!to_server)
            sdo_client_take(&client, &frame);
        else if (sdo_server_take(&server, &frame, 0, &answer))
            carry(answer, false);
    }
}

/// One round: all that both halves have to say. False if nobody had anything.
static bool talk(void)
{
    struct can_frame frame;
    bool said = false;
    while (sdo_client_upcoming(&client, &frame)) {
        sdo_client_sent(&client);
        carry(frame, true);
        said = true;
    }
    if (sdo_server_upcoming(&server, &frame)) {
        sdo_server_sent(&server, 0);
        carry(frame, false);
        said = true;
    }
    return said;
}

/// Runs a transfer to its end; silence brings the reminders, then the time-outs.
static void run(struct can_frame request)
{
    struct can_frame frame;
    carry(request, true);
    for (int silences = 0; silences < 3; silences++) {
        while (talk())
            ;
        if (client.state != sdo_client_waiting)
            break;
        sdo_client_remind(&client);
        if (sdo_server_advance(&server, sdo_server_timeout_us / 2, &frame))
            carry(frame, false);
    }
    if (client.state == sdo_client_waiting)
        carry(sdo_client_give_up(&client), true);
    if (sdo_server_advance(&server, sdo_server_timeout_us, &frame))
        carry(frame, false);
    TEST_ASSERT_EQUAL(sdo_server_idle, server.state);
    TEST_ASSERT_EQUAL_UINT64(CAN_NEVER_US, sdo_server_deadline_us(&server));
}

static void test_sdo_crc_has_its_check_value(void)
{
    TEST_ASSERT_EQUAL_HEX16(0x31C3, sdo_crc(0, (const uint8_t *)"123456789", 9));
    TEST_ASSERT_EQUAL_HEX16(0x31C3, sdo_crc(sdo_crc(0, (const uint8_t *)"1234", 4), (const uint8_t *)"56789", 5));
}

static void carries(enum sdo_method method, uint32_t size)
{
    char text[48];
    snprintf(text, sizeof text, "method %d, %lu bytes", method, (unsigned long)size);
    setUp();
    run(sdo_client_download_data(&client, method, 0x2100, 0, source, size));
    TEST_ASSERT_EQUAL_MESSAGE(sdo_client_done, client.state, text);
    TEST_ASSERT_EQUAL_UINT32_MESSAGE(size, owner.table.size, text);
    TEST_ASSERT_TRUE_MESSAGE(memcmp(source, owner.table.bytes, size) == 0, text);
    run(sdo_client_upload_data(&client, method, 0x2100, 0, sink, sizeof sink));
    TEST_ASSERT_EQUAL_MESSAGE(sdo_client_done, client.state, text);
    TEST_ASSERT_EQUAL_UINT32_MESSAGE(size, client.receiver.size, text);
    TEST_ASSERT_TRUE_MESSAGE(memcmp(source, sink, size) == 0, text);
    TEST_ASSERT_EQUAL_HEX8_MESSAGE(0xEE, sink[size], text);
    TEST_ASSERT_EQUAL_UINT32(0, client.unexpected);
}

static void test_sdo_long_carries_every_size(void)
{
    for (uint32_t size = 0; size <= 2 * 127 * 7 + 16; size++)
        if (size != 13) {
            carries(sdo_segmented, size);
            carries(sdo_block, size);
        }
    carries(sdo_block, room_bytes);
}

static void test_sdo_long_serves_numbers_and_strings_too(void)
{
    static const enum sdo_method methods[] = {sdo_segmented, sdo_block};
    static const uint8_t number[2] = {0xCD, 0xAB};
    for (int i = 0; i < 2; i++) {
        setUp();
        run(sdo_client_upload_data(&client, methods[i], 0x2101, 0, sink, sizeof sink));
        TEST_ASSERT_EQUAL(sdo_client_done, client.state);
        TEST_ASSERT_EQUAL_UINT32(2, client.receiver.size);
        TEST_ASSERT_EQUAL_HEX16(0x1234, can_get(sink, 2));
        run(sdo_client_download_data(&client, methods[i], 0x2101, 0, number, 2));
        TEST_ASSERT_EQUAL(sdo_client_done, client.state);
        TEST_ASSERT_EQUAL_HEX16(0xABCD, owner.number);
        run(sdo_client_upload_data(&client, methods[i], 0x1008, 0, sink, sizeof sink));
        TEST_ASSERT_EQUAL(sdo_client_done, client.state);
        TEST_ASSERT_EQUAL_UINT32(19, client.receiver.size);
        TEST_ASSERT_EQUAL_MEMORY("a drive with a name", sink, 19);
    }
}

static void refuses(struct can_frame request, uint32_t abort_code)
{
    run(request);
    TEST_ASSERT_EQUAL(sdo_client_aborted, client.state);
    TEST_ASSERT_EQUAL_HEX32(abort_code, client.abort_code);
    TEST_ASSERT_EQUAL_UINT32(10, owner.table.size); // as before
    TEST_ASSERT_TRUE(owner.table.bytes == old_bytes);
    TEST_ASSERT_EQUAL_HEX16(0x1234, owner.number);
}

static void test_sdo_long_refuses_what_does_not_fit(void)
{
    static const enum sdo_method methods[] = {sdo_segmented, sdo_block};
    for (int i = 0; i < 2; i++) {
        enum sdo_method m = methods[i];
        setUp();
        refuses(sdo_client_download_data(&client, m, 0x2100, 0, source, room_bytes + 1), od_abort_too_long);
        refuses(sdo_client_download_data(&client, m, 0x2101, 0, source, 1), od_abort_too_short);
        refuses(sdo_client_download_data(&client, m, 0x2101, 0, source, 3), od_abort_too_long);
        refuses(sdo_client_download_data(&client, m, 0x1008, 0, source, 3), od_abort_read_only);
        refuses(sdo_client_download_data(&client, m, 0x2200, 0, source, 3), od_abort_no_object);
        refuses(sdo_client_download_data(&client, m, 0x2100, 1, source, 3), od_abort_no_subindex);
        refuses(sdo_client_download_data(&client, m, 0x2100, 0, source, 13), od_abort_value);
        refuses(sdo_client_upload_data(&client, m, 0x2103, 0, sink, 3), od_abort_write_only);
        refuses(sdo_client_upload_data(&client, m, 0x2100, 0, sink, 9), od_abort_memory);
        refuses(sdo_client_upload_data(&client, m, 0x2101, 0, sink, 1), od_abort_memory);
    }
    TEST_ASSERT_EQUAL_UINT32(1, owner.odd_refused);
}

/// Every frame of a transfer is lost, doubled or changed once: the right bytes arrive, or the client knows they did
/// not.
static void survives(int kind, enum sdo_method method, bool download, uint32_t size)
{
    unsigned frames = 0;
    bool flips = kind == hit_flip && method == sdo_segmented; // nothing protects the bytes but CAN itself
    for (unsigned nth = 0; nth <= frames && !flips; nth++) {
        setUp();
        run(sdo_client_download_data(&client, sdo_segmented, 0x2100, 0, source + 1, size));
        hit.kind = kind;
        hit.count = 0;
        hit.nth = nth;
        if (download)
            run(sdo_client_download_data(&client, method, 0x2100, 0, source, size));
        else
            run(sdo_client_upload_data(&client, method, 0x2100, 0, sink, sizeof sink));
        frames = nth == 0 ? hit.count : frames;
        hit.kind = hit_none;
        char text[80];
        snprintf(text, sizeof text, "fault %d at frame %u of %u, method %d, %s", kind, nth, frames, method,
                 download ? "download" : "upload");
        const uint8_t *got = download ? owner.table.bytes : sink, *wanted = download ? source : source + 1;
        uint32_t count = download ? owner.table.size : client.receiver.size;
        bool arrived = count == size && memcmp(got, wanted, size) == 0;
        if (client.state == sdo_client_done)
            TEST_ASSERT_TRUE_MESSAGE(arrived, text);
        else
            TEST_ASSERT_NOT_EQUAL_MESSAGE(od_abort_none, client.abort_code, text);
        if (nth == 0)
            TEST_ASSERT_TRUE_MESSAGE(arrived, text);
    }
}

static void test_sdo_long_is_right_or_refused_whatever_frame_is_hit(void)
{
    for (int kind = hit_lose; kind <= hit_flip; kind++)
        for (int download = 0; download < 2; download++) {
            survives(kind, sdo_segmented, download, 100);
            survives(kind, sdo_block, download, 100);
            survives(kind, sdo_block, download, 127 * 7 + 40);
        }
}

/// In a block, a lost segment is sent again: no transfer fails because of one.
static void test_sdo_block_sends_lost_segments_again(void)
{
    const uint32_t size = 127 * 7 + 40;
    const unsigned segments = 127 + 6;
    for (int download = 0; download < 2; download++)
        for (unsigned nth = 1; nth <= segments; nth++) {
            setUp();
            run(sdo_client_download_data(&client, sdo_segmented, 0x2100, 0, source, size));
            hit.kind = hit_lose;
            hit.count = 0;
            hit.nth = nth + (download ? 2 : 3) + (nth > 127); // behind the start, and the answer to the first sub-block
            if (download)
                run(sdo_client_download_data(&client, sdo_block, 0x2100, 0, source + 1, size));
            else
                run(sdo_client_upload_data(&client, sdo_block, 0x2100, 0, sink, sizeof sink));
            hit.kind = hit_none;
            char text[64];
            snprintf(text, sizeof text, "segment %u, %s: %s", nth, download ? "download" : "upload",
                     od_abort_str(client.abort_code));
            TEST_ASSERT_EQUAL_MESSAGE(sdo_client_done, client.state, text);
        }
}

static void test_sdo_server_gives_up_after_its_time_and_says_so(void)
{
    struct can_frame request = sdo_client_download_data(&client, sdo_segmented, 0x2100, 0, source, 100), answer;
    TEST_ASSERT_TRUE(sdo_server_take(&server, &request, 500, &answer));
    TEST_ASSERT_EQUAL_UINT64(500 + sdo_server_timeout_us, sdo_server_deadline_us(&server));
    TEST_ASSERT_FALSE(sdo_server_advance(&server, 499 + sdo_server_timeout_us, &answer));
    TEST_ASSERT_TRUE(sdo_server_advance(&server, 500 + sdo_server_timeout_us, &answer));
    TEST_ASSERT_EQUAL_HEX8(0x80, answer.data[0]);
    TEST_ASSERT_EQUAL_HEX32(od_abort_timeout, can_get(&answer.data[4], 4));
    TEST_ASSERT_EQUAL_HEX16(0x2100, can_get(&answer.data[1], 2));
    TEST_ASSERT_EQUAL(sdo_server_idle, server.state);
    TEST_ASSERT_EQUAL_UINT32(1, server.timeouts);
}

static void test_sdo_server_forgets_a_transfer_with_an_abort_or_a_new_one(void)
{
    struct can_frame request = sdo_client_download_data(&client, sdo_block, 0x2100, 0, source, 100), answer;
    sdo_server_take(&server, &request, 0, &answer);
    TEST_ASSERT_EQUAL(sdo_server_block_download, server.state);
    struct can_frame give_up = sdo_client_give_up(&client);
    TEST_ASSERT_FALSE(sdo_server_take(&server, &give_up, 0, &answer));
    TEST_ASSERT_EQUAL(sdo_server_idle, server.state);
    request = sdo_client_download_data(&client, sdo_segmented, 0x2100, 0, source, 100);
    sdo_server_take(&server, &request, 0, &answer);
    run(sdo_client_upload_data(&client, sdo_segmented, 0x1008, 0, sink, sizeof sink));
    TEST_ASSERT_EQUAL(sdo_client_done, client.state);
    TEST_ASSERT_EQUAL_UINT32(10, owner.table.size);
}

static void test_sdo_server_switches_to_segments_below_the_clients_threshold(void)
{
    struct can_frame request = can_frame_make(0x605, 8), answer;
    request.data[0] = 0xA4;
    can_put(&request.data[1], 2, 0x1008);
    request.data[4] = 127;
    request.data[5] = 19;
    TEST_ASSERT_TRUE(sdo_server_take(&server, &request, 0, &answer));
    TEST_ASSERT_EQUAL_HEX8(0x41, answer.data[0]);
    request.data[5] = 18;
    TEST_ASSERT_TRUE(sdo_server_take(&server, &request, 0, &answer));
    TEST_ASSERT_EQUAL_HEX8(0xC6, answer.data[0]);
    request.data[4] = 0;
    TEST_ASSERT_TRUE(sdo_server_take(&server, &request, 0, &answer));
    TEST_ASSERT_EQUAL_HEX32(od_abort_block_size, can_get(&answer.data[4], 4));
    request.data[4] = 128;
    TEST_ASSERT_TRUE(sdo_server_take(&server, &request, 0, &answer));
    TEST_ASSERT_EQUAL_HEX32(od_abort_block_size, can_get(&answer.data[4], 4));
}

/// Hands the server eight bytes; the answer's command byte, or 0 if it says nothing.
static uint8_t say(uint8_t command, uint32_t first, uint32_t second, struct can_frame *out_answer)
{
    struct can_frame request = can_frame_make(0x605, 8);
    request.data[0] = command;
    can_put(&request.data[1], 3, first);
    can_put(&request.data[4], 4, second);
    *out_answer = can_frame_make(0, 0);
    return sdo_server_take(&server, &request, 0, out_answer) ? out_answer->data[0] : 0;
}

static void says_abort(uint8_t command, uint32_t first, uint32_t second, uint32_t abort_code)
{
    struct can_frame answer;
    TEST_ASSERT_EQUAL_HEX8(0x80, say(command, first, second, &answer));
    TEST_ASSERT_EQUAL_HEX32(abort_code, can_get(&answer.data[4], 4));
    TEST_ASSERT_EQUAL(sdo_server_idle, server.state);
}

static void test_sdo_server_refuses_a_toggle_bit_that_stays(void)
{
    struct can_frame answer;
    TEST_ASSERT_EQUAL_HEX8(0x60, say(0x20, 0x2100, 0, &answer));
    TEST_ASSERT_EQUAL_HEX8(0x20, say(0x00, 0, 0, &answer));
    says_abort(0x00, 0, 0, od_abort_toggle);
    TEST_ASSERT_EQUAL_HEX8(0x41, say(0x40, 0x1008, 0, &answer));
    TEST_ASSERT_EQUAL_HEX8(0x00, say(0x60, 0, 0, &answer));
    says_abort(0x60, 0, 0, od_abort_toggle);
}

static void test_sdo_client_refuses_a_toggle_bit_that_stays(void)
{
    struct can_frame answer = can_frame_make(0x585, 8), frame;
    sdo_client_download_data(&client, sdo_segmented, 0x2100, 0, source, 100);
    answer.data[0] = 0x60;
    can_put(&answer.data[1], 2, 0x2100);
    sdo_client_take(&client, &answer);
    answer = can_frame_make(0x585, 8);
    answer.data[0] = 0x20;
    sdo_client_take(&client, &answer);
    TEST_ASSERT_EQUAL(sdo_client_waiting, client.state);
    sdo_client_take(&client, &answer);
    TEST_ASSERT_EQUAL(sdo_client_aborted, client.state);
    TEST_ASSERT_EQUAL_HEX32(od_abort_toggle, client.abort_code);
    TEST_ASSERT_TRUE(sdo_client_upcoming(&client, &frame)); // and tells the server
    TEST_ASSERT_EQUAL_HEX8(0x80, frame.data[0]);
}

static void test_sdo_server_keeps_a_download_without_size_within_its_room(void)
{
    struct can_frame answer;
    TEST_ASSERT_EQUAL_HEX8(0x60, say(0x20, 0x2102, 0, &answer));
    TEST_ASSERT_EQUAL_HEX8(0x20, say(0x00, 0, 0, &answer));
    TEST_ASSERT_EQUAL_HEX8(0x30, say(0x10, 0, 0, &answer));
    says_abort(0x00, 0, 0, od_abort_too_long); // 21 bytes into 16
    TEST_ASSERT_EQUAL_UINT32(0, owner.in_place.size);
}

static void test_sdo_server_holds_the_client_to_the_size_it_said(void)
{
    struct can_frame answer;
    TEST_ASSERT_EQUAL_HEX8(0x60, say(0x21, 0x2100, 8, &answer));
    says_abort(0x01, 0, 0, od_abort_too_short); // the last seven of eight
    TEST_ASSERT_EQUAL_HEX8(0x60, say(0x21, 0x2100, 6, &answer));
    says_abort(0x01, 0, 0, od_abort_too_long);
    TEST_ASSERT_TRUE(owner.table.bytes == old_bytes);
    TEST_ASSERT_EQUAL_UINT32(10, owner.table.size);
    says_abort(0x21, 0x2104, 8, od_abort_read_only);
    says_abort(0x23, 0x2104, 8, od_abort_read_only);
    says_abort(0xC2, 0x2104, 8, od_abort_read_only);
}

static void test_sdo_server_does_not_answer_the_end_of_a_sub_block_twice(void)
{
    struct can_frame answer;
    TEST_ASSERT_EQUAL_HEX8(0xA4, say(0xC6, 0x2100, 1000, &answer));
    for (uint8_t number = 1; number < sdo_block_max; number++)
        TEST_ASSERT_EQUAL_HEX8(0, say(number, 0, 0, &answer));
    TEST_ASSERT_EQUAL_HEX8(0xA2, say(sdo_block_max, 0, 0, &answer));
    TEST_ASSERT_EQUAL(sdo_block_max, answer.data[1]);
    TEST_ASSERT_EQUAL_HEX8(0, say(sdo_block_max, 0, 0, &answer)); // an answer would be taken for the next one's
    TEST_ASSERT_EQUAL_HEX8(0, say(1, 0, 0, &answer));
    TEST_ASSERT_EQUAL_HEX8(0xA2, say(sdo_block_max, 0, 0, &answer));
    TEST_ASSERT_EQUAL(1, answer.data[1]);
}

static void test_sdo_block_sender_gives_up_on_a_receiver_that_never_gets_anything(void)
{
    struct can_frame answer;
    TEST_ASSERT_EQUAL_HEX8(0xC6, say(0xA4, 0x1008, 4, &answer));
    TEST_ASSERT_EQUAL_HEX8(0, say(0xA3, 0, 0, &answer));
    for (int n = 0; n <= sdo_stalled_max; n++) {
        for (; sdo_server_upcoming(&server, &answer); sdo_server_sent(&server, 0))
            ;
        struct can_frame nothing = can_frame_make(0x605, 8);
        nothing.data[0] = 0xA2; // the last segment in order was number 0
        nothing.data[2] = 4;
        bool answered = sdo_server_take(&server, &nothing, 0, &answer);
        TEST_ASSERT_EQUAL(n == sdo_stalled_max, answered);
    }
    TEST_ASSERT_EQUAL_HEX32(od_abort_timeout, can_get(&answer.data[4], 4));
}

static void test_sdo_block_client_passes_over_an_answer_to_what_it_has_not_sent(void)
{
    struct can_frame answer = can_frame_make(0x585, 8), frame;
    sdo_client_download_data(&client, sdo_block, 0x2100, 0, source, 100);
    answer.data[0] = 0xA4;
    can_put(&answer.data[1], 2, 0x2100);
    answer.data[4] = 10;
    sdo_client_take(&client, &answer);
    for (int n = 0; n < 3; n++) {
        TEST_ASSERT_TRUE(sdo_client_upcoming(&client, &frame));
        TEST_ASSERT_EQUAL(n + 1, frame.data[0]);
        sdo_client_sent(&client);
    }
    answer = can_frame_make(0x585, 8);
    answer.data[0] = 0xA2;
    answer.data[1] = 2;
    answer.data[2] = 10;
    sdo_client_take(&client, &answer);
    TEST_ASSERT_EQUAL_UINT32(1, client.unexpected);
    TEST_ASSERT_TRUE(sdo_client_upcoming(&client, &frame));
    TEST_ASSERT_EQUAL(4, frame.data[0]);
}

static void test_sdo_domain_in_place_is_empty_while_it_changes(void)
{
    struct can_frame request = sdo_client_download_data(&client, sdo_segmented, 0x2102, 0, source, 16), answer;
    TEST_ASSERT_TRUE(sdo_server_take(&server, &request, 0, &answer));
    TEST_ASSERT_EQUAL_UINT32(0, owner.in_place.size);
    run(sdo_client_download_data(&client, sdo_block, 0x2102, 0, source, 16));
    TEST_ASSERT_EQUAL_UINT32(16, owner.in_place.size);
    TEST_ASSERT_EQUAL_MEMORY(source, in_place_bytes, 16);
}

// ---- Every byte in every state

static struct sdo_server states[64];
static unsigned state_count;

/// Keeps a copy of the server whenever it is in a state that no copy is in yet.
static void collect_states(void)
{
    for (unsigned i = 0; i < state_count; i++)
        if (states[i].state == server.state && states[i].receiver.last == server.receiver.last &&
            states[i].receiver.received == server.receiver.received && states[i].sender.sent == server.sender.sent)
            return;
    if (state_count < sizeof states / sizeof states[0])
        states[state_count++] = server;
}

static void collect_while(struct can_frame request)
{
    struct can_frame frame, answer;
    bool have = true;
    for (int i = 0; i < 40 && have; i++) {
        if (sdo_server_take(&server, &request, 0, &answer))
            sdo_client_take(&client, &answer);
        collect_states();
        while (sdo_server_upcoming(&server, &frame)) {
            sdo_server_sent(&server, 0);
            collect_states();
            sdo_client_take(&client, &frame);
        }
        have = sdo_client_upcoming(&client, &request);
        if (have)
            sdo_client_sent(&client);
    }
}

static void test_sdo_server_stands_every_byte_and_length_in_every_state(void)
{
    state_count = 0;
    static const enum sdo_method methods[] = {sdo_segmented, sdo_block};
    for (int i = 0; i < 2; i++) {
        collect_while(sdo_client_download_data(&client, methods[i], 0x2100, 0, source, 20));
        collect_while(sdo_client_upload_data(&client, methods[i], 0x2100, 0, sink, sizeof sink));
    }
    bool seen[sdo_server_block_upload_end + 1] = {false};
    for (unsigned s = 0; s < state_count; s++) {
        seen[states[s].state] = true;
        for (unsigned command = 0; command < 256; command++)
            for (uint8_t length = 0; length <= 8; length++)
                for (unsigned fill = 0; fill < 256; fill += 51) { // 00, 33, .. FF in the other bytes
                    server = states[s];
                    struct can_frame frame = can_frame_make(0x605, length), answer;
                    memset(frame.data, (int)fill, length);
                    frame.data[0] = (uint8_t)command;
                    bool answered = sdo_server_take(&server, &frame, 7, &answer);
                    TEST_ASSERT_TRUE(length == 8 || !answered);
                    TEST_ASSERT_TRUE(length == 8 || server.state == states[s].state);
                    if (answered) {
                        TEST_ASSERT_EQUAL_HEX16(0x585, answer.id);
                        TEST_ASSERT_EQUAL(8, answer.length);
                        TEST_ASSERT_TRUE(answer.data[0] != 0x80 || server.state == sdo_server_idle);
                    }
                    TEST_ASSERT_TRUE(server.receiver.size <= server.receiver.capacity);
                    TEST_ASSERT_TRUE(server.sender.base <= server.sender.size);
                    sdo_server_upcoming(&server, &answer);
                }
    }
    for (int state = 0; state <= sdo_server_block_upload_end; state++)
        TEST_ASSERT_TRUE_MESSAGE(seen[state], "a state of the server was never reached");
    printf("%u distinct states of the server, 256 command bytes, 9 lengths, 6 fillings\n", state_count);
}

/// An answer with this command byte and all other bytes `fill`, in a given phase of a given transfer.
static void client_stands(enum sdo_method method, bool download, unsigned answers_before, unsigned command,
                          uint8_t length, uint8_t fill)
{
    struct can_frame request, answer, frame;
    server.state = sdo_server_idle;
    request = download ? sdo_client_download_data(&client, method, 0x2100, 0, source, 20)
                       : sdo_client_upload_data(&client, method, 0x1008, 0, sink, sizeof sink);
    bool have = true;
    for (unsigned i = 0; i < answers_before && have; i++) {
        bool answered = sdo_server_take(&server, &request, 0, &answer) ||
                        (sdo_server_upcoming(&server, &answer) && (sdo_server_sent(&server, 0), true));
        if (answered)
            sdo_client_take(&client, &answer);
        have = sdo_client_upcoming(&client, &request);
        if (have)
            sdo_client_sent(&client);
    }
    frame = can_frame_make(0x585, length);
    memset(frame.data, fill, length);
    frame.data[0] = (uint8_t)command;
    if (fill == 0) { // names the object, so that it is taken for an answer in the first phase
        can_put(&frame.data[1], 2, client.index);
        frame.data[3] = client.subindex;
    }
    enum sdo_client_state before = client.state;
    TEST_ASSERT_TRUE(sdo_client_take(&client, &frame));
    if (length != 8)
        TEST_ASSERT_EQUAL(before, client.state);
    TEST_ASSERT_TRUE(client.state != sdo_client_aborted || client.abort_code != od_abort_none);
    TEST_ASSERT_TRUE(client.receiver.size <= client.receiver.capacity);
    sdo_client_upcoming(&client, &frame);
}

static void test_sdo_client_stands_every_byte_and_length_in_every_phase(void)
{
    for (int method = sdo_segmented; method <= sdo_block; method++)
        for (int download = 0; download < 2; download++)
            for (unsigned answers = 0; answers < 6; answers++)
                for (unsigned command = 0; command < 256; command++)
                    for (unsigned fill = 0; fill < 256; fill += 85)
                        for (uint8_t length = fill == 0 ? 0 : 8; length <= 8; length++)
                            client_stands((enum sdo_method)method, download, answers, command, length, (uint8_t)fill);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_sdo_crc_has_its_check_value);
    RUN_TEST(test_sdo_long_carries_every_size);
    RUN_TEST(test_sdo_long_serves_numbers_and_strings_too);
    RUN_TEST(test_sdo_long_refuses_what_does_not_fit);
    RUN_TEST(test_sdo_long_is_right_or_refused_whatever_frame_is_hit);
    RUN_TEST(test_sdo_block_sends_lost_segments_again);
    RUN_TEST(test_sdo_server_gives_up_after_its_time_and_says_so);
    RUN_TEST(test_sdo_server_forgets_a_transfer_with_an_abort_or_a_new_one);
    RUN_TEST(test_sdo_server_switches_to_segments_below_the_clients_threshold);
    RUN_TEST(test_sdo_server_refuses_a_toggle_bit_that_stays);
    RUN_TEST(test_sdo_client_refuses_a_toggle_bit_that_stays);
    RUN_TEST(test_sdo_server_keeps_a_download_without_size_within_its_room);
    RUN_TEST(test_sdo_server_holds_the_client_to_the_size_it_said);
    RUN_TEST(test_sdo_server_does_not_answer_the_end_of_a_sub_block_twice);
    RUN_TEST(test_sdo_block_sender_gives_up_on_a_receiver_that_never_gets_anything);
    RUN_TEST(test_sdo_block_client_passes_over_an_answer_to_what_it_has_not_sent);
    RUN_TEST(test_sdo_domain_in_place_is_empty_while_it_changes);
    RUN_TEST(test_sdo_server_stands_every_byte_and_length_in_every_state);
    RUN_TEST(test_sdo_client_stands_every_byte_and_length_in_every_phase);
    return UNITY_END();
}
