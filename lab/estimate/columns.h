/* SPDX-License-Identifier: MIT */
/// Which columns of a run a response is taken from, and whether their numbers can be used.
#ifndef SERVOSCOPE_ESTIMATE_COLUMNS_H
#define SERVOSCOPE_ESTIMATE_COLUMNS_H

#include "lab/record/error.h"
#include "lab/record/run.h"

#include <stdbool.h>

/// Names are the run's own spelling and live as long as it does.
struct columns {
    const char *input;
    const char *output;
    const char *reference; ///< NULL: the run has none, and none was asked for
};

/// Chooses the columns; each of the three names wanted may be NULL.
///
/// input:     torque_Nm, force_N, current_A, voltage_V, the first there is
/// output:    velocity_rad_per_s, velocity_m_per_s, position_rad, position_m
/// reference: velocity_ref_rad_per_s, velocity_ref_m_per_s, position_ref_rad, position_ref_m: what enters a closed loop
///            from outside; else torque_ref_Nm, force_ref_N, current_ref_A, voltage_ref_V. These are what a controller
///            asks for, and follow nothing but the table only if no loop is closed. A default reference that stands
///            still is none.
/// Lost:      what stands in samples with `valid` 0 is not looked at
///
/// Errors:    error_refused if there is no such column, one is not finite, input and output are the same one, or one
///            of them does not change
/// Test:      tests/fault/test_frf_refusals.c
int columns_choose(const struct run *run, const struct columns *wanted, struct columns *out_columns,
                   struct error *out_error);

/// Whether the reference is a set-point of speed or position, which only a closed loop has.
bool columns_closed_loop(const struct columns *self);

/// Whether a column holds a position, which drifts when the speed has a mean.
bool columns_is_position(const char *name);

/// Row of the first lost sample (`valid` 0) of `rows` rows from row `first`, counted from 1; 0 if none was lost.
size_t columns_first_lost_row(const struct run *run, size_t first, size_t rows);

/// Values of a column with straight lines where samples were lost (`valid` 0), so that nothing builds on what stands
/// there; before the first and behind the last valid sample its value. Returns the run's own values where none was
/// lost, else *out_owned, which is to be freed; NULL if memory is short.
const double *columns_filled(const struct run *run, const char *name, double **out_owned);

#endif
