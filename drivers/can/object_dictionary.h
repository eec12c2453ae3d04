/* SPDX-License-Identifier: MIT */
/// The object dictionary: what a node says of itself and what may be written, as const tables.
/// A dictionary is a list of sections, each a table of entries and the object (owner) that their values live in, so
/// that the communication part and the application each bring their own. Values pass as int64_t, which holds every type
/// here.
#ifndef SERVOSCOPE_DRIVERS_CAN_OBJECT_DICTIONARY_H
#define SERVOSCOPE_DRIVERS_CAN_OBJECT_DICTIONARY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum od_type {
    od_u8,
    od_i8,
    od_u16,
    od_i16,
    od_u32,
    od_i32,
    od_string, ///< VISIBLE_STRING: the owner has a struct od_data
    od_domain, ///< DOMAIN: likewise
};

/// Where the bytes of a string or a domain are. A download goes to `room` and becomes the value when it is complete and
/// the entry's write function, called with its size, agrees; then bytes = room. With room == bytes the old value is
/// gone as soon as a download starts.
struct od_data {
    const uint8_t *bytes;
    uint32_t size;
    uint8_t *room; ///< NULL: cannot be written
    uint32_t capacity;
};

enum od_access {
    od_readable = 1,
    od_writable = 2,
    od_mappable_receive = 4,  ///< may be written by an RPDO
    od_mappable_transmit = 8, ///< may be sent in a TPDO
    od_constant = 16,         ///< value is `constant`, not in the owner
};

/// Abort codes of CiA 301, used by the dictionary and by SDO.
enum od_abort {
    od_abort_none = 0,
    od_abort_toggle = 0x05030000,
    od_abort_timeout = 0x05040000,
    od_abort_command = 0x05040001,
    od_abort_block_size = 0x05040002,
    od_abort_sequence = 0x05040003,
    od_abort_crc = 0x05040004,
    od_abort_memory = 0x05040005,
    od_abort_access = 0x06010000,
    od_abort_write_only = 0x06010001,
    od_abort_read_only = 0x06010002,
    od_abort_no_object = 0x06020000,
    od_abort_not_mappable = 0x06040041,
    od_abort_mapping_length = 0x06040042,
    od_abort_incompatible = 0x06040043,
    od_abort_length = 0x06070010,
    od_abort_too_long = 0x06070012,
    od_abort_too_short = 0x06070013,
    od_abort_no_subindex = 0x06090011,
    od_abort_value = 0x06090030,
    od_abort_general = 0x08000000,
    od_abort_state = 0x08000022, ///< cannot be stored because of the present state of the device
};

struct od_entry {
    uint16_t index;
    uint8_t subindex;
    uint8_t type;   ///< enum od_type
    uint8_t access; ///< enum od_access, or-ed
    size_t offset;  ///< of the value in the owner
    int64_t constant;
    /// Checks and stores a value that is within the type's range; returns an abort code. NULL: od_store. Of strings and
    /// domains the value is the size of what has come, to be found in the room of their struct od_data.
    uint32_t (*write)(void *owner, const struct od_entry *entry, int64_t value);
};

/// Rows of a table of entries; `owner` is the struct that holds `member`.
#define OD_CONSTANT(index, sub, type, value)                                                                           \
    {                                                                                                                  \
        index, sub, type, od_readable | od_constant, 0, value, NULL                                                    \
    }
#define OD_ENTRY(index, sub, type, access, owner, member, write)                                                       \
    {                                                                                                                  \
        index, sub, type, access, offsetof(struct owner, member), 0, write                                             \
    }

struct od_section {
    const struct od_entry *entries;
    size_t count;
    void *owner;
};

enum { od_sections_max = 4 };

struct object_dictionary {
    size_t section_count;
    struct od_section sections[od_sections_max];
};

/// An entry that has been looked up.
struct od_place {
    const struct od_entry *entry;
    void *owner;
};

/// Bytes of a number; 0 of strings and domains.
uint8_t od_type_size(uint8_t type);

/// The bytes of a string or a domain; NULL if the entry is a number.
struct od_data *od_data_of(const struct od_place *place);

/// Looks an entry up: od_abort_none, od_abort_no_object or od_abort_no_subindex.
uint32_t od_locate(const struct object_dictionary *self, uint16_t index, uint8_t subindex, struct od_place *out_place);

/// The number as it is stored, access rights aside; 0 of strings and domains.
int64_t od_load(const struct od_place *place);

/// Stores without any check; for `write` functions.
void od_store(void *owner, const struct od_entry *entry, int64_t value);

/// Checks the type's range and writes by the entry's function; access rights are the caller's to check.
uint32_t od_write(const struct od_place *place, int64_t value);

/// The raw little-endian number of an entry's size as a value (sign extended), and back.
int64_t od_from_raw(uint8_t type, uint32_t raw);
uint32_t od_to_raw(uint8_t type, int64_t value);

const char *od_abort_str(uint32_t abort_code);

#endif
