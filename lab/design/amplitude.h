/* SPDX-License-Identifier: MIT */
/// Relative amplitudes other than those that follow from the limits: what `--amplitude` means.
///
///     constraint                     each line alone just reaches a limit (first paper, 3.4)
///     flat                           equal torque amplitudes
///     one-over-f                     torque power in proportion to 1 / f: the same power in every octave of an even
///                                    grid, so that a resonance is seen equally well wherever it lies (fourth paper,
///                                    3.1)
///     d-optimal:MODEL.json,ALPHA     torque power that estimates the parameters of the model best (optimal_power.h);
///                                    the share ALPHA of it, 0 < ALPHA <= 1, is taken away and spread evenly over all
///                                    lines, in case the model is wrong (fourth paper, 2)
///     FILE                           rows `frequency_hz,amplitude` (a comma or blanks between them, `#` begins a
///                                    comment, the row of names may be there): torque amplitudes, one row for each line
///
/// For d-optimal the parameters are the masses, the belt and the viscous friction, the response is motor torque to
/// motor speed with white noise on the speed, and what the model's torque lag lets through counts.
#ifndef SERVOSCOPE_DESIGN_AMPLITUDE_H
#define SERVOSCOPE_DESIGN_AMPLITUDE_H

#include "lab/design/design.h"
#include "sim/model.h"

/// Finds request->torque_shape for a specification; the lines, the period and the rate of the request have to be set.
/// *out_shape gets bin_count numbers > 0, to be freed by the caller, or NULL for "constraint".
/// Errors: error_usage with value and expectation for the specification; error_refused with file and line for what
///         stands in a file, for a model whose parameters the lines do not tell apart, and if memory is short;
///         *out_shape is NULL then
/// Test:   tests/unit/test_design_amplitude.c
int design_amplitude_shape(const char *specification, const struct design_request *request, double **out_shape,
                           struct error *out_error);

/// The same for d-optimal with a model at hand.
/// Shapes: out_shape: request->bin_count
/// Errors: error_usage for ALPHA; error_refused, beginning with `place`, for the model
int design_amplitude_optimal(const char *place, const struct sim_model *model, double alpha,
                             const struct design_request *request, double *out_shape, struct error *out_error);

#endif
