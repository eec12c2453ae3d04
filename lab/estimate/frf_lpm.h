/* SPDX-License-Identifier: MIT */
/// Robust local polynomial method for periodic excitation: all periods together, none left out for settling.
#ifndef SERVOSCOPE_ESTIMATE_FRF_LPM_H
#define SERVOSCOPE_ESTIMATE_FRF_LPM_H

#include "lab/estimate/options.h"
#include "lab/estimate/periodic.h"
#include "lab/record/frf_file.h"

/// Takes the transient out of the spectra of P consecutive periods, and makes the variance from what no transient
/// explains.
///
/// Equation:  X(kP + r) = X_0(k) [r = 0] + T(kP + r) + V(kP + r), X = input or output, resolution 1/P of a bin.
///            T = sum_s t_s r^s, s = 0..R, is fitted to the 2n nearest lines with r no multiple of P (third paper,
///            2.14.2); those are reached by no periodic signal, whether a bin is excited or not.
///            G = (Y(kP) - T_y(kP)) / (U(kP) - T_u(kP))
///            var G = (1 + l) / (q |U - T_u|^2) sum_r |V_y - G V_u|^2,  q = 2n - (R + 1),  l = [(K^H K)^-1]_00
///            which equals |G|^2 (1 + l) (s_y^2/|Y|^2 + s_u^2/|U|^2 - 2 Re(s_yu / (Y conj(U)))) with the covariances
///            from the residuals. The paper's (2.12) lacks 1 + l, the scatter of T itself (1.190 for R = 2, n = 6,
///            P = 2), and its 2.15.1 the conjugate.
///
/// Order:     without one R = 2, 4, .. 8 line by line, as long as the sum of log var G over the 25 lines around
///            it falls by more than chance (third paper, 2.14.5); without a half width n = R/2 + 5, which leaves q = 9
///            for each order
/// Edges:     where one side has fewer than n lines the other side gives more; the mean (line 0) is never used
/// Units:     as frf_mean_estimate; degrees of freedom 2 q (the fewest of any line)
/// Keys:      lpm_order, lpm_half_width, lpm_variance_factor (1 + l)
/// Errors:    error_refused if fewer than 2 consecutive periods count, q would be 0, there are fewer than 2n lines
///            without excitation, no line has power, or memory is short; *out_frf is empty then
/// Test:      tests/unit/test_frf_lpm.c, tests/golden/test_frf_lpm.c; bench lpm
int frf_lpm_estimate(const struct periodic *recording, const struct estimate_options *options, struct frf *out_frf,
                     struct error *out_error);

#endif
