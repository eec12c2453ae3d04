/* SPDX-License-Identifier: MIT */
/// The drive's resonance and the antiresonance below it, from the measured lines alone.
#ifndef SERVOSCOPE_TUNE_RESONANCE_H
#define SERVOSCOPE_TUNE_RESONANCE_H

#include "lab/tune/plant.h"

#include <stdbool.h>

struct resonance {
    bool found;
    double frequency_hz; ///< of the pole pair, undamped
    double damping;
    double prominence_db; ///< of the peak: what it surely stands out above the higher of the valleys beside it
    bool has_antiresonance;
    double antiresonance_hz; ///< of the zero pair
    double antiresonance_damping;
};

/// Finds the most prominent peak of |G| (3 dB at least, with every line four standard deviations off against it), and
/// the most prominent valley below it. Frequency and damping come from the lines around each, by least squares:
///
/// Equation:  (x - p) G = r + (x - p)(c0 + c1 x),  x = j (w - w0)/w0, linear in p and three more complex numbers,
///            weights 1/|x - p| from the iteration before; for a valley the same of 1/G     (docs/theory.md F29)
///
/// The hold and any delay are smooth there and do not bias p. A damping below .001 (lines too sparse to see the width)
/// is given as .001.
/// Errors:    false if memory is short
/// Test:      tests/unit/test_tune_resonance.c
bool resonance_find(const struct tune_plant *plant, struct resonance *out_resonance);

#endif
