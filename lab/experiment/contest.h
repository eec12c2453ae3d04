/* SPDX-License-Identifier: MIT */
/// A contest of two causes over simulated runs of one excitation: one of them is what the drive has, the other tries to
/// explain it. What decides is what diagnosis itself would compute from these runs.
#ifndef SERVOSCOPE_EXPERIMENT_CONTEST_H
#define SERVOSCOPE_EXPERIMENT_CONTEST_H

#include "lab/diagnose/fit.h"
#include "lab/experiment/variant.h"

/// Plays one table of an excitation on a drive with its noise (its `seed`) and records a run: settling periods and
/// counted ones, as `servoscope measure` writes it.
typedef int (*contest_measure)(void *user, const struct sim_model *drive, const struct variant *excitation,
                               size_t table, struct run *out_run, struct error *out_error);

struct contest_door {
    contest_measure measure;
    void *user;
};

/// Runs of an excitation, made ready for fits under the noise of the drive that they were played on.
struct contest {
    size_t runs;
    struct recording recordings[variant_tables_max];
    struct evidence evidence[variant_tables_max];
    struct fit_data data;
    const struct sim_model *given; ///< what both causes are causes beside
    struct fit fit;                ///< of `plain`
    struct hypothesis plain;       ///< the given model, its own numbers refitted within a few percent
};

/// Plays and prepares. `given` must outlive the contest.
/// Errors: of the door; error_refused for what cannot be prepared or fitted
int contest_init(struct contest *self, const struct contest_door *door, const struct variant *excitation,
                 const struct sim_model *drive, const struct sim_model *given, struct error *out_error);
void contest_free(struct contest *self);

struct contest_outcome {
    double evidence;         ///< nats that the cause gains over the given model refitted
    double nats;             ///< nats by which it beats its rival: the separation
    double rival_evidence;   ///< nats that the rival gains over the given model refitted
    double misfit;           ///< mean squared whitened residual with the right cause: about 1, or the fit is none
    struct hypothesis rival; ///< with the rival's best numbers
};

/// Lets `rival` explain what was played with `cause` at `values`.
/// Equation:  nats = (cost of given + rival - cost of given + cause) / 2, each at its best numbers; cost = -2 log
///            likelihood (docs/theory.md, F62). `start`: numbers of the rival to try beside its own search; NULL: none
/// Errors:    false if memory is short or nothing can be fitted
bool contest_decide(const struct contest *self, int cause, const double *values, int rival, const double *start,
                    struct contest_outcome *out_outcome);

/// Nats that the cause that was played gains over the given model refitted, its fit beginning at `values`.
/// Errors: 0 if memory is short or nothing can be fitted
double contest_evidence(const struct contest *self, int cause, const double *values);

/// Nats that a cause at `values` would be seen with in runs that do not have it, nothing refitted.
/// Errors: 0 if memory is short
double contest_visibility(const struct contest *self, int cause, const double *values);

#endif
