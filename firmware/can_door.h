/* SPDX-License-Identifier: MIT */
/// The results on CANopen: manufacturer objects behind the node's SDO server, and, in place of a bus, two queues in
/// memory with a master at their other end that reads the whole frequency response.
#ifndef SERVOSCOPE_FIRMWARE_CAN_DOOR_H
#define SERVOSCOPE_FIRMWARE_CAN_DOOR_H

#include "drivers/can/canopen_node.h"
#include "drivers/can/sdo_client.h"
#include "firmware/results.h"

enum { can_door_queue_frames = 8, can_door_node_id = 5 };

struct can_queue {
    struct can_frame frames[can_door_queue_frames];
    uint32_t put, taken; ///< since the start; one writer each
};

/// What the node offers, object 2200; real numbers are the bits of an IEEE single.
struct can_results {
    uint32_t periods;         ///< :1 periods that count
    uint16_t bin;             ///< :2 which bin the rest is about; writable
    uint32_t real, imaginary; ///< :3 :4 rad/s per Nm
    uint32_t std;             ///< :5
    uint8_t validity;         ///< :6 enum frf_validity
    const struct results *source;
};

/// What the master has read of one bin.
struct can_reading {
    uint32_t real, imaginary, std;
    uint8_t validity;
};

struct can_door {
    struct canopen_node node;
    struct can_queue to_node, to_master;
    struct can_results results;
    struct sdo_client client;
    uint32_t step; ///< of the master: a request each
    struct can_reading readings[results_bins_max];
    uint32_t heartbeats, aborted, answered;
};

void can_door_init(struct can_door *self, const struct results *results);

/// The node's side: serves what has arrived and what is due.
void can_door_serve(struct can_door *self, uint64_t now_us);

/// The master's side: takes what has arrived and asks for more; true when it has read every bin.
bool can_door_read_all(struct can_door *self);

#endif
