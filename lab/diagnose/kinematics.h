/* SPDX-License-Identifier: MIT */
/// What the speed column and the position column say of each other: evidence of errors of the sensors, which the
/// mechanics see only where the speed is wrong. Looked at below a fiftieth of the sample rate, where a derivative of
/// samples is a speed.
#ifndef SERVOSCOPE_DIAGNOSE_KINEMATICS_H
#define SERVOSCOPE_DIAGNOSE_KINEMATICS_H

#include "lab/diagnose/recording.h"
#include "sim/model.h"

struct evidence;

enum { kinematics_nuisances = 4 };

struct kinematics {
    size_t bins;    ///< 1..bins of the block; 0: the run has not both columns, or they contradict each other
    size_t values;  ///< 2 bins: real and imaginary parts
    double *weight; ///< per bin, one over the standard deviation of each part
    double *target; ///< whitened difference of the columns, nuisances taken out
    size_t nuisances;
    double *basis; ///< values x nuisances, orthonormal: what a small gain, delay or filter of the speed column would do
};

/// Errors: false if memory is short.
bool kinematics_init(struct evidence *evidence);
void kinematics_free(struct kinematics *self);

/// Estimates the noise of the difference: from the scatter of the periods, without periods from its own spectrum, lines
/// left out; and what the model's dry friction adds where the motion turns between two samples.
/// Errors: false if memory is short.
bool kinematics_estimate_noise(struct evidence *evidence, const struct sim_model *model);

/// Residual of the difference under a model, whitened; nuisances taken out.
/// Shapes: out: evidence->kinematics.values
/// Errors: false if memory is short
bool kinematics_residual(const struct evidence *evidence, const struct sim_model *model, double *out);

#endif
