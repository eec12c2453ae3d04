/* SPDX-License-Identifier: MIT */
/// Modbus RTU slave: bytes with their times in, replies out. No clock: times are arguments, in microseconds of any
/// origin. A frame ends with a silence of t3.5; a silence of more than t1.5 inside it spoils it.
/// Broadcasts (address 0) are not obeyed: nothing that moves should listen to a request that nobody answers.
#ifndef SERVOSCOPE_DRIVERS_MODBUS_SLAVE_RTU_H
#define SERVOSCOPE_DRIVERS_MODBUS_SLAVE_RTU_H

#include "drivers/modbus/register_map.h"

enum { modbus_rtu_frame_max = 256, modbus_rtu_frame_least = 4 };

struct modbus_rtu_timing {
    uint32_t t15_us; ///< 0: gaps inside a frame are not judged (a host's serial port delivers bytes in lumps)
    uint32_t t35_us;
};

/// Equation: 1.5 and 3.5 characters of 11 bits; 750 and 1750 us above 19200 bit/s, as the standard recommends
struct modbus_rtu_timing modbus_rtu_timing_of(uint32_t bits_per_s);

/// Read-only for the application.
struct modbus_rtu_slave {
    struct modbus_map *map;
    uint8_t address;
    struct modbus_rtu_timing timing;
    uint8_t frame[modbus_rtu_frame_max];
    uint32_t size;
    bool spoiled; ///< too long, or a gap inside
    uint64_t last_us;
    struct {
        uint32_t answered; ///< frames for this slave, exceptions included
        uint32_t foreign;  ///< for other addresses, broadcasts included
        uint32_t bad_crc;
        uint32_t spoiled; ///< too short, too long, with a gap, or ended by a byte before they were polled
    } count;
};

/// Range: address 1 .. 247
void modbus_rtu_slave_init(struct modbus_rtu_slave *self, struct modbus_map *map, uint8_t address,
                           struct modbus_rtu_timing timing);

/// Takes one byte that arrived at now_us. Call modbus_rtu_slave_poll() with the same time before it, or a frame that
/// has ended in between is lost.
void modbus_rtu_slave_byte(struct modbus_rtu_slave *self, uint8_t byte, uint64_t now_us);

/// Whether the silence since the last byte has ended a frame; then answers it.
/// Returns: length of the reply in out_reply (modbus_rtu_frame_max bytes), 0: nothing to send
uint32_t modbus_rtu_slave_poll(struct modbus_rtu_slave *self, uint64_t now_us, uint8_t *out_reply);

/// Answers a whole frame, for ports that find the ends of frames themselves.
uint32_t modbus_rtu_slave_frame(struct modbus_rtu_slave *self, const uint8_t *frame, uint32_t size, uint8_t *out_reply);

#endif
