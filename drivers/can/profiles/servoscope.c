/* SPDX-License-Identifier: MIT */
#include "drivers/can/cia402_profile.h"

/// The simulated drive of this program (sim/node/simulated_drive.h). It has no vendor number: there is none to have.
const struct cia402_profile cia402_profile_servoscope = {
    .name = "servoscope",
    .make = "servoscope's simulated drive",
    .source = "sim/node/simulated_drive_objects.c",
    .product = 0x00000402,
    .exponent_min = -6,
    .exponent_max = 0,
    .units_min = 1,
    .units_max = 255,
    .period_min_us = 50,
    .period_max_us = 100000,
    .torque_units_per_rated = 1000,
    .has_sync_timeout = true,
};
