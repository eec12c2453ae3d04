/* SPDX-License-Identifier: MIT */
/// Which excitation separates two causes that the data so far cannot tell apart: the separation of each, in nats of
/// log likelihood, expected before anything moves, and checked with fresh noise.
///
/// A drive is simulated with one cause, and the other tries to explain what was recorded; then the other way round,
/// with the second cause at the size at which it imitates the first one best. The smaller result counts. Everything is
/// judged by diagnosis itself (docs/theory.md, F62); nothing here knows a cause by name.
#ifndef SERVOSCOPE_EXPERIMENT_SEPARATION_H
#define SERVOSCOPE_EXPERIMENT_SEPARATION_H

#include "lab/experiment/cause.h"
#include "lab/experiment/contest.h"
#include "lab/experiment/variant.h"

enum { separation_checks = 3 };

/// Below this the data leave two causes as they are: a tie (lab/diagnose/judge.h).
extern const double separation_tie_nats;

struct separation_candidate {
    struct variant excitation;
    bool measured;      ///< false: not possible; excitation.why_not says why
    double nats;        ///< the smaller of both directions, mean over a few noises
    double evidence[2]; ///< nats of each cause over the model without it: it can show at all
};

struct separation_request {
    const struct sim_model *model;
    int effects[2];
    struct variant_basis basis;
    double enough_nats; ///< > 0: the cheapest excitation that separates by this much is chosen
    struct contest_door door;
    bool (*progress)(void *user, const char *what, size_t done, size_t total); ///< NULL: none; false stops
    void *user;
};

struct separation {
    struct sim_model given; ///< without both causes
    struct separation_cause causes[2];
    struct separation_candidate candidates[variant_kinds];
    int chosen;  ///< index of a candidate, -1: nothing separates them
    bool enough; ///< the chosen one reaches what was asked for
    size_t checked;
    double checked_nats[separation_checks]; ///< of the chosen one, fresh noise each
    char reason[400];                       ///< with chosen < 0: why nothing separates them
};

/// Reads "A,B". Errors: error_usage: not two, an unknown one (the message lists the ids), one and the same
int separation_parse(const char *text, int out_effects[2], struct error *out_error);

/// Takes both causes out of the model, makes the excitations, lets the causes compete, chooses, checks.
/// Errors: error_refused: a cause that cannot act in this model or that no fit names, an excitation as given that
///         cannot be designed or played, stopped by progress, memory is short; *out_separation is empty then
/// Cost:   about a hundred fits of one cause each
/// Test:   tests/unit/test_separation.c
int separation_run(const struct separation_request *request, struct separation *out_separation,
                   struct error *out_error);
void separation_free(struct separation *self);

/// One cause's numbers and where they come from, one sentence without a full stop.
void separation_describe_cause(const struct separation *self, size_t index, char *out_text, size_t size);

#endif
