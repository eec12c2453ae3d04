/* SPDX-License-Identifier: MIT */
/// Arbitrary-signal estimator: cross spectrum over the input's own power. Biased where the input is noisy, and so in
/// every closed loop: the response says so.
#ifndef SERVOSCOPE_ESTIMATE_FRF_H1_H
#define SERVOSCOPE_ESTIMATE_FRF_H1_H

#include "lab/estimate/arbitrary.h"
#include "lab/estimate/options.h"
#include "lab/estimate/periodic.h"
#include "lab/record/frf_file.h"

/// Takes whole periods as segments, without a window: nothing leaks.
/// Equation:  ratio_of_line with the input as instrument; degrees of freedom 2 (M - 1)
/// Validity:  a line whose mean input could be scatter alone (chance above 1e-3) is not valid
/// Keys:      warning
/// Errors:    error_refused if no line has power, or memory is short; *out_frf is empty then
/// Test:      tests/unit/test_frf_h1.c, tests/golden/test_frf_feedback.c
int frf_h1_estimate(const struct periodic *recording, const struct estimate_options *options, struct frf *out_frf,
                    struct error *out_error);

/// Takes overlapping segments with a Hann window (segments_transform); degrees of freedom 2 (nu - 1). What segments too
/// short for a resonance move its lines by is in std (resolution_enlarge).
/// Keys:      warning, warning_resolution, segment_samples, segments
int frf_h1_estimate_arbitrary(const struct arbitrary *recording, const struct estimate_options *options,
                              struct frf *out_frf, struct error *out_error);

#endif
