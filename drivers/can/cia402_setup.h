/* SPDX-License-Identifier: MIT */
/// The first half of cia402_master: from a node on the bus to a drive that is configured and operational, without
/// torque.
#ifndef SERVOSCOPE_DRIVERS_CAN_CIA402_SETUP_H
#define SERVOSCOPE_DRIVERS_CAN_CIA402_SETUP_H

#include "drivers/can/cia402_master.h"

/// Checks self->configuration and the drive, reads its scaling, writes its parameters and PDO mapping (each read back),
/// starts its heartbeat and NMT. self->detail says what went wrong, with object and abort code.
enum drive_status cia402_setup(struct cia402_master *self);

#endif
