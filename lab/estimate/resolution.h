/* SPDX-License-Identifier: MIT */
/// What segments too short for a resonance do to a response: the window smears output and input over its width, which
/// moves the lines around the resonance in every segment alike, so that no scatter shows it.
#ifndef SERVOSCOPE_ESTIMATE_RESOLUTION_H
#define SERVOSCOPE_ESTIMATE_RESOLUTION_H

#include "lab/estimate/arbitrary.h"
#include "lab/estimate/ratio.h"
#include "lab/record/error.h"
#include "lab/record/frf_file.h"

/// Adds to the standard deviation of a response from segments with a Hann window what the window moves its lines by.
///
/// Equation:  D = G - G_lpm, with the whole record's resolution; |D|^2/(std^2 + std_lpm^2) = r ~ F(2, 18) by noise. A
///            line is moved where r > 1 and its chance, (1 + r/9)^-9, times that of the less likely neighbour is below
///            exp(-9); or below exp(-4) where the response curves: |c| > std/2, c = (d2 Y/Z - G d2 U/Z) / (6 U/Z) with
///            Y/Z, U/Z the transfers from the instrument and d2 x_k = x_(k-1) - 2 x_k + x_(k+1), by which a Hann window
///            moves a smooth curve. Then std^2 grows by |D|^2 less the noise of both; noise_std stays
/// Keys:      warning_resolution with the number of lines that are moved by more than 3 std, and the worst
/// Limits:    a resonance that the whole record does not resolve either (width below about 1/T), or that the local
///            polynomials' own noise hides, is not seen
/// Errors:    error_refused if memory is short; *io_frf is empty then
/// Test:      tests/unit/test_frf_h1.c
int resolution_enlarge(const struct arbitrary *recording, const struct ratio_spectra *spectra, struct frf *io_frf,
                       struct error *out_error);

#endif
