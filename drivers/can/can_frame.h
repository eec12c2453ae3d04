/* SPDX-License-Identifier: MIT */
/// One classical CAN frame with an 11-bit identifier, its little-endian payload and its length on the wire.
#ifndef SERVOSCOPE_DRIVERS_CAN_FRAME_H
#define SERVOSCOPE_DRIVERS_CAN_FRAME_H

#include <stdbool.h>
#include <stdint.h>

enum { can_data_max = 8, can_id_max = 0x7FF };

struct can_frame {
    uint16_t id;                ///< 0 .. can_id_max; the smaller one wins the bus
    uint8_t length;             ///< bytes in data, 0 .. can_data_max
    bool remote;                ///< a request without data; nothing here answers one
    uint8_t data[can_data_max]; ///< bytes from `length` on are 0
};

/// Makes an empty data frame.
struct can_frame can_frame_make(uint16_t id, uint8_t length);

/// Whether identifier and length are within range.
bool can_frame_is_valid(const struct can_frame *frame);

/// Writes the low `size` bytes (0..4) of `value`, least significant first.
void can_put(uint8_t *out_data, uint8_t size, uint32_t value);

/// Reads `size` bytes (0..4), least significant first.
uint32_t can_get(const uint8_t *data, uint8_t size);

/// Longest time a data frame of `length` bytes can take on the wire, in bits, intermission included.
/// Equation:  47 + 8 n + floor((34 + 8 n - 1) / 4)   (n = 0: 55, 4: 95, 6: 115, 8: 135)
/// Range:     length 0..8; more counts as 8
/// Test:      tests/unit/test_inproc_bus.c
unsigned can_frame_bits_worst(unsigned length);

/// Time this very frame takes on the wire, in bits, stuff bits counted one by one, intermission included.
/// Range:     between 47 + 8 n and can_frame_bits_worst(n)
unsigned can_frame_bits_exact(const struct can_frame *frame);

#endif
