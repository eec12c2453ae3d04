/* SPDX-License-Identifier: MIT */
#include "sim/node/eds.h"

struct name {
    uint16_t first, last; ///< indices that share it
    const char *text;
};

static const struct name objects[] = {
    {0x1000, 0x1000, "Device type"},
    {0x1001, 0x1001, "Error register"},
    {0x1003, 0x1003, "Pre-defined error field"},
    {0x1005, 0x1005, "COB-ID SYNC message"},
    {0x1006, 0x1006, "Communication cycle period"},
    {0x1007, 0x1007, "Synchronous window length"},
    {0x1008, 0x1008, "Manufacturer device name"},
    {0x1009, 0x1009, "Manufacturer hardware version"},
    {0x100A, 0x100A, "Manufacturer software version"},
    {0x1014, 0x1014, "COB-ID EMCY"},
    {0x1016, 0x1016, "Consumer heartbeat time"},
    {0x1017, 0x1017, "Producer heartbeat time"},
    {0x1018, 0x1018, "Identity object"},
    {0x1019, 0x1019, "Synchronous counter overflow value"},
    {0x1029, 0x1029, "Error behaviour"},
    {0x1200, 0x1200, "SDO server parameter"},
    {0x1400, 0x15FF, "RPDO communication parameter"},
    {0x1600, 0x17FF, "RPDO mapping parameter"},
    {0x1800, 0x19FF, "TPDO communication parameter"},
    {0x1A00, 0x1BFF, "TPDO mapping parameter"},
    {0x2000, 0x2000, "Counters of the drive"},
    {0x2001, 0x2001, "Check of samples"},
    {0x2002, 0x2002, "Check of set-points"},
    {0x2003, 0x2003, "SYNC time-out"},
    {0x2004, 0x2004, "Blocked motor"},
    {0x6007, 0x6007, "Abort connection option code"},
    {0x603F, 0x603F, "Error code"},
    {0x6040, 0x6040, "Controlword"},
    {0x6041, 0x6041, "Statusword"},
    {0x605A, 0x605A, "Quick stop option code"},
    {0x605B, 0x605B, "Shutdown option code"},
    {0x605C, 0x605C, "Disable operation option code"},
    {0x605D, 0x605D, "Halt option code"},
    {0x605E, 0x605E, "Fault reaction option code"},
    {0x6060, 0x6060, "Modes of operation"},
    {0x6061, 0x6061, "Modes of operation display"},
    {0x6062, 0x6062, "Position demand value"},
    {0x6063, 0x6063, "Position actual internal value"},
    {0x6064, 0x6064, "Position actual value"},
    {0x6065, 0x6065, "Following error window"},
    {0x6066, 0x6066, "Following error time out"},
    {0x606B, 0x606B, "Velocity demand value"},
    {0x606C, 0x606C, "Velocity actual value"},
    {0x6071, 0x6071, "Target torque"},
    {0x6072, 0x6072, "Max torque"},
    {0x6074, 0x6074, "Torque demand"},
    {0x6075, 0x6075, "Motor rated current"},
    {0x6076, 0x6076, "Motor rated torque"},
    {0x6077, 0x6077, "Torque actual value"},
    {0x607A, 0x607A, "Target position"},
    {0x607D, 0x607D, "Software position limit"},
    {0x607F, 0x607F, "Max profile velocity"},
    {0x6080, 0x6080, "Max motor speed"},
    {0x6084, 0x6084, "Profile deceleration"},
    {0x6085, 0x6085, "Quick stop deceleration"},
    {0x6087, 0x6087, "Torque slope"},
    {0x608F, 0x608F, "Position encoder resolution"},
    {0x60A8, 0x60A8, "SI unit position"},
    {0x60A9, 0x60A9, "SI unit velocity"},
    {0x60AA, 0x60AA, "SI unit acceleration"},
    {0x60B1, 0x60B1, "Velocity offset"},
    {0x60B2, 0x60B2, "Torque offset"},
    {0x60C2, 0x60C2, "Interpolation time period"},
    {0x60F4, 0x60F4, "Following error actual value"},
    {0x60FF, 0x60FF, "Target velocity"},
    {0x6502, 0x6502, "Supported drive modes"},
};

/// Names of single entries; `text` is followed by the subindex if it ends in a blank.
static const struct {
    uint16_t first, last;
    uint8_t first_sub, last_sub;
    const char *text;
} entries[] = {
    {0x1003, 0x1003, 0, 0, "Number of errors"},
    {0x1003, 0x1003, 1, 8, "Standard error field "},
    {0x1016, 0x1016, 1, 1, "Consumer heartbeat time 1"},
    {0x1018, 0x1018, 1, 1, "Vendor-ID"},
    {0x1018, 0x1018, 2, 2, "Product code"},
    {0x1018, 0x1018, 3, 3, "Revision number"},
    {0x1018, 0x1018, 4, 4, "Serial number"},
    {0x1029, 0x1029, 1, 1, "Communication error"},
    {0x1200, 0x1200, 1, 1, "COB-ID client to server (rx)"},
    {0x1200, 0x1200, 2, 2, "COB-ID server to client (tx)"},
    {0x1400, 0x15FF, 1, 1, "COB-ID used by RPDO"},
    {0x1400, 0x15FF, 2, 2, "Transmission type"},
    {0x1600, 0x17FF, 0, 0, "Number of mapped objects"},
    {0x1600, 0x17FF, 1, 8, "Mapped object "},
    {0x1800, 0x19FF, 1, 1, "COB-ID used by TPDO"},
    {0x1800, 0x19FF, 2, 2, "Transmission type"},
    {0x1800, 0x19FF, 3, 3, "Inhibit time"},
    {0x1800, 0x19FF, 5, 5, "Event timer"},
    {0x1A00, 0x1BFF, 0, 0, "Number of mapped objects"},
    {0x1A00, 0x1BFF, 1, 8, "Mapped object "},
    {0x2001, 0x2002, 1, 1, "SYNC counter"},
    {0x2001, 0x2002, 2, 2, "Check byte"},
    {0x607D, 0x607D, 1, 1, "Min position limit"},
    {0x607D, 0x607D, 2, 2, "Max position limit"},
    {0x608F, 0x608F, 1, 1, "Encoder increments"},
    {0x608F, 0x608F, 2, 2, "Motor revolutions"},
    {0x60C2, 0x60C2, 1, 1, "Interpolation time period value"},
    {0x60C2, 0x60C2, 2, 2, "Interpolation time index"},
    {0x0000, 0xFFFF, 0, 0, "Highest sub-index supported"},
};

void eds_object_name(uint16_t index, char *out_text)
{
    for (size_t i = 0; i < sizeof objects / sizeof objects[0]; i++) {
        if (index < objects[i].first || index > objects[i].last)
            continue;
        if (objects[i].first == objects[i].last)
            snprintf(out_text, eds_name_max, "%s", objects[i].text);
        else
            snprintf(out_text, eds_name_max, "%s %u", objects[i].text, index - objects[i].first + 1u);
        return;
    }
    snprintf(out_text, eds_name_max, "Object %04X", index);
}

void eds_entry_name(uint16_t index, uint8_t subindex, char *out_text)
{
    for (size_t i = 0; i < sizeof entries / sizeof entries[0]; i++) {
        if (index < entries[i].first || index > entries[i].last || subindex < entries[i].first_sub ||
            subindex > entries[i].last_sub)
            continue;
        if (entries[i].first_sub == entries[i].last_sub)
            snprintf(out_text, eds_name_max, "%s", entries[i].text);
        else
            snprintf(out_text, eds_name_max, "%s%u", entries[i].text, subindex);
        return;
    }
    snprintf(out_text, eds_name_max, "Object %04X:%u", index, subindex);
}
