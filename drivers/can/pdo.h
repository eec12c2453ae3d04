/* SPDX-License-Identifier: MIT */
/// Process data objects (CiA 301): a node's values in one frame, mapped at run time.
/// Mapping order, as real drives demand it: disable the PDO, set the count to 0, write the entries, set the count,
/// enable. Transmission types: RPDO 0..240 take effect at the next SYNC, 254 and 255 at once; TPDO 1..240 go out with
/// every n-th SYNC, 254 and 255 when a mapped value has changed or the event timer has run out, but not within the
/// inhibit time.
#ifndef SERVOSCOPE_DRIVERS_CAN_PDO_H
#define SERVOSCOPE_DRIVERS_CAN_PDO_H

#include "drivers/can/can_frame.h"
#include "drivers/can/object_dictionary.h"

#include <stdbool.h>
#include <stdint.h>

enum { pdo_entries_max = 8, pdo_per_direction = 4 };

/// Bits of the COB-ID parameter.
#define PDO_DISABLED  0x80000000u
#define PDO_NO_REMOTE 0x40000000u

enum pdo_direction { pdo_receive, pdo_transmit };

struct pdo {
    uint32_t cob_id;                  ///< 1400/1800 subindex 1
    uint8_t transmission_type;        ///< subindex 2
    uint8_t mapped_count;             ///< 1600/1A00 subindex 0
    uint32_t mapped[pdo_entries_max]; ///< index << 16 | subindex << 8 | bits
    struct od_place places[pdo_entries_max];
    uint16_t inhibit_100us; ///< subindex 3: shortest time between two event-driven TPDOs
    uint16_t event_ms;      ///< subindex 5: longest time between two event-driven TPDOs, 0: no such
    bool sent;              ///< an event-driven TPDO has gone out, at last_us, with `data`
    uint64_t last_us;
    uint8_t length;             ///< bytes of the mapped values
    uint8_t syncs;              ///< since a TPDO was last sent
    bool pending;               ///< an RPDO's data waits for SYNC
    bool mixed;                 ///< and it replaced different data that waited for the same SYNC
    uint8_t data[can_data_max]; ///< of an RPDO: received; of an event-driven TPDO: last sent
    uint32_t wrong_length;      ///< RPDOs that were too short for their mapping: not used
    uint32_t repeated;          ///< RPDOs that replaced one still waiting for SYNC
};

bool pdo_is_enabled(const struct pdo *self);

bool pdo_is_synchronous(const struct pdo *self);

/// Writes mapping entry 1..8; only while the PDO is disabled and the count is 0.
uint32_t pdo_set_entry(struct pdo *self, const struct object_dictionary *dictionary, enum pdo_direction direction,
                       uint8_t number, uint32_t mapped);

/// Writes the count; checks every entry and the total length.
uint32_t pdo_set_count(struct pdo *self, const struct object_dictionary *dictionary, enum pdo_direction direction,
                       uint8_t count);

/// Writes the COB-ID; changing any but the disable bit needs the PDO disabled.
uint32_t pdo_set_cob_id(struct pdo *self, uint32_t cob_id);

uint32_t pdo_set_transmission_type(struct pdo *self, enum pdo_direction direction, uint8_t type);

/// Writes a TPDO's inhibit time; only while it is disabled.
uint32_t pdo_set_inhibit_time(struct pdo *self, uint16_t inhibit_100us);

/// Keeps the data of a received frame; false if it is not this PDO's or too short.
bool pdo_take(struct pdo *self, const struct can_frame *frame);

/// Writes kept data to the mapped objects; returns how many values were refused.
unsigned pdo_apply(struct pdo *self);

/// Reads the mapped objects into a frame.
struct can_frame pdo_make(const struct pdo *self);

/// Whether a synchronous TPDO goes out with this SYNC; counts it.
bool pdo_due(struct pdo *self);

/// When an event-driven TPDO is due: at once if it has never been sent or has changed, but not within the inhibit time;
/// with the event timer at the latest. CAN_NEVER_US if nothing is pending.
uint64_t pdo_event_deadline_us(const struct pdo *self);

/// Remembers that it went out.
void pdo_event_sent(struct pdo *self, const struct can_frame *frame, uint64_t now_us);

#endif
