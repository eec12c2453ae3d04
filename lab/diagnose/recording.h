/* SPDX-License-Identifier: MIT */
/// A run prepared for diagnosis: what moved, under which torque, in one block to be explained.
/// Periodic runs: the block is the mean of the counted periods, in which noise is smaller by the root of their number;
/// the periods themselves stay at hand because their scatter is the noise. Other runs: the block is the whole run.
#ifndef SERVOSCOPE_DIAGNOSE_RECORDING_H
#define SERVOSCOPE_DIAGNOSE_RECORDING_H

#include "lab/diagnose/oddities.h"
#include "lab/diagnose/repair.h"
#include "lab/record/error.h"
#include "lab/record/run.h"
#include "sim/effect.h"

#include <stdbool.h>
#include <stddef.h>

/// One stretch of samples. Torques in Nm or N, motion in rad or m.
struct stretch {
    size_t samples;
    size_t substeps;    ///< steps of the simulation per sample: more where torque changes within one
    double *torque_ref; ///< NULL: the run has none; then the measured torque drives the model
    double *torque;
    double *position;
    double *velocity;     ///< best estimate from the position and, if there is one, the speed column
    double position_gain; ///< share that a measured position has in where the motor is, beside where it was and what
                          ///< speed has taken it from there; 0 counts as 1: all of it
    double *kinematics;   ///< speed column less the derivative of the position column; NULL: not both are there
    double start_s; ///< time of the first sample since the run began; of a mean of periods the middle of them all,
                    ///< where the clock of effects that depend on time stands still
    bool held;      ///< the torque of a row acts until the next, instead of going straight there
    bool still;     ///< nothing accelerates: all of the torque goes against friction and what depends on place
    bool *lost;     ///< rows that were not measured: NULL if there are none, and in a mean of periods
};

struct recording {
    bool linear, periodic;
    bool derived;           ///< the speed is the derivative of the position
    const char *input_unit; ///< NULL: a torque or a force; "A", "V": what stands for it, in that unit
    double rate_hz;
    size_t periods;       ///< counted ones; 1 if not periodic
    struct stretch block; ///< what has to be explained
    struct stretch all;   ///< every row of the run
    size_t lead;          ///< rows of `all` before the counted part
    size_t *starts;       ///< first row of each counted period; those with lost samples are not among them
    size_t bin_count;     ///< excited bins of the block, ascending
    size_t *bins;
    size_t band; ///< highest bin of the block that is looked at
    struct sim_coverage coverage;
    size_t filled; ///< rows that were not measured, filled with what is about them
    size_t turns;  ///< how often the position began anew at a turn, before it was put together
    struct repair_finding finding;
    struct oddities oddities;
    char motion_from[280]; ///< one sentence: how the speed was made, with the filter's figures
};

/// Prepares a run. Errors: error_refused where a torque or a motion column is missing, fewer than 64 samples are left,
/// or nothing moves; the message names the file and what was expected.
int recording_prepare(const struct run *run, struct recording *out_recording, struct error *out_error);
void recording_free(struct recording *self);

/// Says when, in seconds since the run began, the rows of a recording begin that is a part of a run.
void recording_begin(struct recording *self, double start_s);

#endif
