/* SPDX-License-Identifier: MIT */
/// The text of `drive --faults`: what is to go wrong, separated by commas. Frames are counted from 1 for each COB-ID
/// (in hexadecimal, or "any"), both ways; SYNCs are counted in operation enabled. Without a COUNT frames, SYNCs and
/// silence are missing once, an encoder stays broken; a COUNT of 0 is for ever.
///   drop:ID:N[:COUNT]  duplicate:ID:N  swap:ID:N  shorten:ID:N  delay:ID:N:US  corrupt:ID:N:BYTE:MASK  bus-off:ID:N:US
///   encoder-stuck:SYNC[:COUNT]  encoder-reversed:SYNC[:COUNT]  encoder-dead:SYNC[:COUNT]  sync-missed:SYNC[:COUNT]
///   silent:SYNC[:COUNT]  heartbeat-stops:SYNC  reset:SYNC  end-stop:POSITION
#ifndef SERVOSCOPE_TOOLS_FAULT_LIST_H
#define SERVOSCOPE_TOOLS_FAULT_LIST_H

#include "lab/record/error.h"
#include "ports/inproc.h"
#include "sim/model.h"
#include "sim/node/simulated_drive.h"

#include <stddef.h>

enum { fault_list_frames_max = 1024, fault_list_drive_max = 64 };

struct fault_list {
    size_t frame_count, drive_count;
    struct inproc_fault frames[fault_list_frames_max];
    struct simulated_fault drive[fault_list_drive_max];
};

/// Reads the text; NULL is an empty list. An end stop is put into the model, both ways.
/// Errors: error_usage with the entry and what was expected
int fault_list_read(const char *text, struct fault_list *out_list, struct sim_model *io_model, struct error *out_error);

/// Names as they are typed; NULL beyond the kinds.
const char *fault_list_frame_name(enum inproc_fault_kind kind);
const char *fault_list_drive_name(enum simulated_fault_kind kind);

#endif
