/* SPDX-License-Identifier: MIT */
#include "drivers/can/pdo.h"

#include "drivers/can/can_port.h"

#include <string.h>

bool pdo_is_enabled(const struct pdo *self)
{
    return !(self->cob_id & PDO_DISABLED);
}

bool pdo_is_synchronous(const struct pdo *self)
{
    return self->transmission_type <= 240;
}

/// Checks a mapping entry against the dictionary: exists, mappable in this direction, the right length. Returns an
/// abort code.
static uint32_t check_entry(const struct object_dictionary *dictionary, enum pdo_direction direction, uint32_t mapped,
                            struct od_place *out_place)
{
    uint32_t abort_code = od_locate(dictionary, (uint16_t)(mapped >> 16), (uint8_t)(mapped >> 8), out_place);
    if (abort_code != od_abort_none)
        return abort_code;
    uint8_t needed = direction == pdo_receive ? od_mappable_receive : od_mappable_transmit;
    if (!(out_place->entry->access & needed))
        return od_abort_not_mappable;
    if ((mapped & 0xFF) != 8u * od_type_size(out_place->entry->type))
        return od_abort_not_mappable;
    return od_abort_none;
}

uint32_t pdo_set_entry(struct pdo *self, const struct object_dictionary *dictionary, enum pdo_direction direction,
                       uint8_t number, uint32_t mapped)
{
    if (number < 1 || number > pdo_entries_max)
        return od_abort_no_subindex;
    if (pdo_is_enabled(self) || self->mapped_count != 0)
        return od_abort_access;
    struct od_place place = {0};
    uint32_t abort_code = mapped == 0 ? od_abort_none : check_entry(dictionary, direction, mapped, &place);
    if (abort_code == od_abort_none)
        self->mapped[number - 1] = mapped;
    return abort_code;
}

uint32_t pdo_set_count(struct pdo *self, const struct object_dictionary *dictionary, enum pdo_direction direction,
                       uint8_t count)
{
    if (pdo_is_enabled(self))
        return od_abort_access;
    if (count > pdo_entries_max)
        return od_abort_mapping_length;
    unsigned length = 0;
    struct od_place places[pdo_entries_max] = {{0}};
    for (uint8_t i = 0; i < count; i++) {
        uint32_t abort_code = check_entry(dictionary, direction, self->mapped[i], &places[i]);
        if (abort_code != od_abort_none)
            return abort_code;
        length += od_type_size(places[i].entry->type);
    }
    if (length > can_data_max)
        return od_abort_mapping_length;
    memcpy(self->places, places, sizeof places);
    self->mapped_count = count;
    self->length = (uint8_t)length;
    return od_abort_none;
}

uint32_t pdo_set_cob_id(struct pdo *self, uint32_t cob_id)
{
    if ((cob_id & ~(PDO_DISABLED | PDO_NO_REMOTE)) > can_id_max)
        return od_abort_value; // 29-bit identifiers are not ours
    if (pdo_is_enabled(self) && !(cob_id & PDO_DISABLED) && cob_id != self->cob_id)
        return od_abort_access;
    self->cob_id = cob_id;
    self->sent = false;
    self->pending = self->mixed = false;
    self->syncs = 0;
    return od_abort_none;
}

uint32_t pdo_set_transmission_type(struct pdo *self, enum pdo_direction direction, uint8_t type)
{
    bool synchronous = type <= 240 && !(direction == pdo_transmit && type == 0);
    if (!synchronous && type < 254)
        return od_abort_value;
    if (pdo_is_enabled(self) && type != self->transmission_type)
        return od_abort_access;
    self->transmission_type = type;
    return od_abort_none;
}

uint32_t pdo_set_inhibit_time(struct pdo *self, uint16_t inhibit_100us)
{
    if (pdo_is_enabled(self) && inhibit_100us != self->inhibit_100us)
        return od_abort_access;
    self->inhibit_100us = inhibit_100us;
    return od_abort_none;
}

bool pdo_take(struct pdo *self, const struct can_frame *frame)
{
    if (!pdo_is_enabled(self) || frame->id != (self->cob_id & can_id_max) || frame->remote)
        return false;
    if (frame->length < self->length) {
        self->wrong_length++;
        return false;
    }
    if (self->pending) {
        self->repeated++;
        self->mixed = self->mixed || memcmp(self->data, frame->data, sizeof self->data) != 0;
    }
    memcpy(self->data, frame->data, sizeof self->data);
    self->pending = true;
    return true;
}

unsigned pdo_apply(struct pdo *self)
{
    unsigned refused = 0;
    uint8_t at = 0;
    for (uint8_t i = 0; i < self->mapped_count; i++) {
        const struct od_entry *entry = self->places[i].entry;
        uint8_t size = od_type_size(entry->type);
        int64_t value = od_from_raw(entry->type, can_get(&self->data[at], size));
        if (od_write(&self->places[i], value) != od_abort_none)
            refused++;
        at = (uint8_t)(at + size);
    }
    self->pending = self->mixed = false;
    return refused;
}

struct can_frame pdo_make(const struct pdo *self)
{
    struct can_frame frame = can_frame_make((uint16_t)(self->cob_id & can_id_max), self->length);
    uint8_t at = 0;
    for (uint8_t i = 0; i < self->mapped_count; i++) {
        const struct od_entry *entry = self->places[i].entry;
        uint8_t size = od_type_size(entry->type);
        can_put(&frame.data[at], size, od_to_raw(entry->type, od_load(&self->places[i])));
        at = (uint8_t)(at + size);
    }
    return frame;
}

bool pdo_due(struct pdo *self)
{
    if (!pdo_is_enabled(self) || !pdo_is_synchronous(self))
        return false;
    self->syncs++;
    if (self->syncs < self->transmission_type)
        return false;
    self->syncs = 0;
    return true;
}

/// Whether a TPDO goes out with events rather than with SYNC.
static bool is_event_driven(const struct pdo *self)
{
    return pdo_is_enabled(self) && self->transmission_type >= 254;
}

uint64_t pdo_event_deadline_us(const struct pdo *self)
{
    if (!is_event_driven(self) || self->mapped_count == 0)
        return CAN_NEVER_US;
    if (!self->sent)
        return 0;
    struct can_frame frame = pdo_make(self);
    uint64_t inhibited_us = self->last_us + self->inhibit_100us * (uint64_t)100;
    if (memcmp(frame.data, self->data, sizeof self->data) != 0)
        return inhibited_us;
    if (self->event_ms == 0)
        return CAN_NEVER_US;
    uint64_t event_us = self->last_us + self->event_ms * (uint64_t)1000;
    return event_us > inhibited_us ? event_us : inhibited_us;
}

void pdo_event_sent(struct pdo *self, const struct can_frame *frame, uint64_t now_us)
{
    memcpy(self->data, frame->data, sizeof self->data);
    self->sent = true;
    self->last_us = now_us;
}
