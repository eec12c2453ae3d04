/* SPDX-License-Identifier: MIT */
/// What a column of a run is in the words of dataset 58: quantity, label, units, place and direction; and back.
/// Nodes: 1 is the motor, 2 its load; of the second motor and load 3 and 4, and so on.
/// Directions: rotation about Z on a rotary axis, translation along X on a linear one.
/// Internal to lab/record.
#ifndef SERVOSCOPE_RECORD_UFF_AXIS_H
#define SERVOSCOPE_RECORD_UFF_AXIS_H

#include "lab/record/uff58.h"

#include <stddef.h>

/// Describes a column by its name ("torque_2_Nm"); a name that a run does not know is a general quantity without units.
void uff_describe(const char *column, struct uff_axis *out_axis, struct uff_dof *out_dof);

/// The column that a foreign function's axis stands for: a run's own name ("force_N") where quantity, direction and the
/// units that it states say so, else label and units as they are. `si`: the file's units are m and N, which counts
/// where the axis states none. The name is never empty and has none of the characters that --map gives a meaning.
void uff_name_column(const struct uff_axis *axis, const struct uff_dof *dof, bool si, size_t size, char *out_name);

/// Replaces what --map gives a meaning, and blanks at the ends.
void uff_clean_name(char *name);

#endif
