/* SPDX-License-Identifier: MIT */
/// From a drive's URL to a drive: the one place that knows which port and which protocol stand behind a door.
///   sim:MODEL.json            the simulated drive, spoken to in CAN frames over a bus inside the program
///   odrive:IFACE?node=N, odrive-slcan:HOST:PORT?node=N   an ODrive (CAN Simple)
///   can:IFACE?node=N          a CiA 402 drive on a CAN interface of this machine
///   slcan:HOST:PORT?node=N    the same behind an slcan adapter over TCP, or slcan:/dev/ttyACM0?node=N over a serial
///   line
/// A new kind is one entry in door.c's table and one file door_NAME.c.
#ifndef SERVOSCOPE_TOOLS_DOOR_H
#define SERVOSCOPE_TOOLS_DOOR_H

#include "drivers/drive.h"
#include "lab/record/error.h"
#include "ports/bus_watch.h"
#include "sim/model.h"

#include <stdbool.h>
#include <stdint.h>

/// How --help describes what --drive takes: the lines behind the first.
#define DOOR_HELP                                                                                                      \
    "sim:MODEL.json: the simulated drive of a model file, on a CAN bus inside the program\n"                           \
    "                       can:IFACE?node=N: a CiA 402 drive on a CAN interface (can0); node 5 if not said\n"         \
    "                       slcan:HOST:PORT?node=N, slcan:/dev/ttyACM0?node=N: the same behind an slcan adapter;\n"    \
    "                       more behind '?': &bitrate=B of the bus (default 1000000), &profile=NAME of the drive's "   \
    "make,\n"                                                                                                          \
    "                       &sync_timeout_ms=T where this machine cannot keep pace (docs/bus.md)\n"                    \
    "                       odrive:IFACE?node=N, odrive-slcan:HOST:PORT?node=N: an ODrive, node 0 if not said; "       \
    "&kt=K:\n"                                                                                                         \
    "                       its torque constant in Nm/A, which --mode cascade needs"

struct door_scheme;

struct door {
    struct drive drive;
    void *owner; ///< everything behind the drive
    const struct door_scheme *scheme;
    /// Time without a sample that a measurement has to bear with; 0: as always. A bus in real time stumbles over its
    /// machine's other work.
    double patience_s;
};

/// What the bus and the drive's far end have counted since the door was opened.
struct door_statistics {
    uint32_t bitrate; ///< bit/s; 0: there is no bus to speak of
    double bus_load;  ///< share of the time since the drive was opened, 0..1; on a real bus: as planned
    uint32_t frames;
    uint32_t targets_lost;      ///< SYNCs without a usable set-point, seen by the drive (simulated in the program only)
    uint32_t setpoints_clipped; ///< that did not fit their object
    uint32_t samples_clipped;   ///< measured values that did not fit theirs (simulated in the program only)
    bool in_real_time;          ///< the wall clock was kept: what follows is said
    unsigned cycle_bits;        ///< on the wire, at worst
    double rate_hz;
    uint32_t syncs_late;    ///< more than half a period behind their place
    uint32_t frames_unsent; ///< refused by the interface
    uint32_t frames_lost;   ///< that arrived and nobody took in time
    uint32_t error_frames;
    uint32_t sync_timeout_us;     ///< set in the drive
    char rights[192];             ///< real-time rights, one line
    struct bus_histogram spacing; ///< |spacing of SYNCs - period|, us
    struct bus_histogram reply;   ///< from SYNC to the last TPDO, us
};

/// Makes what the URL names. `model` is used for sim: if it is not NULL; then the URL may be just "sim:".
/// The bus inside the program runs at 1 Mbit/s, or at 2, 4 or 8 Mbit/s (faster than any real one) if the sample rate
/// that the drive is opened with needs more.
/// Errors: error_usage (no such kind of door), error_refused (model file, bus); *out_door is empty then
int door_open(const char *url, const struct sim_model *model, struct door *out_door, struct error *out_error);

/// Whether there is a bus with something to count.
bool door_has_statistics(const struct door *self);

/// What was counted so far.
void door_read_statistics(const struct door *self, struct door_statistics *out_statistics);

/// Stops and closes the drive and frees what is behind it; harmless on an empty door.
void door_close(struct door *self);

#endif
