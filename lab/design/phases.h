/* SPDX-License-Identifier: MIT */
/// Phases in closed form, as unit complex numbers (2 line_count doubles): methods of their own, and starts of others.
#ifndef SERVOSCOPE_DESIGN_PHASES_H
#define SERVOSCOPE_DESIGN_PHASES_H

#include "lab/design/spectrum.h"

/// phi_k = pi (k - 1)^2 / K, k = 1 .. K     (first paper, equation 14).
void design_phases_newman(size_t line_count, double *out_c);

/// phi_k = -2 pi sum_{i<k} (k - i) P_i with the torque's power shares P_i: a group delay in proportion to the power
/// below (Schroeder 1970), which is a sweep through the band. The phases are those of the acceleration's negative, the
/// position's.
void design_phases_schroeder(const struct design_spectrum *spectrum, double *out_c);

/// Uniform on the circle; same seed, same phases.
void design_phases_random(size_t line_count, uint64_t seed, double *out_c);

#endif
