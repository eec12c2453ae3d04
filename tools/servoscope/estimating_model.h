/* SPDX-License-Identifier: MIT */
/// The transfer function of method parametric as `frf` tells it: sentences, an object, a section.
#ifndef SERVOSCOPE_TOOLS_ESTIMATING_MODEL_H
#define SERVOSCOPE_TOOLS_ESTIMATING_MODEL_H

#include "tools/servoscope/estimating_outcome.h"

/// Adds order, poles, zeros, delay, gain and cost, and warnings where the model is doubtful; nothing without a model.
void estimating_model_say(const struct estimating_outcome *outcome, struct remarks *io_remarks);

/// Adds the object `model` (docs/files.md); nothing without one.
void estimating_model_add_json(const struct estimating_outcome *outcome, cJSON *io_object);

/// Adds a section with the model under a name (that of its runs); nothing without one.
void estimating_model_add_page(const struct estimating_outcome *outcome, const char *name, struct page *page);

#endif
