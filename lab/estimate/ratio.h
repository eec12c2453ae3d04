/* SPDX-License-Identifier: MIT */
/// Responses from cross spectra: output and input, each against a third signal (the input itself, or the reference).
#ifndef SERVOSCOPE_ESTIMATE_RATIO_H
#define SERVOSCOPE_ESTIMATE_RATIO_H

#include <complex.h>
#include <stddef.h>

/// Spectra of `rows` periods or segments, `stride` lines each, row after row.
struct ratio_spectra {
    const double complex *input;
    const double complex *output;
    const double complex *instrument;
    size_t rows;
    size_t stride;
    double independent; ///< rows that would tell as much if they did not overlap, > 1
};

struct ratio {
    double complex response;
    double variance;
    double coherence;          ///< of output and instrument, 0..1
    double input_power;        ///< mean |U|^2
    double chance_of_no_power; ///< that scatter alone makes the mean of U conj(Z) this large
};

/// Divides S_yz by S_uz on one line.
/// Equation:  G = sum Y_m conj(Z_m) / sum U_m conj(Z_m)                        (third paper, (2.14) Z = U, (2.15) Z =
///            R)
///            e_m = Y_m - G U_m;  s_e^2 = sum |e_m|^2 / (M (1 - 1/nu)), nu = `independent`
///            var G = (M/nu) s_e^2 sum |Z_m|^2 / |sum U_m conj(Z_m)|^2
/// Validity:  what is not part of the response must not depend on Z. With Z = U in a closed loop it does.
/// Errors:    response and variance are not finite if the denominator is 0
/// Test:      tests/unit/test_frf_h1.c
struct ratio ratio_of_line(const struct ratio_spectra *spectra, size_t line);

#endif
