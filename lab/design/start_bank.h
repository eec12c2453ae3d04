/* SPDX-License-Identifier: MIT */
/// Nominal two-mass drives that stand for the one nobody has measured yet: a start that suits them on average suits
/// most. Every antiresonance is combined with two inertia ratios; friction goes through its range along the way.
#ifndef SERVOSCOPE_DESIGN_START_BANK_H
#define SERVOSCOPE_DESIGN_START_BANK_H

#include "lab/design/transient.h"

#include "sim/model.h"

#include <stddef.h>

enum {
    design_start_bank_antiresonances = 14,
    design_start_bank_load_shares = 2,
    design_start_bank_size = design_start_bank_antiresonances * design_start_bank_load_shares,
};

/// Drive `index` (0 .. design_start_bank_size - 1) for a table: its total inertia is the table's; antiresonances lie
/// from 1/14 of the highest line to that line (never above a quarter of the rate), evenly on a logarithmic axis, for a
/// band is chosen to cover them; the load has 0.4 or 0.7 of the inertia, the belt a damping ratio of 0.03, friction
/// slows the drive with time constants of 6.7, 2, 0.7 and 0.2 s. The controllers are the default model's, in proportion
/// to the inertia, and slower below 1 kHz in proportion to the rate.
/// Test: bench/start.c, tests/golden/test_design_start.c: drives that are not in it
void design_start_bank_drive(const struct design_transient_table *table, size_t index, struct sim_model *out_drive);

#endif
