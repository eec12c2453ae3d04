/* SPDX-License-Identifier: MIT */
/// Rows of a recording that were not measured: found, and filled with what the rows about them say.
#ifndef SERVOSCOPE_DIAGNOSE_REPAIR_H
#define SERVOSCOPE_DIAGNOSE_REPAIR_H

#include "lab/record/run.h"
#include "sim/effect.h"

/// What an effect says that is found in the rows themselves (sim_effect.notice), not by a fit.
struct repair_finding {
    int effect;      ///< index in sim_effects, -1: none
    double evidence; ///< nats
    double values[sim_effect_parameters_max], deviations[sim_effect_parameters_max];
    size_t spikes, first_spike; ///< rows at which a motion column jumps away and back, marked as lost
};

/// Marks rows that `valid` says were lost and rows that an effect in the record spoils beyond doubt (12 nats and half
/// the log of the number of rows), and single rows at which a motion column jumps away and back. Returns how many are
/// marked; out_finding: the strongest such effect.
/// Shapes: out_lost: run->rows
size_t repair_find(const struct run *run, bool *out_lost, struct repair_finding *out_finding);

/// Puts together an angle that begins anew at every turn, in rad, degrees or turns. Returns how often it did, 0 if it
/// is none: every jump a turn within a tenth, every other step below a tenth of one, nothing beyond one turn.
size_t repair_unwrap(size_t rows, double *io_position);

/// Fills the marked rows of a column. With a period: the mean of the other periods at that phase plus the deviation
/// from it on both sides, straight between them; else a cubic through the two measured rows on either side.
/// Range:  the first and the last row are never marked in a run worth looking at; if they are, the nearest row's value
///         is taken
/// Errors: false if memory is short
bool repair_fill(size_t rows, const bool *lost, size_t period, double *io_column);

#endif
