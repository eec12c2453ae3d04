/* SPDX-License-Identifier: MIT */
/// Indirect method: output and input each against the reference that excites the loop; unbiased in a closed loop, for
/// arbitrary signals too.
#ifndef SERVOSCOPE_ESTIMATE_FRF_INDIRECT_H
#define SERVOSCOPE_ESTIMATE_FRF_INDIRECT_H

#include "lab/estimate/arbitrary.h"
#include "lab/estimate/options.h"
#include "lab/estimate/periodic.h"
#include "lab/record/frf_file.h"

/// Takes whole periods. Where every period of the reference is the same this is the ratio of the means (2.13).
/// Equation:  ratio_of_line with the reference as instrument, (2.15); degrees of freedom 2 (M - 1)
/// Validity:  a line where scatter alone explains the mean of U conj(R) (chance above 1e-3) is not valid
/// Keys:      reference; warning if the reference may belong to the loop
/// Errors:    error_refused if there is no reference, no line has power, or memory is short; *out_frf is empty then
/// Test:      tests/unit/test_frf_h1.c, tests/golden/test_frf_feedback.c
int frf_indirect_estimate(const struct periodic *recording, const struct estimate_options *options, struct frf *out_frf,
                          struct error *out_error);

/// Takes overlapping segments with a Hann window (segments_transform); degrees of freedom 2 (nu - 1). What segments too
/// short for a resonance move its lines by is in std (resolution_enlarge).
int frf_indirect_estimate_arbitrary(const struct arbitrary *recording, const struct estimate_options *options,
                                    struct frf *out_frf, struct error *out_error);

#endif
