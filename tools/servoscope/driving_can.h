/* SPDX-License-Identifier: MIT */
/// The simulated drive on a real bus: the loop that gives it the wall clock's time and the bus's frames.
#ifndef SERVOSCOPE_TOOLS_DRIVING_CAN_H
#define SERVOSCOPE_TOOLS_DRIVING_CAN_H

#include "lab/record/error.h"
#include "sim/model.h"
#include "tools/servoscope/can_bus.h"
#include "tools/servoscope/command.h"

/// What the options of `drive` say, whatever the bus.
struct driving_request {
    long long node;
    double for_s;              ///< 0: until a signal comes
    const char *faults;        ///< NULL: none
    double period_tolerance;   ///< of the drive's look at the SYNC's spacing; 0: it does not look
    double latch_us, reply_us; ///< SYNC to sample, sample to its answer
    double drift_ppm;          ///< of the drive's own clock
};

/// Serves the drive as a CiA 402 node on the bus `name` (can_bus.h) until a signal or the time ends it; says on
/// standard output where it is, and at the end what it has seen.
/// Errors: error_usage (no such kind of bus, no such fault), error_refused (bus cannot be opened, or was lost)
int driving_can(const struct driving_request *request, const char *name, struct sim_model *model,
                const struct command_context *context, struct error *out_error);

/// The same model as an ODrive on its own clock (CAN Simple). Takes node 1..62 and no faults.
int driving_odrive(const struct driving_request *request, const char *name, struct sim_model *model,
                   const struct command_context *context, struct error *out_error);

/// Gives a drive the bus's frames and the wall clock's time, for a time (0: for ever), until a signal or the bus's end.
enum can_status driving_serve(const struct can_port *port, const struct can_participant *drive, double for_s);

/// Says where the drive is, unless nothing is to be said.
void driving_say_start(const struct can_bus *bus, const struct driving_request *request, const char *name,
                       const struct command_context *context);

#endif
