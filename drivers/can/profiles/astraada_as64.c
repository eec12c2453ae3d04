/* SPDX-License-Identifier: MIT */
#include "drivers/can/cia402_profile.h"

const struct cia402_profile cia402_profile_astraada_as64 = {
    .name = "astraada_as64",
    .make = "Astraada AS64",
    .source = "AS64 servo drive manual, 8.3.3: shortest SYNC interval 1000 us",
    .exponent_min = -6,
    .exponent_max = 0,
    .units_min = 1,
    .units_max = 255,
    .period_min_us = 1000,
    .torque_units_per_rated = 1000,
};
