/* SPDX-License-Identifier: MIT */
/// The communication half of a CANopen master for one node: frames in and out, SDO with bounded waits, NMT, heartbeats.
/// Time is the port's. Every function that waits says how long at most.
#ifndef SERVOSCOPE_DRIVERS_CAN_CANOPEN_MASTER_H
#define SERVOSCOPE_DRIVERS_CAN_CANOPEN_MASTER_H

#include "drivers/can/can_port.h"
#include "drivers/can/emcy.h"
#include "drivers/can/heartbeat.h"
#include "drivers/can/nmt.h"
#include "drivers/can/sdo_client.h"
#include "drivers/can/sync.h"

#include <stdbool.h>
#include <stdint.h>

/// Abort code for "the bus is off or gone", besides those of CiA 301.
#define CANOPEN_BUS_LOST 0xFFFFFFFFu

enum { canopen_master_sdo_attempts = 3 };

struct canopen_master {
    struct can_port port;
    uint8_t node_id;         ///< of the drive
    uint8_t master_id;       ///< in our own heartbeat
    uint32_t sdo_timeout_us; ///< for one answer
    struct sdo_client sdo;
    struct heartbeat_producer producer;
    struct heartbeat_consumer consumer;
    struct sync_producer sync;
    struct emcy_message emergency; ///< last one that reported an error
    uint32_t emergencies;          ///< those with a code other than 0
    uint32_t unexpected;           ///< frames of our node that are nothing we know
    enum can_status status;        ///< sticky: bus off or gone
    /// Process data of the node: frames 180..57F with its number.
    void (*on_process_data)(void *owner, const struct can_frame *frame);
    void *owner;
};

void canopen_master_init(struct canopen_master *self, const struct can_port *port, uint8_t node_id, uint8_t master_id,
                         uint32_t sdo_timeout_us);

uint64_t canopen_master_time_us(const struct canopen_master *self);

/// Sends; remembers a lost bus in `status`. can_err_full is not sticky.
enum can_status canopen_master_send(struct canopen_master *self, const struct can_frame *frame);

/// Serves what has arrived and what is due; waits for a frame until `until_us` at most. Call in a loop with the
/// condition.
enum can_status canopen_master_step(struct canopen_master *self, uint64_t until_us);

/// Serves the bus until `until_us`, whatever comes.
enum can_status canopen_master_serve(struct canopen_master *self, uint64_t until_us);

/// Reads an object of `size` bytes. Waits at most canopen_master_sdo_attempts time-outs. Returns an abort code;
/// od_abort_timeout if there was no answer, CANOPEN_BUS_LOST if there is no bus.
uint32_t canopen_master_read(struct canopen_master *self, uint16_t index, uint8_t subindex, uint8_t size,
                             uint32_t *out_value);

/// Reads until two readings in a row agree (three tries): for numbers on which every later value depends.
uint32_t canopen_master_read_surely(struct canopen_master *self, uint16_t index, uint8_t subindex, uint8_t size,
                                    uint32_t *out_value);

/// Writes an object.
uint32_t canopen_master_write(struct canopen_master *self, uint16_t index, uint8_t subindex, uint8_t size,
                              uint32_t value);

/// Writes and reads back; od_abort_incompatible if what is read, under `mask`, is not what was written.
uint32_t canopen_master_write_surely(struct canopen_master *self, uint16_t index, uint8_t subindex, uint8_t size,
                                     uint32_t value, uint32_t mask);

/// Reads a string or a domain into `room`. In blocks; in segments if the server has no blocks. Waits at most
/// canopen_master_sdo_attempts times a time-out per segment; usually a few ms. Errors: as canopen_master_read, and
/// od_abort_memory if it does not fit.
/// Test: tests/api/test_canopen_bus.c
uint32_t canopen_master_read_data(struct canopen_master *self, uint16_t index, uint8_t subindex, uint8_t *room,
                                  uint32_t capacity, uint32_t *out_size);

/// Writes a string or a domain, likewise.
uint32_t canopen_master_write_data(struct canopen_master *self, uint16_t index, uint8_t subindex, const uint8_t *bytes,
                                   uint32_t size);

#endif
