/* SPDX-License-Identifier: MIT */
/// From a drive's URL to a drive: the one place that knows which port and which protocol stand behind a door.
///   sim:MODEL.json   the simulated drive, spoken to in CAN frames over a bus inside the program
#ifndef SERVOSCOPE_TOOLS_DOOR_H
#define SERVOSCOPE_TOOLS_DOOR_H

#include "drivers/drive.h"
#include "lab/record/error.h"
#include "sim/model.h"

#include <stdint.h>

/// How --help describes what --drive takes.
#define DOOR_HELP "sim:MODEL.json: the simulated drive of a model file, on a CAN bus inside the program"

struct door {
    struct drive drive;
    void *owner; ///< everything behind the drive
};

/// What the bus and the drive's far end have counted since the door was opened.
struct door_statistics {
    uint32_t bitrate; ///< bit/s
    double bus_load;  ///< share of the time since the drive was opened, 0..1
    uint32_t frames;
    uint32_t targets_lost;      ///< SYNCs without a usable set-point, seen by the drive
    uint32_t setpoints_clipped; ///< that did not fit their object
    uint32_t samples_clipped;   ///< measured values that did not fit theirs
};

/// Makes what the URL names. `model` is used for sim: if it is not NULL; then the URL may be just "sim:".
/// The bus inside the program runs at 1 Mbit/s, or at 2, 4 or 8 Mbit/s (faster than any real one) if the sample rate
/// that the drive is opened with needs more.
/// Errors: error_usage (no such kind of door), error_refused (model file); *out_door is empty then
int door_open(const char *url, const struct sim_model *model, struct door *out_door, struct error *out_error);

/// What was counted so far.
void door_read_statistics(const struct door *self, struct door_statistics *out_statistics);

/// Stops and closes the drive and frees what is behind it; harmless on an empty door.
void door_close(struct door *self);

#endif
