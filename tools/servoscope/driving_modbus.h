/* SPDX-License-Identifier: MIT */
/// The simulated drive behind Modbus registers, in the wall clock's time.
#ifndef SERVOSCOPE_TOOLS_DRIVING_MODBUS_H
#define SERVOSCOPE_TOOLS_DRIVING_MODBUS_H

#include "tools/servoscope/driving_can.h"

/// Serves the drive on `name`, tcp:HOST:PORT or rtu:DEVICE:BAUD, until a signal or the time ends it; says on standard
/// output where it is. As slave on a line its address is request->node.
/// Errors: error_usage (no such kind of place, --faults), error_refused (cannot be opened, line lost)
int driving_modbus(const struct driving_request *request, const char *name, struct sim_model *model,
                   const struct command_context *context, struct error *out_error);

#endif
