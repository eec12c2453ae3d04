/* SPDX-License-Identifier: MIT */
#include "ports/slcan_codec.h"

#include <stdbool.h>
#include <string.h>

static int hex_value(char digit)
{
    if (digit >= '0' && digit <= '9') {
        return digit - '0';
    }
    if (digit >= 'A' && digit <= 'F') {
        return digit - 'A' + 10;
    }
    return digit >= 'a' && digit <= 'f' ? digit - 'a' + 10 : -1;
}

/// Reads `count` hexadecimal digits; -1 if one is none.
static long hex_number(const char *text, size_t count)
{
    long value = 0;
    for (size_t i = 0; i < count; i++) {
        int digit = hex_value(text[i]);
        if (digit < 0) {
            return -1;
        }
        value = value * 16 + digit;
    }
    return value;
}

/// Reads the data's digits; false if one is none.
static bool read_data(const char *digits, struct can_frame *io_frame)
{
    for (size_t i = 0; i < io_frame->length; i++) {
        long byte = hex_number(&digits[2 * i], 2);
        if (byte < 0) {
            return false;
        }
        io_frame->data[i] = (uint8_t)byte;
    }
    return true;
}

/// What stands before the data.
struct head {
    bool extended, remote;
    size_t length;      ///< of the head itself
    size_t data_digits; ///< that follow it
    struct can_frame frame;
};

static bool read_head(const char *line, size_t length, struct head *out)
{
    out->extended = line[0] == 'T' || line[0] == 'R';
    out->remote = line[0] == 'r' || line[0] == 'R';
    out->length = out->extended ? 10 : 5;
    if (length < out->length) {
        return false;
    }
    const long id = hex_number(&line[1], out->length - 2), count = hex_number(&line[out->length - 1], 1);
    if (!(id >= 0 && id <= (out->extended ? 0x1FFFFFFF : can_id_max)) || !(count >= 0 && count <= can_data_max)) {
        return false;
    }
    out->data_digits = out->remote ? 0 : 2 * (size_t)count;
    out->frame = can_frame_make(out->extended ? 0 : (uint16_t)id, (uint8_t)count);
    out->frame.remote = out->remote;
    return true;
}

/// A line of t, r, T or R: identifier, length, data, perhaps four digits of a time stamp.
static enum slcan_event parse_frame(const char *line, size_t length, struct can_frame *out_frame)
{
    enum { stamp_digits = 4 };
    struct head head;
    if (!read_head(line, length, &head)) {
        return slcan_malformed;
    }
    const size_t body = head.length + head.data_digits;
    if (length != body && (length != body + stamp_digits || hex_number(&line[body], stamp_digits) < 0)) {
        return slcan_malformed;
    }
    if (!head.remote && !read_data(&line[head.length], &head.frame)) {
        return slcan_malformed;
    }
    if (head.extended) {
        return slcan_extended;
    }
    *out_frame = head.frame;
    return slcan_frame;
}

static enum slcan_event end_line(struct slcan_parser *self, struct can_frame *out_frame)
{
    const bool overlong = self->overlong;
    const size_t length = self->length;
    self->line[length] = '\0';
    self->length = 0;
    self->overlong = false;
    if (overlong) {
        return slcan_malformed;
    }
    return length > 0 && strchr("tTrR", self->line[0]) ? parse_frame(self->line, length, out_frame) : slcan_command;
}

enum slcan_event slcan_parser_take(struct slcan_parser *self, char byte, struct can_frame *out_frame)
{
    if (byte == '\r') {
        return end_line(self, out_frame);
    }
    if (byte == slcan_bell) {
        self->length = 0;
        self->overlong = false;
        return slcan_refused;
    }
    if (byte == '\n' && self->length == 0) { // some adapters end their lines in CR LF
        return slcan_more;
    }
    if (self->length == slcan_line_max) {
        self->overlong = true;
        return slcan_more;
    }
    self->line[self->length++] = byte == '\0' ? '?' : byte; // a 0 would hide what follows it
    return slcan_more;
}

size_t slcan_format(const struct can_frame *frame, char out_text[slcan_frame_text_max])
{
    static const char digits[] = "0123456789ABCDEF";
    size_t at = 0;
    out_text[at++] = frame->remote ? 'r' : 't';
    out_text[at++] = digits[frame->id >> 8 & 0xF];
    out_text[at++] = digits[frame->id >> 4 & 0xF];
    out_text[at++] = digits[frame->id & 0xF];
    out_text[at++] = digits[frame->length & 0xF];
    for (uint8_t i = 0; i < frame->length && i < can_data_max && !frame->remote; i++) {
        out_text[at++] = digits[frame->data[i] >> 4];
        out_text[at++] = digits[frame->data[i] & 0xF];
    }
    out_text[at++] = '\r';
    out_text[at] = '\0';
    return at;
}

char slcan_rate_digit(uint32_t bitrate)
{
    static const uint32_t rates[] = {10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000, 1000000};
    for (int i = 0; i < (int)(sizeof rates / sizeof rates[0]); i++) {
        if (rates[i] == bitrate) {
            return (char)('0' + i);
        }
    }
    return '\0';
}
