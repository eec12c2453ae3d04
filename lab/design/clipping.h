/* SPDX-License-Identifier: MIT */
/// The step that both clipping methods share.
#ifndef SERVOSCOPE_DESIGN_CLIPPING_H
#define SERVOSCOPE_DESIGN_CLIPPING_H

#include "lab/design/waveform.h"

enum { design_clipping_iterations = 400 };

/// CF_i = 0.5 + 0.5 i / (iterations - 1), i = 0 .. iterations - 1: the schedule of the first paper.
double design_clipping_factor(size_t iteration, size_t iterations);

/// Clips one signal (index into signals[]) of `packed` at +-level and replaces the phases by those of what is left.
/// Equation: (15) and (16) of the first paper; amplitudes stay as prescribed. `packed` is used up.
void design_clipping_step(const struct design_waveform *waveform, size_t signal, double level, double *packed,
                          double *scratch_y, double *inout_c);

#endif
