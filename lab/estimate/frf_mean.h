/* SPDX-License-Identifier: MIT */
/// Frequency response from the mean spectra over periods: the plain method, unbiased by noise, in closed loop too.
#ifndef SERVOSCOPE_ESTIMATE_FRF_MEAN_H
#define SERVOSCOPE_ESTIMATE_FRF_MEAN_H

#include "lab/estimate/options.h"
#include "lab/estimate/periodic.h"
#include "lab/record/frf_file.h"

/// Divides mean output by mean input spectrum, line by line, and gives the quotient's standard deviation.
///
/// Equation:  G = Ybar / Ubar                                                    (first paper, (24))
///            var G = |G|^2/M (s_y^2/|Ybar|^2 + s_u^2/|Ubar|^2 - 2 Re(s_yu / (Ybar conj(Ubar))))
///            s_yu = 1/(M-1) sum (Y_m - Ybar) conj(U_m - Ubar)
///            The paper's (25), (27) with their errors mended: the left side is a standard deviation, the covariance is
///            not squared, and it is divided by the conjugate of Ubar. Computed as the sum of squares that it equals,
///            var G = 1/(M (M-1) |Ubar|^2) sum |(Y_m - Ybar) - G (U_m - Ubar)|^2, which loses no digits and is never
///            negative.
///
/// Units:     std in units of G, sqrt(E|error|^2) of the complex value; 95 % region (circle_confidence_factor):
///            |error| <= std sqrt(F_0.95(2, 2(M-1))), not 2 std
/// Validity:  a line whose mean input could be scatter alone (F test, chance above 1e-3) is not valid; with two or
///            three periods the scatter is that of the 17 lines around it as well
/// Errors:    error_refused if no line has power in the input, or memory is short; *out_frf is empty then
/// Test:      tests/unit/test_frf_mean.c
int frf_mean_estimate(const struct periodic *recording, const struct estimate_options *options, struct frf *out_frf,
                      struct error *out_error);

#endif
