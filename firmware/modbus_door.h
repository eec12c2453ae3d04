/* SPDX-License-Identifier: MIT */
/// The axis on Modbus RTU: the register map's device, its slave, and, in place of a serial line, a buffer each way with
/// a master at the other end that uploads the table, arms, starts, keeps the watchdog content and reads the spectrum.
#ifndef SERVOSCOPE_FIRMWARE_MODBUS_DOOR_H
#define SERVOSCOPE_FIRMWARE_MODBUS_DOOR_H

#include "drivers/modbus/slave_rtu.h"
#include "firmware/results.h"

enum { modbus_door_address = 1, modbus_door_table_bytes = 24576 };

/// A frame on its way; one writer at a time.
struct modbus_line {
    uint8_t bytes[modbus_rtu_frame_max];
    uint32_t size; ///< 0: none
};

struct modbus_door {
    struct modbus_map map;
    struct modbus_rtu_slave slave;
    struct modbus_record snapshot[results_bins_max];
    struct modbus_line to_slave, to_master;
    uint16_t sequence;     ///< of the master's commands
    uint32_t step, offset; ///< of the master: what it is at, and how far with that
    uint64_t asked_us;
    bool waiting; ///< for a reply
    uint32_t requests, refused;
    struct modbus_record readings[results_bins_max]; ///< what the master has read
    uint32_t bins_read, read_count;
};

/// Errors: those of modbus_map_init()
enum core_status modbus_door_init(struct modbus_door *self);

/// The slave's side: takes what has arrived, answers when the line has been silent.
void modbus_door_serve(struct modbus_door *self, uint64_t now_us);

/// The master's side; `table` is uploaded first. True when the spectrum is read, or something was refused.
bool modbus_door_measure(struct modbus_door *self, const uint8_t *table, uint32_t table_bytes, uint64_t now_us);

#endif
