/* SPDX-License-Identifier: MIT */
#include "core/bytes.h"
#include "core/crc32.h"
#include "core/fixed.h"
#include "core/status.h"

#include "unity.h"

#include <string.h>

void setUp(void) {}

void tearDown(void) {}

/* The polynomial's definition, bit by bit: shares nothing with the table of the implementation. */
static uint32_t crc_by_definition(const uint8_t *bytes, size_t size)
{
    uint32_t crc = 0xFFFFFFFFu;
    for (size_t i = 0; i < size; i++) {
        for (int bit = 0; bit < 8; bit++) {
            uint32_t feedback = (crc ^ ((uint32_t)bytes[i] >> bit)) & 1u;
            crc = (crc >> 1) ^ (feedback ? 0xEDB88320u : 0u);
        }
    }
    return ~crc;
}

static void test_crc_has_published_check_value(void)
{
    TEST_ASSERT_EQUAL_HEX32(0xCBF43926u, core_crc32(0, "123456789", 9));
    TEST_ASSERT_EQUAL_HEX32(0, core_crc32(0, "", 0));
    TEST_ASSERT_EQUAL_HEX32(0xD202EF8Du, core_crc32(0, "\0", 1));
}

static void test_crc_equals_definition_for_every_byte(void)
{
    for (unsigned first = 0; first < 256; first++) {
        for (unsigned second = 0; second < 256; second++) {
            uint8_t bytes[2] = {(uint8_t)first, (uint8_t)second};
            TEST_ASSERT_EQUAL_HEX32(crc_by_definition(bytes, 2), core_crc32(0, bytes, 2));
        }
    }
}

static void test_crc_does_not_depend_on_pieces(void)
{
    uint8_t bytes[64];
    for (unsigned i = 0; i < sizeof bytes; i++)
        bytes[i] = (uint8_t)(i * 73u + 11u);
    uint32_t whole = core_crc32(0, bytes, sizeof bytes);
    for (size_t cut = 0; cut <= sizeof bytes; cut++)
        TEST_ASSERT_EQUAL_HEX32(whole, core_crc32(core_crc32(0, bytes, cut), bytes + cut, sizeof bytes - cut));
}

static void test_bytes_round_trip_at_any_alignment(void)
{
    static const uint32_t values[] = {0u, 1u, 0x7FFFFFFFu, 0x80000000u, 0xFFFFFFFFu, 0x12345678u};
    uint8_t room[16];
    for (unsigned shift = 0; shift < 4; shift++) {
        for (unsigned v = 0; v < sizeof values / sizeof values[0]; v++) {
            core_put_u32(room + shift, values[v]);
            TEST_ASSERT_EQUAL_HEX32(values[v], core_get_u32(room + shift));
            TEST_ASSERT_EQUAL_HEX32(values[v], (uint32_t)core_get_i32(room + shift));
            core_put_u16(room + shift, (uint16_t)values[v]);
            TEST_ASSERT_EQUAL_HEX16((uint16_t)values[v], core_get_u16(room + shift));
            TEST_ASSERT_EQUAL_HEX16((uint16_t)values[v], (uint16_t)core_get_i16(room + shift));
        }
    }
    core_put_u32(room, 0x12345678u);
    TEST_ASSERT_EQUAL_HEX8(0x78, room[0]);
    TEST_ASSERT_EQUAL_HEX8(0x12, room[3]);
}

static void test_round_shift_is_odd_and_rounds_halves_away(void)
{
    TEST_ASSERT_EQUAL_INT64(1, core_round_shift_i64(1, 1));
    TEST_ASSERT_EQUAL_INT64(-1, core_round_shift_i64(-1, 1));
    TEST_ASSERT_EQUAL_INT64(0, core_round_shift_i64(1, 2));
    TEST_ASSERT_EQUAL_INT64(INT64_C(1) << 32, core_round_shift_i64(INT64_C(1) << 62, 30));
    for (int64_t value = 0; value < 100; value++)
        TEST_ASSERT_EQUAL_INT64(-core_round_shift_i64(value, 3), core_round_shift_i64(-value, 3));
    TEST_ASSERT_EQUAL_INT32(INT32_MIN, core_scale_q30(INT32_MIN, CORE_Q30_ONE));
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, core_scale_q30(INT32_MAX, CORE_Q30_ONE));
}

static void test_saturate_clips_and_says_so(void)
{
    bool saturated = false;
    TEST_ASSERT_EQUAL_INT32(100, core_saturate_i32(100, 100, &saturated));
    TEST_ASSERT_EQUAL_INT32(-100, core_saturate_i32(-100, 100, &saturated));
    TEST_ASSERT_FALSE(saturated);
    TEST_ASSERT_EQUAL_INT32(100, core_saturate_i32(101, 100, &saturated));
    TEST_ASSERT_TRUE(saturated);
    saturated = false;
    TEST_ASSERT_EQUAL_INT32(-100, core_saturate_i32(-101, 100, &saturated));
    TEST_ASSERT_TRUE(saturated);
    saturated = false;
    TEST_ASSERT_EQUAL_INT32(-INT32_MAX, core_saturate_i32(INT64_MIN, INT32_MAX, &saturated));
    TEST_ASSERT_TRUE(saturated);
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, core_count_up(UINT32_MAX));
    TEST_ASSERT_EQUAL_UINT32(1, core_count_up(0));
}

static void test_status_text_differs_for_every_status(void)
{
    for (int a = 0; a > -100; a--) {
        TEST_ASSERT_NOT_NULL(core_status_str((enum core_status)a));
        for (int b = a - 1; b > -100; b--) {
            const char *text = core_status_str((enum core_status)a);
            if (strcmp(text, "unknown status") != 0)
                TEST_ASSERT_NOT_EQUAL(0, strcmp(text, core_status_str((enum core_status)b)));
        }
    }
    TEST_ASSERT_EQUAL_STRING("ok", core_status_str(core_ok));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_crc_has_published_check_value);
    RUN_TEST(test_crc_equals_definition_for_every_byte);
    RUN_TEST(test_crc_does_not_depend_on_pieces);
    RUN_TEST(test_bytes_round_trip_at_any_alignment);
    RUN_TEST(test_round_shift_is_odd_and_rounds_halves_away);
    RUN_TEST(test_saturate_clips_and_says_so);
    RUN_TEST(test_status_text_differs_for_every_status);
    return UNITY_END();
}
