/* SPDX-License-Identifier: MIT */
/// What each cause is worth on data that the fit has not seen.
#ifndef SERVOSCOPE_DIAGNOSE_CAUSE_GAIN_H
#define SERVOSCOPE_DIAGNOSE_CAUSE_GAIN_H

#include "lab/diagnose/diagnosis.h"
#include "lab/diagnose/fit.h"

/// Measures one cause, named in the hypothesis: the error on unseen data without it, everything else refitted on the
/// data it was fitted to; and what it earns on the unseen data as it is, everything else kept.
/// Equation:  unseen_nats = (X_without - X_with) / 2,  X the sum of squared whitened residuals of all periods
/// Errors:    false if memory is short
bool cause_gain_measure(const struct fit_data *data, const struct hypothesis *hypothesis, const struct fit_data *unseen,
                        int effect, struct cause_gain *out_gain);

/// Whether a cause cannot be judged by the unseen data: it changes next to nothing there, of what it earns where it was
/// fitted.
bool cause_gain_is_hidden(const struct diagnosis_cause *cause);

/// Whether a cause does clearly more harm than good on unseen data: what was found is not there as it was found.
bool cause_gain_is_harm(const struct diagnosis_cause *cause);

#endif
