/* SPDX-License-Identifier: MIT */
/// Where an effect could start: its scan values tried on top of a fitted hypothesis, the best one fitted roughly.
#ifndef SERVOSCOPE_DIAGNOSE_SCAN_H
#define SERVOSCOPE_DIAGNOSE_SCAN_H

#include "lab/diagnose/beside.h"
#include "lab/diagnose/fit.h"

/// What scans on top of one hypothesis share.
struct scan {
    const struct fit_data *data;
    const struct sim_coverage *coverage;
    const struct hypothesis *from;
    const struct fit *fit; ///< of it, derivatives included
    struct beside beside;
    struct fit scratch;
    double *columns; ///< two of data->values, and a signal of the longest block
};

/// One effect on top of the hypothesis, roughly fitted.
struct scan_candidate {
    int effect;
    double cost;
    struct hypothesis hypothesis;
};

/// Errors: false if memory is short.
bool scan_init(struct scan *self, const struct fit_data *data, const struct sim_coverage *coverage,
               const struct hypothesis *from, const struct fit *fit);
void scan_free(struct scan *self);

/// Tries one effect from its scan values; keeps the best. A place of which, to first order, no size at all would lower
/// the cost by `worth` is not fitted: nothing is known of how near it is, so that should be a small part of what is
/// hoped for.
/// Errors: false if no scan value leads anywhere.
bool scan_effect(struct scan *self, int effect, double worth, struct scan_candidate *out);

#endif
