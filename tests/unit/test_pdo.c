/* SPDX-License-Identifier: MIT */
#include "drivers/can/canopen_node.h"
#include "drivers/can/pdo_check.h"

#include "unity.h"

#include <stdio.h>
#include <string.h>

struct application {
    struct canopen_node node;
    uint16_t control;
    int32_t position;
    uint8_t fixed_in_place;
    int synchronised;
    bool fresh;
    int lost;
    uint16_t lost_code;
};

static struct application app;
static struct can_frame sent[64];
static unsigned sent_count;

static enum can_status port_send(void *self, const struct can_frame *frame)
{
    (void)self;
    if (sent_count == sizeof sent / sizeof sent[0])
        return can_err_full;
    sent[sent_count++] = *frame;
    return can_ok;
}

static const struct can_port_operations port_operations = {port_send, NULL, NULL, NULL};

static void on_synchronise(void *owner, uint64_t now_us, bool targets_fresh)
{
    struct application *self = owner;
    (void)now_us;
    self->synchronised++;
    self->fresh = targets_fresh;
}

static void on_connection_lost(void *owner, uint16_t emcy_code, uint64_t now_us)
{
    struct application *self = owner;
    (void)now_us;
    self->lost++;
    self->lost_code = emcy_code;
}

static void on_reset(void *owner)
{
    (void)owner;
}

static const struct canopen_node_events events = {on_synchronise, on_connection_lost, on_reset};

#define AT(member) offsetof(struct application, member)

static const struct od_entry entries[] = {
    {0x6040, 0, od_u16, od_readable | od_writable | od_mappable_receive, AT(control), 0, NULL},
    {0x6064, 0, od_i32, od_readable | od_mappable_transmit, AT(position), 0, NULL},
    {0x607A, 0, od_i32, od_readable | od_writable | od_mappable_receive, AT(position), 0, NULL},
    {0x6061, 0, od_u8, od_readable, AT(fixed_in_place), 0, NULL},
};

static void receive(uint16_t id, uint8_t length, const uint8_t *data)
{
    struct can_frame frame = can_frame_make(id, length);
    if (length > 0)
        memcpy(frame.data, data, length);
    canopen_node_receive(&app.node, &frame, app.node.now_us);
}

static uint32_t sdo_write(uint16_t index, uint8_t subindex, uint8_t size, uint32_t value)
{
    uint8_t data[8] = {(uint8_t)(0x23 | ((4 - size) << 2)), (uint8_t)index, (uint8_t)(index >> 8), subindex};
    can_put(&data[4], 4, value);
    sent_count = 0;
    receive(0x605, 8, data);
    TEST_ASSERT_EQUAL(1, sent_count);
    return sent[0].data[0] == 0x80 ? can_get(&sent[0].data[4], 4) : od_abort_none;
}

static void ok(uint16_t index, uint8_t subindex, uint8_t size, uint32_t value)
{
    char text[48];
    snprintf(text, sizeof text, "%04X:%u = %08lX", index, subindex, (unsigned long)value);
    TEST_ASSERT_EQUAL_HEX32_MESSAGE(od_abort_none, sdo_write(index, subindex, size, value), text);
}

static void nmt(enum nmt_command command)
{
    uint8_t data[2] = {(uint8_t)command, 5};
    receive(0x000, 2, data);
}

static void sync_with(uint8_t counter)
{
    sent_count = 0;
    receive(0x080, 1, &counter);
}

void setUp(void)
{
    memset(&app, 0, sizeof app);
    const struct can_port port = {&port_operations, NULL};
    const struct canopen_node_identity identity = {.device_type = 0x00020192};
    sent_count = 0;
    canopen_node_init(&app.node, 5, &port, &identity, entries, sizeof entries / sizeof entries[0], &events, &app);
    canopen_node_boot(&app.node, 0);
    TEST_ASSERT_EQUAL(1, sent_count);
    TEST_ASSERT_EQUAL_HEX16(0x705, sent[0].id);
    TEST_ASSERT_EQUAL_HEX8(0, sent[0].data[0]);
}

void tearDown(void) {}

static void test_pdo_mapping_needs_the_right_order(void)
{
    const uint32_t control = 0x60400010, position = 0x607A0020;
    TEST_ASSERT_EQUAL_HEX32(od_abort_none, sdo_write(0x1600, 1, 4, control)); // disabled and empty after power-on
    TEST_ASSERT_EQUAL_HEX32(od_abort_none, sdo_write(0x1600, 2, 4, position));
    TEST_ASSERT_EQUAL_HEX32(od_abort_none, sdo_write(0x1600, 0, 1, 2));
    TEST_ASSERT_EQUAL_HEX32(od_abort_access, sdo_write(0x1600, 1, 4, control)); // count is not 0
    ok(0x1400, 1, 4, 0x205);
    TEST_ASSERT_EQUAL_HEX32(od_abort_access, sdo_write(0x1600, 0, 1, 0)); // enabled
    TEST_ASSERT_EQUAL_HEX32(od_abort_access, sdo_write(0x1600, 1, 4, control));
    TEST_ASSERT_EQUAL_HEX32(od_abort_access, sdo_write(0x1400, 1, 4, 0x206));
    TEST_ASSERT_EQUAL_HEX32(od_abort_access, sdo_write(0x1400, 2, 1, 1));
    ok(0x1400, 1, 4, PDO_DISABLED | 0x205);
    ok(0x1600, 0, 1, 0);
    ok(0x1600, 1, 4, control);
}

static void test_pdo_mapping_refuses_what_cannot_be_mapped(void)
{
    TEST_ASSERT_EQUAL_HEX32(od_abort_no_object, sdo_write(0x1600, 1, 4, 0x70000010));
    TEST_ASSERT_EQUAL_HEX32(od_abort_no_subindex, sdo_write(0x1600, 1, 4, 0x60400110));
    TEST_ASSERT_EQUAL_HEX32(od_abort_not_mappable, sdo_write(0x1600, 1, 4, 0x60400020)); // wrong length
    TEST_ASSERT_EQUAL_HEX32(od_abort_not_mappable, sdo_write(0x1600, 1, 4, 0x60640020)); // the other direction
    TEST_ASSERT_EQUAL_HEX32(od_abort_not_mappable, sdo_write(0x1A00, 1, 4, 0x60400010));
    TEST_ASSERT_EQUAL_HEX32(od_abort_not_mappable, sdo_write(0x1A00, 1, 4, 0x60610008));
    for (uint8_t i = 1; i <= 3; i++)
        ok(0x1A00, i, 4, 0x60640020);
    TEST_ASSERT_EQUAL_HEX32(od_abort_mapping_length, sdo_write(0x1A00, 0, 1, 3)); // twelve bytes
    TEST_ASSERT_EQUAL_HEX32(od_abort_mapping_length, sdo_write(0x1A00, 0, 1, 9));
    TEST_ASSERT_EQUAL_HEX32(od_abort_no_object, sdo_write(0x1A00, 0, 1, 4)); // the fourth is not set
    ok(0x1A00, 0, 1, 2);
    TEST_ASSERT_EQUAL_HEX32(od_abort_value, sdo_write(0x1800, 1, 4, 0x20000185)); // 29 bits
    TEST_ASSERT_EQUAL_HEX32(od_abort_value, sdo_write(0x1800, 2, 1, 253));        // on request: not offered
    TEST_ASSERT_EQUAL_HEX32(od_abort_value, sdo_write(0x1800, 2, 1, 0));
    TEST_ASSERT_EQUAL_HEX32(od_abort_value, sdo_write(0x1400, 2, 1, 241));
}

static void map(uint8_t rpdo_type, uint8_t tpdo_type)
{
    ok(0x1400, 2, 1, rpdo_type);
    ok(0x1600, 1, 4, 0x60400010);
    ok(0x1600, 2, 4, 0x607A0020);
    ok(0x1600, 0, 1, 2);
    ok(0x1400, 1, 4, 0x205);
    ok(0x1800, 2, 1, tpdo_type);
    ok(0x1A00, 1, 4, 0x60640020);
    ok(0x1A00, 2, 4, 0x20010108);
    ok(0x1A00, 0, 1, 2);
    ok(0x1800, 1, 4, 0x185);
    ok(0x1019, 0, 1, 240);
    nmt(nmt_start);
}

static const uint8_t target[6] = {0x0F, 0x00, 0xFE, 0xFF, 0xFF, 0xFF};

static void test_pdo_synchronous_target_takes_effect_at_sync(void)
{
    map(1, 1);
    receive(0x205, 6, target);
    TEST_ASSERT_EQUAL_INT32(0, app.position);
    sync_with(1);
    TEST_ASSERT_EQUAL_INT32(-2, app.position);
    TEST_ASSERT_EQUAL_HEX16(0x0F, app.control);
    TEST_ASSERT_TRUE(app.fresh);
    TEST_ASSERT_EQUAL(1, sent_count);
    TEST_ASSERT_EQUAL_HEX16(0x185, sent[0].id);
    TEST_ASSERT_EQUAL(5, sent[0].length);
    TEST_ASSERT_EQUAL_INT32(-2, od_from_raw(od_i32, can_get(sent[0].data, 4)));
    TEST_ASSERT_EQUAL(1, sent[0].data[4]);
    sync_with(2); // nothing came: keeps, counts, says so
    TEST_ASSERT_FALSE(app.fresh);
    TEST_ASSERT_EQUAL_INT32(-2, app.position);
    TEST_ASSERT_EQUAL_UINT32(1, app.node.errors.targets_lost);
}

static void test_pdo_immediate_target_takes_effect_at_once(void)
{
    map(255, 1);
    receive(0x205, 6, target);
    TEST_ASSERT_EQUAL_INT32(-2, app.position);
}

static void test_pdo_does_nothing_unless_operational(void)
{
    map(255, 1);
    static const enum nmt_command others[] = {nmt_stop, nmt_enter_pre_operational};
    for (int i = 0; i < 2; i++) {
        nmt(others[i]);
        receive(0x205, 6, target);
        sync_with(1);
        TEST_ASSERT_EQUAL_INT32(0, app.position);
        TEST_ASSERT_EQUAL(0, app.synchronised);
        TEST_ASSERT_EQUAL(0, sent_count);
    }
    TEST_ASSERT_EQUAL(1, app.lost); // leaving operational is said once
    TEST_ASSERT_EQUAL_HEX16(emcy_communication, app.lost_code);
}

static void test_pdo_every_length_is_judged(void)
{
    map(1, 1);
    for (uint8_t length = 0; length <= 8; length++) {
        const uint8_t data[8] = {0x0F, 0, 1, 0, 0, 0, 0, 0};
        app.position = 0;
        sent_count = 0;
        receive(0x205, length, data);
        bool enough = length >= 6; // more is the sender's business, as with real drives
        TEST_ASSERT_EQUAL(enough ? 0 : 1, sent_count);
        if (!enough) {
            TEST_ASSERT_EQUAL_HEX16(0x085, sent[0].id);
            TEST_ASSERT_EQUAL_HEX16(emcy_pdo_length, can_get(sent[0].data, 2));
        }
        sync_with((uint8_t)(length + 1));
        TEST_ASSERT_EQUAL_INT32(enough ? 1 : 0, app.position);
        TEST_ASSERT_EQUAL(enough, app.fresh);
    }
}

static void test_pdo_every_nth_sync_sends(void)
{
    static const uint8_t types[] = {1, 2, 3, 240};
    for (size_t i = 0; i < sizeof types; i++) {
        setUp();
        map(1, types[i]);
        for (unsigned n = 1; n <= 480; n++) {
            sync_with((uint8_t)((n - 1) % 240 + 1));
            TEST_ASSERT_EQUAL(n % types[i] == 0 ? 1 : 0, sent_count);
        }
    }
}

static void map_checked(void)
{
    ok(0x1401, 2, 1, 1);
    ok(0x1601, 1, 4, 0x607A0020);
    ok(0x1601, 2, 4, 0x20020108);
    ok(0x1601, 3, 4, 0x20020208);
    ok(0x1601, 0, 1, 3);
    ok(0x1401, 1, 4, 0x305);
    ok(0x1400, 2, 1, 1);
    ok(0x1600, 1, 4, 0x60400010);
    ok(0x1600, 0, 1, 1);
    ok(0x1400, 1, 4, 0x205);
    ok(0x1019, 0, 1, 240);
    nmt(nmt_start);
}

static void send_checked(uint8_t counter, uint8_t flip_first, uint8_t flip_second)
{
    uint8_t first[2] = {0x0F, 0}, second[6] = {1, 2, 3, 4, counter, 0};
    second[5] = pdo_check(pdo_check(pdo_check_start, first, 2), second, 5);
    first[0] ^= flip_first;
    second[1] ^= flip_second;
    receive(0x205, 2, first);
    receive(0x305, 6, second);
}

static void test_pdo_check_lets_only_this_syncs_whole_set_in(void)
{
    map_checked();
    send_checked(1, 0, 0);
    sync_with(1);
    TEST_ASSERT_TRUE(app.fresh);
    TEST_ASSERT_EQUAL_INT32(0x04030201, app.position);
    app.position = 0;
    send_checked(1, 0, 0); // for the last SYNC
    sync_with(2);
    TEST_ASSERT_FALSE(app.fresh);
    send_checked(3, 4, 0);
    sync_with(3);
    TEST_ASSERT_FALSE(app.fresh);
    send_checked(4, 0, 4);
    sync_with(4);
    TEST_ASSERT_FALSE(app.fresh);
    TEST_ASSERT_EQUAL_INT32(0, app.position);
    TEST_ASSERT_EQUAL_UINT32(3, app.node.errors.targets_rejected);
    TEST_ASSERT_EQUAL_UINT32(0, app.node.errors.targets_lost);
}

/// Another control word that the check byte cannot tell from 000F in front of these bytes.
static uint16_t lookalike(const uint8_t *second, uint8_t count)
{
    const uint8_t first[2] = {0x0F, 0};
    uint8_t check = pdo_check(pdo_check(pdo_check_start, first, 2), second, count);
    for (uint32_t word = 0x10; word <= UINT16_MAX; word++) {
        const uint8_t other[2] = {(uint8_t)word, (uint8_t)(word >> 8)};
        if (pdo_check(pdo_check(pdo_check_start, other, 2), second, count) == check)
            return (uint16_t)word;
    }
    return 0;
}

static void test_pdo_check_refuses_a_set_that_was_mixed_even_if_the_check_fits(void)
{
    map_checked();
    const uint8_t second[5] = {1, 2, 3, 4, 1};
    uint16_t word = lookalike(second, 5);
    TEST_ASSERT_NOT_EQUAL(0, word);
    send_checked(1, 0, 0);
    const uint8_t leftover[2] = {(uint8_t)word, (uint8_t)(word >> 8)};
    receive(0x205, 2, leftover);
    sync_with(1);
    TEST_ASSERT_FALSE(app.fresh);
    TEST_ASSERT_EQUAL_HEX16(0, app.control);
    send_checked(2, 0, 0); // and the next one is judged on its own
    sync_with(2);
    TEST_ASSERT_TRUE(app.fresh);
}

static void test_pdo_check_finds_every_one_and_two_bit_error(void)
{
    uint8_t data[16];
    for (int i = 0; i < 15; i++)
        data[i] = (uint8_t)(17 * i + 3);
    data[15] = pdo_check(pdo_check_start, data, 15);
    for (int a = 0; a < 128; a++)
        for (int b = a; b < 128; b++) {
            uint8_t altered[16];
            memcpy(altered, data, sizeof altered);
            altered[a / 8] ^= (uint8_t)(1u << (a % 8));
            if (b != a)
                altered[b / 8] ^= (uint8_t)(1u << (b % 8));
            TEST_ASSERT_TRUE(pdo_check(pdo_check_start, altered, 15) != altered[15]);
        }
}

static void test_pdo_lost_sync_is_said_after_one_and_a_half_periods(void)
{
    map(1, 1);
    ok(0x1006, 0, 4, 1000);
    app.node.now_us = 10000;
    sync_with(1);
    TEST_ASSERT_EQUAL_UINT64(11500, canopen_node_deadline_us(&app.node));
    canopen_node_advance(&app.node, 11499);
    TEST_ASSERT_EQUAL(0, app.lost);
    canopen_node_advance(&app.node, 11500);
    TEST_ASSERT_EQUAL(1, app.lost);
    TEST_ASSERT_EQUAL_HEX16(emcy_sync_lost, app.lost_code);
    canopen_node_advance(&app.node, 99999);
    TEST_ASSERT_EQUAL(1, app.lost); // once
}

static void test_pdo_sync_counter_tells_gaps_repeats_and_old_ones(void)
{
    map(1, 1);
    ok(0x1006, 0, 4, 1000);
    sync_with(239);
    sync_with(240);
    sync_with(1); // wraps
    TEST_ASSERT_EQUAL_UINT32(0, app.node.sync.missed);
    sync_with(4);
    TEST_ASSERT_EQUAL_UINT32(2, app.node.sync.missed);
    sync_with(4);
    sync_with(3);
    TEST_ASSERT_EQUAL_UINT32(2, app.node.sync.repeated);
    TEST_ASSERT_EQUAL(4, app.synchronised);
    receive(0x080, 0, NULL);
    TEST_ASSERT_EQUAL_UINT32(1, app.node.sync.malformed);
    TEST_ASSERT_EQUAL(4, app.synchronised);
    TEST_ASSERT_EQUAL_HEX32(od_abort_state, sdo_write(0x1019, 0, 1, 10)); // only while 1006 is 0
}

static void test_pdo_masters_heartbeat_is_watched_once_heard(void)
{
    ok(0x1016, 1, 4, 0x007F0064);
    TEST_ASSERT_EQUAL_UINT64(CAN_NEVER_US, canopen_node_deadline_us(&app.node));
    const uint8_t operational = 5;
    app.node.now_us = 1000;
    receive(0x77F, 1, &operational);
    TEST_ASSERT_EQUAL_UINT64(101000, canopen_node_deadline_us(&app.node));
    canopen_node_advance(&app.node, 101000);
    TEST_ASSERT_EQUAL(1, app.lost);
    TEST_ASSERT_EQUAL_HEX16(emcy_heartbeat, app.lost_code);
    TEST_ASSERT_EQUAL_HEX32(od_abort_value, sdo_write(0x1016, 1, 4, 0x00800064));
}

static void test_pdo_nmt_reset_boots_again_with_defaults(void)
{
    map(1, 1);
    sent_count = 0;
    nmt(nmt_reset_communication);
    TEST_ASSERT_EQUAL(1, sent_count);
    TEST_ASSERT_EQUAL_HEX16(0x705, sent[0].id);
    TEST_ASSERT_EQUAL(nmt_pre_operational, app.node.state);
    TEST_ASSERT_FALSE(pdo_is_enabled(&app.node.rpdo[0]));
    TEST_ASSERT_EQUAL(0, app.node.rpdo[0].mapped_count);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_pdo_mapping_needs_the_right_order);
    RUN_TEST(test_pdo_mapping_refuses_what_cannot_be_mapped);
    RUN_TEST(test_pdo_synchronous_target_takes_effect_at_sync);
    RUN_TEST(test_pdo_immediate_target_takes_effect_at_once);
    RUN_TEST(test_pdo_does_nothing_unless_operational);
    RUN_TEST(test_pdo_every_length_is_judged);
    RUN_TEST(test_pdo_every_nth_sync_sends);
    RUN_TEST(test_pdo_check_lets_only_this_syncs_whole_set_in);
    RUN_TEST(test_pdo_check_refuses_a_set_that_was_mixed_even_if_the_check_fits);
    RUN_TEST(test_pdo_check_finds_every_one_and_two_bit_error);
    RUN_TEST(test_pdo_lost_sync_is_said_after_one_and_a_half_periods);
    RUN_TEST(test_pdo_sync_counter_tells_gaps_repeats_and_old_ones);
    RUN_TEST(test_pdo_masters_heartbeat_is_watched_once_heard);
    RUN_TEST(test_pdo_nmt_reset_boots_again_with_defaults);
    return UNITY_END();
}
