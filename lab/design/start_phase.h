/* SPDX-License-Identifier: MIT */
/// Where in the period to begin so that a drive at rest is disturbed least.
#ifndef SERVOSCOPE_DESIGN_START_PHASE_H
#define SERVOSCOPE_DESIGN_START_PHASE_H

#include <stddef.h>

/// Of all zero crossings of the velocity (the sample nearer to zero of the two around it) the one with the least
/// absolute acceleration (first paper, 3.3). The period is cyclic; without a crossing, which a signal of zero mean does
/// not have, 0.
size_t design_start_phase_paper(size_t samples, const double *velocity_rad_per_s,
                                const double *acceleration_rad_per_s2);

#endif
