/* SPDX-License-Identifier: MIT */
#include "drivers/can/object_dictionary.h"

#include <string.h>

uint8_t od_type_size(uint8_t type)
{
    switch (type) {
    case od_u8:
    case od_i8:
        return 1;
    case od_u16:
    case od_i16:
        return 2;
    case od_string:
    case od_domain:
        return 0;
    default:
        return 4;
    }
}

struct od_data *od_data_of(const struct od_place *place)
{
    if (od_type_size(place->entry->type) != 0)
        return NULL;
    return (struct od_data *)(void *)((char *)place->owner + place->entry->offset);
}

static bool type_is_signed(uint8_t type)
{
    return type == od_i8 || type == od_i16 || type == od_i32;
}

uint32_t od_locate(const struct object_dictionary *self, uint16_t index, uint8_t subindex, struct od_place *out_place)
{
    bool index_known = false;
    for (size_t s = 0; s < self->section_count; s++) {
        const struct od_section *section = &self->sections[s];
        for (size_t i = 0; i < section->count; i++) {
            const struct od_entry *entry = &section->entries[i];
            if (entry->index != index)
                continue;
            index_known = true;
            if (entry->subindex == subindex) {
                *out_place = (struct od_place){.entry = entry, .owner = section->owner};
                return od_abort_none;
            }
        }
    }
    return index_known ? od_abort_no_subindex : od_abort_no_object;
}

int64_t od_from_raw(uint8_t type, uint32_t raw)
{
    unsigned bits = 8u * od_type_size(type);
    int64_t value = (int64_t)(raw & (uint32_t)(((uint64_t)1 << bits) - 1));
    if (type_is_signed(type) && value >= (int64_t)1 << (bits - 1))
        value -= (int64_t)1 << bits;
    return value;
}

uint32_t od_to_raw(uint8_t type, int64_t value)
{
    unsigned bits = 8u * od_type_size(type);
    return (uint32_t)((uint64_t)value & (((uint64_t)1 << bits) - 1));
}

int64_t od_load(const struct od_place *place)
{
    const struct od_entry *entry = place->entry;
    if (entry->access & od_constant)
        return entry->constant;
    // The value is kept as a C integer of the entry's size: copy it in the machine's own byte order.
    const char *from = (const char *)place->owner + entry->offset;
    uint8_t value8;
    uint16_t value16;
    uint32_t value32;
    switch (od_type_size(entry->type)) {
    case 0:
        return 0;
    case 1:
        memcpy(&value8, from, sizeof value8);
        return od_from_raw(entry->type, value8);
    case 2:
        memcpy(&value16, from, sizeof value16);
        return od_from_raw(entry->type, value16);
    default:
        memcpy(&value32, from, sizeof value32);
        return od_from_raw(entry->type, value32);
    }
}

void od_store(void *owner, const struct od_entry *entry, int64_t value)
{
    char *to = (char *)owner + entry->offset;
    uint32_t raw = od_to_raw(entry->type, value);
    uint8_t value8 = (uint8_t)raw;
    uint16_t value16 = (uint16_t)raw;
    switch (od_type_size(entry->type)) {
    case 0:
        break;
    case 1:
        memcpy(to, &value8, sizeof value8);
        break;
    case 2:
        memcpy(to, &value16, sizeof value16);
        break;
    default:
        memcpy(to, &raw, sizeof raw);
        break;
    }
}

uint32_t od_write(const struct od_place *place, int64_t value)
{
    const struct od_entry *entry = place->entry;
    if (entry->access & od_constant)
        return od_abort_read_only;
    bool number = od_type_size(entry->type) != 0;
    if (number && od_from_raw(entry->type, od_to_raw(entry->type, value)) != value)
        return od_abort_value;
    if (entry->write)
        return entry->write(place->owner, entry, value);
    od_store(place->owner, entry, value);
    return od_abort_none;
}

const char *od_abort_str(uint32_t abort_code)
{
    static const struct {
        uint32_t code;
        const char *text;
    } texts[] = {
        {od_abort_none, "no error"},
        {od_abort_toggle, "toggle bit not alternated"},
        {od_abort_timeout, "SDO timed out"},
        {od_abort_command, "command specifier not valid or unknown"},
        {od_abort_block_size, "invalid block size"},
        {od_abort_sequence, "invalid sequence number"},
        {od_abort_crc, "CRC error"},
        {od_abort_memory, "out of memory"},
        {od_abort_access, "unsupported access"},
        {od_abort_write_only, "object can only be written"},
        {od_abort_read_only, "object can only be read"},
        {od_abort_no_object, "object does not exist"},
        {od_abort_not_mappable, "object cannot be mapped"},
        {od_abort_mapping_length, "mapped objects exceed the PDO's length"},
        {od_abort_incompatible, "incompatible parameter"},
        {od_abort_length, "length does not match"},
        {od_abort_too_long, "data too long"},
        {od_abort_too_short, "data too short"},
        {od_abort_no_subindex, "subindex does not exist"},
        {od_abort_value, "value out of range"},
        {od_abort_general, "general error"},
        {od_abort_state, "not in the present state of the device"},
    };
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++)
        if (texts[i].code == abort_code)
            return texts[i].text;
    return "unknown abort code";
}
