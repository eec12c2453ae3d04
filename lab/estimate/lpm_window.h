/* SPDX-License-Identifier: MIT */
/// Local polynomial through the lines around one line that is left out: what a smooth spectrum (a transient) is there.
#ifndef SERVOSCOPE_ESTIMATE_LPM_WINDOW_H
#define SERVOSCOPE_ESTIMATE_LPM_WINDOW_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

/// Polynomials that are orthonormal on the window's lines; real, because the lines' distances are.
struct lpm_window {
    size_t lines;    ///< 2n
    size_t columns;  ///< R + 1
    long *offsets;   ///< `lines` distances from the centre, none 0
    double *basis;   ///< columns x lines: Q of K = Q T, K the powers of the distances
    double *weights; ///< `lines`: the polynomial's value at the centre is the sum of weights times lines
    double leverage; ///< [(K^H K)^-1]_00: that value's variance over the variance of one line
};

/// Allocates a window; the caller fills in `offsets`, then prepares it.
/// Errors: false if memory is short; *out_self needs no freeing then
bool lpm_window_alloc(size_t lines, int order, struct lpm_window *out_self);

/// Makes the basis from the offsets: Gram and Schmidt, twice, on powers of the distances scaled to 1.
/// Errors: false if the lines do not determine the polynomial (fewer than R + 1 different distances)
/// Test:   tests/unit/test_lpm_window.c
bool lpm_window_prepare(struct lpm_window *self);

/// Fits the lines around `centre` of a spectrum and returns the polynomial's value there.
/// Equation:  Y(c + r) = T(r) + V(r), T = sum_s t_s r^s; least squares over the offsets r
/// Shapes:    centre points into a spectrum that has every offset; out_residual: `lines` values of V
double complex lpm_window_fit(const struct lpm_window *self, const double complex *centre,
                              double complex *out_residual);

void lpm_window_free(struct lpm_window *self);

#endif
