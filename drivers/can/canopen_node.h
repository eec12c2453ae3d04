/* SPDX-License-Identifier: MIT */
/// The communication half of a CANopen node (CiA 301): NMT, heartbeats, SYNC, EMCY, SDO server, PDOs, over an object
/// dictionary whose application part is somebody else's. No clock: times are arguments; no waiting.
/// Objects: 1000, 1001, 1003, 1005 (80h only), 1006, 1007, 1008, 1009, 100A, 1014, 1016, 1017, 1018, 1019, 1029, 1200,
/// 1400..1403, 1600..1603, 1800..1803, 1A00..1A03, 2001, 2002 (pdo_check.h). There is nothing to store, so 1010 and
/// 1011 do not exist.
/// On a SYNC it takes the set-points received before it, lets the application sample and control, and sends the TPDOs.
#ifndef SERVOSCOPE_DRIVERS_CAN_CANOPEN_NODE_H
#define SERVOSCOPE_DRIVERS_CAN_CANOPEN_NODE_H

#include "drivers/can/can_port.h"
#include "drivers/can/emcy.h"
#include "drivers/can/heartbeat.h"
#include "drivers/can/nmt.h"
#include "drivers/can/object_dictionary.h"
#include "drivers/can/pdo.h"
#include "drivers/can/sdo_server.h"
#include "drivers/can/sync.h"

#include <stdbool.h>
#include <stdint.h>

/// What the application does; every function must be there.
struct canopen_node_events {
    /// One SYNC: mapped objects hold the set-points. targets_fresh is false if a synchronous RPDO was missing, was
    /// meant for another SYNC or failed its check: then, where they carry a check (2002), the objects still hold what
    /// they held before, and otherwise what has come.
    void (*synchronise)(void *owner, uint64_t now_us, bool targets_fresh);
    /// SYNC (1.5 periods) or the master's heartbeat is missing, or NMT left operational; the code to report if it
    /// matters.
    void (*connection_lost)(void *owner, uint16_t emcy_code, uint64_t now_us);
    /// NMT reset: back to power-on values.
    void (*reset)(void *owner);
};

struct canopen_node_identity {
    uint32_t device_type, vendor, product, revision, serial;       ///< 1000, 1018
    const char *device_name, *hardware_version, *software_version; ///< 1008, 1009, 100A; NULL: ""
};

/// Sticky, since init.
struct canopen_node_errors {
    uint32_t targets_lost;     ///< SYNCs without a complete set of RPDOs
    uint32_t targets_rejected; ///< complete sets that were for another SYNC or failed their check
    uint32_t values_refused;   ///< mapped values out of their object's range
    uint32_t targets_outside;  ///< synchronous RPDOs after the window (1007)
    uint32_t frames_unsent;    ///< the port took them not
};

/// What a lost heartbeat does to the NMT state (object 1029:1).
enum canopen_error_behaviour {
    canopen_error_leaves_operational, ///< to pre-operational
    canopen_error_stays,              ///< after power-on: the fault is to be seen in the process data
    canopen_error_stops,
};

/// Segments of a block upload go out in bursts, so that SYNC and process data find room in the send queue: 4 x 135 bits
/// take 540 us at 1 Mbit/s.
enum { canopen_segment_burst = 4, canopen_segment_gap_us = 600 };

struct canopen_node {
    struct can_port port; ///< only `send` is used
    uint8_t node_id;
    enum nmt_state state;
    struct object_dictionary dictionary;
    const struct canopen_node_events *events;
    void *owner;
    uint64_t now_us; ///< of the call being served
    struct sdo_server sdo;
    struct heartbeat_producer producer;
    struct heartbeat_consumer consumer;
    struct sync_consumer sync;
    struct emcy_producer emcy;
    struct pdo rpdo[pdo_per_direction];
    struct pdo tpdo[pdo_per_direction];
    uint64_t segments_us; ///< when the next segments of a block upload may go out
    struct canopen_node_identity identity;
    struct od_data device_name, hardware_version, software_version;
    uint32_t consumer_entry;              ///< 1016:1, node << 16 | ms
    uint16_t heartbeat_ms;                ///< 1017
    uint8_t error_behaviour;              ///< 1029:1, enum canopen_error_behaviour
    uint32_t sync_cob_id, emcy_cob_id;    ///< 1005, 1014
    uint32_t sdo_cob_ids[2];              ///< 1200
    uint8_t sample_counter, sample_check; ///< 2001:1, :2
    uint8_t target_counter, target_check; ///< 2002:1, :2
    bool bus_was_off;
    struct canopen_node_errors errors;
};

/// Prepares the node; `entries` is the application's part of the dictionary, whose owner is `owner`.
/// Lifetime: port, entries, events and owner must outlive self, and self must not move.
void canopen_node_init(struct canopen_node *self, uint8_t node_id, const struct can_port *port,
                       const struct canopen_node_identity *identity, const struct od_entry *entries, size_t entry_count,
                       const struct canopen_node_events *events, void *owner);

/// Sends the boot-up message and goes to pre-operational.
void canopen_node_boot(struct canopen_node *self, uint64_t now_us);

/// Serves one received frame.
void canopen_node_receive(struct canopen_node *self, const struct can_frame *frame, uint64_t now_us);

/// Serves what is due by time: heartbeats, missing SYNC, missing master.
void canopen_node_advance(struct canopen_node *self, uint64_t now_us);

/// When canopen_node_advance is due next.
uint64_t canopen_node_deadline_us(const struct canopen_node *self);

/// Records an error and sends its EMCY.
void canopen_node_raise(struct canopen_node *self, uint16_t emcy_code, uint8_t register_bits);

/// Clears the error register and says so.
void canopen_node_clear_errors(struct canopen_node *self);

#endif
