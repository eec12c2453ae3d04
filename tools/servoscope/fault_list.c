/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/fault_list.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

enum { fields_max = 4, entry_max = 80 };

/// A kind of fault and the numbers behind its name.
struct form {
    const char *name;
    const char *fields; ///< for messages
    int least, most;    ///< numbers
};

static const struct form frame_forms[inproc_fault_kinds] = {
    [inproc_drop] = {"drop", "ID:N[:COUNT]", 2, 3},
    [inproc_duplicate] = {"duplicate", "ID:N", 2, 2},
    [inproc_delay] = {"delay", "ID:N:US", 3, 3},
    [inproc_swap] = {"swap", "ID:N", 2, 2},
    [inproc_corrupt] = {"corrupt", "ID:N:BYTE:MASK", 4, 4},
    [inproc_shorten] = {"shorten", "ID:N", 2, 2},
    [inproc_bus_off] = {"bus-off", "ID:N:US", 3, 3},
};

static const struct form drive_forms[simulated_fault_kinds] = {
    [simulated_fault_encoder_stuck] = {"encoder-stuck", "SYNC[:COUNT]", 1, 2},
    [simulated_fault_encoder_reversed] = {"encoder-reversed", "SYNC[:COUNT]", 1, 2},
    [simulated_fault_encoder_dead] = {"encoder-dead", "SYNC[:COUNT]", 1, 2},
    [simulated_fault_heartbeat_stops] = {"heartbeat-stops", "SYNC", 1, 1},
    [simulated_fault_reset] = {"reset", "SYNC", 1, 1},
    [simulated_fault_sync_missed] = {"sync-missed", "SYNC[:COUNT]", 1, 2},
    [simulated_fault_silent] = {"silent", "SYNC[:COUNT]", 1, 2},
};

static const struct form end_stop_form = {"end-stop", "POSITION", 1, 1};

const char *fault_list_frame_name(enum inproc_fault_kind kind)
{
    return kind < inproc_fault_kinds ? frame_forms[kind].name : NULL;
}

const char *fault_list_drive_name(enum simulated_fault_kind kind)
{
    return kind < simulated_fault_kinds ? drive_forms[kind].name : NULL;
}

/// One entry, its name and fields apart.
struct entry {
    char text[entry_max];
    const char *name;
    const char *fields[fields_max];
    int count;
};

static int refuse(const struct form *form, const char *text, struct error *out_error)
{
    return error_set(out_error, error_usage, "--faults: '%s': expected %s:%s", text, form->name, form->fields);
}

static bool split(const char *text, size_t length, struct entry *out)
{
    *out = (struct entry){.count = 0};
    if (length >= sizeof out->text) {
        return false;
    }
    memcpy(out->text, text, length);
    out->name = out->text;
    for (char *at = strchr(out->text, ':'); at; at = strchr(at, ':')) {
        if (out->count == fields_max) {
            return false;
        }
        *at++ = '\0';
        out->fields[out->count++] = at;
    }
    return true;
}

/// A whole number, hexadecimal with 0x, within its range.
static bool read_whole(const char *text, unsigned long lowest, unsigned long highest, unsigned long *out_value)
{
    char *end;
    errno = 0;
    *out_value = strtoul(text, &end, 0);
    return *text >= '0' && *text <= '9' && *end == '\0' && errno == 0 && *out_value >= lowest && *out_value <= highest;
}

static bool read_id(const char *text, uint16_t *out_id)
{
    char *end;
    if (strcmp(text, "any") == 0) {
        *out_id = inproc_any;
        return true;
    }
    unsigned long id = strtoul(text, &end, 16);
    *out_id = (uint16_t)id;
    return *text != '\0' && *text != '-' && *end == '\0' && id <= can_id_max;
}

/// The numbers behind ID and N; false if one is out of range or the list is full.
static bool add_frame_fault(struct fault_list *list, struct inproc_fault fault, const struct entry *entry)
{
    unsigned long values[fields_max] = {0}, count = 1;
    for (int i = 2; i < entry->count; i++) {
        if (!read_whole(entry->fields[i], 0, UINT32_MAX, &values[i])) {
            return false;
        }
    }
    if (fault.kind == inproc_drop && entry->count == 3) {
        count = values[2];
    } else if (fault.kind == inproc_corrupt) {
        fault.byte = (uint8_t)values[2];
        fault.mask = (uint8_t)values[3];
        count = values[2] < can_data_max && values[3] >= 1 && values[3] <= 0xFF;
    } else {
        fault.delay_us = (uint32_t)values[2];
    }
    if (count == 0 || count > fault_list_frames_max - list->frame_count) {
        return false;
    }
    for (unsigned long i = 0; i < count; i++) {
        list->frames[list->frame_count++] = fault;
        fault.nth++;
    }
    return true;
}

static int read_frame_fault(struct fault_list *list, enum inproc_fault_kind kind, const struct entry *entry,
                            const char *text, struct error *out_error)
{
    const struct form *form = &frame_forms[kind];
    struct inproc_fault fault = {.kind = kind};
    unsigned long nth;
    if (entry->count < form->least || entry->count > form->most || !read_id(entry->fields[0], &fault.cob_id) ||
        !read_whole(entry->fields[1], 1, UINT32_MAX - fault_list_frames_max, &nth)) {
        return refuse(form, text, out_error);
    }
    fault.nth = (uint32_t)nth;
    return add_frame_fault(list, fault, entry) ? 0 : refuse(form, text, out_error);
}

static int read_drive_fault(struct fault_list *list, enum simulated_fault_kind kind, const struct entry *entry,
                            const char *text, struct error *out_error)
{
    const struct form *form = &drive_forms[kind];
    const bool passes = kind == simulated_fault_sync_missed || kind == simulated_fault_silent;
    unsigned long sync = 0, count = passes ? 1 : 0; // an encoder that breaks stays broken
    bool good = entry->count >= form->least && entry->count <= form->most &&
                read_whole(entry->fields[0], 1, UINT32_MAX, &sync) &&
                (entry->count < 2 || read_whole(entry->fields[1], 0, UINT32_MAX, &count)) &&
                list->drive_count < fault_list_drive_max;
    if (!good) {
        return refuse(form, text, out_error);
    }
    list->drive[list->drive_count++] = (struct simulated_fault){kind, (uint32_t)sync, (uint32_t)count};
    return 0;
}

static int read_end_stop(const struct entry *entry, struct sim_model *model, const char *text, struct error *out_error)
{
    char *end = NULL;
    double position = entry->count == 1 ? strtod(entry->fields[0], &end) : 0.0;
    if (!(position > 0.0 && position <= 1e6) || !end || *end != '\0') {
        return refuse(&end_stop_form, text, out_error);
    }
    model->has_end_stops = true;
    model->end_stops_rad[0] = -position;
    model->end_stops_rad[1] = position;
    return 0;
}

static int read_entry(const char *at, size_t length, struct fault_list *list, struct sim_model *model,
                      struct error *out_error)
{
    struct entry entry;
    char text[entry_max] = "";
    memcpy(text, at, length < sizeof text - 1 ? length : sizeof text - 1);
    if (!split(at, length, &entry)) {
        return error_set(out_error, error_usage, "--faults: '%s': too long for any fault", text);
    }
    for (int kind = 0; kind < inproc_fault_kinds; kind++) {
        if (frame_forms[kind].name && strcmp(entry.name, frame_forms[kind].name) == 0) {
            return read_frame_fault(list, (enum inproc_fault_kind)kind, &entry, text, out_error);
        }
    }
    for (int kind = 0; kind < simulated_fault_kinds; kind++) {
        if (strcmp(entry.name, drive_forms[kind].name) == 0) {
            return read_drive_fault(list, (enum simulated_fault_kind)kind, &entry, text, out_error);
        }
    }
    if (strcmp(entry.name, end_stop_form.name) == 0) {
        return read_end_stop(&entry, model, text, out_error);
    }
    return error_set(out_error, error_usage,
                     "--faults: '%s' is no fault; expected drop, duplicate, delay, swap, corrupt, shorten, bus-off, "
                     "encoder-stuck, encoder-reversed, encoder-dead, sync-missed, silent, heartbeat-stops, reset or "
                     "end-stop",
                     entry.name);
}

int fault_list_read(const char *text, struct fault_list *out_list, struct sim_model *io_model, struct error *out_error)
{
    int status = 0;
    out_list->frame_count = out_list->drive_count = 0;
    for (const char *at = text; at && *at != '\0' && !status;) {
        size_t length = strcspn(at, ",");
        status = read_entry(at, length, out_list, io_model, out_error);
        at += length + (at[length] == ',');
    }
    return status;
}
