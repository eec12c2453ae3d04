/* SPDX-License-Identifier: MIT */
/// A CANopen node and a master on the in-process bus: long SDO transfers, event-driven process data, the communication
/// objects, all on the bus's own time.
#include "drivers/can/canopen_master.h"
#include "drivers/can/canopen_node.h"
#include "ports/inproc.h"

#include "unity.h"

#include <stdio.h>
#include <string.h>

enum { node_id = 5, table_bytes = 8192 };

static const uint32_t sdo_timeout_us = 50000;

struct application {
    struct canopen_node node;
    int32_t position;
    struct od_data table;
    int lost;
    uint16_t lost_code;
};

static struct application app;
static struct inproc_bus bus;
static struct canopen_master master;
static uint8_t table_room[table_bytes], source[table_bytes], sink[table_bytes];
static uint64_t arrived_us[64];
static unsigned arrivals;

static void on_synchronise(void *owner, uint64_t now_us, bool targets_fresh)
{
    (void)owner, (void)now_us, (void)targets_fresh;
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
    {0x6064, 0, od_i32, od_readable | od_mappable_transmit, AT(position), 0, NULL},
    {0x2100, 0, od_domain, od_readable | od_writable, AT(table), 0, NULL},
};

static void node_receive(void *self, const struct can_frame *frame, uint64_t now_us)
{
    canopen_node_receive(self, frame, now_us);
}

static void node_advance(void *self, uint64_t now_us)
{
    canopen_node_advance(self, now_us);
}

static uint64_t node_deadline_us(const void *self)
{
    return canopen_node_deadline_us(self);
}

static void on_process_data(void *owner, const struct can_frame *frame)
{
    (void)owner;
    if (frame->id == 0x180 + node_id && arrivals < sizeof arrived_us / sizeof arrived_us[0])
        arrived_us[arrivals++] = canopen_master_time_us(&master);
}

void setUp(void)
{
    struct can_port master_port, node_port;
    const struct canopen_node_identity identity = {
        .device_type = 0x00020192, .device_name = "test drive", .hardware_version = "A"};
    memset(&app, 0, sizeof app);
    app.table = (struct od_data){.bytes = table_room, .room = table_room, .capacity = table_bytes};
    arrivals = 0;
    inproc_bus_init(&bus, 1000000, inproc_stuffing_worst);
    inproc_bus_add_port(&bus, &master_port);
    int node = inproc_bus_add_participant(&bus, &node_port);
    canopen_node_init(&app.node, node_id, &node_port, &identity, entries, sizeof entries / sizeof entries[0], &events,
                      &app);
    const struct can_participant participant = {&app.node, node_receive, node_advance, node_deadline_us};
    inproc_bus_bind(&bus, node, &participant);
    canopen_master_init(&master, &master_port, node_id, 127, sdo_timeout_us);
    master.on_process_data = on_process_data;
    canopen_node_boot(&app.node, 0);
    for (uint32_t i = 0; i < table_bytes; i++)
        source[i] = (uint8_t)(i * 91 + (i >> 7));
}

void tearDown(void) {}

static void serve_ms(uint32_t ms)
{
    TEST_ASSERT_EQUAL(can_ok, canopen_master_serve(&master, canopen_master_time_us(&master) + ms * 1000u));
}

static void writes(uint16_t index, uint8_t subindex, uint8_t size, uint32_t value, uint32_t abort_code)
{
    char text[48];
    snprintf(text, sizeof text, "%04X:%u = %08lX", index, subindex, (unsigned long)value);
    TEST_ASSERT_EQUAL_HEX32_MESSAGE(abort_code, canopen_master_write(&master, index, subindex, size, value), text);
}

static uint32_t reads(uint16_t index, uint8_t subindex, uint8_t size)
{
    uint32_t value = 0;
    char text[32];
    snprintf(text, sizeof text, "%04X:%u", index, subindex);
    TEST_ASSERT_EQUAL_HEX32_MESSAGE(od_abort_none, canopen_master_read(&master, index, subindex, size, &value), text);
    return value;
}

static void command(enum nmt_command nmt)
{
    struct can_frame frame = nmt_command_frame(nmt, node_id);
    TEST_ASSERT_EQUAL(can_ok, canopen_master_send(&master, &frame));
    serve_ms(1);
}

// ---- Long transfers

static void test_canopen_bus_carries_a_table_in_blocks(void)
{
    uint32_t size = 0;
    uint64_t from_us = canopen_master_time_us(&master);
    TEST_ASSERT_EQUAL_HEX32(od_abort_none, canopen_master_write_data(&master, 0x2100, 0, source, table_bytes));
    uint64_t written_us = canopen_master_time_us(&master);
    TEST_ASSERT_EQUAL_UINT32(table_bytes, app.table.size);
    TEST_ASSERT_EQUAL_MEMORY(source, table_room, table_bytes);
    TEST_ASSERT_EQUAL_HEX32(od_abort_none, canopen_master_read_data(&master, 0x2100, 0, sink, table_bytes, &size));
    TEST_ASSERT_EQUAL_UINT32(table_bytes, size);
    TEST_ASSERT_EQUAL_MEMORY(source, sink, table_bytes);
    printf("%d bytes at 1 Mbit/s: %.3f s down, %.3f s up\n", table_bytes, (double)(written_us - from_us) * 1e-6,
           (double)(canopen_master_time_us(&master) - written_us) * 1e-6);
    TEST_ASSERT_EQUAL_UINT32(0, master.sdo.unexpected);
}

static void test_canopen_bus_reads_the_strings(void)
{
    uint32_t size = 0;
    TEST_ASSERT_EQUAL_HEX32(od_abort_none, canopen_master_read_data(&master, 0x1008, 0, sink, table_bytes, &size));
    TEST_ASSERT_EQUAL_UINT32(10, size);
    TEST_ASSERT_EQUAL_MEMORY("test drive", sink, 10);
    TEST_ASSERT_EQUAL_HEX32(od_abort_none, canopen_master_read_data(&master, 0x1009, 0, sink, table_bytes, &size));
    TEST_ASSERT_EQUAL_UINT32(1, size);
    TEST_ASSERT_EQUAL_HEX32(od_abort_none, canopen_master_read_data(&master, 0x100A, 0, sink, table_bytes, &size));
    TEST_ASSERT_EQUAL_UINT32(0, size); // none was given
    TEST_ASSERT_EQUAL_HEX32(od_abort_memory, canopen_master_read_data(&master, 0x1008, 0, sink, 9, &size));
    TEST_ASSERT_EQUAL_HEX32(od_abort_no_object, canopen_master_read_data(&master, 0x1010, 1, sink, 9, &size));
}

/// Every single SDO frame of a transfer is lost once, in both directions.
static void test_canopen_bus_transfer_survives_any_lost_frame(void)
{
    const uint32_t size = 200;
    static const uint16_t ids[] = {0x600 + node_id, 0x580 + node_id};
    for (int upload = 0; upload < 2; upload++)
        for (int side = 0; side < 2; side++)
            for (uint32_t nth = 1; nth <= 34; nth++) {
                setUp();
                const struct inproc_fault fault = {.kind = inproc_drop, .cob_id = ids[side], .nth = nth};
                inproc_bus_set_faults(&bus, &fault, 1);
                uint32_t got = 0, abort_code = od_abort_none;
                memcpy(table_room, source, size);
                app.table.size = size;
                if (upload)
                    abort_code = canopen_master_read_data(&master, 0x2100, 0, sink, table_bytes, &got);
                else
                    abort_code = canopen_master_write_data(&master, 0x2100, 0, source + 5, size);
                char text[64];
                snprintf(text, sizeof text, "%s, frame %lu of %03X", upload ? "upload" : "download", (unsigned long)nth,
                         ids[side]);
                TEST_ASSERT_EQUAL_HEX32_MESSAGE(od_abort_none, abort_code, text);
                TEST_ASSERT_TRUE_MESSAGE(memcmp(upload ? sink : table_room, upload ? source : source + 5, size) == 0,
                                         text);
                inproc_bus_set_faults(&bus, NULL, 0);
            }
}

static void test_canopen_bus_transfer_ends_when_the_node_is_gone(void)
{
    const struct inproc_fault fault = {.kind = inproc_bus_off, .cob_id = 0x600 + node_id, .nth = 20, .endpoint = 1};
    inproc_bus_set_faults(&bus, &fault, 1);
    uint64_t from_us = canopen_master_time_us(&master);
    TEST_ASSERT_EQUAL_HEX32(od_abort_timeout, canopen_master_write_data(&master, 0x2100, 0, source, table_bytes));
    // The segments that nobody takes go out in 0.02 s; then a time-out for each of the attempts, and one more for the
    // attempt that was under way.
    TEST_ASSERT_TRUE(canopen_master_time_us(&master) - from_us <= 4 * sdo_timeout_us + 20000);
}

static void test_canopen_bus_stopped_node_drops_its_transfer(void)
{
    struct can_frame request = sdo_client_download_data(&master.sdo, sdo_segmented, 0x2100, 0, source, 100);
    canopen_master_send(&master, &request);
    serve_ms(1);
    TEST_ASSERT_EQUAL(sdo_server_segment_download, app.node.sdo.state);
    command(nmt_stop);
    TEST_ASSERT_EQUAL(sdo_server_idle, app.node.sdo.state);
    serve_ms(1 + sdo_server_timeout_us / 1000);
    TEST_ASSERT_EQUAL_UINT32(0, app.node.sdo.timeouts); // a stopped node has nothing to say, not even an abort
}

// ---- Event-driven process data

static void map_event(uint16_t inhibit_100us, uint16_t event_ms)
{
    writes(0x1800, 2, 1, 255, od_abort_none);
    writes(0x1800, 3, 2, inhibit_100us, od_abort_none);
    writes(0x1800, 5, 2, event_ms, od_abort_none);
    writes(0x1A00, 1, 4, 0x60640020, od_abort_none);
    writes(0x1A00, 0, 1, 1, od_abort_none);
    writes(0x1800, 1, 4, 0x180 + node_id, od_abort_none);
    writes(0x1800, 3, 2, inhibit_100us + 1u, od_abort_access); // enabled
    command(nmt_start);
}

static void test_canopen_bus_event_tpdo_goes_out_on_start_and_on_change(void)
{
    map_event(0, 0);
    TEST_ASSERT_EQUAL(1, arrivals); // with entering operational
    serve_ms(50);
    TEST_ASSERT_EQUAL(1, arrivals);
    app.position = 7;
    reads(0x1000, 0, 4); // anything that wakes the node
    TEST_ASSERT_EQUAL(2, arrivals);
    command(nmt_enter_pre_operational);
    app.position = 8;
    reads(0x1000, 0, 4);
    TEST_ASSERT_EQUAL(2, arrivals);
}

static void test_canopen_bus_event_timer_repeats_and_inhibit_time_holds_back(void)
{
    const uint64_t arbitration_us = 270; // an SDO answer may be on the wire, another before it
    map_event(30, 10);                   // 3 ms, 10 ms
    TEST_ASSERT_EQUAL(1, arrivals);
    serve_ms(45);
    TEST_ASSERT_EQUAL(5, arrivals); // at 10, 20, 30, 40 ms after the first
    for (unsigned i = 1; i < arrivals; i++)
        TEST_ASSERT_UINT64_WITHIN(arbitration_us, 10000, arrived_us[i] - arrived_us[i - 1]);
    for (int n = 0; n < 40; n++) { // a change every ms at least
        app.position++;
        reads(0x1000, 0, 4);
        serve_ms(1);
    }
    for (unsigned i = 5; i < arrivals; i++) {
        uint64_t gap_us = arrived_us[i] - arrived_us[i - 1];
        TEST_ASSERT_TRUE(gap_us + arbitration_us >= 3000);
        TEST_ASSERT_TRUE(i == 5 || gap_us <= 3000 + arbitration_us);
    }
    TEST_ASSERT_TRUE(arrivals > 15);
}

// ---- Objects

static void test_canopen_bus_history_is_cleared_by_zero_only(void)
{
    canopen_node_raise(&app.node, emcy_following_error, emcy_profile_specific);
    canopen_node_raise(&app.node, emcy_pdo_length, emcy_communication_error);
    serve_ms(1);
    TEST_ASSERT_EQUAL_UINT32(2, reads(0x1003, 0, 1));
    TEST_ASSERT_EQUAL_HEX32(emcy_pdo_length, reads(0x1003, 1, 4)); // newest first
    TEST_ASSERT_EQUAL_HEX32(emcy_following_error, reads(0x1003, 2, 4));
    TEST_ASSERT_EQUAL_HEX32(0, reads(0x1003, 8, 4));
    writes(0x1003, 0, 1, 1, od_abort_value);
    writes(0x1003, 1, 4, 0, od_abort_read_only);
    TEST_ASSERT_EQUAL_UINT32(2, reads(0x1003, 0, 1));
    writes(0x1003, 0, 1, 0, od_abort_none);
    TEST_ASSERT_EQUAL_UINT32(0, reads(0x1003, 0, 1));
    TEST_ASSERT_EQUAL_HEX32(0, reads(0x1003, 1, 4));
    TEST_ASSERT_EQUAL_UINT32(2, master.emergencies);
}

static void test_canopen_bus_identifiers_are_said_and_stay(void)
{
    TEST_ASSERT_EQUAL_HEX32(0x80, reads(0x1005, 0, 4));
    writes(0x1005, 0, 4, 0x80, od_abort_none);
    writes(0x1005, 0, 4, 0x40000080, od_abort_value); // it would have to produce SYNC
    writes(0x1005, 0, 4, 0x81, od_abort_value);
    TEST_ASSERT_EQUAL_HEX32(0x80 + node_id, reads(0x1014, 0, 4));
    TEST_ASSERT_EQUAL_HEX32(0x600 + node_id, reads(0x1200, 1, 4));
    TEST_ASSERT_EQUAL_HEX32(0x580 + node_id, reads(0x1200, 2, 4));
    uint32_t value = 0;
    TEST_ASSERT_EQUAL_HEX32(od_abort_no_object, canopen_master_read(&master, 0x1010, 0, 1, &value));
    TEST_ASSERT_EQUAL_HEX32(od_abort_no_object, canopen_master_read(&master, 0x1011, 0, 1, &value));
}

static void test_canopen_bus_node_heartbeat_keeps_its_period(void)
{
    writes(0x1017, 0, 2, 20, od_abort_none);
    heartbeat_consumer_start(&master.consumer, node_id, 30000);
    serve_ms(500);
    TEST_ASSERT_EQUAL(heartbeat_alive, master.consumer.life);
    TEST_ASSERT_EQUAL_UINT8(nmt_pre_operational, master.consumer.state);
    writes(0x1017, 0, 2, 0, od_abort_none);
    serve_ms(100);
    TEST_ASSERT_EQUAL(heartbeat_lost, master.consumer.life);
}

/// What 1029:1 makes of a master that falls silent.
static void silence_leads_to(uint8_t behaviour, enum nmt_state state)
{
    setUp();
    writes(0x1029, 1, 1, behaviour, od_abort_none);
    writes(0x1016, 1, 4, 0x007F0000 | 100, od_abort_none);
    heartbeat_producer_start(&master.producer, 127, 20000, canopen_master_time_us(&master));
    command(nmt_start);
    serve_ms(300);
    TEST_ASSERT_EQUAL(nmt_operational, app.node.state);
    TEST_ASSERT_EQUAL(0, app.lost);
    heartbeat_producer_start(&master.producer, 127, 0, 0);
    serve_ms(99);
    TEST_ASSERT_EQUAL(nmt_operational, app.node.state);
    serve_ms(30);
    TEST_ASSERT_EQUAL(state, app.node.state);
    TEST_ASSERT_EQUAL(state == nmt_operational ? 1 : 2, app.lost); // the heartbeat, then leaving operational
}

static void test_canopen_bus_lost_master_does_what_1029_says(void)
{
    silence_leads_to(canopen_error_leaves_operational, nmt_pre_operational);
    silence_leads_to(canopen_error_stays, nmt_operational);
    silence_leads_to(canopen_error_stops, nmt_stopped);
    setUp();
    writes(0x1029, 1, 1, 3, od_abort_value);
    TEST_ASSERT_EQUAL_UINT32(canopen_error_stays, reads(0x1029, 1, 1));
}

static void send_sync(void)
{
    struct can_frame sync = can_frame_make(sync_cob_id, 0);
    canopen_master_send(&master, &sync);
    serve_ms(1);
}

static void test_canopen_bus_set_points_after_the_window_are_passed_over(void)
{
    writes(0x1400, 2, 1, 1, od_abort_none);
    writes(0x1600, 1, 4, 0x20020108, od_abort_none);
    writes(0x1600, 0, 1, 1, od_abort_none);
    writes(0x1400, 1, 4, 0x200 + node_id, od_abort_none);
    writes(0x1007, 0, 4, 4000, od_abort_none);
    command(nmt_start);
    struct can_frame target = can_frame_make(0x200 + node_id, 1);
    send_sync();
    for (uint8_t value = 1; value <= 2; value++) { // 1 ms after SYNC, then 6 ms after the next one
        target.data[0] = value;
        serve_ms(value == 1 ? 0 : 5);
        canopen_master_send(&master, &target);
        serve_ms(1);
        send_sync();
        TEST_ASSERT_EQUAL_UINT8(1, app.node.target_counter);
    }
    TEST_ASSERT_EQUAL_UINT32(1, app.node.errors.targets_outside);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_canopen_bus_carries_a_table_in_blocks);
    RUN_TEST(test_canopen_bus_reads_the_strings);
    RUN_TEST(test_canopen_bus_transfer_survives_any_lost_frame);
    RUN_TEST(test_canopen_bus_transfer_ends_when_the_node_is_gone);
    RUN_TEST(test_canopen_bus_stopped_node_drops_its_transfer);
    RUN_TEST(test_canopen_bus_event_tpdo_goes_out_on_start_and_on_change);
    RUN_TEST(test_canopen_bus_event_timer_repeats_and_inhibit_time_holds_back);
    RUN_TEST(test_canopen_bus_history_is_cleared_by_zero_only);
    RUN_TEST(test_canopen_bus_identifiers_are_said_and_stay);
    RUN_TEST(test_canopen_bus_node_heartbeat_keeps_its_period);
    RUN_TEST(test_canopen_bus_lost_master_does_what_1029_says);
    RUN_TEST(test_canopen_bus_set_points_after_the_window_are_passed_over);
    return UNITY_END();
}
