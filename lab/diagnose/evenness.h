/* SPDX-License-Identifier: MIT */
/// Noise that depends on the motion: where a drive reverses, friction makes much of a little noise of the speed. A few
/// such instants are alike in all bins, and many bins say little more than one.
#ifndef SERVOSCOPE_DIAGNOSE_EVENNESS_H
#define SERVOSCOPE_DIAGNOSE_EVENNESS_H

#include "lab/diagnose/noise.h"

/// How many independent values the contrasts of some bins are worth, as a share of their number: 1 where their power is
/// the same at all places of a period, less where it sits at a few.
/// Equation:  min(1, (1 + 2 / (P - 1)) mean(g)^2 / mean(g^2)),  g the sum over the P periods of the squares, in time
/// Range:     two periods or more
/// Shapes:    contrasts: evidence->contrast.values; work: 5 x samples of the block
double evenness(const struct evidence *evidence, const double *contrasts, size_t first_bin, size_t last_bin,
                double *work);

#endif
