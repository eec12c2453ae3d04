/* SPDX-License-Identifier: MIT */
/// What the free gain of a current or a voltage takes the place of.
#ifndef SERVOSCOPE_DIAGNOSE_GAIN_TIE_H
#define SERVOSCOPE_DIAGNOSE_GAIN_TIE_H

#include "lab/diagnose/diagnosis.h"

/// Adds these ties, and says what a unit of the input makes; nothing where the input is a torque or a force.
void gain_tie_list(struct diagnosis *io_diagnosis);

#endif
