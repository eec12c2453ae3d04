/* SPDX-License-Identifier: MIT */
/// Which effects a recording needs: forward selection by penalised likelihood with joint refits, then backward
/// elimination.
#ifndef SERVOSCOPE_DIAGNOSE_SEARCH_H
#define SERVOSCOPE_DIAGNOSE_SEARCH_H

#include "lab/diagnose/fit.h"

#include <stdint.h>

enum { search_memo_size = 64 };

/// A set of names that was fitted under some noise.
struct search_fitted {
    bool used;
    bool named[sim_effects_max];
    uint64_t stamp; ///< of the noise
    double cost;
};

/// Fits that need not be repeated; the oldest make room. All zeros to begin with.
struct search_memo {
    size_t next;
    struct search_fitted fitted[search_memo_size];
};

struct search_options {
    size_t causes_max;                              ///< most effects named at once
    bool (*progress)(void *user, const char *what); ///< NULL: none; returns false to stop the search
    void *user;
};

/// Fits `io_hypothesis`, drops effects that are not needed, and adds the one that gains most beyond what it costs, if
/// one does; then looks whether all named ones are still in the right place and needed. One at a time, because beside a
/// better model the noise is estimated anew: what a wrong one leaves scatters with the motion and buys names. On return
/// io_fit belongs to the final hypothesis. Cost of an effect: half its parameters times the log of the number of
/// residuals, for where it was looked for, and a floor; gains count after division by the misfit that is left (which is
/// one for a model that explains all).
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

/// From now on, as long as the noise stays: the names of a hypothesis leave `cost`, which was found elsewhere.
void search_remember(const struct fit_data *data, const struct hypothesis *hypothesis, double cost);

/// What an effect has to gain before it is a name.
double search_threshold(const struct fit_data *data, int effect);

#endif
