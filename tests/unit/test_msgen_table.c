/* SPDX-License-Identifier: MIT */
/* Every field of the table's header at its limits and one beyond, with both CRCs right, so that each check is reached.
 * */
#include "core/bytes.h"
#include "core/crc32.h"
#include "msgen/table.h"

#include "unity.h"

#include <stdlib.h>
#include <string.h>

enum { samples = 20, channels = 3, bin_count = 3, room = 4096 };
static const uint32_t bins[bin_count] = {1, 4, 9};
static uint8_t bytes[room + 1];
static struct msgen_table table;

static void fill_table(enum msgen_format format)
{
    memset(&table, 0, sizeof table);
    table.rate_num_hz = 8000;
    table.rate_den = 3;
    table.period_samples = samples;
    table.bin_count = bin_count;
    table.start_index = 7;
    table.channels = channels;
    table.format = format;
    for (unsigned c = 0; c < channels; c++)
        table.scale_bits[c] = 0x3F800000u + c;
}

static size_t data_size(void)
{
    return (size_t)bin_count * 4u + (size_t)samples * channels * msgen_format_bytes(table.format);
}

/* bytes at `at`, header by hand after the encoder so that a field can be wrong */
static size_t build(enum msgen_format format)
{
    fill_table(format);
    uint8_t *data = bytes + msgen_header_bytes;
    for (unsigned b = 0; b < bin_count; b++)
        core_put_u32(data + 4u * b, bins[b]);
    for (unsigned i = 0; i < samples * channels; i++) {
        uint8_t *at = data + 4u * bin_count + i * msgen_format_bytes(format);
        if (format == msgen_format_i16)
            core_put_u16(at, (uint16_t)(0x8000u + i * 1110u));
        else
            core_put_u32(at, format == msgen_format_i32 ? 0x80000000u + i * 71582789u : 0x3F000000u + i);
    }
    table.data_crc32 = core_crc32(0, data, data_size());
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_table_encode_header(&table, bytes));
    return msgen_header_bytes + data_size();
}

/* Makes both CRCs right for whatever the bytes are now. */
static void sign(size_t size)
{
    core_put_u32(bytes + 48, core_crc32(0, bytes + msgen_header_bytes, size - msgen_header_bytes));
    core_put_u32(bytes + 52, core_crc32(0, bytes, 52));
}

static void expect_word(uint32_t offset, uint32_t value, enum core_status expected)
{
    struct msgen_table view;
    size_t size = build(msgen_format_i16);
    core_put_u32(bytes + offset, value);
    sign(size);
    TEST_ASSERT_EQUAL_INT_MESSAGE(expected, msgen_table_open(bytes, size, &view), core_status_str(expected));
    if (expected != core_ok && offset >= 8)
        TEST_ASSERT_EQUAL_UINT32(offset, view.fault_offset);
}

static void expect_byte(uint32_t offset, uint8_t value, enum core_status expected)
{
    struct msgen_table view;
    size_t size = build(msgen_format_i16);
    bytes[offset] = value;
    sign(size);
    TEST_ASSERT_EQUAL_INT(expected, msgen_table_open(bytes, size, &view));
    TEST_ASSERT_EQUAL_UINT32(offset, view.fault_offset);
}

void setUp(void)
{
    memset(bytes, 0xA5, sizeof bytes);
}

void tearDown(void) {}

static void test_table_reads_back_what_was_encoded(void)
{
    size_t size = build(msgen_format_i32);
    struct msgen_table view;
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_table_open(bytes, size, &view));
    TEST_ASSERT_EQUAL_UINT32(8000, view.rate_num_hz);
    TEST_ASSERT_EQUAL_UINT32(3, view.rate_den);
    TEST_ASSERT_EQUAL_UINT32(samples, view.period_samples);
    TEST_ASSERT_EQUAL_UINT32(channels, view.channels);
    TEST_ASSERT_EQUAL_UINT32(7, view.start_index);
    TEST_ASSERT_EQUAL_INT(msgen_format_i32, view.format);
    TEST_ASSERT_FALSE(view.linear);
    for (unsigned b = 0; b < bin_count; b++)
        TEST_ASSERT_EQUAL_UINT32(bins[b], msgen_table_bin(&view, b));
    for (unsigned c = 0; c < channels; c++) {
        TEST_ASSERT_EQUAL_HEX32(0x3F800000u + c, view.scale_bits[c]);
        for (unsigned n = 0; n < samples; n++)
            TEST_ASSERT_EQUAL_HEX32(0x80000000u + (n * channels + c) * 71582789u,
                                    (uint32_t)msgen_table_count(&view, n, c));
    }
    TEST_ASSERT_EQUAL_HEX32(core_crc32(0, bytes, 52), view.header_crc32);
}

static void test_table_reads_i16_and_f32(void)
{
    struct msgen_table view;
    size_t size = build(msgen_format_i16);
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_table_open(bytes, size, &view));
    TEST_ASSERT_EQUAL_INT32(-32768, msgen_table_count(&view, 0, 0));
    TEST_ASSERT_EQUAL_INT32(-32768 + 59 * 1110, msgen_table_count(&view, 19, 2));
    size = build(msgen_format_f32);
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_table_open(bytes, size, &view));
    TEST_ASSERT_EQUAL_HEX32(0x3F000000u + 59u, msgen_table_float_bits(&view, 19, 2));
}

static void test_table_opens_at_any_alignment(void)
{
    size_t size = build(msgen_format_i32);
    uint8_t moved[room];
    for (size_t shift = 0; shift < 8; shift++) {
        struct msgen_table view;
        memcpy(moved + shift, bytes, size);
        TEST_ASSERT_EQUAL_INT(core_ok, msgen_table_open(moved + shift, size, &view));
        TEST_ASSERT_EQUAL_HEX32(0x80000000u + 59u * 71582789u, (uint32_t)msgen_table_count(&view, 19, 2));
    }
}

static void test_table_refuses_null(void)
{
    struct msgen_table view;
    TEST_ASSERT_EQUAL_INT(core_err_argument, msgen_table_open(NULL, 0, &view));
    TEST_ASSERT_EQUAL_INT(core_err_argument, msgen_table_open(bytes, 0, NULL));
    TEST_ASSERT_EQUAL_INT(core_err_argument, msgen_table_encode_header(NULL, bytes));
    TEST_ASSERT_EQUAL_INT(core_err_argument, msgen_table_encode_header(&table, NULL));
}

static void test_table_refuses_each_field_out_of_range(void)
{
    expect_byte(0, 'm', core_err_table_magic);
    expect_byte(4, 0, core_err_table_version);
    expect_byte(4, 3, core_err_table_version);
    expect_byte(6, 0, core_err_table_channels);
    expect_byte(6, 4, core_err_table_channels);
    expect_byte(7, 0, core_err_table_format);
    expect_byte(7, 4, core_err_table_format);
    expect_word(8, 0, core_err_table_rate);
    expect_word(12, 0, core_err_table_rate);
    expect_word(16, 3, core_err_table_samples);
    expect_word(16, SERVOSCOPE_TABLE_SAMPLES_MAX + 1, core_err_table_samples);
    expect_word(16, 0xFFFFFFFFu, core_err_table_samples);
    expect_word(20, 0, core_err_table_bin_count);
    expect_word(20, 10, core_err_table_bin_count);
    expect_word(20, 0xFFFFFFFFu, core_err_table_bin_count);
    expect_word(24, samples - 1, core_ok);
    expect_word(24, samples, core_err_table_start);
    expect_word(28, 1, core_ok);
    expect_word(28, 2, core_err_table_unit);
    expect_word(44, 0, core_err_table_size);
    expect_word(44, bin_count * 4 + samples * channels * 2 + 1, core_err_table_size);
}

static void test_table_refuses_unusable_scales(void)
{
    static const uint32_t unusable[] = {
        0u,                                    /* zero */
        0x80000000u,                           /* minus zero */
        0x00000001u, 0x007FFFFFu,              /* denormal */
        0x7F800000u, 0x7FC00000u, 0xFF800000u, /* infinite, NaN, minus infinite */
        0xBF800000u,                           /* negative */
    };
    for (unsigned channel = 0; channel < channels; channel++) {
        for (unsigned i = 0; i < sizeof unusable / sizeof unusable[0]; i++)
            expect_word(32 + 4 * channel, unusable[i], core_err_table_scale);
        expect_word(32 + 4 * channel, 0x00800000u, core_ok);
        expect_word(32 + 4 * channel, 0x7F7FFFFFu, core_ok);
    }
}

static void test_table_refuses_scale_of_a_channel_that_is_not_there(void)
{
    fill_table(msgen_format_i16);
    table.channels = 2;
    TEST_ASSERT_EQUAL_INT(core_err_table_reserved, msgen_table_encode_header(&table, bytes));
    table.scale_bits[2] = 0;
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_table_encode_header(&table, bytes));
}

static void test_table_refuses_bins_out_of_order_or_range(void)
{
    expect_word(56, 0, core_err_table_bin_order);
    expect_word(60, 1, core_err_table_bin_order);
    expect_word(60, 0, core_err_table_bin_order);
    expect_word(64, 4, core_err_table_bin_order);
    expect_word(64, 5, core_ok);
    expect_word(64, samples / 2, core_err_table_bin_range);
    expect_word(64, 0xFFFFFFFFu, core_err_table_bin_range);
}

static void test_table_refuses_float_samples_that_are_not_finite(void)
{
    static const uint32_t not_finite[] = {0x7F800000u, 0xFF800000u, 0x7FC00000u, 0xFFFFFFFFu, 0x7F800001u};
    for (unsigned i = 0; i < sizeof not_finite / sizeof not_finite[0]; i++) {
        for (unsigned at = 0; at < samples * channels; at++) {
            struct msgen_table view;
            size_t size = build(msgen_format_f32);
            core_put_u32(bytes + msgen_header_bytes + 4 * bin_count + 4 * at, not_finite[i]);
            sign(size);
            TEST_ASSERT_EQUAL_INT(core_err_table_sample, msgen_table_open(bytes, size, &view));
            TEST_ASSERT_EQUAL_UINT32(msgen_header_bytes + 4 * bin_count + 4 * at, view.fault_offset);
        }
    }
}

static void test_table_refuses_every_truncation_and_anything_behind(void)
{
    static const enum msgen_format formats[] = {msgen_format_i16, msgen_format_i32, msgen_format_f32};
    for (unsigned f = 0; f < 3; f++) {
        size_t size = build(formats[f]);
        struct msgen_table view;
        for (size_t shorter = 0; shorter < size; shorter++) {
            /* A copy of the exact size, so that a sanitizer sees any read behind it. */
            uint8_t *cut = malloc(shorter ? shorter : 1);
            TEST_ASSERT_NOT_NULL(cut);
            memcpy(cut, bytes, shorter);
            TEST_ASSERT_EQUAL_INT(core_err_table_truncated, msgen_table_open(cut, shorter, &view));
            free(cut);
        }
        TEST_ASSERT_EQUAL_INT(core_err_table_trailing, msgen_table_open(bytes, size + 1, &view));
    }
}

static void test_table_refuses_every_changed_byte(void)
{
    size_t size = build(msgen_format_i16);
    struct msgen_table view;
    for (size_t at = 0; at < size; at++) {
        for (unsigned change = 1; change < 256; change++) {
            bytes[at] ^= (uint8_t)change;
            TEST_ASSERT_NOT_EQUAL(core_ok, msgen_table_open(bytes, size, &view));
            bytes[at] ^= (uint8_t)change;
        }
    }
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_table_open(bytes, size, &view));
}

static void test_table_names_the_crc_that_is_wrong(void)
{
    struct msgen_table view;
    size_t size = build(msgen_format_i16);
    bytes[9] ^= 1;
    TEST_ASSERT_EQUAL_INT(core_err_table_header_crc, msgen_table_open(bytes, size, &view));
    bytes[9] ^= 1;
    bytes[size - 1] ^= 1;
    TEST_ASSERT_EQUAL_INT(core_err_table_data_crc, msgen_table_open(bytes, size, &view));
}

static void test_table_encoder_leaves_the_bytes_alone_on_error(void)
{
    fill_table(msgen_format_i16);
    table.rate_den = 0;
    uint8_t before[sizeof bytes];
    memcpy(before, bytes, sizeof bytes);
    TEST_ASSERT_EQUAL_INT(core_err_table_rate, msgen_table_encode_header(&table, bytes));
    TEST_ASSERT_EQUAL_MEMORY(before, bytes, sizeof bytes);
    table.rate_den = 1;
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_table_encode_header(&table, bytes));
    TEST_ASSERT_EQUAL_HEX8(0xA5, bytes[msgen_header_bytes]);
}

/* The same table with travel: 8 more bytes of header, the rest moved. */
static size_t build_travelling(int64_t travel_q30)
{
    size_t size = build(msgen_format_i16);
    memmove(bytes + msgen_header_travel_bytes, bytes + msgen_header_bytes, size - msgen_header_bytes);
    table.travel_q30 = travel_q30;
    TEST_ASSERT_EQUAL_UINT32(msgen_header_travel_bytes, msgen_table_header_bytes(&table));
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_table_encode_header(&table, bytes));
    return msgen_header_travel_bytes + data_size();
}

static void sign_travelling(void)
{
    core_put_u32(bytes + 60, core_crc32(0, bytes, 60));
}

static void test_table_with_travel_reads_back(void)
{
    static const int64_t travels[] = {1, -1, 123456789012345, -((int64_t)1 << 61), (int64_t)1 << 61, -4294967296};
    for (unsigned i = 0; i < sizeof travels / sizeof travels[0]; i++) {
        struct msgen_table view;
        size_t size = build_travelling(travels[i]);
        TEST_ASSERT_EQUAL_UINT32(2, core_get_u16(bytes + 4));
        TEST_ASSERT_EQUAL_INT(core_ok, msgen_table_open(bytes, size, &view));
        TEST_ASSERT_EQUAL_INT64(travels[i], view.travel_q30);
        TEST_ASSERT_EQUAL_HEX32(core_crc32(0, bytes, 60), view.header_crc32);
        TEST_ASSERT_EQUAL_UINT32(bins[2], msgen_table_bin(&view, 2));
        TEST_ASSERT_EQUAL_INT32(-32768 + 59 * 1110, msgen_table_count(&view, 19, 2));
    }
}

static void test_table_without_travel_is_version_1_as_ever(void)
{
    struct msgen_table view;
    size_t size = build(msgen_format_i16);
    TEST_ASSERT_EQUAL_UINT32(1, core_get_u16(bytes + 4));
    TEST_ASSERT_EQUAL_UINT32(msgen_header_bytes, msgen_table_header_bytes(&table));
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_table_open(bytes, size, &view));
    TEST_ASSERT_EQUAL_INT64(0, view.travel_q30);
    /* What the encoder of the first version wrote for this table. */
    TEST_ASSERT_EQUAL_HEX32(0xbe5391f6, view.header_crc32);
}

static void test_table_refuses_travel_out_of_range(void)
{
    static const uint32_t out_of_range[][2] = {
        {0, 0},          /* none: that is version 1 */
        {1, 0x20000000}, /* 2^61 + 1 */
        {0, 0x80000000}, /* -2^63 */
    };
    struct msgen_table view;
    for (unsigned i = 0; i < sizeof out_of_range / sizeof out_of_range[0]; i++) {
        size_t size = build_travelling(77);
        core_put_u32(bytes + 52, out_of_range[i][0]);
        core_put_u32(bytes + 56, out_of_range[i][1]);
        sign_travelling();
        TEST_ASSERT_EQUAL_INT(core_err_table_travel, msgen_table_open(bytes, size, &view));
        TEST_ASSERT_EQUAL_UINT32(52, view.fault_offset);
    }
    fill_table(msgen_format_i16);
    table.travel_q30 = 77;
    table.channels = 2; /* no position to travel */
    table.scale_bits[2] = 0;
    TEST_ASSERT_EQUAL_INT(core_err_table_travel, msgen_table_encode_header(&table, bytes));
}

static void test_table_with_travel_refuses_every_truncation_and_changed_byte(void)
{
    struct msgen_table view;
    size_t size = build_travelling(-77);
    for (size_t shorter = 0; shorter < size; shorter++) {
        uint8_t *cut = malloc(shorter ? shorter : 1);
        TEST_ASSERT_NOT_NULL(cut);
        memcpy(cut, bytes, shorter);
        TEST_ASSERT_EQUAL_INT(core_err_table_truncated, msgen_table_open(cut, shorter, &view));
        free(cut);
    }
    TEST_ASSERT_EQUAL_INT(core_err_table_trailing, msgen_table_open(bytes, size + 1, &view));
    for (size_t at = 0; at < size; at++) {
        for (unsigned change = 1; change < 256; change++) {
            bytes[at] ^= (uint8_t)change;
            TEST_ASSERT_NOT_EQUAL(core_ok, msgen_table_open(bytes, size, &view));
            bytes[at] ^= (uint8_t)change;
        }
    }
    core_put_u32(bytes + 64, 0);
    core_put_u32(bytes + 48, core_crc32(0, bytes + 64, size - 64));
    sign_travelling();
    TEST_ASSERT_EQUAL_INT(core_err_table_bin_order, msgen_table_open(bytes, size, &view));
    TEST_ASSERT_EQUAL_UINT32(64, view.fault_offset);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_table_reads_back_what_was_encoded);
    RUN_TEST(test_table_reads_i16_and_f32);
    RUN_TEST(test_table_opens_at_any_alignment);
    RUN_TEST(test_table_refuses_null);
    RUN_TEST(test_table_refuses_each_field_out_of_range);
    RUN_TEST(test_table_refuses_unusable_scales);
    RUN_TEST(test_table_refuses_scale_of_a_channel_that_is_not_there);
    RUN_TEST(test_table_refuses_bins_out_of_order_or_range);
    RUN_TEST(test_table_refuses_float_samples_that_are_not_finite);
    RUN_TEST(test_table_refuses_every_truncation_and_anything_behind);
    RUN_TEST(test_table_refuses_every_changed_byte);
    RUN_TEST(test_table_names_the_crc_that_is_wrong);
    RUN_TEST(test_table_encoder_leaves_the_bytes_alone_on_error);
    RUN_TEST(test_table_with_travel_reads_back);
    RUN_TEST(test_table_without_travel_is_version_1_as_ever);
    RUN_TEST(test_table_refuses_travel_out_of_range);
    RUN_TEST(test_table_with_travel_refuses_every_truncation_and_changed_byte);
    return UNITY_END();
}
