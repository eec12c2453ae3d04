/* SPDX-License-Identifier: MIT */
#include "drivers/can/cia402_profile.h"

/// CST adds 60B2 to 6071, so that a leftover offset would be torque: the master clears it for every make. Position in
/// PUU, 1 280 000 per turn with the factory's electronic gear; speed in 0.1 rpm; both without objects that say so.
const struct cia402_profile cia402_profile_delta_asda_a2 = {
    .name = "delta_asda_a2",
    .make = "Delta ASDA-A2",
    .source = "ASDA-A2-E CANopen manual 2015, 5.3 and 5.8: 60C2:1 1..20 ms, 60C2:2 always -3",
    .vendor = 0x000001DD,
    .exponent_min = -3,
    .exponent_max = -3,
    .units_min = 1,
    .units_max = 20,
    .period_min_us = 1000,
    .period_max_us = 20000,
    .torque_units_per_rated = 1000,
    .units = {.increments = 1280000,
              .revolutions = 1,
              .position_unit = CIA402_UNIT(0, cia402_unit_increment, 0),
              .velocity_unit = CIA402_UNIT(-1, cia402_unit_revolution, cia402_unit_minute)},
};
