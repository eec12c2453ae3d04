/* SPDX-License-Identifier: MIT */
/// Digital low-pass filters in second-order sections, and filtering without phase shift.
#ifndef SERVOSCOPE_NUMERIC_FILTER_H
#define SERVOSCOPE_NUMERIC_FILTER_H

#include <stddef.h>

enum { filter_sections_max = 8 };

/// Cascade of b0 + b1 z^-1 + b2 z^-2 over 1 + a1 z^-1 + a2 z^-2.
struct filter {
    size_t sections;
    double b[filter_sections_max][3];
    double a[filter_sections_max][2];
};

/// Butterworth low-pass by the bilinear transform with prewarping; gain 1 at DC, -3 dB at `cutoff`.
/// Range: order even, 2..16; cutoff in units of half the sampling rate, 0 < cutoff < 1.
struct filter filter_butterworth(size_t order, double cutoff);

/// Chebyshev type I low-pass with `ripple_db` in the pass band up to `cutoff`; even order, so the DC gain is -ripple_db
/// (the convention of the usual decimation filters).
struct filter filter_chebyshev(size_t order, double ripple_db, double cutoff);

/// Filters x forward and backward in place: magnitude squared, no phase shift. Both ends are extended by odd reflection over
/// up to 3 (2 sections + 1) samples, each section starting in the steady state of its first input.
/// Range: samples > 3 (2 sections + 1), else x is left as it is.
void filter_zero_phase(const struct filter *self, size_t samples, double *x);

#endif
