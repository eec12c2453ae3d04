/* SPDX-License-Identifier: MIT */
/// What slcan.c and the ways to open one (slcan_open.c) share: bytes of the line. Internal to ports.
#ifndef SERVOSCOPE_PORTS_SLCAN_LINE_H
#define SERVOSCOPE_PORTS_SLCAN_LINE_H

#include "ports/slcan.h"

/// Makes a port without a line.
void slcan_line_init(struct slcan *self, bool adapter);

/// Queues text and writes as much of it as the line takes now; false if there is no room for it.
bool slcan_line_write(struct slcan *self, const char *text, size_t length);

/// Takes what has arrived, writes what waits, accepts clients.
void slcan_line_pump(struct slcan *self);

/// Waits for something to pump until `until_us`; false if only the time has come.
bool slcan_line_wait(struct slcan *self, uint64_t until_us);

#endif
