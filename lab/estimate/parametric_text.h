/* SPDX-License-Identifier: MIT */
/// A parametric model in words and on a page.
#ifndef SERVOSCOPE_ESTIMATE_PARAMETRIC_TEXT_H
#define SERVOSCOPE_ESTIMATE_PARAMETRIC_TEXT_H

#include "lab/estimate/parametric_identify.h"
#include "lab/page/page.h"

#include <stdbool.h>
#include <stddef.h>

enum { parametric_text_size = 600 };

/// "2 over 3 in 1/z, 1 sample late".
void parametric_text_order(const struct parametric_model *model, char out_text[parametric_text_size]);

/// "76.27 +- 0.04 Hz, damping 0.0159 +- 0.0009; 18.6 +- 0.4 Hz, real; ...", "none". A root on the real axis right of it
/// is said to be unstable (a pole) or non-minimum-phase (a zero); those above `limit_hz` (0: none) are only counted,
/// and a root at a negative z, which no s has, is given as z.
void parametric_text_roots(const struct parametric_model *model, bool poles, double limit_hz,
                           char out_text[parametric_text_size]);

/// Delay of a model in seconds, without the sample that a model in 1/z is late by the hold.
double parametric_delay_without_hold_s(const struct parametric_model *model);

/// "delay 0.61 +- 0.02 ms, gain at 0 Hz 3.1 +- 0.1"; "" if the model has neither.
void parametric_text_delay_and_gain(const struct parametric_model *model, char out_text[parametric_text_size]);

/// Cost by the noise against its expected value, and what that means.
void parametric_text_cost(const struct parametric_outcome *outcome, char out_text[parametric_text_size]);

/// What zeros to show: those of the drive without its hold where there is one.
const struct parametric_model *parametric_shown(const struct parametric_outcome *outcome);

/// Adds a subsection: order, delay, gain and cost as pairs, poles and zeros as a table, what is doubtful as notes.
/// Test: tests/unit/test_parametric_text.c
void parametric_add_page(const struct parametric_outcome *outcome, const char *name, struct page *page);

#endif
