/* SPDX-License-Identifier: MIT */
/// A measurement that the drive makes itself: the table goes into it over Modbus, it plays and transforms, the spectra
/// of each period come back, and the response is written.
#ifndef SERVOSCOPE_TOOLS_MODBUS_MEASURING_H
#define SERVOSCOPE_TOOLS_MODBUS_MEASURING_H

#include "tools/servoscope/measuring.h"

#include <stdbool.h>

/// How --help describes it, behind the other kinds of drive.
#define MODBUS_MEASURING_HELP                                                                                          \
    "                       modbus-tcp:HOST:PORT, modbus-rtu:DEVICE:BAUD, ?slave=N (default 1): a drive that plays "   \
    "the\n"                                                                                                            \
    "                       table and measures by itself (docs/modbus.md); --out is its frequency response then"

/// Whether a drive's URL is modbus-tcp:HOST:PORT or modbus-rtu:DEVICE:BAUD (either with ?slave=N).
bool modbus_measuring_is(const char *url);

/// Uploads the table, runs it, reads spectra while it runs, writes the frequency response to request->out.
/// Ctrl-C ramps the drive down; what was measured until then is written if it is enough.
/// Errors: error_usage, error_refused
int modbus_measuring_run(const struct measuring_request *request, const char *url,
                         const struct command_context *context, struct error *out_error);

#endif
