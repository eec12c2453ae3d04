/* SPDX-License-Identifier: MIT */
/// Frames as lines of text: every frame comes back, every split of the text and every wrong byte is judged.
#include "ports/slcan_codec.h"

#include <string.h>
#include <unity.h>

void setUp(void) {}

void tearDown(void) {}

/// Feeds text; counts the events of each kind, keeps the last frame.
struct heard {
    unsigned events[slcan_malformed + 1];
    struct can_frame frame;
};

static void feed(struct slcan_parser *parser, struct heard *heard, const char *text, size_t length)
{
    for (size_t i = 0; i < length; i++) {
        heard->events[slcan_parser_take(parser, text[i], &heard->frame)]++;
    }
}

static struct heard hear(const char *text)
{
    struct slcan_parser parser = {.length = 0};
    struct heard heard = {.frame = {.id = 0}};
    feed(&parser, &heard, text, strlen(text));
    return heard;
}

static struct can_frame sample_frame(unsigned id, unsigned length)
{
    struct can_frame frame = can_frame_make((uint16_t)id, (uint8_t)length);
    for (unsigned i = 0; i < length; i++) {
        frame.data[i] = (uint8_t)(id + 37 * i + 0xA0);
    }
    return frame;
}

static void assert_same(const struct can_frame *expected, const struct can_frame *actual)
{
    TEST_ASSERT_EQUAL_HEX16(expected->id, actual->id);
    TEST_ASSERT_EQUAL_UINT8(expected->length, actual->length);
    TEST_ASSERT_EQUAL(expected->remote, actual->remote);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(expected->data, actual->data, can_data_max);
}

static void test_slcan_codec_returns_every_frame(void)
{
    char text[slcan_frame_text_max];
    for (unsigned id = 0; id <= can_id_max; id++) {
        for (unsigned length = 0; length <= can_data_max; length++) {
            for (int remote = 0; remote < 2; remote++) {
                struct can_frame frame =
                    remote ? can_frame_make((uint16_t)id, (uint8_t)length) : sample_frame(id, length);
                frame.remote = remote != 0;
                size_t size = slcan_format(&frame, text);
                TEST_ASSERT_EQUAL_size_t(strlen(text), size);
                TEST_ASSERT_EQUAL_size_t(6 + (remote ? 0 : 2 * length), size);
                struct heard heard = hear(text);
                TEST_ASSERT_EQUAL_UINT(1, heard.events[slcan_frame]);
                assert_same(&frame, &heard.frame);
            }
        }
    }
}

static void test_slcan_codec_writes_what_adapters_read(void)
{
    char text[slcan_frame_text_max];
    struct can_frame frame = can_frame_make(0x605, 4);
    can_put(frame.data, 4, 0x00100040);
    slcan_format(&frame, text);
    TEST_ASSERT_EQUAL_STRING("t605440001000\r", text);
}

static void test_slcan_codec_reads_small_letters_and_time_stamps(void)
{
    struct heard heard = hear("t60524aBc1234\r");
    TEST_ASSERT_EQUAL_UINT(1, heard.events[slcan_frame]);
    TEST_ASSERT_EQUAL_HEX8(0x4A, heard.frame.data[0]);
    TEST_ASSERT_EQUAL_HEX8(0xBC, heard.frame.data[1]);
}

/// Two frames and an answer between them, cut into pieces at any two places: what is read does not depend on them.
static void test_slcan_codec_does_not_mind_splits(void)
{
    const char text[] = "t1238112233445566778\r\rz\rt60524ABC\r";
    const size_t length = sizeof text - 1;
    const struct heard whole = hear(text);
    TEST_ASSERT_EQUAL_UINT(1, whole.events[slcan_frame]); // the first lacks a digit
    TEST_ASSERT_EQUAL_UINT(1, whole.events[slcan_malformed]);
    TEST_ASSERT_EQUAL_UINT(2, whole.events[slcan_command]);
    for (size_t a = 0; a <= length; a++) {
        for (size_t b = a; b <= length; b++) {
            struct slcan_parser parser = {.length = 0};
            struct heard heard = {.frame = {.id = 0}};
            feed(&parser, &heard, text, a);
            feed(&parser, &heard, text + a, b - a);
            feed(&parser, &heard, text + b, length - b);
            TEST_ASSERT_EQUAL_UINT_ARRAY(whole.events, heard.events, slcan_malformed + 1);
            assert_same(&whole.frame, &heard.frame);
        }
    }
}

/// Every byte at every place of a line: another valid frame, or the line is refused; what follows is unharmed.
static void test_slcan_codec_survives_every_byte_at_every_place(void)
{
    const char line[] = "t60524ABC\r";
    for (size_t at = 0; at + 1 < sizeof line; at++) {
        for (int byte = 0; byte < 256; byte++) {
            char text[2 * sizeof line];
            struct slcan_parser parser = {.length = 0};
            struct heard heard = {.frame = {.id = 0}};
            memcpy(text, line, sizeof line);
            text[at] = (char)byte;
            feed(&parser, &heard, text, sizeof line - 1);
            feed(&parser, &heard, "\r", 1); // ends what the byte may have opened
            TEST_ASSERT_TRUE(heard.events[slcan_frame] <= 1);
            if (heard.events[slcan_frame] == 1) {
                TEST_ASSERT_TRUE(can_frame_is_valid(&heard.frame));
            }
            feed(&parser, &heard, line, sizeof line - 1);
            TEST_ASSERT_TRUE(heard.events[slcan_frame] >= 1);
            TEST_ASSERT_EQUAL_HEX16(0x605, heard.frame.id);
            TEST_ASSERT_EQUAL_HEX8(0x4A, heard.frame.data[0]);
        }
    }
}

static void test_slcan_codec_refuses_every_truncation(void)
{
    const char line[] = "t605811223344AABBCCDD";
    for (size_t length = 1; length < sizeof line - 1; length++) {
        struct slcan_parser parser = {.length = 0};
        struct heard heard = {.frame = {.id = 0}};
        feed(&parser, &heard, line, length);
        feed(&parser, &heard, "\r", 1);
        TEST_ASSERT_EQUAL_UINT_MESSAGE(1, heard.events[slcan_malformed], line);
        TEST_ASSERT_EQUAL_UINT(0, heard.events[slcan_frame]);
    }
}

static void test_slcan_codec_refuses_what_is_out_of_range(void)
{
    TEST_ASSERT_EQUAL_UINT(1, hear("t8000\r").events[slcan_malformed]); // identifier of 12 bits
    TEST_ASSERT_EQUAL_UINT(1, hear("t7FF9112233445566778899\r").events[slcan_malformed]);
    TEST_ASSERT_EQUAL_UINT(1, hear("T200000000\r").events[slcan_malformed]);
    TEST_ASSERT_EQUAL_UINT(1, hear("T1FFFFFFF0\r").events[slcan_extended]);
    TEST_ASSERT_EQUAL_UINT(1, hear("R000006052\r").events[slcan_extended]);
}

static void test_slcan_codec_drops_a_line_that_is_too_long(void)
{
    struct slcan_parser parser = {.length = 0};
    struct heard heard = {.frame = {.id = 0}};
    for (int i = 0; i < 1000; i++) {
        feed(&parser, &heard, "t", 1);
    }
    feed(&parser, &heard, "\rt60524ABC\r", 11);
    TEST_ASSERT_EQUAL_UINT(1, heard.events[slcan_malformed]);
    TEST_ASSERT_EQUAL_UINT(1, heard.events[slcan_frame]);
}

static void test_slcan_codec_knows_the_rates(void)
{
    TEST_ASSERT_EQUAL_CHAR('8', slcan_rate_digit(1000000));
    TEST_ASSERT_EQUAL_CHAR('6', slcan_rate_digit(500000));
    TEST_ASSERT_EQUAL_CHAR('0', slcan_rate_digit(10000));
    TEST_ASSERT_EQUAL_CHAR('\0', slcan_rate_digit(83333));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_slcan_codec_returns_every_frame);
    RUN_TEST(test_slcan_codec_writes_what_adapters_read);
    RUN_TEST(test_slcan_codec_reads_small_letters_and_time_stamps);
    RUN_TEST(test_slcan_codec_does_not_mind_splits);
    RUN_TEST(test_slcan_codec_survives_every_byte_at_every_place);
    RUN_TEST(test_slcan_codec_refuses_every_truncation);
    RUN_TEST(test_slcan_codec_refuses_what_is_out_of_range);
    RUN_TEST(test_slcan_codec_drops_a_line_that_is_too_long);
    RUN_TEST(test_slcan_codec_knows_the_rates);
    return UNITY_END();
}
