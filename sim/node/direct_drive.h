/* SPDX-License-Identifier: MIT */
/// The simulated drive behind drivers/drive.h without a bus: one exchange is one sample of the model, nothing is lost,
/// nothing is quantised on the way. What a bus would do to the same measurement is the difference to the drive on a
/// bus.
#ifndef SERVOSCOPE_SIM_NODE_DIRECT_DRIVE_H
#define SERVOSCOPE_SIM_NODE_DIRECT_DRIVE_H

#include "drivers/drive.h"
#include "sim/belt_drive.h"

#include <stdbool.h>

/// Read-only for the application.
struct direct_drive {
    struct sim_belt_drive drive;
    const struct sim_model *model;
    struct drive_configuration configuration;
    struct drive_counters counters;
    double origin; ///< position at arm
    bool armed;
    char detail[160]; ///< what went wrong last
};

/// Puts the drive at rest and returns its door. Both `self` and `model` must outlive the door.
/// Door:   open checks that model and table run at one rate; exchange fails with drive_err_fault at an end stop, past
/// the
///         following error, or when a value is no number any more; stop is a quick stop of at most 2 s, then no torque
/// Test:   tests/api/test_simulate_frf.c
struct drive direct_drive_init(struct direct_drive *self, const struct sim_model *model);

#endif
