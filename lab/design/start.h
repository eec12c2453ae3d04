/* SPDX-License-Identifier: MIT */
/// Where a finished design begins in its period, and what a drive at rest will make of it.
#ifndef SERVOSCOPE_DESIGN_START_H
#define SERVOSCOPE_DESIGN_START_H

#include "lab/design/design.h"

/// Sets start_index as request->start says, and expected_transient: of request->start_model where there is one, else
/// the mean over the bank of nominal drives.
/// Errors: error_refused if memory is short, or for a start model that does not suit the request (other rate, unstable,
///         an undamped resonance on a line); a bank that can say nothing leaves the transient unknown
int design_start_apply(const struct design_request *request, struct design_result *io_result, struct error *out_error);

/// What design_start_apply() would expect if the period began at another sample: energy of the transient as a share of
/// the steady state's, for each.
/// Shapes: out_shares: result->period_samples
/// Cost:   that of design_start_choose()
/// Errors: false if it is not known or memory is short
bool design_start_shares(const struct design_request *request, const struct design_result *result, double *out_shares);

#endif
