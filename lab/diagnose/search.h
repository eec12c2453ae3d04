/* SPDX-License-Identifier: MIT */
/// Which effects a recording needs: forward selection by penalised likelihood with joint refits, then backward
/// elimination.
#ifndef SERVOSCOPE_DIAGNOSE_SEARCH_H
#define SERVOSCOPE_DIAGNOSE_SEARCH_H

#include "lab/diagnose/fit.h"

struct search_options {
    size_t causes_max;                              ///< most effects named at once
    bool (*progress)(void *user, const char *what); ///< NULL: none; returns false to stop the search
    void *user;
};

/// Starting from `io_hypothesis`, adds and drops effects until none gains more than it costs. On return io_fit belongs
/// to the final hypothesis. Cost of an effect: half its parameters times the log of the number of residuals, for where
/// it was looked for, and a floor; gains count after division by the misfit that is left (which is one for a model that
/// explains all).
/// Errors: false if memory is short.
bool search_run(const struct fit_data *data, const struct sim_coverage *coverage, const struct search_options *options,
                struct hypothesis *io_hypothesis, struct fit *io_fit);

/// Names one effect on top of a fitted hypothesis (`fit` belongs to it), from its best scan value, and refits. It is
/// not refitted if the first step gets nowhere near `hoped_cost`. On return out_fit belongs to the new hypothesis.
/// Errors: false if no scan value leads anywhere or memory is short; hypothesis unchanged then.
bool search_add(const struct fit_data *data, const struct sim_coverage *coverage, int effect, const struct fit *fit,
                double hoped_cost, struct hypothesis *io_hypothesis, struct fit *out_fit);

/// Gain of one named effect, in nats of log likelihood: what the fit loses without it, everything else refitted.
/// Errors: negative infinity if memory is short.
double search_evidence(const struct fit_data *data, const struct hypothesis *hypothesis, const struct fit *fit,
                       int effect);

/// What an effect has to gain before it is a name.
double search_threshold(const struct fit_data *data, int effect);

#endif
