/* SPDX-License-Identifier: MIT */
#include "drivers/can/cia402_profile.h"

const struct cia402_profile cia402_profile_infranor = {
    .name = "infranor",
    .make = "Infranor XtrapulsGem",
    .source = "XtrapulsGem manual: 1006 in multiples of 500 us, at most 20 ms",
    .exponent_min = -6,
    .exponent_max = 0,
    .units_min = 1,
    .units_max = 255,
    .period_min_us = 500,
    .period_max_us = 20000,
    .period_step_us = 500,
    .torque_units_per_rated = 1000,
};
