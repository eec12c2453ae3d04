/* SPDX-License-Identifier: MIT */
#include "sim/node/eds.h"

#include <inttypes.h>
#include <string.h>

enum { object_variable = 7, object_array = 8, object_record = 9, no_more = 0x10000 };

/// Smallest index above `index`, no_more if there is none.
static uint32_t next_index(const struct object_dictionary *dictionary, int32_t index)
{
    uint32_t next = no_more;
    for (size_t s = 0; s < dictionary->section_count; s++)
        for (size_t i = 0; i < dictionary->sections[s].count; i++) {
            uint32_t candidate = dictionary->sections[s].entries[i].index;
            if ((int32_t)candidate > index && candidate < next)
                next = candidate;
        }
    return next;
}

/// How many subindices an object has; `out_highest` is the highest of them.
static unsigned count_entries(const struct object_dictionary *dictionary, uint16_t index, unsigned *out_highest)
{
    struct od_place place;
    unsigned count = 0;
    *out_highest = 0;
    for (unsigned subindex = 0; subindex <= UINT8_MAX; subindex++)
        if (od_locate(dictionary, index, (uint8_t)subindex, &place) == od_abort_none) {
            count++;
            *out_highest = subindex;
        }
    return count;
}

static unsigned data_type(uint8_t type)
{
    static const uint8_t types[] = {
        [od_i8] = 0x02,  [od_i16] = 0x03, [od_i32] = 0x04,    [od_u8] = 0x05,
        [od_u16] = 0x06, [od_u32] = 0x07, [od_string] = 0x09, [od_domain] = 0x0F,
    };
    return types[type];
}

static const char *access_type(uint8_t access)
{
    bool readable = access & od_readable, writable = access & od_writable;
    if (access & od_constant)
        return "const";
    if (readable && writable)
        return (access & od_mappable_receive) ? "rww" : (access & od_mappable_transmit) ? "rwr" : "rw";
    return writable ? "wo" : "ro";
}

static bool is_cob_id(uint16_t index, uint8_t subindex)
{
    bool pdo = (index >= 0x1400 && index <= 0x15FF) || (index >= 0x1800 && index <= 0x19FF);
    return (pdo && subindex == 1) || index == 0x1014 || (index == 0x1200 && subindex > 0);
}

static void write_default(FILE *file, const struct canopen_node *node, const struct od_place *place)
{
    const struct od_entry *entry = place->entry;
    bool same_everywhere = (entry->access & (od_writable | od_constant)) != 0 || entry->index < 0x2000;
    const struct od_data *data = od_data_of(place);
    if (!same_everywhere || !(entry->access & od_readable) || entry->type == od_domain)
        return;
    if (data) {
        fprintf(file, "DefaultValue=%.*s\n", (int)data->size, (const char *)data->bytes);
        return;
    }
    int64_t value = od_load(place);
    if (is_cob_id(entry->index, entry->subindex))
        fprintf(file, "DefaultValue=$NODEID+0x%" PRIX32 "\n", (uint32_t)value - node->node_id);
    else
        fprintf(file, "DefaultValue=%" PRId64 "\n", value);
}

static void write_entry(FILE *file, const struct canopen_node *node, const struct od_place *place, const char *name)
{
    const struct od_entry *entry = place->entry;
    bool mappable = (entry->access & (od_mappable_receive | od_mappable_transmit)) != 0;
    fprintf(file, "ParameterName=%s\nObjectType=0x%X\nDataType=0x%04X\nAccessType=%s\n", name, object_variable,
            data_type(entry->type), access_type(entry->access));
    write_default(file, node, place);
    fprintf(file, "PDOMapping=%d\n\n", mappable);
}

static void write_object(FILE *file, const struct canopen_node *node, uint16_t index)
{
    struct od_place place;
    char name[eds_name_max];
    unsigned highest = 0, count = count_entries(&node->dictionary, index, &highest);
    bool array = index == 0x1003 || index == 0x1016;
    eds_object_name(index, name);
    fprintf(file, "[%X]\n", index);
    if (highest == 0) {
        od_locate(&node->dictionary, index, 0, &place);
        write_entry(file, node, &place, name);
        return;
    }
    fprintf(file, "ParameterName=%s\nObjectType=0x%X\nSubNumber=0x%X\n\n", name, array ? object_array : object_record,
            count);
    for (unsigned subindex = 0; subindex <= highest; subindex++)
        if (od_locate(&node->dictionary, index, (uint8_t)subindex, &place) == od_abort_none) {
            fprintf(file, "[%Xsub%X]\n", index, subindex);
            eds_entry_name(index, (uint8_t)subindex, name);
            write_entry(file, node, &place, name);
        }
}

enum list { list_mandatory, list_optional, list_manufacturer };

static enum list list_of(uint32_t index)
{
    if (index == 0x1000 || index == 0x1001 || index == 0x1018)
        return list_mandatory;
    return index >= 0x2000 && index < 0x6000 ? list_manufacturer : list_optional;
}

static void write_list(FILE *file, const struct object_dictionary *dictionary, enum list list, const char *title)
{
    unsigned count = 0;
    for (uint32_t i = next_index(dictionary, -1); i != no_more; i = next_index(dictionary, (int32_t)i))
        count += list_of(i) == list;
    fprintf(file, "[%s]\nSupportedObjects=%u\n", title, count);
    count = 0;
    for (uint32_t i = next_index(dictionary, -1); i != no_more; i = next_index(dictionary, (int32_t)i))
        if (list_of(i) == list)
            fprintf(file, "%u=0x%04" PRIX32 "\n", ++count, i);
    fprintf(file, "\n");
}

static void write_head(FILE *file, const struct canopen_node *node)
{
    static const int rates_kbit_per_s[] = {10, 20, 50, 125, 250, 500, 800, 1000};
    fprintf(file, "[FileInfo]\nFileName=servoscope-drive.eds\nFileVersion=1\nFileRevision=0\nEDSVersion=4.0\n"
                  "Description=Simulated servo drive of servoscope\n\n");
    fprintf(file,
            "[DeviceInfo]\nVendorName=servoscope\nVendorNumber=0x%" PRIX32
            "\nProductName=%.*s\nProductNumber=0x%" PRIX32 "\nRevisionNumber=0x%" PRIX32 "\n",
            node->identity.vendor, (int)node->device_name.size, (const char *)node->device_name.bytes,
            node->identity.product, node->identity.revision);
    for (size_t i = 0; i < sizeof rates_kbit_per_s / sizeof rates_kbit_per_s[0]; i++)
        fprintf(file, "BaudRate_%d=1\n", rates_kbit_per_s[i]);
    fprintf(file,
            "SimpleBootUpMaster=0\nSimpleBootUpSlave=1\nGranularity=8\nDynamicChannelsSupported=0\n"
            "GroupMessaging=0\nNrOfRXPDO=%d\nNrOfTXPDO=%d\nLSS_Supported=0\n\n",
            pdo_per_direction, pdo_per_direction);
    fprintf(file, "[DummyUsage]\n");
    for (int type = 1; type <= 7; type++)
        fprintf(file, "Dummy%04d=0\n", type);
    fprintf(file, "\n[Comments]\nLines=0\n\n");
}

bool eds_write(FILE *file, const struct canopen_node *node)
{
    const struct object_dictionary *dictionary = &node->dictionary;
    write_head(file, node);
    write_list(file, dictionary, list_mandatory, "MandatoryObjects");
    write_list(file, dictionary, list_optional, "OptionalObjects");
    write_list(file, dictionary, list_manufacturer, "ManufacturerObjects");
    for (uint32_t i = next_index(dictionary, -1); i != no_more; i = next_index(dictionary, (int32_t)i))
        write_object(file, node, (uint16_t)i);
    return fflush(file) == 0 && !ferror(file);
}
