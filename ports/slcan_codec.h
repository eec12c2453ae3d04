/* SPDX-License-Identifier: MIT */
/// The text protocol of Lawicel's serial CAN adapters: CAN frames and commands as lines of ASCII that end in CR.
///   tIIILDD..   data frame, 11-bit identifier      TIIIIIIIILDD..  29-bit: not ours, counted
///   rIIIL       remote frame                       RIIIIIIIIL      29-bit
///   Sn bit rate, O open, C close, ...              answers: CR done, BEL refused, z CR and Z CR frame taken
/// A line may come in any number of pieces, and several at once. No allocation, no input or output, no clock.
#ifndef SERVOSCOPE_PORTS_SLCAN_CODEC_H
#define SERVOSCOPE_PORTS_SLCAN_CODEC_H

#include "drivers/can/can_frame.h"

#include <stddef.h>
#include <stdint.h>

enum {
    slcan_line_max = 32, ///< longest line without its CR: T, 8 digits, length, 16 digits, 4 of a time stamp, and room
    slcan_frame_text_max = 23, ///< t, 3 digits, length, 16 digits, CR, and a terminating 0
    slcan_bell = 7,
};

enum slcan_event {
    slcan_more,      ///< the line goes on
    slcan_frame,     ///< a frame with an 11-bit identifier
    slcan_extended,  ///< a well-formed line of a 29-bit frame
    slcan_command,   ///< any other line: `line` has it, without its CR; an empty one is a plain "done"
    slcan_refused,   ///< BEL
    slcan_malformed, ///< a frame line that is none, or a line that is too long; it is dropped
};

struct slcan_parser {
    char line[slcan_line_max + 1]; ///< terminated once an event says so
    size_t length;
    bool overlong; ///< what comes is dropped up to the next CR
};

/// Takes one byte; `out_frame` is written with slcan_frame.
/// Test: tests/unit/test_slcan_codec.c (every byte at every place of a line, every split)
enum slcan_event slcan_parser_take(struct slcan_parser *self, char byte, struct can_frame *out_frame);

/// Writes a frame as a line with its CR and a terminating 0; its length without the 0.
size_t slcan_format(const struct can_frame *frame, char out_text[slcan_frame_text_max]);

/// The digit n of the command Sn for a bit rate, or 0 if there is none.
char slcan_rate_digit(uint32_t bitrate);

#endif
