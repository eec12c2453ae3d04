/* SPDX-License-Identifier: MIT */
#include "drivers/can/cia402_profile.h"

const struct cia402_profile cia402_profile_nanotec_pd4 = {
    .name = "nanotec_pd4",
    .make = "Nanotec PD4",
    .source = "Nanotec object directory: 60C2:2 is -3 only",
    .vendor = 0x0000026C,
    .exponent_min = -3,
    .exponent_max = -3,
    .units_min = 1,
    .units_max = 255,
    .torque_units_per_rated = 1000,
    .units = {.velocity_unit = CIA402_UNIT(0, cia402_unit_revolution, cia402_unit_minute),
              .position_unit = CIA402_UNIT(0, cia402_unit_increment, 0)},
};
