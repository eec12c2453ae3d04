/* SPDX-License-Identifier: MIT */
/// The slave: check sum, every exception, silence and gaps on a virtual clock, every truncation and every single-bit
/// error of a frame, streams cut anywhere, and who may write.
#include "drivers/modbus/crc16.h"
#include "drivers/modbus/slave_rtu.h"
#include "drivers/modbus/slave_tcp.h"
#include "tests/support/modbus_bench.h"

enum { address = 17, baud = 19200, byte_us = 573 };

static struct modbus_rtu_slave rtu;
static struct modbus_tcp_slave tcp;
static uint8_t reply[modbus_tcp_frame_max];
static uint64_t now_us;

void setUp(void)
{
    bench_begin();
    modbus_rtu_slave_init(&rtu, &bench_drive->map, address, modbus_rtu_timing_of(baud));
    modbus_tcp_slave_init(&tcp, &bench_drive->map);
    now_us = 1000000;
}

void tearDown(void)
{
    bench_end();
}

static uint32_t seal(uint8_t *frame, uint32_t size)
{
    uint16_t crc = modbus_crc16(frame, size);
    frame[size] = (uint8_t)crc;
    frame[size + 1] = (uint8_t)(crc >> 8);
    return size + 2;
}

/// Reads ORDER_PROBE.
static uint32_t make_read(uint8_t *out_frame)
{
    static const uint8_t request[] = {address, 3, 0, 2, 0, 2};
    memcpy(out_frame, request, sizeof request);
    return seal(out_frame, sizeof request);
}

static uint32_t feed(const uint8_t *bytes, uint32_t size, uint32_t gap_us)
{
    for (uint32_t i = 0; i < size; i++) {
        now_us += gap_us;
        TEST_ASSERT_EQUAL_UINT32(0, modbus_rtu_slave_poll(&rtu, now_us, reply));
        modbus_rtu_slave_byte(&rtu, bytes[i], now_us);
    }
    now_us += rtu.timing.t35_us;
    return modbus_rtu_slave_poll(&rtu, now_us, reply);
}

static void expect_probe(uint32_t length)
{
    static const uint8_t expected[] = {address, 3, 4, 1, 2, 3, 4};
    TEST_ASSERT_EQUAL_UINT32(9, length);
    TEST_ASSERT_EQUAL_UINT8_ARRAY(expected, reply, sizeof expected);
    TEST_ASSERT_EQUAL_UINT16(0, modbus_crc16(reply, 9));
}

static void test_modbus_crc_has_its_check_value(void)
{
    TEST_ASSERT_EQUAL_HEX16(0x4B37, modbus_crc16((const uint8_t *)"123456789", 9));
}

static void test_modbus_rtu_timing_follows_the_line(void)
{
    TEST_ASSERT_EQUAL_UINT32(1718, modbus_rtu_timing_of(9600).t15_us);
    TEST_ASSERT_EQUAL_UINT32(4010, modbus_rtu_timing_of(9600).t35_us);
    TEST_ASSERT_EQUAL_UINT32(750, modbus_rtu_timing_of(115200).t15_us);
    TEST_ASSERT_EQUAL_UINT32(1750, modbus_rtu_timing_of(115200).t35_us);
}

static void test_modbus_rtu_answers_after_the_silence_and_once(void)
{
    uint8_t frame[16];
    uint32_t size = make_read(frame);
    for (uint32_t i = 0; i < size; i++)
        modbus_rtu_slave_byte(&rtu, frame[i], now_us += byte_us);
    TEST_ASSERT_EQUAL_UINT32(0, modbus_rtu_slave_poll(&rtu, now_us + rtu.timing.t35_us - 1, reply));
    expect_probe(modbus_rtu_slave_poll(&rtu, now_us + rtu.timing.t35_us, reply));
    TEST_ASSERT_EQUAL_UINT32(0, modbus_rtu_slave_poll(&rtu, now_us + 10 * rtu.timing.t35_us, reply));
}

/// t1.5 to the microsecond, at each place of the frame.
static void test_modbus_rtu_spoils_a_frame_with_a_gap(void)
{
    uint8_t frame[16];
    uint32_t size = make_read(frame);
    for (uint32_t at = 1; at < size; at++)
        for (uint32_t beyond = 0; beyond < 2; beyond++) {
            for (uint32_t i = 0; i < size; i++)
                modbus_rtu_slave_byte(&rtu, frame[i], now_us += i == at ? rtu.timing.t15_us + beyond : byte_us);
            uint32_t length = modbus_rtu_slave_poll(&rtu, now_us += rtu.timing.t35_us, reply);
            TEST_ASSERT_EQUAL_UINT32(beyond ? 0 : 9, length);
        }
    TEST_ASSERT_EQUAL_UINT32(size - 1, rtu.count.spoiled);
    rtu.timing.t15_us = 0; // a host does not judge gaps
    expect_probe(feed(frame, size, rtu.timing.t35_us - 1));
}

static void test_modbus_rtu_ignores_every_truncation(void)
{
    uint8_t frame[16];
    uint32_t size = make_read(frame);
    for (uint32_t length = 1; length < size; length++)
        TEST_ASSERT_EQUAL_UINT32(0, feed(frame, length, byte_us));
    TEST_ASSERT_EQUAL_UINT32(0, rtu.count.answered);
    expect_probe(feed(frame, size, byte_us));
}

/// A command that is damaged in any one bit is not obeyed, nor in any two.
static void test_modbus_rtu_ignores_every_bit_error(void)
{
    static const uint8_t request[] = {address, 16, 0, 0x10, 0, 3, 6, 0, 1, 0, 0, 0, 9};
    uint8_t good[32], bad[32];
    memcpy(good, request, sizeof request);
    uint32_t size = seal(good, sizeof request);
    for (uint32_t first = 0; first < 8 * size; first++)
        for (uint32_t second = first; second < 8 * size; second++) {
            memcpy(bad, good, size);
            bad[first / 8] ^= (uint8_t)(1u << first % 8);
            if (second != first)
                bad[second / 8] ^= (uint8_t)(1u << second % 8);
            TEST_ASSERT_EQUAL_UINT32(0, modbus_rtu_slave_frame(&rtu, bad, size, reply));
        }
    TEST_ASSERT_EQUAL_INT(modbus_state_idle, bench_drive->map.resting);
    TEST_ASSERT_EQUAL_UINT32(8, modbus_rtu_slave_frame(&rtu, good, size, reply));
    TEST_ASSERT_EQUAL_INT(modbus_state_uploading, bench_drive->map.resting);
}

static void test_modbus_rtu_obeys_no_broadcast_and_no_other_address(void)
{
    for (unsigned other = 0; other < 256; other++) {
        uint8_t frame[32] = {(uint8_t)other, 16, 0, 0x10, 0, 3, 6, 0, 1, 0, 0, 0, 9};
        uint32_t size = seal(frame, 13);
        if (other != address)
            TEST_ASSERT_EQUAL_UINT32(0, modbus_rtu_slave_frame(&rtu, frame, size, reply));
    }
    TEST_ASSERT_EQUAL_UINT32(255, rtu.count.foreign);
    TEST_ASSERT_EQUAL_INT(modbus_state_idle, bench_drive->map.resting);
}

static void test_modbus_rtu_drops_what_is_too_long(void)
{
    uint8_t byte = 0;
    for (int i = 0; i < 300; i++)
        modbus_rtu_slave_byte(&rtu, byte, now_us += byte_us);
    TEST_ASSERT_EQUAL_UINT32(0, modbus_rtu_slave_poll(&rtu, now_us += rtu.timing.t35_us, reply));
    TEST_ASSERT_EQUAL_UINT32(1, rtu.count.spoiled);
    uint8_t frame[16];
    expect_probe(feed(frame, make_read(frame), byte_us));
}

// ---- Functions

static void expect_exception(const uint8_t *request, uint32_t size, enum modbus_exception exception)
{
    TEST_ASSERT_EQUAL_UINT32(2, modbus_pdu_answer(&bench_drive->map, true, request, size, reply));
    TEST_ASSERT_EQUAL_HEX8(request[0] | 0x80, reply[0]);
    TEST_ASSERT_EQUAL_UINT8(exception, reply[1]);
}

static void test_modbus_pdu_knows_five_functions(void)
{
    for (unsigned function = 0; function < 256; function++) {
        const uint8_t request[1] = {(uint8_t)function};
        bool known = function == 3 || function == 4 || function == 6 || function == 16 || function == 23;
        expect_exception(request, 1, known ? modbus_exception_value : modbus_exception_function);
    }
}

static void test_modbus_pdu_refuses_counts_and_lengths(void)
{
    static const struct {
        uint8_t bytes[16];
        uint32_t size;
        enum modbus_exception exception;
    } bad[] = {
        {{3, 0, 0, 0, 0}, 5, modbus_exception_value},
        {{3, 0, 0, 0, 126}, 5, modbus_exception_value},
        {{4, 0, 0, 1, 1}, 5, modbus_exception_value},
        {{3, 0, 0, 0, 1, 0}, 6, modbus_exception_value},
        {{3, 0, 0x13, 0, 1}, 5, modbus_exception_address},
        {{4, 0xFF, 0xFF, 0, 2}, 5, modbus_exception_address},
        {{6, 0, 0, 0, 1}, 5, modbus_exception_address},  // read only
        {{6, 0, 0x48, 0, 1}, 5, modbus_exception_value}, // half a number
        {{6, 0, 0x1F, 0}, 4, modbus_exception_value},
        {{16, 0, 0x1F, 0, 0, 0}, 6, modbus_exception_value},
        {{16, 0, 0x1F, 0, 1, 1, 5}, 7, modbus_exception_value},
        {{16, 0, 0x1F, 0, 1, 2, 5}, 7, modbus_exception_value},
        {{16, 0, 0x1F, 0, 124, 248}, 6, modbus_exception_value},
        {{16, 0, 0x1E, 0, 1, 2, 0, 0}, 8, modbus_exception_address},
        {{23, 0, 0x1F, 0, 1, 0, 0x1F, 0, 1, 2, 0}, 11, modbus_exception_value},
        {{23, 0, 0x1F, 0, 126, 0, 0x1F, 0, 1, 2, 0, 7}, 12, modbus_exception_value},
        {{23, 0, 0x1F, 0, 1, 0, 0x1F, 0, 0, 0}, 10, modbus_exception_value},
        {{23, 0, 0x13, 0, 1, 0, 0x1F, 0, 1, 2, 0, 7}, 12, modbus_exception_address},
        {{23, 0, 0x1F, 0, 1, 0, 0x20, 0, 1, 2, 0, 7}, 12, modbus_exception_address},
    };
    for (unsigned i = 0; i < sizeof bad / sizeof bad[0]; i++)
        expect_exception(bad[i].bytes, bad[i].size, bad[i].exception);
    TEST_ASSERT_EQUAL_UINT32(0, bench_drive->map.values[modbus_field_nonce]); // none of them has written
}

static void test_modbus_pdu_writes_and_reads_in_one_request(void)
{
    static const uint8_t one[] = {6, 0, 0x1F, 0x12, 0x34};
    static const uint8_t both[] = {23, 0, 0x1F, 0, 2, 0, 0x1F, 0, 1, 2, 0x56, 0x78};
    TEST_ASSERT_EQUAL_UINT32(5, modbus_pdu_answer(&bench_drive->map, true, one, sizeof one, reply));
    TEST_ASSERT_EQUAL_UINT8_ARRAY(one, reply, 5);
    TEST_ASSERT_EQUAL_UINT32(6, modbus_pdu_answer(&bench_drive->map, true, both, sizeof both, reply));
    TEST_ASSERT_EQUAL_HEX8(0x56, reply[2]);
    TEST_ASSERT_EQUAL_HEX8(0x78, reply[3]);
}

/// Exception 04: what the drive itself cannot do.
static void test_modbus_pdu_says_when_the_drive_cannot(void)
{
    struct modbus_host host;
    struct modbus_host_setup setup = bench_setup(0, 10);
    setup.run.velocity_limit = 1e-9f;
    TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_open(&host, &bench_link, 1));
    TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_upload(&host, bench_table, &setup, NULL, NULL));
    const uint8_t arm[] = {16, 0, 0x10, 0, 3, 6, 0, 3, 0xA5, 0xA5, 0x77, 0x77};
    expect_exception(arm, sizeof arm, modbus_exception_device);
}

// ---- TCP

static uint32_t make_tcp(uint8_t *out_frame, uint16_t transaction)
{
    const uint8_t request[] = {(uint8_t)(transaction >> 8), (uint8_t)transaction, 0, 0, 0, 6, 1, 3, 0, 2, 0, 2};
    memcpy(out_frame, request, sizeof request);
    return sizeof request;
}

static void test_modbus_tcp_takes_a_stream_in_any_pieces(void)
{
    uint8_t stream[3 * 12];
    uint32_t size = 0, length;
    for (uint16_t t = 0; t < 3; t++)
        size += make_tcp(stream + size, (uint16_t)(0x4100 + t));
    for (uint32_t piece = 1; piece <= size; piece++) {
        unsigned answers = 0;
        for (uint32_t at = 0; at < size;) {
            uint32_t count = size - at < piece ? size - at : piece;
            at += modbus_tcp_slave_take(&tcp, true, stream + at, count, reply, &length);
            if (length == 0)
                continue;
            TEST_ASSERT_EQUAL_UINT32(13, length);
            TEST_ASSERT_EQUAL_HEX8(answers++, reply[1]);
            TEST_ASSERT_EQUAL_HEX8(0x01, reply[9]);
        }
        TEST_ASSERT_EQUAL_UINT(3, answers);
    }
}

static void test_modbus_tcp_gives_up_on_what_is_none(void)
{
    static const uint8_t at[] = {2, 3, 4, 5, 5};
    static const uint8_t value[] = {1, 1, 1, 0, 1}; // protocol, protocol, too long, no unit, no function
    for (unsigned i = 0; i < sizeof at; i++) {
        uint8_t frame[12];
        uint32_t length, size = make_tcp(frame, 1);
        frame[at[i]] = value[i];
        modbus_tcp_slave_init(&tcp, &bench_drive->map);
        TEST_ASSERT_EQUAL_UINT32(size, modbus_tcp_slave_take(&tcp, true, frame, size, reply, &length));
        TEST_ASSERT_TRUE(tcp.broken);
        TEST_ASSERT_EQUAL_UINT32(0, length);
    }
}

static void test_modbus_tcp_lets_a_second_client_read_only(void)
{
    const uint8_t write_one[] = {0, 1, 0, 0, 0, 6, 1, 6, 0, 0x1F, 0, 7};
    uint8_t frame[12];
    uint32_t length;
    modbus_tcp_slave_take(&tcp, false, write_one, sizeof write_one, reply, &length);
    TEST_ASSERT_EQUAL_UINT32(9, length);
    TEST_ASSERT_EQUAL_HEX8(0x86, reply[7]);
    TEST_ASSERT_EQUAL_UINT8(modbus_exception_busy, reply[8]);
    TEST_ASSERT_FALSE(tcp.has_written);
    TEST_ASSERT_EQUAL_UINT32(0, bench_drive->map.values[modbus_field_nonce]);
    modbus_tcp_slave_take(&tcp, false, frame, make_tcp(frame, 1), reply, &length);
    TEST_ASSERT_EQUAL_UINT32(13, length);
    modbus_tcp_slave_take(&tcp, true, write_one, sizeof write_one, reply, &length);
    TEST_ASSERT_TRUE(tcp.has_written);
    TEST_ASSERT_EQUAL_UINT32(7, bench_drive->map.values[modbus_field_nonce]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_modbus_crc_has_its_check_value);
    RUN_TEST(test_modbus_rtu_timing_follows_the_line);
    RUN_TEST(test_modbus_rtu_answers_after_the_silence_and_once);
    RUN_TEST(test_modbus_rtu_spoils_a_frame_with_a_gap);
    RUN_TEST(test_modbus_rtu_ignores_every_truncation);
    RUN_TEST(test_modbus_rtu_ignores_every_bit_error);
    RUN_TEST(test_modbus_rtu_obeys_no_broadcast_and_no_other_address);
    RUN_TEST(test_modbus_rtu_drops_what_is_too_long);
    RUN_TEST(test_modbus_pdu_knows_five_functions);
    RUN_TEST(test_modbus_pdu_refuses_counts_and_lengths);
    RUN_TEST(test_modbus_pdu_writes_and_reads_in_one_request);
    RUN_TEST(test_modbus_pdu_says_when_the_drive_cannot);
    RUN_TEST(test_modbus_tcp_takes_a_stream_in_any_pieces);
    RUN_TEST(test_modbus_tcp_gives_up_on_what_is_none);
    RUN_TEST(test_modbus_tcp_lets_a_second_client_read_only);
    return UNITY_END();
}
