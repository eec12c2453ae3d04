/* SPDX-License-Identifier: MIT */
#include "drivers/can/cia402_profile.h"

/// Whatever does what CiA 402 says: every period that 60C2 can hold in whole microseconds, units from 608F, 60A8, 60A9.
const struct cia402_profile cia402_profile_generic = {
    .name = "generic",
    .make = "a generic drive",
    .source = "CiA 402 as read in makers' manuals",
    .exponent_min = -6,
    .exponent_max = 0,
    .units_min = 1,
    .units_max = 255,
    .torque_units_per_rated = 1000,
};
