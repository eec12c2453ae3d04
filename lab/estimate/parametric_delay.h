/* SPDX-License-Identifier: MIT */
/// Whether a response has a delay, before orders are chosen: a transfer function without one needs many more poles.
#ifndef SERVOSCOPE_ESTIMATE_PARAMETRIC_DELAY_H
#define SERVOSCOPE_ESTIMATE_PARAMETRIC_DELAY_H

#include "lab/estimate/parametric.h"

enum { parametric_delay_samples_max = 16 };

/// Puts a delay into a structure that has none, if a fit with it is surely better. A discrete model gets whole samples,
/// fixed: the rest of a delay between two samples is one more coefficient of the numerator, exactly. A continuous one
/// gets a free delay and where to look for it.
///
/// Criterion: least description length over models with as many zeros as poles, 1, 2, ... up to `order_max`; one sample
///            rather than none unless none is shorter by 3 nats
/// Cost:      24 to 102 fits for a discrete model
/// Test:      tests/unit/test_parametric_delay.c
void parametric_delay_find(const struct parametric_data *data, size_t order_max,
                           struct parametric_structure *io_structure);

/// Description length of the best stable model of a structure with as many zeros as poles, 1, 2, ... up to `order_max`.
/// Infinite if none can be fitted. out_model (may be NULL): that model.
double parametric_shortest(const struct parametric_data *data, const struct parametric_structure *structure,
                           size_t order_max, struct parametric_model *out_model);

#endif
