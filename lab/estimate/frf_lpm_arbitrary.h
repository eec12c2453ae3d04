/* SPDX-License-Identifier: MIT */
/// Local polynomial method for arbitrary excitation: response and transient as polynomials around each line.
#ifndef SERVOSCOPE_ESTIMATE_FRF_LPM_ARBITRARY_H
#define SERVOSCOPE_ESTIMATE_FRF_LPM_ARBITRARY_H

#include "lab/estimate/arbitrary.h"
#include "lab/estimate/options.h"
#include "lab/record/frf_file.h"

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

/// Fits the lines around every n-th line of the whole record's spectrum.
///
/// Equation:  X(k + r) = sum_s (g_s r^s Z(k + r) + t_s r^s) + V(k + r), r = -n..n, s = 0..R, with X the output, and the
///            input too where there is a reference; Z is the reference, else the input
///            G = g_0 of the output, with a reference over g_0 of the input; e = V_y - G V_u (V_u = 0 without one)
///            var G = [(K^H K)^-1]_gg sum |e|^2 / q / |g_0 of the input|^2,  q = 2n + 1 - 2 (R + 1)
///
/// Without a reference the noise is taken to be on the output alone (output error), and a closed loop biases the
/// response as it does that of h1: the key `warning` says so. With one, noise on both sides and feedback are allowed.
/// Order:     2 unless given; a half width of R + 5 leaves q = 9
/// Lines:     n record lines apart, or 1/segment_samples; fewer if there would be more than 4000
/// Validity:  a line whose regressors depend on each other, or where the input's part that follows the reference could
///            be scatter (chance above 1e-3), is not valid
/// Keys:      lpm_order, lpm_half_width, reference, warning
/// Errors:    error_refused if no line has power or rank, the record is too short, or memory is short
/// Test:      tests/unit/test_frf_lpm_arbitrary.c
int frf_lpm_estimate_arbitrary(const struct arbitrary *recording, const struct estimate_options *options,
                               struct frf *out_frf, struct error *out_error);

/// The same, order 2, at the record's lines nearest to chosen frequencies.
/// Shapes: frequency_hz, out_response, out_std: count; out_std is INFINITY where there is no valid line
/// Errors: false if memory is short; where the record is too short for the method no line is valid
bool frf_lpm_arbitrary_at(const struct arbitrary *recording, const double *frequency_hz, size_t count,
                          double complex *out_response, double *out_std);

#endif
