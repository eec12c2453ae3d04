/* SPDX-License-Identifier: MIT */
/// Digital low-pass filters in second-order sections, and filtering without phase shift.
#ifndef SERVOSCOPE_NUMERIC_FILTER_H
#define SERVOSCOPE_NUMERIC_FILTER_H

#include <stdbool.h>
#include <stddef.h>

enum { filter_sections_max = 8 };

/// Cascade of b0 + b1 z^-1 + b2 z^-2 over 1 + a1 z^-1 + a2 z^-2.
struct filter {
    size_t sections;
    double b[filter_sections_max][3];
    double a[filter_sections_max][2];
};

/// Butterworth low-pass by the bilinear transform with prewarping; gain 1 at DC, -3 dB at `cutoff`.
/// Range: order even, 2..16; cutoff in units of half the sample rate, 0 < cutoff < 1.
struct filter filter_butterworth(size_t order, double cutoff);

/// Chebyshev type I low-pass with `ripple_db` in the pass band up to `cutoff`; even order, so the DC gain is -ripple_db
/// (the convention of the usual decimation filters).
struct filter filter_chebyshev(size_t order, double ripple_db, double cutoff);

/// Filters x forward and backward in place: magnitude squared, no phase shift. Both ends are extended by odd reflection
/// over 3 orders (6 samples a section), each section starting in the steady state of its first input. How far the ends
/// are extended decides the last digits of a fit: with this reach the published figures of EMPS come out to every
/// digit.
/// Range:  samples > 6 sections
/// Errors: false if there are fewer samples or memory is short; x is then as it was.
/// Test:   tests/unit/test_filter.c, tests/golden/test_emps.c
bool filter_zero_phase(const struct filter *self, size_t samples, double *x);

#endif
